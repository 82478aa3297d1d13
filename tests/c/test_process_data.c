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

int main(void)
{
	analog_7i77_packs_to_the_published_words();
	extremes_of_place_and_width();
	fields_that_cannot_be_are_refused();
	images_that_cannot_be_are_refused();
	levels_of_the_decoder_agree();
	bulk_refuses_what_lies_outside_a_record();
	return CHECK_RESULT();
}
