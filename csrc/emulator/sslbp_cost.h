/* What the SSLBP firmware's paths cost, in cycles of its processor: fitted to recordings of the firmware
 * (SSLBP observed), in which the start of a frame is known to one cycle of 100 MHz. What depends on a
 * channel's state is in sslbp_cost.c. A turn is what the main loop gives one channel in one pass. */
#ifndef HM2_EMULATOR_SSLBP_COST_H
#define HM2_EMULATOR_SSLBP_COST_H

enum sslbp_cost {
	/* One pass of the main loop without its turns, and what a pending command adds. */
	COST_PASS = 54,
	COST_TO_COMPLETE = 36, /* of it: from the last turn to the completion of a command */
	COST_TO_DOORBELL = 6, /* of it: from there to the look at the doorbell */
	COST_PASS_START = 4,
	COST_PASS_DOIT = 7,
	COST_PASS_STOP = 4,
	COST_COMPLETE = 7, /* DATA written, COMMAND cleared */

	/* From the doorbell to the end of a command or of its decoding. */
	COST_DECODE_LOCAL = 41,
	COST_LOCAL_DONE = 45, /* COMMAND is cleared that late */
	COST_DECODE_DOIT = 41,
	COST_DECODE_STOP = 2,
	COST_DECODE_START = 1441, /* divides the clock by the tick rate */
	COST_START_SETUP = 3, /* more for a setup start */
	COST_AFTER_START = 60, /* to the first turn */
	COST_DECODE_STOP_ALL = 81,
	COST_AFTER_STOP_ALL = 6, /* from COMMAND clear to the first turn */

	/* Initialisation. */
	COST_INIT = 15,
	COST_INIT_PER_CHANNEL = 1486, /* divides the baud rate by the clock */
	COST_RESET_TO_CLEAR = 2164, /* from the release to COMMAND clear */
	COST_RESET_DOORBELL = 5, /* the doorbell is cleared that much later */
	COST_RESET_DATA = 10,    /* and DATA written */

	/* The tick counter. */
	COST_TIMER_ORIGIN = 3, /* its phase at power-up */
	COST_TIMER_SET = -20, /* the divider is written that much before the end of a start command */
	COST_TIMER_SET_SETUP = -32,
	COST_TO_CLOCK = 20, /* from the beginning of a turn to the look at the counter */
	COST_TO_MEASURE = 100, /* and to the one that measures an exchange */

	/* Turns. */
	COST_CHANNEL = 30, /* of a channel that is not started */
	COST_CHANNEL_INIT = 60,
	COST_CHANNEL_ACTIVE_INIT = 44, /* more for one that was started */
	COST_CHANNEL_FIRST_INIT = 17, /* more when all are initialised */
	COST_INIT_REGISTERS = 10, /* interface data is 0 that much into the turn */
	COST_INIT_FIRST_REGISTER = 45, /* but for the first register */
	COST_BEGIN = 57,
	COST_START_PAUSE = 45,
	COST_PAUSE = 48,
	COST_IDLE = 42,
	COST_REFUSE = 28,
	COST_TO_START_BIT = 40, /* from the beginning of a turn to the first start bit */
	COST_WAIT = 65,
	COST_WAIT_LONG = 68,
	COST_TO_RECEIVE = 29, /* a turn sees what came that much into it */
	COST_TO_RECEIVE_RUN = 24,
	COST_ANSWER_USED = 5, /* what an answer with a wrong CRC saves */
	COST_BREAK = 91,
	COST_SURPLUS = 20,
	COST_ERROR = 4,
	COST_ERROR_COOKIE = 35,
	COST_ERROR_FAULT = 31,
	COST_ERROR_FAULT_8I20 = 19,
	COST_ERROR_RUNNING = -11,
	COST_ERROR_STAYS = 26, /* more when the state is not left */
	COST_CHECK_STATUS = 42,
	COST_CHECK_8I20 = 69,
	COST_IS_8I20 = 82,
	COST_CHECK_7I64 = 58,
	COST_CHECK_FAULT = 44,
	COST_CHECK_FAULT_AGAIN = 42,
	COST_CHECK_ENABLED = 38,
	COST_READY = -4,
	COST_LEAVE_CHATTER = 4,
	COST_LEAVE_CHATTER_8I20 = 6,
	COST_PROCESS_FAULT = 15,

	/* The UART. */
	COST_TX_GAP = 3 /* between two bytes out of the FIFO */
};

#endif
