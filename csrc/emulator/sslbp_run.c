/* Good answers in chatter, process data and setup mode. */
#include "sslbp_state.h"

#include <string.h>

#define RUN_MARGIN_TICKS 20
#define FAULT_7I64 0x08 /* watchdog bit of its status byte */

static int forget_request(struct hm2_sslbp *s, int channel)
{
	uint8_t others = (uint8_t)~(1u << channel);
	s->ram[HM2_SSLBP_LOCAL_REQUEST_MASK] &= others;
	s->ram[HM2_SSLBP_LOCAL_INVALID_MASK] &= others;
	return 0;
}

static uint8_t run_state(uint8_t id)
{
	if (id == HM2_SSLBP_REMOTE_ID_ID_8I20)
		return HM2_COM_STATE_RUN_8I20;
	return id == HM2_SSLBP_REMOTE_ID_ID_7I64 ? HM2_COM_STATE_RUN_7I64 : HM2_COM_STATE_RUN;
}

static int chatter(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	uint8_t bit = (uint8_t)(1u << channel);
	block[HM2_SSLBP_CHANNEL_EXCHANGE_TIME] =
		(uint8_t)(sslbp_timer_at(s, s->cpu + COST_TO_MEASURE) - block[HM2_SSLBP_CHANNEL_START_TIME]);
	s->ram[HM2_SSLBP_LOCAL_CHATTER_MASK] |= bit;
	sslbp_ready(s, channel, HM2_COM_STATE_CHATTER_SEND);
	if (!(s->ram[HM2_SSLBP_LOCAL_REQUEST_MASK] & bit))
		return 0;
	/* Named in a DOIT: the zeros end here. */
	s->ram[HM2_SSLBP_LOCAL_CHATTER_MASK] &= (uint8_t)~bit;
	s->ram[HM2_SSLBP_LOCAL_RUNNING_MASK] |= bit;
	memset(block, 0, HM2_SSLBP_CHANNEL_STATE);
	block[HM2_SSLBP_CHANNEL_TIMEOUT] = (uint8_t)(block[HM2_SSLBP_CHANNEL_EXCHANGE_TIME] + RUN_MARGIN_TICKS);
	block[HM2_SSLBP_CHANNEL_STATE] = run_state(block[HM2_SSLBP_CHANNEL_ID]);
	return block[HM2_SSLBP_CHANNEL_ID] ? COST_LEAVE_CHATTER_8I20 : COST_LEAVE_CHATTER;
}

static int process_data(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	int cost = 0;
	block[HM2_SSLBP_CHANNEL_REMOTE_FAULT] = block[0];
	if (block[0]) {
		block[HM2_SSLBP_CHANNEL_STATUS] |= HM2_CS_STATUS_COMMUNICATION_ERROR | HM2_CS_STATUS_REMOTE_FAULT;
		block[HM2_SSLBP_CHANNEL_ERROR_LOG] |= HM2_LOCAL_FAULT_REMOTE_FAULT;
		cost = COST_PROCESS_FAULT;
	} else {
		block[HM2_SSLBP_CHANNEL_STATUS] &= (uint8_t)~HM2_CS_STATUS_NO_REMOTE_ID;
	}
	for (int reg = 0; reg < 3; reg++)
		sslbp_show(s, channel, 1 + reg, sslbp_get32(block + 1 + 4 * reg), s->cpu);
	block[HM2_SSLBP_CHANNEL_STATE] = HM2_COM_STATE_RUN;
	return cost + forget_request(s, channel);
}

/* Status low, high, fault low, high, bus voltage low, high, temperature low, high. */
static int process_8i20(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	uint32_t last = sslbp_get32(block + 4);
	sslbp_show(s, channel, 1, last << 16 | last >> 16, s->cpu);
	sslbp_show(s, channel, 2, sslbp_get32(block), s->cpu);
	if (block[2] | block[3])
		block[HM2_SSLBP_CHANNEL_STATUS] |= HM2_CS_STATUS_REMOTE_FAULT;
	block[HM2_SSLBP_CHANNEL_STATE] = HM2_COM_STATE_RUN_8I20;
	return forget_request(s, channel);
}

/* Three bytes of inputs, status, four bytes of analog inputs. */
static int process_7i64(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	sslbp_show(s, channel, 1, sslbp_get32(block) & 0xFFFFFF, s->cpu);
	sslbp_show(s, channel, 2, sslbp_get32(block + 4), s->cpu);
	if (block[3] & FAULT_7I64)
		block[HM2_SSLBP_CHANNEL_STATUS] |= HM2_CS_STATUS_REMOTE_FAULT;
	block[HM2_SSLBP_CHANNEL_STATE] = HM2_COM_STATE_RUN_7I64;
	return forget_request(s, channel);
}

static int setup_access(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	unsigned size = block[HM2_SSLBP_CHANNEL_READ_SIZE];
	if (size) {
		memset(block + size, 0, 8 - size);
		sslbp_show(s, channel, 1, sslbp_get32(block), s->cpu);
		sslbp_show(s, channel, 2, sslbp_get32(block + 4), s->cpu);
	}
	block[HM2_SSLBP_CHANNEL_STATE] = HM2_COM_STATE_SETUP;
	return forget_request(s, channel);
}

int sslbp_answer_run(struct hm2_sslbp *s, int channel)
{
	switch (sslbp_state(s, channel)) {
	case HM2_COM_STATE_CHATTER_GET:
		return chatter(s, channel);
	case HM2_COM_STATE_RUN_8I20_GET:
		return process_8i20(s, channel);
	case HM2_COM_STATE_RUN_7I64_GET:
		return process_7i64(s, channel);
	case HM2_COM_STATE_SETUP_GET:
		return setup_access(s, channel);
	default:
		return process_data(s, channel);
	}
}
