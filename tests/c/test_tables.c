/* Tables in a remote's memory, at the ends of what may be in them. */
#include <string.h>

#include "check.h"
#include "hm2.h"

enum { BASE = 0x100, POINTERS = 0, RECORD = 0x40, SIZE = 0x100 };

static uint8_t memory[SIZE];
static hm2_toc_record records[2];
static hm2_error error;

static void put16(size_t at, uint32_t value)
{
	memory[at] = (uint8_t)value;
	memory[at + 1] = (uint8_t)(value >> 8);
}

/* A table of one record, an input from 0 to 1. */
static void build(uint8_t bits, uint8_t data_type, const char *name)
{
	memset(memory, 0, sizeof memory);
	put16(POINTERS, BASE + RECORD);
	memory[RECORD] = 0xA0;
	memory[RECORD + 1] = bits;
	memory[RECORD + 2] = data_type;
	put16(RECORD + 10, 0x3F80); /* 1.0 */
	put16(RECORD + 12, 0x200);
	memcpy(memory + RECORD + 14, "V", 2);
	memcpy(memory + RECORD + 16, name, strlen(name) + 1);
}

static int read_table(int table, size_t length)
{
	size_t count = 9;
	memset(records, 0, sizeof records);
	const int status = hm2_toc_read_buffer(memory, length, BASE, BASE + POINTERS, table, NULL, 0, records, 2, &count, &error);
	CHECK_EQUAL(count, status == HM2_OK);
	return status;
}

static void test_only_printable_characters_are_taken_over(void)
{
	build(8, HM2_FIELD_UNSIGNED, "a ~\x7F\x1F\xE4z");
	CHECK_EQUAL(read_table(HM2_PTOC, SIZE), HM2_OK);
	CHECK(strcmp(records[0].name, "a ~___z") == 0);
	CHECK(records[0].warnings & HM2_TOC_UNPRINTABLE);
	build(8, HM2_FIELD_UNSIGNED, "a ~z");
	CHECK_EQUAL(read_table(HM2_PTOC, SIZE), HM2_OK);
	CHECK_EQUAL(records[0].warnings & HM2_TOC_UNPRINTABLE, 0);
}

/* Process data of a stream fit a word; a parameter is read in 1, 2, 4 or 8 bytes. */
static void test_widths(void)
{
	static const struct {
		uint8_t type, bits;
		int table, detail; /* 0: as it should be */
	} cases[] = {{HM2_FIELD_STREAM, 32, HM2_PTOC, 0}, {HM2_FIELD_STREAM, 33, HM2_PTOC, HM2_TOC_BITS},
	             {HM2_FIELD_STREAM, 64, HM2_GTOC, 0}, {HM2_FIELD_STREAM, 40, HM2_GTOC, HM2_TOC_PARAMETER_SIZE},
	             {HM2_FIELD_UNSIGNED, 64, HM2_GTOC, 0}, {HM2_FIELD_UNSIGNED, 65, HM2_GTOC, HM2_TOC_BITS},
	             {HM2_FIELD_UNSIGNED, 24, HM2_GTOC, HM2_TOC_PARAMETER_SIZE}, {HM2_FIELD_UNSIGNED, 24, HM2_PTOC, 0},
	             {HM2_FIELD_UNSIGNED, 65, HM2_PTOC, HM2_TOC_BITS}};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		build(cases[i].bits, cases[i].type, "x");
		CHECK_EQUAL(read_table(cases[i].table, SIZE), cases[i].detail ? HM2_ERR_FORMAT : HM2_OK);
		if (!cases[i].detail)
			continue;
		CHECK_EQUAL(error.detail, cases[i].detail);
		CHECK_EQUAL(error.address, BASE + RECORD + 1);
		CHECK_EQUAL(error.received, cases[i].bits);
	}
}

/* Each byte that is needed, and none more. */
static void test_records_that_end_with_the_memory(void)
{
	build(8, HM2_FIELD_UNSIGNED, "x");
	for (size_t length = RECORD; length < RECORD + 18; length++)
		CHECK_EQUAL(read_table(HM2_PTOC, length), HM2_ERR_RANGE);
	CHECK_EQUAL(read_table(HM2_PTOC, RECORD + 18), HM2_OK);
	memory[RECORD] = 0xB0; /* a mode */
	memcpy(memory + RECORD + 4, "m", 2);
	for (size_t length = RECORD; length < RECORD + 6; length++)
		CHECK_EQUAL(read_table(HM2_PTOC, length), HM2_ERR_RANGE);
	CHECK_EQUAL(error.address, BASE + RECORD + 5);
	CHECK_EQUAL(read_table(HM2_PTOC, RECORD + 3), HM2_ERR_RANGE);
	CHECK_EQUAL(error.address, BASE + RECORD); /* its head is read at once */
	CHECK_EQUAL(read_table(HM2_PTOC, RECORD + 6), HM2_OK);
}

int main(void)
{
	test_only_printable_characters_are_taken_over();
	test_widths();
	test_records_that_end_with_the_memory();
	return CHECK_RESULT();
}
