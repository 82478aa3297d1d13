/* Cycles that depend on the state: see sslbp_cost.h. */
#include "sslbp_state.h"

/* Some states look something up before they send. */
static int lookup(unsigned state)
{
	switch (state) {
	case HM2_COM_STATE_FAULT_8I20_SEND:
		return 1;
	case HM2_COM_STATE_NAME_1_SEND:
	case HM2_COM_STATE_NAME_2_SEND:
	case HM2_COM_STATE_NAME_3_SEND:
	case HM2_COM_STATE_CLEAR_FAULT_8I20_POLL_SEND:
	case HM2_COM_STATE_ENABLED_8I20_SEND:
		return 2;
	case HM2_COM_STATE_FAULT_AGAIN_8I20_SEND:
		return 3;
	default:
		return state >= HM2_COM_STATE_CHATTER_SEND ? 6 : 0;
	}
}

/* From the look at the tick counter, which is the start time, to the end of the turn. */
int sslbp_cost_after_clock(unsigned state)
{
	switch (state) {
	case HM2_COM_STATE_CHATTER_SEND:
		return 14;
	case HM2_COM_STATE_RUN_8I20:
	case HM2_COM_STATE_RUN_7I64:
		return 66;
	default:
		return 25;
	}
}

int sslbp_cost_to_start_bit(unsigned state)
{
	return COST_TO_START_BIT + lookup(state);
}

/* States whose timeout is a case of its own wait on a longer path. */
int sslbp_cost_of_waiting(unsigned state)
{
	switch (state) {
	case HM2_COM_STATE_COOKIE_GET:
	case HM2_COM_STATE_UNIT_NUMBER_GET:
	case HM2_COM_STATE_DISCOVERY_GET:
	case HM2_COM_STATE_ZERO_GET:
		return COST_WAIT_LONG;
	default:
		return state >= HM2_COM_STATE_CHATTER_GET ? COST_WAIT_LONG : COST_WAIT;
	}
}

/* The header is taken apart bit by bit. */
static int setup_access(unsigned header)
{
	static const uint8_t write[] = {17, 29, 46, 73};
	int ones = (int)(header & 1) + (int)(header >> 1 & 1) + (int)(header >> 2 & 1);
	if (header >> 6 == HM2_LBP_KIND_LOCAL)
		return (header & 0x20 ? 109 : 110) + 7 * ones;
	return (header & 0x04 ? 123 : 114) + (header & 0x20 ? write[header & 3] : 0);
}

int sslbp_cost_of_sending(unsigned state, const uint8_t *frame, size_t length)
{
	int bytes = (int)length - 1;
	switch (state) {
	case HM2_COM_STATE_TIMEOUT_SEND:
		return 73;
	case HM2_COM_STATE_CLEAR_STATUS_SEND:
		return 75;
	case HM2_COM_STATE_MODE_SEND:
	case HM2_COM_STATE_CLEAR_FAULT_SEND:
		return 76;
	case HM2_COM_STATE_ZERO_SEND:
		return 74 + 10 * bytes;
	case HM2_COM_STATE_CHATTER_SEND:
		return 80 + 10 * bytes;
	case HM2_COM_STATE_RUN:
		return 76 + 12 * bytes;
	case HM2_COM_STATE_RUN_8I20:
	case HM2_COM_STATE_RUN_7I64:
		return 94;
	case HM2_COM_STATE_SETUP:
		return setup_access(frame[0]);
	default:
		return 68 + 5 * bytes + (bytes > 2 ? 2 : 0) + lookup(state);
	}
}

int sslbp_cost_of_answer(unsigned state, unsigned size)
{
	static const uint8_t setup[] = {88, 106, 125, 0, 156, 0, 0, 0, 210};
	int bytes = (int)size;
	switch (state) {
	case HM2_COM_STATE_COOKIE_GET:
		return 104;
	case HM2_COM_STATE_UNIT_NUMBER_GET:
		return 132;
	case HM2_COM_STATE_DISCOVERY_GET:
		return 168;
	case HM2_COM_STATE_ZERO_GET:
		return 80 + 11 * bytes;
	case HM2_COM_STATE_CHATTER_GET:
		return 94 + 11 * bytes;
	case HM2_COM_STATE_RUN_8I20_GET:
	case HM2_COM_STATE_RUN_7I64_GET:
		return 176;
	case HM2_COM_STATE_RUN_GET:
		return 97 + 28 * bytes / 3;
	case HM2_COM_STATE_SETUP_GET:
		return size <= 8 ? setup[size] : 0;
	case HM2_COM_STATE_CLEAR_FAULT_POLL_GET:
		return 94;
	default:
		return 75 + (bytes ? 2 + 14 * bytes : 0);
	}
}
