/* Transfers in and out of LBP16 datagrams. Pure functions. */
#include "registers.h"
#include "udp.h"

#include <string.h>

enum { SCRATCH_SEQUENCE = HM2_LBP16_TIMER_SCRATCH, SCRATCH_PROBE = HM2_LBP16_TIMER_SCRATCH + 4 };

#define TAIL 12 /* bytes of udp_datagram_close */

static uint32_t min3(size_t a, size_t b, size_t c)
{
	const size_t least = a < b ? a : b;

	return (uint32_t)(least < c ? least : c);
}

static hm2_lbp16_command scratch(int write, uint16_t address, uint8_t words)
{
	return (hm2_lbp16_command){.address = address, .write = (uint8_t)write, .has_address = 1,
	                           .space = HM2_LBP16_SPACE_TIMER, .element_size = 2, .increment = 1, .count = words};
}

static void append(struct udp_datagram *datagram, const hm2_lbp16_command *command, const uint8_t *data)
{
	/* room was checked by whoever calls */
	(void)hm2_lbp16_put(datagram->bytes, sizeof datagram->bytes, &datagram->length, command, data);
	if (!command->write)
		datagram->reply_size += (size_t)command->count * command->element_size;
}

void udp_datagram_open(struct udp_datagram *datagram)
{
	const hm2_lbp16_command last = scratch(0, SCRATCH_SEQUENCE, 2);

	datagram->length = datagram->reply_size = 0;
	datagram->answered = datagram->writes = datagram->once = 0;
	append(datagram, &last, NULL);
}

void udp_datagram_close(struct udp_datagram *datagram)
{
	static const uint8_t blank[4];
	const hm2_lbp16_command write = scratch(1, SCRATCH_SEQUENCE, 2);
	const hm2_lbp16_command read = scratch(0, SCRATCH_SEQUENCE, 2);

	datagram->sequence_at = datagram->length + 4;
	append(datagram, &write, blank);
	append(datagram, &read, NULL);
}

void udp_datagram_number(struct udp_datagram *datagram, uint32_t sequence)
{
	datagram->sequence = sequence;
	udp_put32(datagram->bytes + datagram->sequence_at, sequence);
}

/* How many of the transfer's words this datagram still takes, in one command. */
static uint32_t room(const struct udp_datagram *datagram, const hm2_transfer *transfer, uint32_t wanted)
{
	const size_t request = sizeof datagram->bytes - TAIL - datagram->length;
	const size_t reply = HM2_LBP16_MAX_PAYLOAD - 4 - datagram->reply_size;

	if (request < 4)
		return 0;
	if (transfer->flags & HM2_TRANSFER_WRITE)
		return min3(wanted, HM2_LBP16_MAX_COUNT, (request - 4) / 4);
	return min3(wanted, HM2_LBP16_MAX_COUNT, reply / 4);
}

static void append_words(struct udp_datagram *datagram, const hm2_transfer *transfer, uint32_t word, uint32_t count)
{
	const int same = (transfer->flags & HM2_TRANSFER_SAME_ADDRESS) != 0;
	const int write = (transfer->flags & HM2_TRANSFER_WRITE) != 0;
	const hm2_lbp16_command command = {.address = (uint16_t)(transfer->address + (same ? 0 : 4 * word)),
	                                   .write = (uint8_t)write, .has_address = 1, .space = HM2_LBP16_SPACE_HOSTMOT2, .element_size = 4,
	                                   .increment = (uint8_t)!same, .count = (uint8_t)count};
	uint8_t data[4 * HM2_LBP16_MAX_COUNT];

	for (uint32_t i = 0; write && i < count; i++)
		udp_put32(data + 4 * i, transfer->words[word + i]);
	append(datagram, &command, data);
	datagram->writes |= write;
	datagram->once |= same && !write; /* a FIFO gives its words only once */
}

void udp_datagram_pack(struct udp_datagram *datagram, struct udp_list *list)
{
	struct udp_position *at = &list->at;

	udp_datagram_open(datagram);
	datagram->start = *at;
	while (at->transfer < list->count) {
		const hm2_transfer *transfer = &list->transfers[at->transfer];
		const uint32_t wanted = transfer->count - at->word;
		const uint32_t count = room(datagram, transfer, wanted);

		if (count)
			append_words(datagram, transfer, at->word, count);
		at->word += count;
		if (at->word == transfer->count) {
			at->transfer++;
			at->word = 0;
		} else if (count < HM2_LBP16_MAX_COUNT) {
			break;
		}
	}
	datagram->end = *at;
	udp_datagram_close(datagram);
}

void udp_datagram_unpack(const struct udp_datagram *datagram, const struct udp_list *list, const uint8_t *reply)
{
	struct udp_position at = datagram->start;

	reply += 4;
	for (; at.transfer <= datagram->end.transfer && at.transfer < list->count; at.transfer++, at.word = 0) {
		const hm2_transfer *transfer = &list->transfers[at.transfer];
		const uint32_t end = at.transfer == datagram->end.transfer ? datagram->end.word : transfer->count;

		if (transfer->flags & HM2_TRANSFER_WRITE)
			continue;
		for (; at.word < end; at.word++, reply += 4)
			transfer->words[at.word] = udp_get32(reply);
	}
}

void udp_datagram_strip(struct udp_datagram *datagram)
{
	const size_t end = datagram->sequence_at - 4; /* the write of its number starts here */
	hm2_lbp16_command command;
	const uint8_t *data;
	size_t from = 0, to = 0;

	while (from < end) {
		const size_t start = from;

		if (hm2_lbp16_next(datagram->bytes, datagram->length, &from, &command, &data) != HM2_OK)
			return; /* cannot be: these are our own bytes */
		if (command.write)
			continue;
		memmove(datagram->bytes + to, datagram->bytes + start, from - start);
		to += from - start;
	}
	memmove(datagram->bytes + to, datagram->bytes + end, datagram->length - end);
	datagram->length -= end - to;
	datagram->sequence_at = to + 4;
	datagram->writes = 0;
}

int udp_datagram_raw(struct udp_datagram *datagram, const uint8_t *commands, size_t length, size_t reply_size)
{
	hm2_lbp16_command command;
	const uint8_t *data;
	size_t expected, offset = 0;

	if (hm2_lbp16_reply_size(commands, length, &expected) != HM2_OK || expected != reply_size)
		return HM2_ERR_RANGE;
	udp_datagram_open(datagram);
	if (length > sizeof datagram->bytes - TAIL - datagram->length ||
	    reply_size > HM2_LBP16_MAX_PAYLOAD - UDP_OVERHEAD)
		return HM2_ERR_RANGE;
	while (hm2_lbp16_next(commands, length, &offset, &command, &data) == HM2_OK) { /* to the end, as checked above */
		datagram->writes |= command.write;
		datagram->once |= !command.has_address || command.write;
	}
	memcpy(datagram->bytes + datagram->length, commands, length);
	datagram->length += length;
	datagram->reply_size += reply_size;
	udp_datagram_close(datagram);
	return HM2_OK;
}

size_t udp_probe(uint8_t *bytes, size_t capacity, uint32_t number)
{
	const hm2_lbp16_command write = scratch(1, SCRATCH_PROBE, 2);
	/* one word more than the two numbers: a length that no datagram's reply can have */
	const hm2_lbp16_command read = scratch(0, SCRATCH_SEQUENCE, UDP_PROBE_REPLY / 2);
	size_t length = 0;
	uint8_t data[4];

	udp_put32(data, number);
	(void)hm2_lbp16_put(bytes, capacity, &length, &write, data);
	(void)hm2_lbp16_put(bytes, capacity, &length, &read, NULL);
	return length;
}
