/* Process data against the examples of sserial.md 6, its checks, and every level of the bulk decoder. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "../../csrc/bulk.c"
#include "check.h"

static const hm2_image no_image;

/* 7I77 analog: six SIGNED of 13 bits, two enables. Expected words from sserial.md 6. */
static void analog_7i77_packs_to_the_published_words(void)
{
	hm2_field fields[8];
	uint32_t words[3] = {0xFFFFFFFF, 0xFFFFFFFF, 0xFFFF0000};
	hm2_image image = {words, 3, 1, 3, 3, 1};
	double values[8] = {10, -10, 0, 5, -5, 2.5, 1, 1};
	uint64_t raw[8] = {0};
	for (int i = 0; i < 8; i++)
		fields[i] = (hm2_field){.kind = i < 6 ? HM2_FIELD_SIGNED : HM2_FIELD_BOOLEAN,
		                        .direction = HM2_FIELD_OUTPUT,
		                        .partner = -1,
		                        .bits = i < 6 ? 13 : 1,
		                        .offset = i < 6 ? 13 * (uint32_t)i : 72 + (uint32_t)i,
		                        .scale = 10,
		                        .low = -10,
		                        .high = 10};
	struct hm2_process_data *data = NULL;
	CHECK_EQUAL(hm2_process_data_new(fields, 8, &no_image, &image, values, raw, &data, NULL), HM2_OK);
	hm2_process_data_pack(data);
	CHECK_EQUAL(words[0], 0x02000FFF);
	CHECK_EQUAL(words[1], 0x8003FF80);
	CHECK_EQUAL(words[2], 0xFFFFC7FF); /* the upper half is nobody's and stays */
	CHECK_EQUAL(raw[5], 0x3FF);
	CHECK_EQUAL(hm2_process_data_configure(data, 0, 10, -2.5, 2.5, 0, NULL), HM2_OK);
	hm2_process_data_pack(data);
	CHECK_EQUAL(words[0], 0x020003FF);
	hm2_process_data_free(data);
}

/* What one input field of the given width at the given place makes of a register file full of noise. */
static void extremes_of_place_and_width(void)
{
	uint32_t words[7];
	hm2_image image = {words, 7, 1, 7, 7, 1};
	for (uint32_t i = 0; i < 7; i++)
		words[i] = 0x9E3779B9u * (i + 1);
	for (uint32_t bits = 1; bits <= 64; bits++)
		for (uint32_t offset = 0; offset + bits <= 224; offset++) {
			hm2_field field = {.kind = HM2_FIELD_STREAM, .partner = -1, .bits = bits, .offset = offset};
			double value = 0;
			uint64_t raw = 0, expected = 0;
			struct hm2_process_data *data = NULL;
			CHECK_EQUAL(hm2_process_data_new(&field, 1, &image, &no_image, &value, &raw, &data, NULL), HM2_OK);
			hm2_process_data_unpack(data);
			for (uint32_t i = 0; i < bits; i++)
				expected |= (uint64_t)(words[(offset + i) / 32] >> (offset + i) % 32 & 1) << i;
			CHECK_EQUAL(raw, expected);
			hm2_process_data_free(data);
		}
}

static int status_of(hm2_field field, hm2_error *error)
{
	uint32_t words[6];
	hm2_image image = {words, 6, 2, 3, 3, 1};
	double value;
	uint64_t raw;
	struct hm2_process_data *data = NULL;
	int status = hm2_process_data_new(&field, 1, &image, &image, &value, &raw, &data, error);
	hm2_process_data_free(data);
	return status;
}

static void fields_that_cannot_be_are_refused(void)
{
	const hm2_field good = {.channel = 1, .kind = HM2_FIELD_SIGNED, .partner = -1, .bits = 64, .offset = 32};
	hm2_error error;
	hm2_field field = good;
	CHECK_EQUAL(status_of(field, &error), HM2_OK);
	field.offset = 33;
	CHECK_EQUAL(status_of(field, &error), HM2_ERR_RANGE);
	CHECK_EQUAL(error.index, 0);
	CHECK_EQUAL(error.expected, 96);
	CHECK_EQUAL(error.received, 97);
	field.offset = UINT32_MAX;
	CHECK_EQUAL(status_of(field, NULL), HM2_ERR_RANGE);
	field = good;
	field.channel = 2;
	CHECK_EQUAL(status_of(field, &error), HM2_ERR_RANGE);
	field.channel = -1;
	CHECK_EQUAL(status_of(field, &error), HM2_ERR_RANGE);
	field = good;
	field.bits = 0;
	CHECK_EQUAL(status_of(field, &error), HM2_ERR_RANGE);
	field.bits = 65;
	CHECK_EQUAL(status_of(field, &error), HM2_ERR_RANGE);
	field = good;
	field.kind = HM2_FIELD_FLOAT;
	field.bits = 33;
	CHECK_EQUAL(status_of(field, &error), HM2_ERR_RANGE);
	field.kind = 0x04; /* parameters only */
	CHECK_EQUAL(status_of(field, &error), HM2_ERR_RANGE);
	field = good;
	field.direction = 0x40;
	CHECK_EQUAL(status_of(field, &error), HM2_ERR_RANGE);
	field = good;
	field.kind = HM2_FIELD_ENCODER_H;
	field.partner = 0; /* itself */
	CHECK_EQUAL(status_of(field, &error), HM2_ERR_RANGE);
	field.partner = 5;
	CHECK_EQUAL(status_of(field, &error), HM2_ERR_RANGE);
}

static void images_that_cannot_be_are_refused(void)
{
	uint32_t words[6];
	double value;
	uint64_t raw;
	hm2_field field = {.kind = HM2_FIELD_BITS, .partner = -1, .bits = 1};
	struct hm2_process_data *data = NULL;
	hm2_image image = {words, 5, 2, 3, 3, 1};
	CHECK_EQUAL(hm2_process_data_new(&field, 1, &image, &no_image, &value, &raw, &data, NULL), HM2_ERR_RANGE);
	image = (hm2_image){words, 6, 2, 3, 3, 0};
	CHECK_EQUAL(hm2_process_data_new(&field, 1, &image, &no_image, &value, &raw, &data, NULL), HM2_ERR_RANGE);
	image = (hm2_image){words, 6, UINT32_MAX, 3, UINT32_MAX, 1};
	CHECK_EQUAL(hm2_process_data_new(&field, 1, &image, &no_image, &value, &raw, &data, NULL), HM2_ERR_RANGE);
	image = (hm2_image){words, 6, 0, 3, 3, 1}; /* words of no channel, channels of no words */
	CHECK_EQUAL(hm2_process_data_new(NULL, 0, &image, &no_image, NULL, NULL, &data, NULL), HM2_ERR_RANGE);
	image = (hm2_image){words, 0, 2, 3, 3, 1};
	CHECK_EQUAL(hm2_process_data_new(&field, 1, &image, &no_image, &value, &raw, &data, NULL), HM2_ERR_RANGE);
	image = (hm2_image){NULL, 6, 2, 3, 3, 1};
	CHECK_EQUAL(hm2_process_data_new(&field, 1, &image, &no_image, &value, &raw, &data, NULL), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_process_data_new(&field, 1, &no_image, &no_image, &value, &raw, &data, NULL), HM2_ERR_RANGE);
	CHECK(data == NULL);
	CHECK_EQUAL(hm2_process_data_new(NULL, 0, &no_image, &no_image, NULL, NULL, &data, NULL), HM2_OK);
	hm2_process_data_unpack(data);
	hm2_process_data_pack(data);
	hm2_process_data_free(data);
	hm2_process_data_free(NULL);
}

/* The wider levels correct a product where the plain one divides: not one bit may differ. */
static void levels_of_the_decoder_agree(void)
{
	enum { COUNT = 1500 };
	static uint32_t records[COUNT][3];
	static double one[BLOCK], other[BLOCK];
	static block at;
	for (size_t i = 0; i < COUNT; i++)
		for (size_t w = 0; w < 3; w++)
			records[i][w] = (uint32_t)random() * 2654435761u;
	at.count = at.padded = BLOCK;
	fill_rows(&at, (const uint8_t *)records, sizeof records[0], 3);
	for (uint32_t bits = 1; bits <= 64; bits++)
		for (int kind = HM2_FIELD_UNSIGNED; kind <= HM2_FIELD_SIGNED; kind++) {
			hm2_column column = {.data = one, .type = HM2_COLUMN_F64, .kind = kind, .bits = bits,
			                     .offset = bits % 32, .word_stride = 1, .scale = 36.3 / bits};
			decode_plain(&at, &column, 1, 0);
			column.data = other;
#if defined(__x86_64__) && defined(__GNUC__)
			if (__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma")) {
				decode_avx2(&at, &column, 1, 0);
				CHECK(memcmp(one, other, sizeof one) == 0);
			}
			if (choose_decoder() == decode_avx512) {
				decode_avx512(&at, &column, 1, 0);
				CHECK(memcmp(one, other, sizeof one) == 0);
			}
#endif
		}
}

static void bulk_refuses_what_lies_outside_a_record(void)
{
	uint8_t record[12] = {0};
	double value;
	hm2_error error;
	hm2_column column = {.data = &value, .type = HM2_COLUMN_F64, .kind = HM2_FIELD_UNSIGNED, .bits = 33,
	                     .offset = 63, .word_stride = 1, .scale = 1};
	CHECK_EQUAL(hm2_bulk_decode(record, 12, 3, 1, &column, 1, &error), HM2_OK);
	column.offset = 64;
	CHECK_EQUAL(hm2_bulk_decode(record, 12, 3, 1, &column, 1, &error), HM2_ERR_RANGE);
	CHECK_EQUAL(error.index, 0);
	column.offset = 0;
	column.type = HM2_COLUMN_U32;
	CHECK_EQUAL(hm2_bulk_decode(record, 12, 3, 1, &column, 1, &error), HM2_ERR_RANGE);
	column.type = 99;
	CHECK_EQUAL(hm2_bulk_decode(record, 12, 3, 1, &column, 1, NULL), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_bulk_decode(record, 12, HM2_BULK_WORDS + 1, 1, &column, 0, &error), HM2_ERR_RANGE);
	CHECK_EQUAL(error.index, -1);
}

/* ---- counters ---- */

static uint32_t counts[3];
static double places[4];
static uint64_t raws[4];

static struct hm2_process_data *fields_of(const hm2_field *fields, size_t count)
{
	const hm2_image image = {counts, 3, 1, 3, 3, 1};
	struct hm2_process_data *data = NULL;
	CHECK_EQUAL(hm2_process_data_new(fields, count, &image, &image, places, raws, &data, NULL), HM2_OK);
	return data;
}

static hm2_field counter_at(uint32_t offset)
{
	return (hm2_field){.kind = HM2_FIELD_ENCODER, .partner = -1, .bits = 16, .offset = offset, .scale = 1};
}

static void only_a_counter_can_be_zeroed(void)
{
	const hm2_field fields[] = {{.kind = HM2_FIELD_PAD, .partner = -1, .bits = 16},
	                            {.kind = HM2_FIELD_UNSIGNED, .direction = HM2_FIELD_OUTPUT, .partner = -1, .bits = 8,
	                             .offset = 64, .scale = 255, .high = 255},
	                            counter_at(32)};
	struct hm2_process_data *data = fields_of(fields, 3);
	counts[1] = 40;
	hm2_process_data_unpack(data);
	CHECK(places[2] == 40.0);
	for (size_t i = 0; i < 2; i++)
		CHECK_EQUAL(hm2_process_data_zero(data, i, NULL), HM2_OK);
	hm2_process_data_unpack(data);
	CHECK(places[2] == 40.0);
	CHECK_EQUAL(hm2_process_data_zero(data, 2, NULL), HM2_OK);
	hm2_process_data_unpack(data);
	CHECK(places[2] == 0.0);
	hm2_process_data_free(data);
}

/* What a counter has counted beyond its register, 65536 + 10, goes to the one that takes its place, and to no other. */
static double carried_on(const hm2_field *to_fields, size_t count, size_t index)
{
	const hm2_field fields[] = {{.kind = HM2_FIELD_PAD, .partner = -1, .bits = 16},
	                            {.kind = HM2_FIELD_UNSIGNED, .direction = HM2_FIELD_OUTPUT, .partner = -1, .bits = 8,
	                             .offset = 64, .scale = 255, .high = 255},
	                            counter_at(0)};
	struct hm2_process_data *from = fields_of(fields, 3), *to = fields_of(to_fields, count);
	for (uint32_t count_now = 0; count_now <= 65546; count_now += 16384) {
		counts[0] = counts[1] = count_now & 0xFFFF;
		hm2_process_data_unpack(from);
	}
	counts[0] = counts[1] = 10;
	hm2_process_data_unpack(from);
	CHECK(places[2] == 65546.0);
	hm2_process_data_carry_on(to, from);
	hm2_process_data_unpack(to);
	hm2_process_data_free(from);
	hm2_process_data_free(to);
	return places[index];
}

static void a_counter_goes_on_where_its_predecessor_was(void)
{
	hm2_field same[] = {{.kind = HM2_FIELD_PAD, .partner = -1, .bits = 16},
	                    {.kind = HM2_FIELD_UNSIGNED, .direction = HM2_FIELD_OUTPUT, .partner = -1, .bits = 8,
	                     .offset = 64, .scale = 255, .high = 255},
	                    counter_at(0), counter_at(32)};
	const hm2_field before[] = {counter_at(32), same[0], counter_at(0)};
	const hm2_field later[] = {same[0], same[1], same[0], counter_at(0)};
	CHECK(carried_on(same, 3, 2) == 65546.0);
	CHECK(carried_on(same, 4, 2) == 65546.0);
	CHECK(carried_on(same, 4, 3) == 10.0);
	CHECK(carried_on(same + 3, 1, 0) == 10.0); /* another number of fields: none is at its place */
	CHECK(carried_on(before, 3, 2) == 10.0);   /* another counter comes first, which is none of the two */
	CHECK(carried_on(before, 3, 0) == 10.0);
	CHECK(carried_on(later, 4, 3) == 10.0);
}

/* ---- columns at the ends of what there is ---- */

static void scales_near_the_ends_of_doubles_are_exact(void)
{
	static const double scales[] = {3e-307, -3e-307, 1e305, -1e305};
	uint32_t record[40] = {0};
	double values[40];
	for (uint32_t i = 0; i < 40; i++)
		record[i] = 0x9E3779B9u * (i + 1) & 0xFFF;
	for (size_t s = 0; s < 4; s++) {
		const hm2_column column = {.data = values, .type = HM2_COLUMN_F64, .kind = HM2_FIELD_UNSIGNED, .bits = 12,
		                           .word_stride = 1, .scale = scales[s]};
		CHECK_EQUAL(hm2_bulk_decode((const uint8_t *)record, 4, 1, 40, &column, 1, NULL), HM2_OK);
		for (uint32_t i = 0; i < 40; i++)
			CHECK(values[i] == record[i] * scales[s] / 4095.0);
	}
}

static void raw_words_are_taken_from_where_they_lie(void)
{
	uint32_t records[3][2] = {{0x11223344, 0x55667788}, {1, 2}, {0xFFFF0000, 0x0000FFFF}}, words[3];
	for (uint32_t offset = 0; offset <= 32; offset += 8) {
		const hm2_column column = {.data = words, .type = HM2_COLUMN_U32, .kind = HM2_FIELD_STREAM, .bits = 32,
		                           .offset = offset, .word_stride = 1};
		CHECK_EQUAL(hm2_bulk_decode((const uint8_t *)records, 8, 2, 3, &column, 1, NULL), HM2_OK);
		for (int i = 0; i < 3; i++) {
			const uint64_t whole = records[i][0] | (uint64_t)records[i][1] << 32;
			CHECK_EQUAL(words[i], (uint32_t)(whole >> offset));
		}
	}
}

int main(void)
{
	only_a_counter_can_be_zeroed();
	a_counter_goes_on_where_its_predecessor_was();
	scales_near_the_ends_of_doubles_are_exact();
	raw_words_are_taken_from_where_they_lie();
	analog_7i77_packs_to_the_published_words();
	extremes_of_place_and_width();
	fields_that_cannot_be_are_refused();
	images_that_cannot_be_are_refused();
	levels_of_the_decoder_agree();
	bulk_refuses_what_lies_outside_a_record();
	return CHECK_RESULT();
}
