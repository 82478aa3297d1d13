/* One step generator. */
#ifndef HM2_EMULATOR_STEPPER_H
#define HM2_EMULATOR_STEPPER_H

#include <stdint.h>

#define STEPPER_TABLE 16

/* The common pulse train that lets the generators add: a 33-bit accumulator whose top bit's steps are
 * seen two clocks later. It starts over when its rate is written. */
struct master_rate {
	uint32_t rate;
	uint32_t old_rate;  /* before `since` */
	int64_t since;
	int64_t old_since;
};

struct stepper {
	int64_t clock;
	int64_t accumulator; /* 48 bits, kept sign extended: 16 bits of steps, 32 of fraction */
	int32_t rate;
	uint16_t setup_time;
	uint16_t hold_time;
	uint16_t pulse_time;
	uint16_t idle_time;
	uint16_t pulse_timer;
	uint16_t direction_timer;
	uint8_t mode;
	uint8_t old_half;         /* top bit of the fraction one clock ago */
	uint8_t added_down;       /* the last addition was a negative one */
	uint8_t direction;        /* as on the pin: 1 down */
	uint8_t holding;          /* the direction timer runs behind a step, not before one */
	uint8_t pulse;
	uint8_t pulse_timer_ran;  /* one clock ago */
	uint8_t table_pointer;
	uint8_t table_last;
	uint32_t table[STEPPER_TABLE];
	/* variants with index and probe inputs */
	uint8_t inputs;           /* levels of index (bit 0) and probe (bit 1) */
	uint8_t filter[2];
	uint8_t filtered;
	uint8_t filtered_before;
	uint8_t latches;          /* 0 none, else see stepgen.c */
	uint32_t latch;
};

void master_rate_write(struct master_rate *master, int64_t now, uint32_t rate);
void stepper_advance(struct stepper *stepper, const struct master_rate *master, int64_t to);
void stepper_write_accumulator(struct stepper *stepper, uint32_t value);
/* All registers 0; the levels of its inputs stay. */
void stepper_power_up(struct stepper *stepper);
void stepper_push_table(struct stepper *stepper, uint32_t word);
/* What its pins show: bit 0 step, 1 direction, 2.. further table bits. */
uint32_t stepper_outputs(const struct stepper *stepper, int swaps);

enum { STEPPER_NO_LATCH, STEPPER_LATCH_OLD, STEPPER_LATCH_C2 };

#endif
