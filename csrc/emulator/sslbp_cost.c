/* Cycles that depend on the state: see sslbp_cost.h. */
#include "sslbp_state.h"

int sslbp_cost_to_start_bit(unsigned state)
{
	if (state == HM2_COM_STATE_NAME_1_SEND || state == HM2_COM_STATE_NAME_2_SEND || state == HM2_COM_STATE_NAME_3_SEND)
		return COST_TO_START_BIT + 2;
	if (state == HM2_COM_STATE_ZERO_SEND || state >= HM2_COM_STATE_CHATTER_SEND)
		return COST_TO_START_BIT + 6;
	return COST_TO_START_BIT;
}

/* The states of the first firmware generation wait on a shorter path. */
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

int sslbp_cost_of_sending(unsigned state, size_t length)
{
	int bytes = (int)length;
	switch (state) {
	case HM2_COM_STATE_TIMEOUT_SEND:
		return 73;
	case HM2_COM_STATE_CLEAR_STATUS_SEND:
		return 75;
	case HM2_COM_STATE_MODE_SEND:
	case HM2_COM_STATE_CLEAR_FAULT_SEND:
		return 76;
	case HM2_COM_STATE_ZERO_SEND:
	case HM2_COM_STATE_CHATTER_SEND:
		return 80 + 10 * (bytes - 1);
	case HM2_COM_STATE_RUN:
	case HM2_COM_STATE_RUN_8I20:
	case HM2_COM_STATE_RUN_7I64:
		return 80 + 10 * (bytes - 1);
	case HM2_COM_STATE_SETUP:
		return 108 + 5 * (bytes - 1);
	case HM2_COM_STATE_NAME_1_SEND:
	case HM2_COM_STATE_NAME_2_SEND:
	case HM2_COM_STATE_NAME_3_SEND:
		return 70;
	default:
		return 68 + 5 * (bytes - 1) + (bytes > 3 ? 2 : 0);
	}
}

int sslbp_cost_of_answer(unsigned state, unsigned size)
{
	int bytes = (int)size;
	switch (state) {
	case HM2_COM_STATE_COOKIE_GET:
		return 104;
	case HM2_COM_STATE_UNIT_NUMBER_GET:
		return 132;
	case HM2_COM_STATE_DISCOVERY_GET:
		return 162;
	case HM2_COM_STATE_ZERO_GET:
		return 75 + 104 * bytes / 9;
	case HM2_COM_STATE_CHATTER_GET:
		return 89 + 104 * bytes / 9;
	case HM2_COM_STATE_RUN_GET:
		return 81 + 12 * bytes;
	case HM2_COM_STATE_SETUP_GET:
		return 108 + 20 * bytes;
	case HM2_COM_STATE_CLEAR_FAULT_POLL_GET:
		return 94;
	default:
		return 75 + (bytes ? 2 + 14 * bytes : 0);
	}
}
