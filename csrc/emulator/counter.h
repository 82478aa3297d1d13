/* One quadrature counter behind its digital filters, as both encoder modules have them. */
#ifndef HM2_EMULATOR_COUNTER_H
#define HM2_EMULATOR_COUNTER_H

#include "divider.h"

#define COUNTER_A 1u
#define COUNTER_B 2u
#define COUNTER_Z 4u
#define COUNTER_PROBE 8u
#define COUNTER_INPUTS 4

struct counter;

/* Where a counter's lines come from. Muxed ones are sampled before the input register, the probe is not. */
struct counter_feed {
	void *self;
	int sampled;
	const uint8_t *probe; /* COUNTER_PROBE or 0 */
	/* The first edge after n that may sample other levels than `lines`. */
	int64_t (*next)(void *self, int index, int64_t n, uint8_t lines);
	/* What edge n samples. */
	uint8_t (*at)(void *self, int index, int64_t n);
};

struct counter {
	int index;
	int has_probe;      /* the variant with a probe input */
	int64_t clock;      /* state is that behind this edge */
	int64_t next_input; /* cached; 0: ask the feed */
	int64_t next_tick;  /* cached; 0: ask the divider */
	uint16_t control;
	uint16_t count;
	uint16_t latch;
	uint16_t stamp;
	uint8_t sampled;    /* levels taken from the lines last */
	uint8_t registered; /* behind the input register */
	uint8_t filtered;
	uint8_t stage1;
	uint8_t stage2;
	uint8_t integrator[COUNTER_INPUTS];
	uint8_t clearing;   /* the count is cleared with the next edge */
	uint8_t index_mask; /* level of the mask pin */
};

void counter_advance(struct counter *counter, const struct counter_feed *feed,
                     const struct divider *filter, const struct divider *timestamp, int64_t to);
void counter_forget(struct counter *counter); /* inputs or rates change: drop what was cached */
void counter_power_up(struct counter *counter);
void counter_clear(struct counter *counter);
void counter_set_control(struct counter *counter, uint32_t value);
uint32_t counter_value(const struct counter *counter);
uint32_t counter_control(const struct counter *counter, uint32_t *value); /* returns the driven bits */

#endif
