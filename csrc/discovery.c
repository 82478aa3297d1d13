/* The tables by which a remote describes itself: PTOC, GTOC and their records (sserial.md 5.1, 5.3).
 *
 * Foreign bytes: every field is checked before it is used, nothing is read beyond a record, and the
 * first thing that cannot be is reported with its place. */
#include "error.h"
#include "registers.h"

#include <math.h>
#include <string.h>

#define MEMORY_END 0x10000u
#define NO_POINTER 0xFFFFu
#define MODE_STRING 4u /* offsets of the first string of a record */
#define DATA_STRINGS 14u

struct reader {
	const hm2_toc_memory *memory;
	int table;
	int entry; /* at work, for the evidence */
	hm2_error *error;
};

static const char *table_name(int table)
{
	return table == HM2_PTOC ? "ptoc" : "gtoc";
}

static int broken(const struct reader *reader, int detail, uint32_t address, uint32_t expected, uint32_t received)
{
	hm2_error *error = reader->error;
	hm2_error_set(error, HM2_ERR_FORMAT, table_name(reader->table));
	if (error) {
		error->detail = detail;
		error->index = reader->entry;
		error->address = address;
		error->expected = expected;
		error->received = received;
	}
	return HM2_ERR_FORMAT;
}

static int fetch(const struct reader *reader, uint32_t address, uint32_t size, uint8_t *bytes)
{
	if (address > MEMORY_END - size)
		return broken(reader, HM2_TOC_CROSSES_END, address, MEMORY_END - size, address);
	return reader->memory->fetch(reader->memory->self, address, size, bytes, reader->error);
}

static uint16_t word_at(const uint8_t *bytes)
{
	return (uint16_t)(bytes[0] | bytes[1] << 8);
}

static float float_at(const uint8_t *bytes)
{
	const uint32_t bits = (uint32_t)word_at(bytes) | (uint32_t)word_at(bytes + 2) << 16;
	float value;
	memcpy(&value, &bits, sizeof value);
	return value;
}

/* Byte by byte: a wider read could run into memory the remote does not answer for. */
static int read_string(const struct reader *reader, uint32_t *address, char *string, uint32_t *warnings)
{
	const uint32_t start = *address;
	for (size_t i = 0; i < HM2_TOC_STRING; i++) {
		uint8_t byte = 0;
		const int status = fetch(reader, (*address)++, 1, &byte);
		if (status != HM2_OK)
			return status;
		string[i] = (char)byte;
		if (byte == 0)
			return HM2_OK;
		if (byte < ' ' || byte > '~') {
			string[i] = '_';
			*warnings |= HM2_TOC_UNPRINTABLE;
		}
	}
	string[HM2_TOC_STRING - 1] = 0;
	return broken(reader, HM2_TOC_STRING_END, start, HM2_TOC_STRING, HM2_TOC_STRING);
}

static int widest(uint8_t data_type)
{
	switch (data_type) {
	case HM2_DATA_TYPE_STREAM: return 32;
	case HM2_DATA_TYPE_BITS:
	case HM2_DATA_TYPE_UNSIGNED:
	case HM2_DATA_TYPE_SIGNED:
	case HM2_DATA_TYPE_NV_UNSIGNED:
	case HM2_DATA_TYPE_NV_SIGNED:
	case HM2_DATA_TYPE_BOOLEAN:
	case HM2_DATA_TYPE_ENCODER:
	case HM2_DATA_TYPE_ENCODER_HIGH:
	case HM2_DATA_TYPE_ENCODER_LOW: return 64;
	default: return 255;
	}
}

static int is_float(uint8_t data_type)
{
	return data_type == HM2_DATA_TYPE_FLOAT || data_type == HM2_DATA_TYPE_NV_FLOAT;
}

static int is_nonvolatile(uint8_t data_type)
{
	return data_type == HM2_DATA_TYPE_NV_UNSIGNED || data_type == HM2_DATA_TYPE_NV_SIGNED ||
	       data_type == HM2_DATA_TYPE_NV_FLOAT;
}

static int is_known(uint8_t data_type)
{
	return data_type == HM2_DATA_TYPE_PAD || is_float(data_type) || widest(data_type) != 255;
}

static int check_width(const struct reader *reader, const hm2_toc_record *record)
{
	const uint32_t at = record->address + 1;
	const uint8_t bits = record->bits;
	const int limit = widest(record->data_type);
	if (bits == 0 || (is_float(record->data_type) && bits != 32 && bits != 64))
		return broken(reader, HM2_TOC_BITS, at, is_float(record->data_type) ? 32 : 1, bits);
	if (bits > limit && (record->data_type != HM2_DATA_TYPE_STREAM || reader->table == HM2_PTOC))
		return broken(reader, HM2_TOC_BITS, at, (uint32_t)limit, bits);
	if (reader->table == HM2_GTOC && !record->is_process_data && bits != 8 && bits != 16 && bits != 32 &&
	    bits != 64)
		return broken(reader, HM2_TOC_PARAMETER_SIZE, at, 8, bits);
	return HM2_OK;
}

static int check_limits(const struct reader *reader, const hm2_toc_record *record)
{
	const float limits[] = {record->minimum, record->maximum};
	for (uint32_t i = 0; i < 2; i++) {
		const uint32_t at = record->address + 4 + 4 * i;
		uint32_t bits;
		memcpy(&bits, &limits[i], sizeof bits);
		if (isnan(limits[i]))
			return broken(reader, HM2_TOC_NOT_A_NUMBER, at, 0, bits);
		if (isinf(limits[i]) && !is_float(record->data_type))
			return broken(reader, HM2_TOC_INFINITE, at, 0, bits);
	}
	if (record->minimum > record->maximum)
		return broken(reader, HM2_TOC_LIMITS, record->address + 4, 0, 0);
	return HM2_OK;
}

static int check_data_record(const struct reader *reader, hm2_toc_record *record)
{
	if (reader->table == HM2_PTOC && is_nonvolatile(record->data_type))
		return broken(reader, HM2_TOC_NOT_IN_PTOC, record->address + 2, 0, record->data_type);
	if (!is_known(record->data_type))
		record->warnings |= HM2_TOC_UNKNOWN_TYPE;
	if (record->direction != HM2_DATA_DIRECTION_IN && record->direction != HM2_DATA_DIRECTION_OUT &&
	    record->direction != HM2_DATA_DIRECTION_BIDIRECTIONAL)
		return broken(reader, HM2_TOC_DIRECTION, record->address + 3, 0, record->direction);
	const int status = check_width(reader, record);
	return status == HM2_OK ? check_limits(reader, record) : status;
}

static int is_in(const hm2_toc_record *ptoc, size_t count, const hm2_toc_record *record)
{
	for (size_t i = 0; i < count; i++) {
		if (ptoc[i].record_type == HM2_RECORD_TYPE_PROCESS_DATA &&
		    (ptoc[i].address == record->address || ptoc[i].parameter_address == record->parameter_address))
			return 1;
	}
	return 0;
}

static int read_data_record(const struct reader *reader, const hm2_toc_record *ptoc, size_t ptoc_count,
                            hm2_toc_record *record)
{
	uint8_t bytes[DATA_STRINGS];
	uint32_t strings = record->address + DATA_STRINGS;
	int status = fetch(reader, record->address, 8, bytes);
	if (status == HM2_OK)
		status = fetch(reader, record->address + 8, 4, bytes + 8);
	if (status == HM2_OK)
		status = fetch(reader, record->address + 12, 2, bytes + 12);
	if (status != HM2_OK)
		return status;
	record->bits = bytes[1];
	record->data_type = bytes[2];
	record->direction = bytes[3];
	record->minimum = float_at(bytes + 4);
	record->maximum = float_at(bytes + 8);
	record->parameter_address = word_at(bytes + 12);
	record->is_process_data = (uint8_t)is_in(ptoc, ptoc_count, record);
	status = check_data_record(reader, record);
	if (status == HM2_OK)
		status = read_string(reader, &strings, record->unit, &record->warnings);
	if (status == HM2_OK)
		status = read_string(reader, &strings, record->name, &record->warnings);
	return status;
}

static int read_mode_record(const struct reader *reader, hm2_toc_record *record)
{
	uint8_t bytes[MODE_STRING];
	uint32_t string = record->address + MODE_STRING;
	const int status = fetch(reader, record->address, MODE_STRING, bytes);
	if (status != HM2_OK)
		return status;
	record->mode_index = bytes[1];
	record->mode_type = bytes[2];
	return read_string(reader, &string, record->name, &record->warnings);
}

static int read_record(const struct reader *reader, const hm2_toc_record *ptoc, size_t ptoc_count,
                       uint32_t address, hm2_toc_record *record)
{
	memset(record, 0, sizeof *record);
	record->address = address;
	int status = fetch(reader, address, 1, &record->record_type);
	if (status != HM2_OK)
		return status;
	if (record->record_type == HM2_RECORD_TYPE_PROCESS_DATA)
		status = read_data_record(reader, ptoc, ptoc_count, record);
	else if (record->record_type == HM2_RECORD_TYPE_MODE)
		status = read_mode_record(reader, record);
	else
		status = broken(reader, HM2_TOC_RECORD_TYPE, address, HM2_RECORD_TYPE_PROCESS_DATA,
		                record->record_type);
	if (record->name[0] == 0)
		record->warnings |= HM2_TOC_NO_NAME;
	return status;
}

/* The pointers first, to their end: a loop must be found before its records are read for ever. */
static int read_pointers(struct reader *reader, uint32_t pointer, uint16_t *pointers, size_t *count)
{
	for (size_t i = 0;; i++) {
		uint8_t bytes[2];
		const uint32_t at = pointer + 2 * (uint32_t)i;
		reader->entry = (int)i;
		const int status = fetch(reader, at, 2, bytes);
		if (status != HM2_OK)
			return status;
		const uint16_t value = word_at(bytes);
		if (value == 0) {
			*count = i;
			return HM2_OK;
		}
		if (i == HM2_TOC_ENTRIES)
			break;
		if (value == NO_POINTER)
			return broken(reader, HM2_TOC_POINTER, at, 0, value);
		for (size_t j = 0; j < i; j++) {
			if (pointers[j] == value)
				return broken(reader, HM2_TOC_LOOP, at, 0, value);
		}
		pointers[i] = value;
	}
	return broken(reader, HM2_TOC_TOO_LONG, pointer, HM2_TOC_ENTRIES, HM2_TOC_ENTRIES + 1);
}

int hm2_toc_read(const hm2_toc_memory *memory, uint32_t pointer, int table, const hm2_toc_record *ptoc,
                 size_t ptoc_count, hm2_toc_record *records, size_t capacity, size_t *count, hm2_error *error)
{
	struct reader reader = {memory, table, -1, error};
	uint16_t pointers[HM2_TOC_ENTRIES];
	size_t entries = 0;
	*count = 0;
	if (pointer == 0)
		return HM2_OK; /* the remote has no such table */
	if (pointer >= NO_POINTER)
		return broken(&reader, HM2_TOC_POINTER, pointer, 0, pointer);
	int status = read_pointers(&reader, pointer, pointers, &entries);
	if (status == HM2_OK && entries > capacity) {
		hm2_error_set(error, HM2_ERR_RANGE, table_name(table));
		return HM2_ERR_RANGE;
	}
	for (size_t i = 0; i < entries && status == HM2_OK; i++) {
		reader.entry = (int)i;
		status = read_record(&reader, ptoc, ptoc_count, pointers[i], &records[i]);
		if (status == HM2_OK)
			*count = i + 1;
	}
	return status;
}

struct buffer {
	const uint8_t *bytes;
	size_t length;
	uint32_t base;
};

static int fetch_buffer(void *self, uint32_t address, uint32_t size, uint8_t *bytes, hm2_error *error)
{
	const struct buffer *buffer = self;
	if (address < buffer->base || address - buffer->base > buffer->length ||
	    size > buffer->length - (address - buffer->base)) {
		hm2_error_set(error, HM2_ERR_RANGE, "toc memory");
		if (error)
			error->address = address;
		return HM2_ERR_RANGE;
	}
	memcpy(bytes, buffer->bytes + (address - buffer->base), size);
	return HM2_OK;
}

int hm2_toc_read_buffer(const uint8_t *bytes, size_t length, uint32_t base, uint32_t pointer, int table,
                        const hm2_toc_record *ptoc, size_t ptoc_count, hm2_toc_record *records,
                        size_t capacity, size_t *count, hm2_error *error)
{
	struct buffer buffer = {bytes, length, base};
	const hm2_toc_memory memory = {&buffer, fetch_buffer};
	return hm2_toc_read(&memory, pointer, table, ptoc, ptoc_count, records, capacity, count, error);
}

static int too_many_bits(int detail, uint32_t limit, uint32_t bits, hm2_error *error)
{
	hm2_error_set(error, HM2_ERR_FORMAT, table_name(HM2_PTOC));
	if (error) {
		error->detail = detail;
		error->expected = limit;
		error->received = bits;
	}
	return HM2_ERR_FORMAT;
}

static uint32_t smaller(uint32_t a, uint32_t b)
{
	return a < b ? a : b;
}

int hm2_toc_check_sizes(const hm2_toc_record *ptoc, size_t count, uint32_t receive_size, uint32_t transmit_size,
                        uint32_t registers, uint32_t *input_bits, uint32_t *output_bits, hm2_error *error)
{
	const uint32_t room = 32 * registers;
	const uint32_t most_in = receive_size ? smaller(room, 8 * (receive_size - 1)) : room;
	const uint32_t most_out = receive_size ? smaller(room, 8 * transmit_size) : room;
	*input_bits = *output_bits = 0;
	for (size_t i = 0; i < count; i++) {
		if (ptoc[i].record_type != HM2_RECORD_TYPE_PROCESS_DATA)
			continue;
		if (ptoc[i].direction != HM2_DATA_DIRECTION_OUT)
			*input_bits += ptoc[i].bits;
		if (ptoc[i].direction != HM2_DATA_DIRECTION_IN)
			*output_bits += ptoc[i].bits;
	}
	if (*input_bits > most_in)
		return too_many_bits(HM2_TOC_INPUT_BITS, most_in, *input_bits, error);
	if (*output_bits > most_out)
		return too_many_bits(HM2_TOC_OUTPUT_BITS, most_out, *output_bits, error);
	return HM2_OK;
}
