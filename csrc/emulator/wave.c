/* Encoder waveforms. A leads B when the position grows; Z is a pattern over the position. Every change
 * of motion starts a new span at the position reached, fraction included, so nothing is ever lost. */
#include "wave.h"

#include <string.h>

/* One count in the units of `fraction`: 2^20 * 10^12, so that rate * picoseconds has these units too. */
#define ONE_COUNT (INT64_C(1048576) * INT64_C(1000000000000))

__extension__ typedef __int128 wide;

static int64_t floor_div(wide a, wide b)
{
	wide q = a / b;
	return (int64_t)(a % b < 0 ? q - 1 : q);
}

static wide rate_value(const struct wave_span *span, int64_t t)
{
	return (wide)span->fraction + (wide)span->rate * (t - span->start_ps);
}

static int64_t run_length(const struct wave_span *span)
{
	int64_t counts = span->counts < 0 ? -span->counts : span->counts;
	return span->mode == WAVE_STEPS ? 2 * counts : counts;
}

/* Edges of a run that lie before t. */
static int64_t run_edges(const struct wave_span *span, int64_t t)
{
	int64_t total = run_length(span);
	if (t <= span->start_ps)
		return 0;
	int64_t edges = (t - 1 - span->start_ps) / span->period_ps;
	return edges < total ? edges : total;
}

static int64_t span_position(const struct wave_span *span, int64_t t)
{
	if (t <= span->start_ps)
		return span->position;
	if (span->mode == WAVE_RUN)
		return span->position + (span->counts < 0 ? -run_edges(span, t) : run_edges(span, t));
	if (span->mode == WAVE_RATE)
		return span->position + floor_div(rate_value(span, t - 1), ONE_COUNT);
	return span->position;
}

static const struct wave_span *span_at(const struct wave *wave, int64_t t)
{
	const struct wave_span *span = &wave->span;
	for (int i = 0; i < WAVE_PAST && t <= span->start_ps; i++)
		span = &wave->past[i];
	return span;
}

int64_t wave_position(const struct wave *wave, int64_t t)
{
	return span_position(span_at(wave, t), t);
}

static int index_level(const struct wave_span *span, int64_t position)
{
	if (span->index_every <= 0)
		return span->index_level;
	int64_t rest = position % span->index_every;
	return (rest < 0 ? rest + span->index_every : rest) < span->index_width;
}

static uint8_t span_bits(const struct wave_span *span, int64_t t)
{
	static const uint8_t quadrature[4] = {0, WAVE_A, WAVE_A | WAVE_B, WAVE_B};
	uint8_t bits;
	if (span->mode == WAVE_STILL && span->held)
		return span->held_bits | span->floating;
	int64_t position = span_position(span, t);
	if (span->mode == WAVE_STEPS)
		bits = (uint8_t)((run_edges(span, t) & 1) | (span->counts > 0 ? WAVE_B : 0));
	else
		bits = quadrature[position & 3];
	if (index_level(span, position))
		bits |= WAVE_Z;
	return bits | span->floating;
}

static int64_t span_next(const struct wave_span *span, int64_t t)
{
	if (span->mode == WAVE_STILL)
		return WAVE_NEVER;
	if (span->mode != WAVE_RATE) {
		int64_t edges = run_edges(span, t);
		return edges < run_length(span) ? span->start_ps + (edges + 1) * span->period_ps : WAVE_NEVER;
	}
	if (span->rate == 0)
		return WAVE_NEVER;
	wide reached = (wide)(span_position(span, t) - span->position) * ONE_COUNT;
	if (span->rate > 0)
		return span->start_ps - floor_div((wide)span->fraction - reached - ONE_COUNT, (wide)span->rate);
	return span->start_ps + floor_div((wide)span->fraction - reached, -(wide)span->rate) + 1;
}

/* Divisions are dear: what was found out about t holds up to the next change. */
static int knows(struct wave *wave, int64_t t)
{
	if (t <= wave->span.start_ps)
		return 0;
	if (t <= wave->known_from || t > wave->known_to) {
		wave->known_bits = span_bits(&wave->span, t);
		wave->known_to = span_next(&wave->span, t);
		wave->known_from = t - 1;
	}
	return 1;
}

uint8_t wave_bits(struct wave *wave, int64_t t)
{
	if (!wave->plugged)
		return WAVE_A | WAVE_B | WAVE_Z;
	return knows(wave, t) ? wave->known_bits : span_bits(span_at(wave, t), t);
}

int64_t wave_next(struct wave *wave, int64_t t)
{
	if (!wave->plugged)
		return WAVE_NEVER;
	if (knows(wave, t))
		return wave->known_to;
	/* Before the present span it is enough to look again from t on. */
	return t;
}

static void forget(struct wave *wave)
{
	wave->known_from = WAVE_NEVER;
	wave->known_to = 0;
}

/* A new span from where the encoder is now. */
static struct wave_span *restart(struct wave *wave, int64_t now)
{
	struct wave_span *span = &wave->span;
	int64_t position = span_position(span, now + 1);
	if (span->start_ps < now) {
		memmove(&wave->past[1], &wave->past[0], (WAVE_PAST - 1) * sizeof wave->past[0]);
		wave->past[0] = *span;
	}
	if (span->mode == WAVE_RATE) {
		wide value = rate_value(span, now);
		span->fraction = (int64_t)(value - (wide)floor_div(value, ONE_COUNT) * ONE_COUNT);
	} else if (span->mode == WAVE_RUN) {
		span->fraction = 0;
	}
	forget(wave);
	span->position = position;
	span->start_ps = now;
	span->held = 0;
	span->mode = WAVE_STILL;
	wave->plugged = 1;
	return span;
}

void wave_run(struct wave *wave, int64_t now, int64_t period_ps, int64_t counts)
{
	struct wave_span *span = restart(wave, now);
	span->mode = WAVE_RUN;
	span->period_ps = period_ps;
	span->counts = counts;
}

void wave_steps(struct wave *wave, int64_t now, int64_t period_ps, int64_t pulses)
{
	struct wave_span *span = restart(wave, now);
	span->mode = WAVE_STEPS;
	span->period_ps = period_ps / 2;
	span->counts = pulses;
}

void wave_rate(struct wave *wave, int64_t now, int64_t rate)
{
	struct wave_span *span = restart(wave, now);
	span->mode = WAVE_RATE;
	span->rate = rate;
}

void wave_set(struct wave *wave, int64_t now, int a, int b, int z)
{
	static const uint8_t phase[4] = {0, 1, 3, 2}; /* position whose A, B these are */
	struct wave_span *span = restart(wave, now);
	span->held = 1;
	span->held_bits = (uint8_t)((a == 1 ? WAVE_A : 0) | (b == 1 ? WAVE_B : 0) | (z == 1 ? WAVE_Z : 0));
	span->floating = (uint8_t)((a < 0 ? WAVE_A : 0) | (b < 0 ? WAVE_B : 0) | (z < 0 ? WAVE_Z : 0));
	span->position = (span->position & ~INT64_C(3)) | phase[span->held_bits & 3];
	span->fraction = 0;
	span->index_level = z == 1;
}

/* Motion goes on, with another pattern. */
void wave_index(struct wave *wave, int64_t every, int64_t width)
{
	forget(wave);
	wave->span.index_every = every;
	wave->span.index_width = width;
	wave->plugged = 1;
}

void wave_preset(struct wave *wave, int64_t now, int64_t position)
{
	struct wave_span *span = restart(wave, now);
	span->position = position;
	span->fraction = 0;
}
