/* Every refusal says the same with and without a place for its evidence, and the evidence names what was refused. */
#include <string.h>

#include "check.h"
#include "hm2.h"
#include "mailbox.h"

static hm2_error error;
static struct mailbox box;

#define REFUSED(expected_status, call)                        \
	do {                                                      \
		hm2_error *evidence = &error;                         \
		memset(&error, 0x55, sizeof error);                   \
		CHECK_EQUAL(call, expected_status);                   \
		CHECK_EQUAL(error.status, expected_status);           \
		CHECK(memchr(error.where, 0, sizeof error.where));    \
		evidence = NULL;                                      \
		CHECK_EQUAL(call, expected_status);                   \
	} while (0)

static void test_words_that_no_board_has(void)
{
	uint32_t word = 0;
	hm2_transfer transfer = {0x100, 1, 4, &word};
	mailbox_open(&box);
	REFUSED(HM2_ERR_ALIGN, hm2_read(box.board, 2, &word, 1, evidence));
	CHECK_EQUAL(error.address, 2);
	REFUSED(HM2_ERR_ALIGN, hm2_write(box.board, 2, &word, 1, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_read(box.board, 0x10000, &word, 1, evidence));
	CHECK_EQUAL(error.expected, 0xFFFC);
	REFUSED(HM2_ERR_RANGE, hm2_write(box.board, 0xFFFC, &word, 2, evidence));
	CHECK_EQUAL(error.expected, 1);
	CHECK_EQUAL(error.received, 2);
	REFUSED(HM2_ERR_RANGE, hm2_read(box.board, 0, &word, 0, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_read(box.board, 0, &word, (size_t)1 << 40, evidence));
	CHECK_EQUAL(error.received, UINT32_MAX);
	REFUSED(HM2_ERR_RANGE, hm2_exchange(box.board, &transfer, 1, evidence)); /* no such flag */
	CHECK_EQUAL(error.index, 0);
	transfer = (hm2_transfer){0x100, 1, 0, NULL};
	REFUSED(HM2_ERR_RANGE, hm2_exchange(box.board, &transfer, 1, evidence));
	REFUSED(HM2_ERR_BUSY, hm2_finish(box.board, 0, evidence)); /* nothing is outstanding */
	hm2_board_set_gate(box.board, 1);
	REFUSED(HM2_ERR_GATED, hm2_write(box.board, 0x100, &word, 1, evidence));
	hm2_board_set_read_only(box.board);
	REFUSED(HM2_ERR_READ_ONLY, hm2_write(box.board, 0x100, &word, 1, evidence));
	hm2_board_close(box.board);
	REFUSED(HM2_ERR_CLOSED, hm2_read(box.board, 2, &word, 1, evidence));
	REFUSED(HM2_ERR_CLOSED, hm2_write(box.board, 2, &word, 1, evidence));
	REFUSED(HM2_ERR_CLOSED, hm2_read(box.board, 0, &word, 1, evidence));
	REFUSED(HM2_ERR_CLOSED, hm2_finish(box.board, 0, evidence));
	transfer = (hm2_transfer){0x100, 1, HM2_TRANSFER_READ, &word};
	REFUSED(HM2_ERR_CLOSED, hm2_begin(box.board, &transfer, 1, evidence));
	CHECK_EQUAL(hm2_board_now_ns(box.board), 0);
	hm2_board_pause_ns(box.board, 1000);
	CHECK_EQUAL(box.now_ns, 0);
	mailbox_free(&box);
	hm2_board_free(NULL);
	hm2_board_close(NULL);
}

static void test_a_second_begin_and_a_close_in_between(void)
{
	uint32_t word;
	const hm2_transfer transfer = {0x100, 1, 0, &word};
	mailbox_open(&box);
	CHECK_EQUAL(hm2_begin(box.board, &transfer, 1, &error), HM2_OK);
	REFUSED(HM2_ERR_BUSY, hm2_begin(box.board, &transfer, 1, evidence));
	hm2_board_close(box.board); /* with an exchange under way */
	REFUSED(HM2_ERR_CLOSED, hm2_begin(box.board, &transfer, 1, evidence));
	mailbox_free(&box);
}

static size_t too_much(void *self, hm2_transfer *transfers, size_t capacity)
{
	(void)self;
	(void)transfers;
	return capacity + 1;
}

static void test_a_cycle_that_is_full(void)
{
	struct hm2_cycle *cycle = NULL;
	const hm2_cyclic nothing = {NULL, NULL, NULL, NULL}, greedy = {NULL, NULL, too_much, NULL};
	mailbox_open(&box);
	CHECK_EQUAL(hm2_cycle_new(box.board, &cycle, &error), HM2_OK);
	CHECK_EQUAL(hm2_cycle_add(cycle, &greedy, &error), HM2_OK);
	REFUSED(HM2_ERR_RANGE, hm2_cycle_run(cycle, evidence));
	CHECK_EQUAL(error.expected, HM2_CYCLE_TRANSFERS);
	for (int i = 1; i < HM2_CYCLE_PARTS; i++)
		CHECK_EQUAL(hm2_cycle_add(cycle, &nothing, &error), HM2_OK);
	REFUSED(HM2_ERR_RANGE, hm2_cycle_add(cycle, &nothing, evidence));
	CHECK_EQUAL(error.expected, HM2_CYCLE_PARTS);
	hm2_cycle_free(cycle);
	mailbox_free(&box);
}

static void test_recordings_that_cannot_be(void)
{
	const uint32_t addresses[] = {0x100, 0x102, 0x10000}, words[] = {1, 2, 3};
	struct hm2_board *board = NULL;
	uint32_t word;
	hm2_bus bus;
	REFUSED(HM2_ERR_ALIGN, hm2_image_bus(addresses, words, 2, &bus, evidence));
	CHECK_EQUAL(error.index, 1);
	REFUSED(HM2_ERR_RANGE, hm2_image_bus(addresses + 2, words, 1, &bus, evidence));
	CHECK_EQUAL(hm2_image_bus(addresses, words, 1, &bus, &error), HM2_OK);
	CHECK_EQUAL(hm2_board_open(&bus, &board, &error), HM2_OK);
	REFUSED(HM2_ERR_ABSENT, hm2_read(board, 0x104, &word, 1, evidence));
	CHECK_EQUAL(error.address, 0x104);
	REFUSED(HM2_ERR_READ_ONLY, hm2_write(board, 0x100, &word, 1, evidence));
	uint32_t same[2] = {0, 0};
	const hm2_transfer transfer = {0x100, 2, HM2_TRANSFER_SAME_ADDRESS, same};
	CHECK_EQUAL(hm2_exchange(board, &transfer, 1, &error), HM2_OK);
	CHECK(same[0] == 1 && same[1] == 1);
	hm2_board_pause_ns(board, 1);
	hm2_board_free(board);
}

/* ---- tables of a card and of a remote ---- */

static void test_an_idrom_that_cannot_be(void)
{
	const uint32_t id[4] = {0x55AACAFE, 0x54534F48, 0x32544F4D, 0x400}, wrong[4] = {0, 0, 0, 0};
	hm2_idrom idrom;
	CHECK_EQUAL(hm2_idrom_parse_id(id, &idrom, NULL), HM2_OK);
	REFUSED(HM2_ERR_FORMAT, hm2_idrom_parse_id(wrong, &idrom, evidence));
	CHECK_EQUAL(error.detail, HM2_BROKEN_COOKIE);
	CHECK_EQUAL(error.expected, 0x55AACAFE);
	CHECK_EQUAL(error.index, -1);
}

static void test_a_table_that_cannot_be(void)
{
	const uint8_t bytes[8] = {0x34, 0x12, 0, 0}, endless[4] = {0xFF, 0xFF, 0, 0};
	hm2_toc_record record = {.record_type = 0xA0, .bits = 33, .direction = 0x40};
	size_t count;
	uint32_t in, out;
	REFUSED(HM2_ERR_FORMAT, hm2_toc_read_buffer(endless, 4, 0x40, 0x40, HM2_GTOC, NULL, 0, &record, 1, &count, evidence));
	CHECK_EQUAL(error.detail, HM2_TOC_POINTER);
	CHECK(strcmp(error.where, "gtoc") == 0);
	REFUSED(HM2_ERR_RANGE, hm2_toc_read_buffer(bytes, 4, 0x40, 0x40, HM2_PTOC, NULL, 0, &record, 1, &count, evidence));
	CHECK_EQUAL(error.address, 0x1234);
	REFUSED(HM2_ERR_RANGE, hm2_toc_read_buffer(bytes, 4, 0x40, 0x40, HM2_PTOC, NULL, 0, &record, 0, &count, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_toc_read_buffer(bytes, 1, 0x40, 0x40, HM2_PTOC, NULL, 0, &record, 1, &count, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_toc_read_buffer(bytes, 4, 0x40, 0x20, HM2_PTOC, NULL, 0, &record, 1, &count, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_toc_read_buffer(bytes, 4, 0x40, 0x80, HM2_PTOC, NULL, 0, &record, 1, &count, evidence));
	record = (hm2_toc_record){.record_type = 0xA0, .bits = 33, .direction = 0x40};
	REFUSED(HM2_ERR_FORMAT, hm2_toc_check_sizes(&record, 1, 0, 0, 1, &in, &out, evidence));
	CHECK_EQUAL(error.detail, HM2_TOC_INPUT_BITS);
	record.direction = 0x80;
	REFUSED(HM2_ERR_FORMAT, hm2_toc_check_sizes(&record, 1, 0, 0, 1, &in, &out, evidence));
	CHECK_EQUAL(error.detail, HM2_TOC_OUTPUT_BITS);
	CHECK_EQUAL(error.expected, 32);
	CHECK_EQUAL(error.received, 33);
	REFUSED(HM2_ERR_FORMAT, hm2_toc_check_sizes(&record, 1, 9, 4, 3, &in, &out, evidence));
	CHECK_EQUAL(error.expected, 32); /* four bytes go out */
}

/* ---- process data ---- */

static void test_fields_that_cannot_be(void)
{
	static uint32_t words[3];
	const hm2_image image = {words, 3, 1, 3, 3, 1}, none = {0};
	static const struct {
		hm2_field field;
		uint32_t expected, received;
	} cases[] = {
		{{.kind = 0x99, .partner = -1, .bits = 1}, HM2_FIELD_FLOAT, 0x99},
		{{.kind = HM2_FIELD_BITS, .partner = -1, .bits = 1, .direction = 0x40}, HM2_FIELD_OUTPUT, 0x40},
		{{.kind = HM2_FIELD_BITS, .partner = -1, .bits = 0}, 64, 0},
		{{.kind = HM2_FIELD_BITS, .partner = -1, .bits = 65}, 64, 65},
		{{.kind = HM2_FIELD_FLOAT, .partner = -1, .bits = 16}, 32, 16},
		{{.kind = HM2_FIELD_BITS, .partner = -1, .bits = 1, .channel = -1}, 1, UINT32_MAX},
		{{.kind = HM2_FIELD_BITS, .partner = -1, .bits = 1, .channel = 1}, 1, 1},
		{{.kind = HM2_FIELD_BITS, .partner = -1, .bits = 1, .offset = 96}, 96, 97},
		{{.kind = HM2_FIELD_BITS, .partner = -1, .bits = 2, .offset = 95}, 96, 97},
		{{.kind = HM2_FIELD_ENCODER_H, .partner = 1, .bits = 8}, 1, 1},
	};
	struct hm2_process_data *data = NULL;
	double value = 0;
	uint64_t raw = 0;
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		REFUSED(HM2_ERR_RANGE, hm2_process_data_new(&cases[i].field, 1, &image, &none, &value, &raw, &data, evidence));
		CHECK_EQUAL(error.index, 0);
		CHECK_EQUAL(error.expected, cases[i].expected);
		CHECK_EQUAL(error.received, cases[i].received);
	}
	const hm2_field pad = {.kind = HM2_FIELD_PAD};
	CHECK_EQUAL(hm2_process_data_new(&pad, 1, &image, &none, &value, &raw, &data, &error), HM2_OK);
	REFUSED(HM2_ERR_RANGE, hm2_process_data_zero(data, 1, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_process_data_configure(data, 1, 1, 0, 1, 0, evidence));
	CHECK_EQUAL(hm2_process_data_configure(data, 0, 1, 0, 1, 0, &error), HM2_OK); /* nothing to do */
	CHECK_EQUAL(hm2_process_data_zero(data, 0, &error), HM2_OK);
	hm2_process_data_restart(data, 0);
	hm2_process_data_free(data);
	hm2_process_data_free(NULL);
}

static void test_counters_in_two_parts_that_do_not_belong_together(void)
{
	static uint32_t words[6];
	const hm2_image image = {words, 6, 2, 3, 3, 1};
	const hm2_field high = {.kind = HM2_FIELD_ENCODER_H, .partner = 1, .bits = 8, .offset = 8};
	const hm2_field low = {.kind = HM2_FIELD_ENCODER_L, .partner = 0, .bits = 8};
	hm2_field others[6] = {low, low, low, low, low, low};
	struct hm2_process_data *data = NULL;
	double values[2] = {0, 0};
	uint64_t raw[2] = {0, 0};
	others[0].kind = HM2_FIELD_ENCODER_H;
	others[1].kind = HM2_FIELD_BITS;
	others[2].channel = 1;
	others[3].direction = HM2_FIELD_OUTPUT;
	others[4].partner = 1;
	others[5].bits = 57;
	for (int i = 0; i < 6; i++) {
		const hm2_field fields[2] = {high, others[i]};
		REFUSED(HM2_ERR_RANGE, hm2_process_data_new(fields, 2, &image, &image, values, raw, &data, evidence));
	}
	const hm2_field fields[2] = {high, low};
	CHECK_EQUAL(hm2_process_data_new(fields, 2, &image, &image, values, raw, &data, &error), HM2_OK);
	hm2_process_data_free(data);
}

static void test_images_that_cannot_be(void)
{
	static uint32_t words[3];
	const hm2_image none = {0};
	const hm2_image wrong[] = {
		{words, 3, 0, 3, 3, 1},          /* no channels */
		{words, 3, 1, 0, 3, 1},          /* no words of a channel */
		{words, 3, 1, 0x10001, 3, 1},    /* too many */
		{words, 3, 1, 3, 3, 0},          /* all in one place */
		{NULL, 3, 1, 3, 3, 1},           /* nowhere */
		{words, 0x10001, 1, 3, 3, 1},    /* more than a window can name */
		{words, 3, 2, 3, 3, 1},          /* the second channel beyond the end */
		{words, 3, 0x10000, 3, UINT32_MAX, 1},
	};
	struct hm2_process_data *data = NULL;
	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
		REFUSED(HM2_ERR_RANGE, hm2_process_data_new(NULL, 0, &wrong[i], &none, NULL, NULL, &data, evidence));
		REFUSED(HM2_ERR_RANGE, hm2_process_data_new(NULL, 0, &none, &wrong[i], NULL, NULL, &data, evidence));
	}
	CHECK_EQUAL(hm2_process_data_new(NULL, 0, &none, &none, NULL, NULL, &data, &error), HM2_OK);
	hm2_process_data_free(data);
}

static void test_columns_that_cannot_be(void)
{
	static uint8_t records[8];
	static double out[2];
	static const hm2_column wrong[] = {
		{out, HM2_COLUMN_F64, HM2_FIELD_UNSIGNED, 0, 0, 0, 1, 1},  {out, HM2_COLUMN_F64, HM2_FIELD_UNSIGNED, 65, 0, 0, 1, 1},
		{out, HM2_COLUMN_F64, HM2_FIELD_BITS, 8, 0, 0, 1, 1},      {out, HM2_COLUMN_F32, HM2_FIELD_FLOAT, 16, 0, 0, 1, 1},
		{out, HM2_COLUMN_U32, HM2_FIELD_BITS, 33, 0, 0, 1, 1},     {out, HM2_COLUMN_U8, HM2_FIELD_BITS, 1, 0, 0, 1, 1},
		{out, 9, HM2_FIELD_BITS, 1, 0, 0, 1, 1},                   {NULL, HM2_COLUMN_U64, HM2_FIELD_BITS, 1, 0, 0, 1, 1},
		{out, HM2_COLUMN_U64, HM2_FIELD_BITS, 1, 0, 2, 1, 1},      {out, HM2_COLUMN_U64, HM2_FIELD_BITS, 2, 63, 0, 1, 1},
	};
	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
		REFUSED(HM2_ERR_RANGE, hm2_bulk_decode(records, 8, 2, 1, &wrong[i], 1, evidence));
		CHECK_EQUAL(error.index, 0);
	}
	REFUSED(HM2_ERR_RANGE, hm2_bulk_decode(records, 8, 0, 1, NULL, 0, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_bulk_decode(records, 8, HM2_BULK_WORDS + 1, 1, NULL, 0, evidence));
}

/* ---- smart serial ---- */

static void test_ports_and_accesses_that_cannot_be(void)
{
	static const hm2_sserial_config wrong[] = {{0x5A00, 0x100, 0x40, 0, 0, 3}, {0x5A00, 0x100, 0x40, 0, 9, 3},
	                                           {0x5A00, 0x100, 0x40, 0, 8, 4}, {0x5A00, 0x100, 0x40, 4, 8, 7}};
	struct hm2_sserial *port = NULL;
	uint8_t byte = 0;
	uint64_t value = 0;
	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
		REFUSED(HM2_ERR_RANGE, hm2_sserial_open(NULL, &wrong[i], &port, evidence));
	hm2_sserial_free(NULL);
	mailbox_open(&box);
	CHECK_EQUAL(hm2_sserial_start(box.port, 1, HM2_SSERIAL_SETUP, &error), 0);
	REFUSED(HM2_ERR_BUSY, hm2_sserial_doit(box.port, 1, evidence));
	CHECK_EQUAL(error.detail, HM2_SSERIAL_MODE_CONFLICT);
	REFUSED(HM2_ERR_BUSY, hm2_sserial_start(box.port, 2, HM2_SSERIAL_NORMAL, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_sserial_read_local(box.port, 0xFFF, &byte, 2, evidence));
	CHECK_EQUAL(error.address, 0xFFF);
	REFUSED(HM2_ERR_RANGE, hm2_sserial_write_local(box.port, 0, &byte, 0, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_sserial_set_bits(box.port, 8, 1, 1, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_sserial_set_bits(box.port, 0, 1, 97, evidence));
	static const uint32_t accesses[][3] = {{8, 0x40, 0}, {0, 0x3F, 0}, {0, 0x100, 0}, {0, 0x80, 0}, {0, 0x44, 0x10000}};
	for (size_t i = 0; i < sizeof accesses / sizeof accesses[0]; i++)
		REFUSED(HM2_ERR_RANGE, hm2_sserial_access(box.port, accesses[i][0], accesses[i][1], accesses[i][2], &value, evidence));
	REFUSED(HM2_ERR_BUSY, hm2_sserial_access(box.port, 1, 0x40, 0, &value, evidence));
	CHECK_EQUAL(error.detail, HM2_SSERIAL_NOT_STARTED);
	REFUSED(HM2_ERR_RANGE, hm2_sserial_write_remote(box.port, 0, 0x100, 0, 1, 0, evidence));
	box.words[DATA / 4] = 1; /* no usable answer */
	REFUSED(HM2_ERR_TIMEOUT, hm2_sserial_read_remote(box.port, 0, 0, 0x20, 1, &value, evidence));
	CHECK_EQUAL(error.detail, HM2_SSERIAL_REMOTE_SILENT);
	CHECK_EQUAL(error.address, 0x20);
	hm2_sserial_set_software_mode(box.port, 8, 1); /* no such channel: nothing */
	hm2_sserial_watch(box.port, 8, 0, 1);
	hm2_sserial_watch(box.port, 0, 7, 1);
	hm2_sserial_identity identity = {1, 1, 1, 1};
	hm2_sserial_get_identity(box.port, 8, &identity);
	CHECK_EQUAL(identity.cs | identity.unit_number | identity.name | identity.toc, 0);
	mailbox_free(&box);
}

/* ---- the emulated card ---- */

static void test_emulated_cards_that_cannot_be(void)
{
	const uint32_t good[16 + 6 + 1] = {3, 64, 88, 0x4153454D, 0x54534554, 9, 144, 1, 1, 1, 33333333, 200000000,
	                                   4, 64, 256, 256, 0x01010003, 0x00051000, 0x1F, 0, 0, 0, 0x03000000};
	static const struct {
		uint8_t word;
		uint32_t value, address;
	} wrong[] = {{10, 999999, 0x428}, {11, 999999, 0x42C}, {7, 0, 0x41C}, {7, 9, 0x41C}, {9, 0, 0x424},
	             {9, 33, 0x424}, {8, 2, 0x424}, {2, 2, 0x420}, {2, 1024, 0x420}, {22, 0x02000000, 0x458}};
	const hm2_emulator_options options = {.strict = 1};
	hm2_emulator *card = NULL;
	uint32_t words[23], word = 0;
	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++) {
		memcpy(words, good, sizeof good);
		words[wrong[i].word] = wrong[i].value;
		if (wrong[i].word == 9)
			words[8] = wrong[i].value; /* as many pins: only the width itself is wrong */
		REFUSED(HM2_ERR_FORMAT, hm2_emulator_new(words, 23, &options, &card, evidence));
		CHECK_EQUAL(error.address, wrong[i].address);
		CHECK(card == NULL);
	}
	REFUSED(HM2_ERR_FORMAT, hm2_emulator_new(good, 15, &options, &card, evidence));
	REFUSED(HM2_ERR_FORMAT, hm2_emulator_new(good, 257, &options, &card, evidence));
	memcpy(words, good, sizeof good);
	words[16] = 0x01010002; /* no IOPort */
	REFUSED(HM2_ERR_FORMAT, hm2_emulator_new(words, 23, &options, &card, evidence));
	CHECK_EQUAL(hm2_emulator_new(good, 23, &options, &card, &error), HM2_OK);
	REFUSED(HM2_ERR_ALIGN, hm2_emulator_read(card, 2, &word, 1, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_emulator_read(card, 0xFFFC, words, 2, evidence));
	REFUSED(HM2_ERR_RANGE, hm2_emulator_write(card, 0x10000, words, 1, evidence));
	REFUSED(HM2_ERR_PROTOCOL, hm2_emulator_read(card, 0x8000, &word, 1, evidence)); /* strict: nothing is there */
	REFUSED(HM2_ERR_PROTOCOL, hm2_emulator_write(card, 0x8000, &word, 1, evidence));
	hm2_emulator_free(card);
	hm2_emulator_free(NULL);
}

static void test_names_of_statuses(void)
{
	for (int status = HM2_ERR_ABSENT; status <= HM2_OK; status++) {
		CHECK(strcmp(hm2_status_name(status), "unknown status") != 0);
		for (int other = HM2_ERR_ABSENT; other < status; other++)
			CHECK(strcmp(hm2_status_name(status), hm2_status_name(other)) != 0);
	}
	CHECK(strcmp(hm2_status_name(1), "unknown status") == 0);
}

int main(void)
{
	test_words_that_no_board_has();
	test_a_second_begin_and_a_close_in_between();
	test_a_cycle_that_is_full();
	test_recordings_that_cannot_be();
	test_an_idrom_that_cannot_be();
	test_a_table_that_cannot_be();
	test_fields_that_cannot_be();
	test_counters_in_two_parts_that_do_not_belong_together();
	test_images_that_cannot_be();
	test_columns_that_cannot_be();
	test_ports_and_accesses_that_cannot_be();
	test_emulated_cards_that_cannot_be();
	test_names_of_statuses();
	return CHECK_RESULT();
}
