/* Any bytes as a remote's memory: what is accepted is bounded, printable where it is text, and fits. */
#include <stdlib.h>
#include <string.h>

#include "hm2.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length);

static void require(int condition)
{
	if (!condition)
		abort();
}

static void check_string(const char *string)
{
	const size_t length = strnlen(string, HM2_TOC_STRING);
	require(length < HM2_TOC_STRING);
	for (size_t i = 0; i < length; i++)
		require(string[i] >= ' ' && string[i] <= '~');
}

static void check_record(const hm2_toc_record *record, int table)
{
	require(record->address < 0xFFFF);
	check_string(record->unit);
	check_string(record->name);
	if (record->record_type == 0xB0)
		return;
	require(record->record_type == 0xA0 && record->bits > 0);
	require(record->direction == 0x00 || record->direction == 0x40 || record->direction == 0x80);
	require(record->minimum <= record->maximum); /* false for a NaN, too */
	if (table == HM2_GTOC && !record->is_process_data)
		require(record->bits % 8 == 0 && record->bits <= 64);
}

static size_t read_table(const uint8_t *memory, size_t length, uint32_t base, uint32_t pointer, int table,
                         const hm2_toc_record *ptoc, size_t ptoc_count, hm2_toc_record *records)
{
	hm2_error error;
	size_t count = 0;
	const int status = hm2_toc_read_buffer(memory, length, base, pointer, table, ptoc, ptoc_count, records,
	                                       HM2_TOC_ENTRIES, &count, &error);
	require(count <= HM2_TOC_ENTRIES);
	require(status == HM2_OK || status == HM2_ERR_FORMAT || status == HM2_ERR_RANGE);
	require(status != HM2_ERR_FORMAT || error.detail > 0);
	for (size_t i = 0; i < count; i++)
		check_record(&records[i], table);
	return count;
}

/* The first bytes say where the memory lies, where the tables are and what the sizes are. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
	static hm2_toc_record ptoc[HM2_TOC_ENTRIES], gtoc[HM2_TOC_ENTRIES];
	uint32_t bits[2];
	hm2_error error;
	if (length < 8)
		return 0;
	const uint32_t base = (uint32_t)(bytes[0] | bytes[1] << 8);
	const uint32_t pointers[2] = {(uint32_t)(bytes[2] | bytes[3] << 8), (uint32_t)(bytes[4] | bytes[5] << 8)};
	uint8_t *memory = malloc(length - 8 + 1);
	require(memory != NULL);
	memcpy(memory, bytes + 8, length - 8);
	const size_t count = read_table(memory, length - 8, base, pointers[0], HM2_PTOC, NULL, 0, ptoc);
	read_table(memory, length - 8, base, pointers[1], HM2_GTOC, ptoc, count, gtoc);
	if (hm2_toc_check_sizes(ptoc, count, bytes[6], bytes[7], 3, &bits[0], &bits[1], &error) == HM2_OK)
		require(bits[0] <= 96 && bits[1] <= 96);
	free(memory);
	return 0;
}
