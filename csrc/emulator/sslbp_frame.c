/* What the firmware says in each sending state, and how long an answer it waits for after it
 * (sserial.md 4.4; for the 8I20 and 7I64 SSLBP observed 2). */
#include "sslbp_state.h"

#include <string.h>

#define PROCESS_BYTES_8I20 8
#define OUTPUTS_7I64 4
#define OUTPUTS_MAX (FRAME_SIZE - 2) /* header and CRC fit the FIFO too */

/* Frames that are always the same, without CRC, and the data bytes of their answers. */
struct fixed_frame {
	uint8_t answer, length, bytes[5];
};

static const struct fixed_frame fixed[HM2_COM_STATE_CHATTER_SEND] = {
	[HM2_COM_STATE_COOKIE_SEND] = {1, 1, {0xDF}},
	[HM2_COM_STATE_TIMEOUT_SEND] = {0, 2, {0xEB, 0x28}},
	[HM2_COM_STATE_CLEAR_STATUS_SEND] = {0, 2, {0xE1, 0x00}},
	[HM2_COM_STATE_STATUS_SEND] = {1, 1, {0xC1}},
	[HM2_COM_STATE_UNIT_NUMBER_SEND] = {4, 1, {0xBC}},
	[HM2_COM_STATE_NAME_0_SEND] = {1, 1, {0xD0}},
	[HM2_COM_STATE_NAME_1_SEND] = {1, 1, {0xD1}},
	[HM2_COM_STATE_NAME_2_SEND] = {1, 1, {0xD2}},
	[HM2_COM_STATE_NAME_3_SEND] = {1, 1, {0xD3}},
	[HM2_COM_STATE_CLEAR_7I64_SEND] = {PROCESS_BYTES_8I20, 5, {0xBD, 0, 0, 0, 0x08}},
	[HM2_COM_STATE_DISCOVERY_SEND] = {6, 1, {0xBB}},
	[HM2_COM_STATE_CLEAR_FAULT_SEND] = {0, 2, {0xE7, 0xFF}},
	[HM2_COM_STATE_CLEAR_FAULT_POLL_SEND] = {1, 1, {0xC7}},
	[HM2_COM_STATE_FAULT_SEND] = {1, 1, {0xD7}},
	[HM2_COM_STATE_CLEAR_FAULT_8I20_SEND] = {0, 5, {0x65, 0x54, 0x08, 0xFF, 0xFF}},
	[HM2_COM_STATE_CLEAR_FAULT_8I20_POLL_SEND] = {2, 3, {0x45, 0x54, 0x08}},
	[HM2_COM_STATE_FAULT_8I20_SEND] = {2, 3, {0x45, 0x52, 0x08}},
	[HM2_COM_STATE_SETPOINT_8I20_SEND] = {0, 5, {0x65, 0x60, 0x08, 0, 0}},
	[HM2_COM_STATE_ENABLE_8I20_SEND] = {0, 5, {0x65, 0x04, 0x08, 0xFF, 0xFF}},
	[HM2_COM_STATE_ENABLED_8I20_SEND] = {2, 3, {0x45, 0xFE, 0x08}},
	[HM2_COM_STATE_FAULT_AGAIN_8I20_SEND] = {2, 3, {0x45, 0x52, 0x08}},
	[HM2_COM_STATE_WATCHDOG_8I20_SEND] = {0, 5, {0x65, 0x5C, 0x08, 0xF4, 0x01}},
};

static size_t process_frame(struct hm2_sslbp *s, int channel, uint8_t *frame, int zeros)
{
	size_t length = sslbp_block(s, channel)[HM2_SSLBP_CHANNEL_TRANSMIT_SIZE];
	if (length > OUTPUTS_MAX)
		length = OUTPUTS_MAX;
	memset(frame, 0, 1 + length);
	frame[0] = HM2_LBP_RPC_PROCESS_DATA;
	for (size_t i = 0; i < length && !zeros && i / 4 < (size_t)s->data_registers; i++)
		frame[1 + i] = (uint8_t)(s->written[channel][1 + i / 4] >> 8 * (i % 4));
	return 1 + length;
}

/* Setup mode: CS holds header and address, the data registers what is to be written. */
static size_t setup_frame(struct hm2_sslbp *s, int channel, uint8_t *frame)
{
	const uint32_t *registers = s->written[channel];
	uint8_t header = (uint8_t)(registers[0] >> 24);
	int local = header >> 6 == HM2_LBP_KIND_LOCAL;
	size_t length = 0;
	frame[length++] = header;
	if (!local && header & 0x04) {
		frame[length++] = (uint8_t)registers[0];
		frame[length++] = (uint8_t)(registers[0] >> 8);
	}
	if (header & 0x20) {
		int size = local ? 1 : 1 << (header & 3);
		for (int i = 0; i < size; i++)
			frame[length++] = (uint8_t)(registers[1 + i / 4] >> 8 * (i % 4));
	}
	return length;
}

size_t sslbp_frame(struct hm2_sslbp *s, int channel, uint8_t *frame)
{
	uint8_t state = sslbp_state(s, channel);
	if (state < HM2_COM_STATE_CHATTER_SEND && fixed[state].length) {
		memcpy(frame, fixed[state].bytes, fixed[state].length);
		return fixed[state].length;
	}
	switch (state) {
	case HM2_COM_STATE_MODE_SEND:
		frame[0] = 0xE6;
		frame[1] = (uint8_t)(s->written[channel][0] >> 24);
		return 2;
	case HM2_COM_STATE_ZERO_SEND:
	case HM2_COM_STATE_CHATTER_SEND:
		return process_frame(s, channel, frame, 1);
	case HM2_COM_STATE_SETUP:
		return setup_frame(s, channel, frame);
	default:
		break;
	}
	size_t length = process_frame(s, channel, frame, 0);
	if (state == HM2_COM_STATE_RUN_7I64)
		frame[OUTPUTS_7I64] = 0; /* its fourth byte is the firmware's */
	return length;
}

int sslbp_answer_size(struct hm2_sslbp *s, int channel)
{
	const uint8_t *block = sslbp_block(s, channel);
	uint8_t state = block[HM2_SSLBP_CHANNEL_STATE];
	switch (state) {
	case HM2_COM_STATE_MODE_GET:
		return 0;
	case HM2_COM_STATE_SETUP_GET:
		return block[HM2_SSLBP_CHANNEL_READ_SIZE];
	case HM2_COM_STATE_ZERO_GET:
	case HM2_COM_STATE_CHATTER_GET:
	case HM2_COM_STATE_RUN_GET:
	case HM2_COM_STATE_RUN_8I20_GET:
	case HM2_COM_STATE_RUN_7I64_GET:
		return block[HM2_SSLBP_CHANNEL_RECEIVE_SIZE];
	default:
		break;
	}
	if (state == 0 || state > HM2_COM_STATE_CHATTER_SEND || !fixed[state - 1].length)
		return -1;
	return fixed[state - 1].answer;
}
