/* The start sequence after each good answer, and its states that only look at one (sserial.md 3.3, 4.4;
 * for the 8I20 and 7I64 SSLBP observed 2). */
#include "sslbp_state.h"

#include <string.h>

#define SIZES_8I20_RECEIVE 8
#define SIZES_8I20_TRANSMIT 4

enum { UNIT_REGISTER = 1, NAME_REGISTER = 2, TABLES_REGISTER = 3 };

static int in_setup(const struct hm2_sslbp *s)
{
	return s->ram[HM2_SSLBP_LOCAL_START_TYPE] == HM2_SSLBP_COMMAND_START_SETUP >> 8;
}

static int fail_with_fault(struct hm2_sslbp *s, int channel)
{
	return sslbp_channel_fail(s, channel, HM2_LOCAL_FAULT_REMOTE_FAULT, HM2_SSLBP_CHANNEL_REMOTE_FAULTS);
}

/* Started: nothing is asked of the channel any more until a DOIT. */
int sslbp_ready(struct hm2_sslbp *s, int channel, uint8_t state)
{
	uint8_t *block = sslbp_block(s, channel);
	uint8_t others = (uint8_t)~(1u << channel);
	s->ram[HM2_SSLBP_LOCAL_NOT_READY_MASK] &= others;
	s->ram[HM2_SSLBP_LOCAL_NOT_STARTED_MASK] &= others;
	if (state == HM2_COM_STATE_SETUP) {
		block[HM2_SSLBP_CHANNEL_STATUS] &= HM2_CS_STATUS_COMMUNICATION_ERROR;
		block[HM2_SSLBP_CHANNEL_TIMEOUT] = s->ram[HM2_SSLBP_LOCAL_RUN_TIMEOUT];
	} else {
		block[HM2_SSLBP_CHANNEL_STATUS] &= (uint8_t)~HM2_CS_STATUS_NOT_READY;
	}
	block[HM2_SSLBP_CHANNEL_STATE] = state;
	return COST_READY;
}

static int predates_discovery(struct hm2_sslbp *s, int channel, uint8_t id, uint8_t state)
{
	uint8_t *block = sslbp_block(s, channel);
	block[HM2_SSLBP_CHANNEL_ID] = id;
	block[HM2_SSLBP_CHANNEL_GENERIC] = 0;
	block[HM2_SSLBP_CHANNEL_RECEIVE_SIZE] = SIZES_8I20_RECEIVE;
	block[HM2_SSLBP_CHANNEL_TRANSMIT_SIZE] = SIZES_8I20_TRANSMIT;
	block[HM2_SSLBP_CHANNEL_STATUS] &= (uint8_t)~HM2_CS_STATUS_NO_REMOTE_ID;
	if (in_setup(s))
		return sslbp_ready(s, channel, HM2_COM_STATE_SETUP);
	block[HM2_SSLBP_CHANNEL_STATE] = state;
	return 0;
}

static int take_cookie(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	if (block[0] == HM2_LBP_COOKIE_VALUE) {
		block[HM2_SSLBP_CHANNEL_STATE] = HM2_COM_STATE_TIMEOUT_SEND;
		return 0;
	}
	sslbp_channel_fail(s, channel, HM2_LOCAL_FAULT_INVALID_COOKIE, HM2_SSLBP_CHANNEL_COOKIE_ERRORS);
	block[HM2_SSLBP_CHANNEL_STATE] = HM2_COM_STATE_START_PAUSE;
	return COST_ERROR_COOKIE;
}

static int take_name(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	unsigned character = (block[HM2_SSLBP_CHANNEL_STATE] - HM2_COM_STATE_NAME_0_GET) / 2;
	block[HM2_SSLBP_CHANNEL_REMOTE_NAME + character] = block[0];
	block[HM2_SSLBP_CHANNEL_STATE]++;
	return 0;
}

static int take_discovery(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	block[HM2_SSLBP_CHANNEL_RECEIVE_SIZE] = block[0];
	block[HM2_SSLBP_CHANNEL_TRANSMIT_SIZE] = block[1];
	block[HM2_SSLBP_CHANNEL_STATUS] &= (uint8_t)~HM2_CS_STATUS_NO_REMOTE_ID;
	sslbp_show(s, channel, TABLES_REGISTER, sslbp_get32(block + 2), s->cpu);
	if (in_setup(s))
		return sslbp_ready(s, channel, HM2_COM_STATE_SETUP);
	block[HM2_SSLBP_CHANNEL_STATE] = HM2_COM_STATE_ZERO_SEND;
	return 0;
}

int sslbp_answer_start(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	uint8_t *state = &block[HM2_SSLBP_CHANNEL_STATE];
	switch (*state) {
	case HM2_COM_STATE_COOKIE_GET:
		return take_cookie(s, channel);
	case HM2_COM_STATE_UNIT_NUMBER_GET:
		sslbp_show(s, channel, UNIT_REGISTER, sslbp_get32(block), s->cpu);
		break;
	case HM2_COM_STATE_NAME_0_GET:
	case HM2_COM_STATE_NAME_1_GET:
	case HM2_COM_STATE_NAME_2_GET:
	case HM2_COM_STATE_NAME_3_GET:
		return take_name(s, channel);
	case HM2_COM_STATE_DISCOVERY_GET:
		return take_discovery(s, channel);
	case HM2_COM_STATE_CLEAR_FAULT_POLL_GET:
	case HM2_COM_STATE_CLEAR_FAULT_8I20_POLL_GET:
		/* No limit on this polling. */
		if (block[0] || (*state == HM2_COM_STATE_CLEAR_FAULT_8I20_POLL_GET && block[1])) {
			--*state;
			return 0;
		}
		break;
	case HM2_COM_STATE_WATCHDOG_8I20_GET:
	case HM2_COM_STATE_CLEAR_7I64_GET:
		*state = HM2_COM_STATE_CHATTER_SEND;
		return 0;
	default:
		break;
	}
	++*state;
	return 0;
}

static int check_name(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	const uint8_t *name = block + HM2_SSLBP_CHANNEL_REMOTE_NAME;
	if (block[HM2_SSLBP_CHANNEL_STATE] == HM2_COM_STATE_CHECK_8I20) {
		sslbp_show(s, channel, NAME_REGISTER, sslbp_get32(name), s->cpu);
		if (memcmp(name, s->ram + HM2_SSLBP_LOCAL_NAME_8I20, 4) == 0)
			return COST_IS_8I20 + predates_discovery(s, channel, HM2_SSLBP_REMOTE_ID_ID_8I20,
			                                            HM2_COM_STATE_CLEAR_FAULT_8I20_SEND);
		block[HM2_SSLBP_CHANNEL_STATE] = HM2_COM_STATE_CHECK_7I64;
		return COST_CHECK_8I20;
	}
	if (memcmp(name, s->ram + HM2_SSLBP_LOCAL_NAME_7I64, 4) == 0) {
		block[HM2_SSLBP_CHANNEL_STATUS] &= (uint8_t)~HM2_CS_STATUS_REMOTE_FAULT;
		return COST_CHECK_7I64 + predates_discovery(s, channel, HM2_SSLBP_REMOTE_ID_ID_7I64,
		                                            HM2_COM_STATE_CLEAR_7I64_SEND);
	}
	block[HM2_SSLBP_CHANNEL_GENERIC] = 0xFF;
	block[HM2_SSLBP_CHANNEL_STATE] = HM2_COM_STATE_MODE_SEND;
	return COST_CHECK_7I64;
}

/* The generic fault byte is read again while it is not 0; the 8I20's word is looked at again. */
static int check_fault(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	uint8_t *state = &block[HM2_SSLBP_CHANNEL_STATE];
	int generic = *state == HM2_COM_STATE_FAULT_CHECK;
	int first = *state == HM2_COM_STATE_FAULT_8I20_CHECK; /* of the two of an 8I20 */
	uint8_t fault = generic ? block[0] : block[0] | block[1];
	if (first)
		block[HM2_SSLBP_CHANNEL_REMOTE_FAULT] = fault;
	if (fault) {
		if (generic)
			block[HM2_SSLBP_CHANNEL_REMOTE_FAULT] = fault;
		fail_with_fault(s, channel);
		if (generic)
			*state = HM2_COM_STATE_FAULT_SEND;
		return COST_CHECK_FAULT + (first ? COST_ERROR_FAULT_8I20 : COST_ERROR_FAULT);
	}
	if (first) {
		*state = HM2_COM_STATE_SETPOINT_8I20_SEND;
		return COST_CHECK_FAULT;
	}
	block[HM2_SSLBP_CHANNEL_STATUS] &= (uint8_t)~HM2_CS_STATUS_REMOTE_FAULT;
	*state = generic ? HM2_COM_STATE_CHATTER_SEND : HM2_COM_STATE_WATCHDOG_8I20_SEND;
	return generic ? COST_CHECK_FAULT : COST_CHECK_FAULT_AGAIN;
}

int sslbp_check(struct hm2_sslbp *s, int channel)
{
	uint8_t *block = sslbp_block(s, channel);
	uint8_t *state = &block[HM2_SSLBP_CHANNEL_STATE];
	switch (*state) {
	case HM2_COM_STATE_STATUS_CHECK:
		if (block[0]) {
			fail_with_fault(s, channel);
			*state = HM2_COM_STATE_START_PAUSE;
			return COST_CHECK_STATUS + COST_ERROR_FAULT;
		}
		*state = HM2_COM_STATE_UNIT_NUMBER_SEND;
		return COST_CHECK_STATUS;
	case HM2_COM_STATE_CHECK_8I20:
	case HM2_COM_STATE_CHECK_7I64:
		return check_name(s, channel);
	case HM2_COM_STATE_ENABLED_8I20_CHECK:
		/* No limit on this polling either. */
		*state = block[0] || block[1] ? HM2_COM_STATE_FAULT_AGAIN_8I20_SEND : HM2_COM_STATE_ENABLED_8I20_SEND;
		return COST_CHECK_ENABLED;
	default:
		return check_fault(s, channel);
	}
}
