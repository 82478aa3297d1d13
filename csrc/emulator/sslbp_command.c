/* The top of the firmware's main loop: is the pending command done, is there a new one
 * (sserial.md 2 and 2.1). */
#include "sslbp_state.h"

enum {
	CLASS_STOP = HM2_SSLBP_COMMAND_STOP >> 8,
	CLASS_START_NORMAL = HM2_SSLBP_COMMAND_START_NORMAL >> 8,
	CLASS_START_SETUP = HM2_SSLBP_COMMAND_START_SETUP >> 8,
	CLASS_DOIT = HM2_SSLBP_COMMAND_DOIT >> 8,
	CLASS_LOCAL = HM2_SSLBP_COMMAND_READ_LOCAL >> 8
};

#define LOCAL_WRITE 0x8000
#define LOCAL_ADDRESS 0x0FFF
#define ALL_CHANNELS 0xFF

/* Ticks: 2 us normally, 200 us in setup mode. */
#define TICK_HZ_NORMAL 500000
#define TICK_HZ_SETUP 5000
#define TIMER_CYCLES 2 /* the divider's own */
#define START_TICKS_NORMAL 200
#define START_TICKS_SETUP 6
#define RUN_TICKS_SETUP 250

static uint8_t *class_of(struct hm2_sslbp *s)
{
	return &s->ram[HM2_SSLBP_LOCAL_PENDING_CLASS];
}

static int complete(struct hm2_sslbp *s, uint8_t result)
{
	s->result = result;
	s->command = 0;
	*class_of(s) = 0;
	return COST_COMPLETE;
}

static int local_access(struct hm2_sslbp *s)
{
	if (!(*class_of(s) & CLASS_LOCAL)) {
		complete(s, HM2_SSLBP_RESULT_INVALID);
		return COST_DECODE_LOCAL - COST_LOCAL_DONE;
	}
	unsigned address = s->decoded & LOCAL_ADDRESS;
	if (s->decoded & LOCAL_WRITE)
		sslbp_ram_write(s, address, (uint8_t)s->argument);
	else
		s->result = sslbp_ram_read(s, address);
	complete(s, s->result);
	return COST_DECODE_LOCAL - COST_LOCAL_DONE;
}

static int doit(struct hm2_sslbp *s)
{
	uint8_t request = (uint8_t)(s->command & ~s->ram[HM2_SSLBP_LOCAL_NOT_READY_MASK]);
	s->ram[HM2_SSLBP_LOCAL_REQUEST_MASK] = request;
	s->ram[HM2_SSLBP_LOCAL_INVALID_MASK] = request;
	s->ram[HM2_SSLBP_LOCAL_NOT_DONE_MASK] = request;
	return COST_DECODE_DOIT;
}

/* The tick rate is worked out anew at every start, which takes longest. */
static int start(struct hm2_sslbp *s)
{
	int setup = *class_of(s) == CLASS_START_SETUP;
	uint32_t divider = s->clock_hz / (setup ? TICK_HZ_SETUP : TICK_HZ_NORMAL);
	uint8_t fresh = (uint8_t)(s->decoded & ~s->ram[HM2_SSLBP_LOCAL_STARTED_MASK]);
	sslbp_timer_set_period(s, s->cpu - (setup ? COST_TIMER_SET_SETUP : COST_TIMER_SET), divider);
	s->ram[HM2_SSLBP_LOCAL_TIMER_DIVIDER] = (uint8_t)(divider - TIMER_CYCLES);
	s->ram[HM2_SSLBP_LOCAL_TIMER_DIVIDER + 1] = (uint8_t)((divider - TIMER_CYCLES) >> 8);
	s->ram[HM2_SSLBP_LOCAL_START_TYPE] = *class_of(s);
	s->ram[HM2_SSLBP_LOCAL_START_TIMEOUT] = setup ? START_TICKS_SETUP : START_TICKS_NORMAL;
	s->ram[HM2_SSLBP_LOCAL_RUN_TIMEOUT] = setup ? RUN_TICKS_SETUP : START_TICKS_NORMAL;
	s->ram[HM2_SSLBP_LOCAL_STARTED_MASK] |= fresh & sslbp_existing(s);
	s->ram[HM2_SSLBP_LOCAL_NOT_READY_MASK] = fresh;
	s->ram[HM2_SSLBP_LOCAL_NOT_STARTED_MASK] = fresh;
	return COST_AFTER_START;
}

void sslbp_global_init(struct hm2_sslbp *s)
{
	for (int c = 0; c < s->channels; c++)
		sslbp_uart_set_rate(s, c, sslbp_get32(sslbp_block(s, c) + HM2_SSLBP_CHANNEL_BAUD_RATE));
	for (unsigned mask = HM2_SSLBP_LOCAL_STARTED_MASK; mask <= HM2_SSLBP_LOCAL_RUNNING_MASK; mask++)
		s->ram[mask] = 0;
	s->ram[HM2_SSLBP_LOCAL_STOP_MASK] = ALL_CHANNELS;
	s->ram[HM2_SSLBP_LOCAL_EXISTING_MASK] = sslbp_existing(s);
	s->ram[HM2_SSLBP_LOCAL_INITIALISED] = 0xFF;
	s->ram[HM2_SSLBP_LOCAL_START_TYPE] = 0;
	*class_of(s) = 0;
	s->result = HM2_SSLBP_RESULT_STOPPED_ALL;
}

/* What takes long happens at its end. */
static int postpone(struct hm2_sslbp *s, int cost)
{
	s->place = PLACE_EXECUTE;
	return cost;
}

static int decode(struct hm2_sslbp *s)
{
	uint8_t high = (uint8_t)(s->command >> 8);
	s->decoded = s->command;
	*class_of(s) = high;
	if (high & CLASS_DOIT)
		return doit(s);
	if (high == CLASS_START_NORMAL || high == CLASS_START_SETUP)
		return postpone(s, COST_DECODE_START + (high == CLASS_START_SETUP ? COST_START_SETUP : 0));
	if (high == CLASS_STOP) {
		if ((s->command & ALL_CHANNELS) == 0)
			return postpone(s, COST_DECODE_STOP_ALL + COST_INIT + s->channels * COST_INIT_PER_CHANNEL);
		s->ram[HM2_SSLBP_LOCAL_STOP_MASK] = (uint8_t)s->command;
		return COST_DECODE_STOP;
	}
	return postpone(s, COST_LOCAL_DONE);
}

int sslbp_command_execute(struct hm2_sslbp *s)
{
	s->place = PLACE_CHANNEL;
	switch (*class_of(s)) {
	case CLASS_START_NORMAL:
	case CLASS_START_SETUP:
		return start(s);
	case CLASS_STOP:
		sslbp_global_init(s);
		s->command = 0;
		return COST_AFTER_STOP_ALL;
	default:
		return local_access(s);
	}
}

static int pending_cost(uint8_t class)
{
	switch (class) {
	case CLASS_DOIT:
		return COST_PASS_DOIT;
	case CLASS_START_NORMAL:
	case CLASS_START_SETUP:
		return COST_PASS_START;
	case CLASS_STOP:
		return COST_PASS_STOP;
	default:
		return 0;
	}
}

/* Whether the pending command goes on, and its result if not. */
static int is_busy(struct hm2_sslbp *s, uint8_t *result)
{
	const uint8_t *ram = s->ram;
	uint8_t existing = ram[HM2_SSLBP_LOCAL_EXISTING_MASK];
	switch (*class_of(s)) {
	case CLASS_DOIT:
		*result = ram[HM2_SSLBP_LOCAL_INVALID_MASK];
		return ram[HM2_SSLBP_LOCAL_REQUEST_MASK] & ram[HM2_SSLBP_LOCAL_NOT_DONE_MASK] & existing &
		       ram[HM2_SSLBP_LOCAL_STARTED_MASK] & (uint8_t)~ram[HM2_SSLBP_LOCAL_NOT_READY_MASK];
	case CLASS_START_NORMAL:
	case CLASS_START_SETUP:
		*result = ram[HM2_SSLBP_LOCAL_NOT_READY_MASK];
		return ram[HM2_SSLBP_LOCAL_NOT_STARTED_MASK] & existing;
	case CLASS_STOP:
		/* A STOP ALL that came while busy names no channel and waits for ever. */
		*result = ram[HM2_SSLBP_LOCAL_STOP_MASK];
		return (s->command & ALL_CHANNELS) == 0 || ram[HM2_SSLBP_LOCAL_STOP_MASK] & existing;
	default:
		return 1;
	}
}

int sslbp_command_quiet(struct hm2_sslbp *s)
{
	uint8_t result;
	if (*class_of(s) && !is_busy(s, &result))
		return -1;
	return pending_cost(*class_of(s));
}

int sslbp_command_complete(struct hm2_sslbp *s)
{
	int cost = COST_TO_DOORBELL;
	uint8_t result;
	s->place = PLACE_DOORBELL;
	if (*class_of(s))
		cost += pending_cost(*class_of(s));
	if (*class_of(s) && !is_busy(s, &result))
		cost += complete(s, result);
	return cost;
}

int sslbp_command_begin(struct hm2_sslbp *s)
{
	int cost = COST_PASS - COST_TO_COMPLETE - COST_TO_DOORBELL;
	s->place = PLACE_CHANNEL;
	s->turn = 0;
	if (!s->doorbell)
		return cost;
	if (*class_of(s)) {
		/* Busy: only a stop is taken, and it is not carried out. */
		if (s->command >> 8 == CLASS_STOP) {
			*class_of(s) = CLASS_STOP;
			s->doorbell = 0;
		}
		return cost;
	}
	s->doorbell = 0;
	return cost + decode(s);
}
