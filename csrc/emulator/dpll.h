/* The DPLL's state, and what modules that follow its timers ask of it. */
#ifndef HM2_EMULATOR_DPLL_H
#define HM2_EMULATOR_DPLL_H

#include <stdint.h>

#define DPLL_TIMERS 4

struct hm2_emulator;

struct dpll {
	struct hm2_emulator *card;
	int64_t clock;
	int64_t accumulator;   /* 42 bits */
	uint32_t base_rate;
	uint32_t prescale;
	int64_t prescale_left; /* edges to the next tick, that one included */
	uint32_t filter_prescale;
	int64_t filter_left;   /* ticks to the integrator's next step, that one included */
	int32_t limit;
	uint32_t phase_error;
	int32_t bounded_error; /* 24 bits, as the next two */
	int32_t integrator;
	int32_t correction;
	uint16_t timer[DPLL_TIMERS];
	uint8_t timer_register[DPLL_TIMERS]; /* the outputs, inverted */
	int sync_pin;
	int64_t before;        /* the accumulator before the last edge */
	uint8_t sync_strobe;   /* a read samples the phase with the next edge */
	uint8_t sync_level;
	uint8_t sync_registered;
	uint8_t sync_filter;
	uint8_t sync_seen;     /* the last two filtered levels */
	/* The clocks of the last two changes of the reference (0) and the timers (1..4), newest first. */
	int64_t rise[DPLL_TIMERS + 1][2];
	int64_t fall[DPLL_TIMERS + 1][2];
};

struct dpll *dpll_of(struct hm2_emulator *card); /* NULL: the card has none */
void dpll_advance(struct dpll *dpll, int64_t to);
int dpll_level(const struct dpll *dpll, int timer); /* 0 reference output, 1..4 timers */

#endif
