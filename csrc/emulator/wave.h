/* What an encoder puts on its lines: A, B and Z as a function of time, in closed form. */
#ifndef HM2_EMULATOR_WAVE_H
#define HM2_EMULATOR_WAVE_H

#include "hm2.h"

#define WAVE_A 1u
#define WAVE_B 2u
#define WAVE_Z 4u
#define WAVE_NEVER INT64_MAX

enum wave_mode { WAVE_STILL, WAVE_RUN, WAVE_RATE, WAVE_STEPS };

/* One way of moving, from start_ps on. */
struct wave_span {
	enum wave_mode mode;
	int64_t start_ps;
	int64_t position; /* counts at start_ps */
	int64_t period_ps; /* RUN: per count; STEPS: per half pulse */
	int64_t counts;    /* RUN, STEPS: how many, with sign */
	int64_t rate;      /* RATE: 2^-20 counts per second */
	int64_t fraction;  /* RATE: 2^-20 * 10^-12 counts beyond position */
	int64_t index_every;
	int64_t index_width;
	uint8_t index_level; /* Z without a pattern */
	uint8_t floating;    /* lines let go */
	uint8_t held;        /* levels came from `set` and hold until it moves */
	uint8_t held_bits;
};

#define WAVE_PAST 6

/* Some spans before are kept, newest first: cables and multiplexers show the past. */
struct wave {
	int plugged;
	struct wave_span span;
	struct wave_span past[WAVE_PAST];
	int64_t known_from; /* for known_from < t <= known_to of the present span: known_bits */
	int64_t known_to;   /* the next change, WAVE_NEVER */
	uint8_t known_bits;
};

/* Line levels just before t: an edge at t itself is not seen yet. A floating line reads 1. */
uint8_t wave_bits(struct wave *wave, int64_t t);
/* The first time >= t at which they may change; WAVE_NEVER. */
int64_t wave_next(struct wave *wave, int64_t t);
int64_t wave_position(const struct wave *wave, int64_t t);

void wave_run(struct wave *wave, int64_t now, int64_t period_ps, int64_t counts);
void wave_steps(struct wave *wave, int64_t now, int64_t period_ps, int64_t pulses);
void wave_rate(struct wave *wave, int64_t now, int64_t rate);
/* 0, 1 or HM2_LEVEL_RELEASE each. */
void wave_set(struct wave *wave, int64_t now, int a, int b, int z);
void wave_index(struct wave *wave, int64_t every, int64_t width);
void wave_preset(struct wave *wave, int64_t now, int64_t position);

#endif
