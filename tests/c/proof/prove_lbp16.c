/* The LBP16 codec, for every packet of up to PACKET bytes and every command. */
#include "../../../csrc/lbp16.c"
#include "prove.h"

#define PACKET 16

/* Any bytes: a packet is its length's memory exactly, so that one byte too far is an error. */
static uint8_t *any_packet(size_t *length)
{
	*length = nondet_uint8();
	ASSUME(*length <= PACKET);
	return __builtin_alloca(*length);
}

static hm2_lbp16_command any_command(void)
{
	hm2_lbp16_command command = {
		.address = nondet_uint16(), .write = nondet_uint8(), .has_address = nondet_uint8(), .info = nondet_uint8(),
		.space = nondet_uint8(), .element_size = nondet_uint8(), .increment = nondet_uint8(), .count = nondet_uint8(),
	};
	return command;
}

/* Decoding any word and encoding the result gives the word again. */
/* proof: --overflow-check --ub-shift-check */
void prove_words_round_trip(void)
{
	const uint16_t word = nondet_uint16();
	hm2_lbp16_command command;

	hm2_lbp16_decode(word, &command);
	PROVE(command.space < 8 && command.count <= 127 && command.write <= 1 && command.increment <= 1);
	PROVE(command.element_size == 1 || command.element_size == 2 || command.element_size == 4 ||
	      command.element_size == 8);
	PROVE(hm2_lbp16_encode(&command) == word);
}

/* Any bytes read as a packet: never beyond them, always forward, data inside, nothing taken that is not whole. */
/* proof: --overflow-check --ub-shift-check */
void prove_next_stays_inside(void)
{
	size_t length;
	const uint8_t *packet = any_packet(&length);
	size_t offset = nondet_uint8();
	const size_t start = offset;
	hm2_lbp16_command command;
	const uint8_t *data;
	const int status = hm2_lbp16_next(packet, length, &offset, &command, &data);

	PROVE(status == HM2_OK || status == HM2_ERR_FORMAT || status == HM2_ERR_RANGE);
	if (status != HM2_OK) {
		PROVE(offset == start && data == NULL);
		return;
	}
	PROVE(offset >= start + 2 && offset <= length && command.count >= 1);
	PROVE((data != NULL) == (command.write != 0));
	if (data)
		PROVE(data == packet + offset - (size_t)command.count * command.element_size);
}

/* Any packet: the walk ends, and the reply is no longer than 127 elements of 8 bytes for each command. */
/* proof: --overflow-check --ub-shift-check */
void prove_reply_size_ends(void)
{
	size_t length;
	const uint8_t *packet = any_packet(&length);
	size_t reply = 1;

	hm2_lbp16_reply_size(packet, length, &reply);
	PROVE(reply <= length / 2 * 127 * 8);
}

/* Any command put behind anything: written whole where there is room, refused and nothing written where not;
 * and what was written reads back as the same command. */
/* proof: --overflow-check --ub-shift-check */
void prove_put_and_next_agree(void)
{
	uint8_t packet[PACKET];
	uint8_t data[PACKET];
	size_t length = nondet_uint8();
	const size_t start = length;
	const size_t capacity = nondet_uint8();
	const hm2_lbp16_command command = any_command();
	hm2_lbp16_command again;
	const uint8_t *body;

	ASSUME(capacity <= PACKET);
	ASSUME(!command.write || (size_t)command.count * command.element_size <= PACKET);
	const int status = hm2_lbp16_put(packet, capacity, &length, &command, data);
	if (status != HM2_OK) {
		PROVE(status == HM2_ERR_RANGE && length == start);
		return;
	}
	PROVE(length <= capacity && length >= start + 2);
	size_t offset = start;
	PROVE(hm2_lbp16_next(packet, length, &offset, &again, &body) == HM2_OK);
	PROVE(offset == length);
	PROVE(again.space == command.space && again.element_size == command.element_size);
	PROVE(again.count == command.count && !again.write == !command.write && !again.info == !command.info);
	PROVE(!again.increment == !command.increment && !again.has_address == !command.has_address);
	PROVE(!command.has_address || again.address == command.address);
	if (command.write) {
		const size_t at = nondet_uint8();
		ASSUME(at < (size_t)command.count * command.element_size);
		PROVE(body[at] == data[at]);
	}
}
