/* A channel's turn in the main loop: errors, sending, waiting, and whatever its state asks for. */
#include "lbp.h"
#include "sslbp_state.h"

#include <string.h>

#define NO_TIMEOUT_YET 0

static int elapsed(struct hm2_sslbp *s, const uint8_t *block)
{
	return (uint8_t)(sslbp_timer_at(s, s->cpu + COST_TO_CLOCK) - block[HM2_SSLBP_CHANNEL_START_TIME]);
}

static void start_clock(struct hm2_sslbp *s, uint8_t *block, int64_t at)
{
	uint16_t now = sslbp_timer_at(s, at);
	block[HM2_SSLBP_CHANNEL_START_TIME] = (uint8_t)now;
	block[HM2_SSLBP_CHANNEL_START_TIME + 1] = (uint8_t)(now >> 8);
}

int sslbp_channel_fail(struct hm2_sslbp *s, int channel, uint8_t fault, unsigned counter)
{
	uint8_t *block = sslbp_block(s, channel);
	int too_many = block[counter] >= block[HM2_SSLBP_CHANNEL_ERROR_LIMIT];
	block[HM2_SSLBP_CHANNEL_ERROR_LOG] |= fault;
	block[HM2_SSLBP_CHANNEL_STATUS] |= HM2_CS_STATUS_COMMUNICATION_ERROR;
	if (too_many)
		block[HM2_SSLBP_CHANNEL_ERROR_LOG] |= HM2_LOCAL_FAULT_TOO_MANY_ERRORS;
	else
		block[counter]++;
	sslbp_uart_flush(s, channel);
	s->ram[HM2_SSLBP_LOCAL_NOT_DONE_MASK] &= (uint8_t)~(1u << channel);
	/* Starting ends there; chatter and process data go their own ways. */
	if (too_many && block[HM2_SSLBP_CHANNEL_STATE] < HM2_COM_STATE_CHATTER_SEND) {
		s->ram[HM2_SSLBP_LOCAL_STARTED_MASK] &= (uint8_t)~(1u << channel);
		s->ram[HM2_SSLBP_LOCAL_NOT_STARTED_MASK] &= (uint8_t)~(1u << channel);
	}
	return too_many;
}

static int initialise(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	uint8_t bit = (uint8_t)(1u << channel);
	int cost = COST_CHANNEL_INIT;
	if (s->ram[HM2_SSLBP_LOCAL_START_TYPE] == 0)
		cost += COST_CHANNEL_FIRST_INIT;
	else if (block[HM2_SSLBP_CHANNEL_STATE] != HM2_COM_STATE_RESET)
		cost += COST_CHANNEL_ACTIVE_INIT;
	memset(block + HM2_SSLBP_CHANNEL_STATE, 0, HM2_SSLBP_CHANNEL_ID - HM2_SSLBP_CHANNEL_STATE + 1);
	block[HM2_SSLBP_CHANNEL_GENERIC] = 0;
	block[HM2_SSLBP_CHANNEL_ERROR_LIMIT] = HM2_SSLBP_LIMIT_ERRORS;
	block[HM2_SSLBP_CHANNEL_STATUS] =
		HM2_CS_STATUS_NOT_READY | HM2_CS_STATUS_NO_REMOTE_ID | HM2_CS_STATUS_REMOTE_FAULT;
	sslbp_uart_flush(s, channel);
	s->ram[HM2_SSLBP_LOCAL_STOP_MASK] &= (uint8_t)~bit;
	s->ram[HM2_SSLBP_LOCAL_STARTED_MASK] &= (uint8_t)~bit;
	s->ram[HM2_SSLBP_LOCAL_REQUEST_MASK] &= (uint8_t)~bit;
	s->ram[HM2_SSLBP_LOCAL_CHATTER_MASK] &= (uint8_t)~bit;
	s->ram[HM2_SSLBP_LOCAL_RUNNING_MASK] &= (uint8_t)~bit;
	s->ram[HM2_SSLBP_LOCAL_NOT_READY_MASK] |= bit;
	s->ram[HM2_SSLBP_LOCAL_NOT_STARTED_MASK] |= bit;
	for (int reg = s->data_registers; reg > 0; reg--)
		sslbp_show(s, channel, reg, 0, s->cpu + (reg == 1 ? COST_INIT_FIRST_REGISTER : COST_INIT_REGISTERS));
	return cost;
}

/* Setup mode: how much the access written to CS reads; 0: it is not one that can be sent. */
static int prepare_setup(struct hm2_sslbp *s, int channel)
{
	uint8_t header = (uint8_t)(s->written[channel][0] >> 24);
	uint8_t *size = &sslbp_block(s, channel)[HM2_SSLBP_CHANNEL_READ_SIZE];
	if (!(header & 0x40))
		return 0;
	if (header & 0x20)
		*size = 0;
	else
		*size = (uint8_t)(header >> 6 == HM2_LBP_KIND_LOCAL ? 1 : 1 << (header & 3));
	return 1;
}

static int refuse(struct hm2_sslbp *s, int channel)
{
	s->ram[HM2_SSLBP_LOCAL_REQUEST_MASK] &= (uint8_t)~(1u << channel);
	s->ram[HM2_SSLBP_LOCAL_NOT_DONE_MASK] &= (uint8_t)~(1u << channel);
	return COST_REFUSE;
}

static int send(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	uint8_t frame[FRAME_SIZE + 1];
	int cost = 0;
	if (block[HM2_SSLBP_CHANNEL_STATE] == HM2_COM_STATE_SETUP && !prepare_setup(s, channel))
		return refuse(s, channel);
	if (s->uarts[channel].rx_count) {
		sslbp_channel_fail(s, channel, HM2_LOCAL_FAULT_EXTRA_CHARACTER, HM2_SSLBP_CHANNEL_EXTRA_CHARACTERS);
		cost += COST_SURPLUS;
	}
	size_t length = sslbp_frame(s, channel, frame);
	int64_t at = s->cpu + cost + sslbp_cost_to_start_bit(block[HM2_SSLBP_CHANNEL_STATE]);
	cost += sslbp_uart_send(s, channel, frame, length, at);
	cost += sslbp_cost_of_sending(block[HM2_SSLBP_CHANNEL_STATE], frame, length);
	start_clock(s, block, s->cpu + cost - sslbp_cost_after_clock(block[HM2_SSLBP_CHANNEL_STATE]));
	block[HM2_SSLBP_CHANNEL_STATE]++;
	return cost;
}

static int time_out(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	int setup = s->ram[HM2_SSLBP_LOCAL_START_TYPE] == HM2_SSLBP_COMMAND_START_SETUP >> 8;
	int too_many = sslbp_channel_fail(s, channel, HM2_LOCAL_FAULT_TIMEOUT, HM2_SSLBP_CHANNEL_TIMEOUTS);
	uint8_t *state = &block[HM2_SSLBP_CHANNEL_STATE];
	s->ram[HM2_SSLBP_LOCAL_REQUEST_MASK] &= (uint8_t)~(1u << channel);
	switch (*state) {
	case HM2_COM_STATE_UNIT_NUMBER_GET:
		if (setup)
			*state = HM2_COM_STATE_NAME_0_SEND;
		return COST_ERROR + COST_ERROR_STAYS;
	case HM2_COM_STATE_DISCOVERY_GET:
		if (setup)
			return COST_ERROR + sslbp_ready(s, channel, HM2_COM_STATE_SETUP);
		*state = HM2_COM_STATE_START_PAUSE;
		break;
	case HM2_COM_STATE_CHATTER_GET:
		if (!too_many)
			*state = HM2_COM_STATE_CHATTER_SEND;
		break;
	case HM2_COM_STATE_ZERO_GET:
	case HM2_COM_STATE_RUN_8I20_GET:
	case HM2_COM_STATE_RUN_7I64_GET:
	case HM2_COM_STATE_SETUP_GET:
		--*state;
		break;
	case HM2_COM_STATE_RUN_GET:
		--*state;
		return COST_ERROR_RUNNING;
	default:
		*state = HM2_COM_STATE_START_PAUSE;
		break;
	}
	return COST_ERROR;
}

/* Take the answer out of the FIFO; 0: its CRC is wrong. */
static int take_answer(struct hm2_sslbp *s, int channel, unsigned size, unsigned crc)
{
	struct sslbp_uart *uart = &s->uarts[channel];
	if (crc && hm2_lbp_crc8(uart->rx, size + crc) != 0)
		return 0;
	memcpy(sslbp_block(s, channel), uart->rx, size);
	uart->rx_count -= size + crc;
	memmove(uart->rx, uart->rx + size + crc, uart->rx_count);
	return 1;
}

static int wait(struct hm2_sslbp *s, int channel, int answer)
{
	uint8_t *block = sslbp_block(s, channel);
	unsigned size = (unsigned)answer;
	unsigned crc = !block[HM2_SSLBP_CHANNEL_DISABLE_CRC];
	if (s->uarts[channel].broken) {
		sslbp_channel_fail(s, channel, HM2_LOCAL_FAULT_SERIAL_BREAK, HM2_SSLBP_CHANNEL_SERIAL_BREAKS);
		return COST_BREAK;
	}
	if (s->uarts[channel].rx_count < size + crc) {
		if (s->wire && elapsed(s, block) < block[HM2_SSLBP_CHANNEL_TIMEOUT])
			return sslbp_cost_of_waiting(block[HM2_SSLBP_CHANNEL_STATE]);
		return COST_WAIT + time_out(s, channel);
	}
	int cost = sslbp_cost_of_answer(block[HM2_SSLBP_CHANNEL_STATE], size);
	if (!take_answer(s, channel, size, crc)) {
		sslbp_channel_fail(s, channel, HM2_LOCAL_FAULT_CRC, HM2_SSLBP_CHANNEL_CRC_ERRORS);
		return cost + COST_ERROR - COST_ANSWER_USED;
	}
	if (block[HM2_SSLBP_CHANNEL_STATE] < HM2_COM_STATE_CHATTER_GET)
		return cost + sslbp_answer_start(s, channel);
	return cost + sslbp_answer_run(s, channel);
}

static int idle(struct hm2_sslbp *s, int channel)
{
	if (s->ram[HM2_SSLBP_LOCAL_REQUEST_MASK] & 1u << channel)
		return send(s, channel);
	return COST_IDLE;
}

static int begin(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	switch (block[HM2_SSLBP_CHANNEL_STATE]) {
	case HM2_COM_STATE_RESET:
		block[HM2_SSLBP_CHANNEL_STATE]++;
		return COST_BEGIN;
	case HM2_COM_STATE_START_PAUSE:
		block[HM2_SSLBP_CHANNEL_TIMEOUT] = s->ram[HM2_SSLBP_LOCAL_START_TIMEOUT];
		start_clock(s, block, s->cpu + COST_TO_CLOCK);
		block[HM2_SSLBP_CHANNEL_STATE]++;
		return COST_START_PAUSE;
	default:
		if (!s->wire || elapsed(s, block) > s->ram[HM2_SSLBP_LOCAL_START_TIMEOUT])
			block[HM2_SSLBP_CHANNEL_STATE]++;
		return COST_PAUSE;
	}
}

static int active_turn(struct hm2_sslbp *s, int channel)
{
	uint8_t state = sslbp_state(s, channel);
	int answer;
	switch (state) {
	case HM2_COM_STATE_RESET:
	case HM2_COM_STATE_START_PAUSE:
	case HM2_COM_STATE_PAUSE:
		return begin(s, channel);
	case HM2_COM_STATE_RUN_8I20:
	case HM2_COM_STATE_RUN_7I64:
	case HM2_COM_STATE_SETUP:
	case HM2_COM_STATE_RUN:
		return idle(s, channel);
	case HM2_COM_STATE_STATUS_CHECK:
	case HM2_COM_STATE_CHECK_8I20:
	case HM2_COM_STATE_CHECK_7I64:
	case HM2_COM_STATE_FAULT_CHECK:
	case HM2_COM_STATE_FAULT_8I20_CHECK:
	case HM2_COM_STATE_ENABLED_8I20_CHECK:
	case HM2_COM_STATE_FAULT_AGAIN_8I20_CHECK:
		return sslbp_check(s, channel);
	default:
		answer = sslbp_answer_size(s, channel);
		return answer >= 0 ? wait(s, channel, answer) : send(s, channel);
	}
}

int sslbp_channel_turn(struct hm2_sslbp *s, int channel)
{
	const uint8_t *block = sslbp_block(s, channel);
	uint8_t bit = (uint8_t)(1u << channel);
	int cost = COST_CHANNEL;
	int to_receive = block[HM2_SSLBP_CHANNEL_STATE] < HM2_COM_STATE_CHATTER_GET ? COST_TO_RECEIVE : COST_TO_RECEIVE_RUN;
	if (s->wire)
		sslbp_uart_run(s, channel, s->cpu + to_receive);
	if (s->ram[HM2_SSLBP_LOCAL_STOP_MASK] & bit)
		cost = initialise(s, channel);
	else if (s->ram[HM2_SSLBP_LOCAL_STARTED_MASK] & bit)
		cost = active_turn(s, channel);
	sslbp_show(s, channel, HM2_SSERIAL_CS - HM2_SSERIAL_CS,
	           (uint32_t)block[HM2_SSLBP_CHANNEL_REMOTE_FAULT] << HM2_SSERIAL_CS_REMOTE_FAULT_LSB |
	               (uint32_t)block[HM2_SSLBP_CHANNEL_STATE] << HM2_SSERIAL_CS_COM_STATE_LSB |
	               (uint32_t)block[HM2_SSLBP_CHANNEL_STATUS] << HM2_SSERIAL_CS_STATUS_LSB |
	               block[HM2_SSLBP_CHANNEL_ERROR_LOG],
	           s->cpu + cost);
	return cost;
}

int sslbp_channel_quiet(struct hm2_sslbp *s, int channel, int64_t from, int64_t *until)
{
	const uint8_t *block = sslbp_block(s, channel);
	uint8_t bit = (uint8_t)(1u << channel);
	uint8_t state = block[HM2_SSLBP_CHANNEL_STATE];
	int64_t at = sslbp_uart_next_event(s, channel);
	int cost = COST_CHANNEL;
	if (s->ram[HM2_SSLBP_LOCAL_STOP_MASK] & bit) {
		at = from;
	} else if (s->ram[HM2_SSLBP_LOCAL_STARTED_MASK] & bit) {
		int answer = sslbp_answer_size(s, channel);
		const struct sslbp_uart *uart = &s->uarts[channel];
		int64_t timeout = from;
		if (state == HM2_COM_STATE_PAUSE) {
			cost = COST_PAUSE;
			timeout = sslbp_timer_reaches(s, from, block[HM2_SSLBP_CHANNEL_START_TIME],
			                              (uint8_t)(s->ram[HM2_SSLBP_LOCAL_START_TIMEOUT] + 1));
		} else if (answer >= 0 && !uart->broken &&
		           uart->rx_count < (unsigned)answer + !block[HM2_SSLBP_CHANNEL_DISABLE_CRC]) {
			cost = sslbp_cost_of_waiting(state);
			timeout = sslbp_timer_reaches(s, from, block[HM2_SSLBP_CHANNEL_START_TIME],
			                              block[HM2_SSLBP_CHANNEL_TIMEOUT]);
		} else if (state == HM2_COM_STATE_RUN || state == HM2_COM_STATE_SETUP ||
		           state == HM2_COM_STATE_RUN_8I20 || state == HM2_COM_STATE_RUN_7I64) {
			cost = COST_IDLE;
			timeout = s->ram[HM2_SSLBP_LOCAL_REQUEST_MASK] & bit ? from : NEVER;
		}
		if (timeout < at)
			at = timeout;
	}
	if (at < *until)
		*until = at;
	return cost;
}
