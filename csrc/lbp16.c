/* The LBP16 wire format: command words and packets. Fact sheet lbp16.md 1. */
#include <string.h>

#include "hm2.h"
#include "registers.h"

static unsigned size_code(unsigned element_size)
{
	switch (element_size) {
	case 1: return HM2_LBP16_SIZE_BITS_8;
	case 2: return HM2_LBP16_SIZE_BITS_16;
	case 4: return HM2_LBP16_SIZE_BITS_32;
	default: return HM2_LBP16_SIZE_BITS_64;
	}
}

static int valid(const hm2_lbp16_command *command)
{
	unsigned size = command->element_size;

	return command->space < 8 && command->count >= 1 && command->count <= HM2_LBP16_MAX_COUNT &&
	       (size == 1 || size == 2 || size == 4 || size == 8);
}

static uint16_t get16(const uint8_t *bytes)
{
	return (uint16_t)(bytes[0] | bytes[1] << 8);
}

static void put16(uint8_t *bytes, uint16_t value)
{
	bytes[0] = (uint8_t)value;
	bytes[1] = (uint8_t)(value >> 8);
}

/* Short names for the fields of the command word. */
enum {
	WRITE = HM2_LBP16_COMMAND_WORD_WRITE_MASK,
	ADDRESS = HM2_LBP16_COMMAND_WORD_ADDRESS_MASK,
	INFO = HM2_LBP16_COMMAND_WORD_INFO_MASK,
	SPACE_LSB = HM2_LBP16_COMMAND_WORD_SPACE_LSB,
	SIZE_LSB = HM2_LBP16_COMMAND_WORD_SIZE_LSB,
	INCREMENT = HM2_LBP16_COMMAND_WORD_INCREMENT_MASK,
	COUNT_MASK = HM2_LBP16_COMMAND_WORD_COUNT_MASK
};

uint16_t hm2_lbp16_encode(const hm2_lbp16_command *command)
{
	unsigned word = (command->write ? WRITE : 0u) | (command->has_address ? ADDRESS : 0u) |
	                (command->info ? INFO : 0u) | (command->increment ? INCREMENT : 0u) |
	                (command->space & 7u) << SPACE_LSB | size_code(command->element_size) << SIZE_LSB |
	                (command->count & COUNT_MASK);

	return (uint16_t)word;
}

void hm2_lbp16_decode(uint16_t word, hm2_lbp16_command *command)
{
	command->address = 0;
	command->write = (word & WRITE) != 0;
	command->has_address = (word & ADDRESS) != 0;
	command->info = (word & INFO) != 0;
	command->space = (uint8_t)(word >> SPACE_LSB & 7);
	command->element_size = (uint8_t)(1 << (word >> SIZE_LSB & 3));
	command->increment = (word & INCREMENT) != 0;
	command->count = (uint8_t)(word & COUNT_MASK);
}

int hm2_lbp16_put(uint8_t *packet, size_t capacity, size_t *length, const hm2_lbp16_command *command,
                  const uint8_t *data)
{
	size_t head = command->has_address ? 4 : 2;
	size_t body = command->write ? (size_t)command->count * command->element_size : 0;
	uint8_t *to = packet + *length;

	if (!valid(command) || *length > capacity || capacity - *length < head + body)
		return HM2_ERR_RANGE;
	put16(to, hm2_lbp16_encode(command));
	if (command->has_address)
		put16(to + 2, command->address);
	if (body)
		memcpy(to + head, data, body);
	*length += head + body;
	return HM2_OK;
}

int hm2_lbp16_next(const uint8_t *packet, size_t length, size_t *offset, hm2_lbp16_command *command,
                   const uint8_t **data)
{
	size_t at = *offset;
	size_t body;

	*data = NULL;
	if (at > length || length - at < 2)
		return HM2_ERR_FORMAT;
	hm2_lbp16_decode(get16(packet + at), command);
	at += 2;
	if (command->count == 0)
		return HM2_ERR_FORMAT;
	if (command->has_address) {
		if (length - at < 2)
			return HM2_ERR_FORMAT;
		command->address = get16(packet + at);
		at += 2;
	}
	if (command->write) {
		body = (size_t)command->count * command->element_size;
		if (length - at < body)
			return HM2_ERR_RANGE;
		*data = packet + at;
		at += body;
	}
	*offset = at;
	return HM2_OK;
}

int hm2_lbp16_reply_size(const uint8_t *packet, size_t length, size_t *reply_size)
{
	hm2_lbp16_command command;
	const uint8_t *data;
	size_t offset = 0;
	int status;

	*reply_size = 0;
	while (offset < length) {
		status = hm2_lbp16_next(packet, length, &offset, &command, &data);
		if (status != HM2_OK)
			return status;
		if (!command.write)
			*reply_size += (size_t)command.count * command.element_size;
	}
	return HM2_OK;
}
