/* Encoder waveforms. A leads B when the position grows; Z is a pattern over the position. Every change
 * of motion starts a new span at the position reached, fraction included, so nothing is ever lost. */
#include "wave.h"

/* One count in the units of `fraction`: 2^20 * 10^12, so that rate * picoseconds has these units too. */
#define ONE_COUNT (INT64_C(1048576) * INT64_C(1000000000000))

__extension__ typedef __int128 wide;

static int64_t floor_div(wide a, wide b)
{
	wide q = a / b;
	return (int64_t)(a % b < 0 ? q - 1 : q);
}

static wide rate_value(const struct wave *wave, int64_t t)
{
	return (wide)wave->fraction + (wide)wave->rate * (t - wave->start_ps);
}

/* Edges of a run that lie before t. */
static int64_t run_edges(const struct wave *wave, int64_t t)
{
	int64_t total = wave->counts < 0 ? -wave->counts : wave->counts;
	if (wave->mode == WAVE_STEPS)
		total *= 2;
	if (t <= wave->start_ps)
		return 0;
	int64_t edges = (t - 1 - wave->start_ps) / wave->period_ps;
	return edges < total ? edges : total;
}

int64_t wave_position(const struct wave *wave, int64_t t)
{
	if (t <= wave->start_ps)
		return wave->position;
	if (wave->mode == WAVE_RUN)
		return wave->position + (wave->counts < 0 ? -run_edges(wave, t) : run_edges(wave, t));
	if (wave->mode == WAVE_RATE)
		return wave->position + floor_div(rate_value(wave, t - 1), ONE_COUNT);
	return wave->position;
}

static int index_level(const struct wave *wave, int64_t position)
{
	if (wave->index_every <= 0)
		return wave->index_level;
	int64_t rest = position % wave->index_every;
	return (rest < 0 ? rest + wave->index_every : rest) < wave->index_width;
}

uint8_t wave_bits(const struct wave *wave, int64_t t)
{
	static const uint8_t quadrature[4] = {0, WAVE_A, WAVE_A | WAVE_B, WAVE_B};
	uint8_t bits;
	if (!wave->plugged)
		return WAVE_A | WAVE_B | WAVE_Z;
	if (wave->mode == WAVE_STILL && wave->held)
		return wave->held_bits | wave->floating;
	int64_t position = wave_position(wave, t);
	if (wave->mode == WAVE_STEPS)
		bits = (uint8_t)((run_edges(wave, t) & 1) | (wave->counts > 0 ? WAVE_B : 0));
	else
		bits = quadrature[position & 3];
	if (index_level(wave, position))
		bits |= WAVE_Z;
	return bits | wave->floating;
}

int64_t wave_next(const struct wave *wave, int64_t t)
{
	if (!wave->plugged || wave->mode == WAVE_STILL)
		return WAVE_NEVER;
	if (wave->mode != WAVE_RATE) {
		int64_t total = wave->counts < 0 ? -wave->counts : wave->counts;
		int64_t edges = run_edges(wave, t);
		if (wave->mode == WAVE_STEPS)
			total *= 2;
		return edges < total ? wave->start_ps + (edges + 1) * wave->period_ps : WAVE_NEVER;
	}
	if (wave->rate == 0)
		return WAVE_NEVER;
	wide reached = (wide)(wave_position(wave, t) - wave->position) * ONE_COUNT;
	if (wave->rate > 0)
		return wave->start_ps -
		       floor_div((wide)wave->fraction - reached - ONE_COUNT, (wide)wave->rate);
	return wave->start_ps + floor_div((wide)wave->fraction - reached, -(wide)wave->rate) + 1;
}

/* A new span from where the encoder is now. */
static void restart(struct wave *wave, int64_t now)
{
	int64_t position = wave_position(wave, now + 1);
	if (wave->mode == WAVE_RATE) {
		wide value = rate_value(wave, now);
		wave->fraction = (int64_t)(value - (wide)floor_div(value, ONE_COUNT) * ONE_COUNT);
	} else if (wave->mode == WAVE_RUN) {
		wave->fraction = 0;
	}
	wave->position = position;
	wave->start_ps = now;
	wave->plugged = 1;
	wave->held = 0;
	wave->mode = WAVE_STILL;
}

void wave_run(struct wave *wave, int64_t now, int64_t period_ps, int64_t counts)
{
	restart(wave, now);
	wave->mode = WAVE_RUN;
	wave->period_ps = period_ps;
	wave->counts = counts;
}

void wave_steps(struct wave *wave, int64_t now, int64_t period_ps, int64_t pulses)
{
	restart(wave, now);
	wave->mode = WAVE_STEPS;
	wave->period_ps = period_ps / 2;
	wave->counts = pulses;
}

void wave_rate(struct wave *wave, int64_t now, int64_t rate)
{
	restart(wave, now);
	wave->mode = WAVE_RATE;
	wave->rate = rate;
}

void wave_set(struct wave *wave, int64_t now, int a, int b, int z)
{
	static const uint8_t phase[4] = {0, 1, 3, 2}; /* position whose A, B these are */
	restart(wave, now);
	wave->held = 1;
	wave->held_bits = (uint8_t)((a == 1 ? WAVE_A : 0) | (b == 1 ? WAVE_B : 0) | (z == 1 ? WAVE_Z : 0));
	wave->floating = (uint8_t)((a < 0 ? WAVE_A : 0) | (b < 0 ? WAVE_B : 0) | (z < 0 ? WAVE_Z : 0));
	wave->position = (wave->position & ~INT64_C(3)) | phase[wave->held_bits & 3];
	wave->fraction = 0;
	wave->index_level = z == 1;
}

void wave_index(struct wave *wave, int64_t every, int64_t width)
{
	wave->index_every = every;
	wave->index_width = width;
	wave->plugged = 1;
}

void wave_preset(struct wave *wave, int64_t now, int64_t position)
{
	restart(wave, now);
	wave->position = position;
	wave->fraction = 0;
}
