/* A free-running divider of ClockLow in closed form: a down counter that ticks as it passes zero and
 * takes its reload register then, so a new value waits for the old countdown (card observed 4). */
#ifndef HM2_EMULATOR_DIVIDER_H
#define HM2_EMULATOR_DIVIDER_H

#include <stdint.h>

struct divider {
	int64_t first;  /* edge of the first tick counted here */
	int64_t period; /* clocks between the ticks from then on */
	int64_t count;  /* ticks before */
};

/* Ticks up to and including edge n. */
static inline int64_t divider_count(const struct divider *divider, int64_t n)
{
	return n < divider->first ? divider->count
	                          : divider->count + (n - divider->first) / divider->period + 1;
}

/* The first tick at edge n or later. */
static inline int64_t divider_next(const struct divider *divider, int64_t n)
{
	if (n <= divider->first)
		return divider->first;
	int64_t past = (n - divider->first + divider->period - 1) / divider->period;
	return divider->first + past * divider->period;
}

/* The reload register changes at edge n. */
static inline void divider_reload(struct divider *divider, int64_t n, int64_t period)
{
	int64_t count = divider_count(divider, n);
	divider->first = divider_next(divider, n + 1);
	divider->count = count;
	divider->period = period;
}

#endif
