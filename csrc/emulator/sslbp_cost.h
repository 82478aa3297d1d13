/* What the SSLBP firmware's paths cost, in cycles of its processor. Fitted to recordings of the
 * firmware (SSLBP observed), in which a frame's start is known to one cycle of 100 MHz. */
#ifndef HM2_EMULATOR_SSLBP_COST_H
#define HM2_EMULATOR_SSLBP_COST_H

enum sslbp_cost {
	/* One pass of the main loop without its channels, and what a pending command adds. */
	COST_PASS = 54,
	COST_TO_COMPLETE = 36, /* from the last channel to the completion of a command */
	COST_TO_DOORBELL = 6,  /* and from there to the look at the doorbell */
	COST_TIMER_ORIGIN = 3,
	COST_START_SETUP = 3, /* more than a normal start */
	COST_TIMER_SET_SETUP = -32,
	COST_TIMER_SET = -20, /* before the end of a start command */
	COST_TO_CLOCK = 20, /* from the beginning of a turn to the look at the tick counter */
	COST_PASS_START = 4,
	COST_PASS_DOIT = 7,
	COST_PASS_STOP = 4,
	COST_COMPLETE = 7, /* write DATA, clear COMMAND */

	/* Decoding a command. */
	COST_LOCAL_DONE = 45, /* from the doorbell to the end of a local access */
	COST_AFTER_STOP_ALL = 6,
	COST_DECODE_LOCAL = 41,
	COST_DECODE_INVALID = 36,
	COST_DECODE_DOIT = 41,
	COST_DECODE_STOP = 2,
	COST_DECODE_START = 1441, /* divides the clock by the tick rate */
	COST_DECODE_STOP_ALL = 81,
	COST_INIT_PER_CHANNEL = 1486, /* divides the baud rate by the clock */
	COST_INIT = 15,
	COST_RESET_TO_CLEAR = 2164,
	COST_RESET_DOORBELL = 5, /* the doorbell is cleared that much after COMMAND */

	/* A channel's turn. */
	COST_CHANNEL = 30,
	COST_CHANNEL_INIT = 60,
	COST_CHANNEL_ACTIVE_INIT = 44, /* more, of one that was started */
	COST_CHANNEL_FIRST_INIT = 17, /* more, when all are initialised */
	COST_PAUSE = 48,
	COST_IDLE = 42,
	COST_WAIT = 65,
	COST_WAIT_LONG = 68,
	COST_ERROR = 4,
	COST_ERROR_STAYS = 26, /* more, when the state is not left */

	/* From the beginning of a turn to the first start bit; FIFO reads see what came this much
	 * into the turn. */
	COST_TO_START_BIT = 40,
	COST_TO_RECEIVE = 29,
	COST_TO_RECEIVE_RUN = 24,

	COST_TO_MEASURE = 100, /* the exchange time, from the beginning of the turn */
	COST_BEGIN = 57,
	COST_START_PAUSE = 45,
	COST_REFUSE = 28,
	COST_READY = -4,
	COST_LEAVE_CHATTER = 4,
	COST_LEAVE_CHATTER_8I20 = 6,
	COST_PROCESS_FAULT = 15,
	COST_CHECK_STATUS = 42,
	COST_CHECK_8I20 = 69,
	COST_IS_8I20 = 82,
	COST_CHECK_FAULT_AGAIN = 42,
	COST_CHECK_7I64 = 58,
	COST_CHECK_FAULT = 44,
	COST_CHECK_ENABLED = 38,
	COST_ANSWER_USED = 15, /* of an answer whose CRC is right */
	COST_INIT_FIRST_REGISTER = 45,
	COST_INIT_REGISTERS = 10,
	COST_AFTER_START = 60,

	COST_TX_GAP = 3 /* between two bytes out of the FIFO */
};

#endif
