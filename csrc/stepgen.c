/* Step generators: 64-bit position from the 16.16 accumulator, and the rate that follows a command. */
#include "hm2.h"

#include <math.h>

#define SUBCOUNTS 65536.0 /* per step */
#define CATCH_UP 0.5      /* of a position error that is made good within one period */

static double limited(double value, double limit)
{
	return fmax(-limit, fmin(limit, value));
}

/* The velocity that brings the error to zero as fast as stopping in time allows. */
static double tracking_velocity(const hm2_stepgen *stepgen, double period)
{
	const double error = stepgen->position_command - stepgen->position;
	const double feed_forward = (stepgen->position_command - stepgen->last_command) / period;
	double correction = CATCH_UP * error / period;
	if (stepgen->max_acceleration > 0.0) {
		/* braking acts in whole periods: half a period's worth is kept back */
		const double half = stepgen->max_acceleration * period / 2.0;
		const double braking = sqrt(half * half + 2.0 * stepgen->max_acceleration * fabs(error)) - half;
		correction = limited(correction, braking);
	}
	return feed_forward + correction;
}

static double next_velocity(const hm2_stepgen *stepgen, double period)
{
	double velocity =
		stepgen->position_control ? tracking_velocity(stepgen, period) : stepgen->velocity_command;
	if (isnan(velocity))
		return 0.0;
	const double fastest = stepgen->max_step_rate / fabs(stepgen->scale);
	velocity = limited(velocity, fmin(stepgen->max_velocity, fastest));
	if (stepgen->max_acceleration > 0.0)
		velocity = stepgen->velocity + limited(velocity - stepgen->velocity, stepgen->max_acceleration * period);
	return limited(velocity, fastest); /* no braking from a speed that pulses cannot be made at */
}

static uint32_t rate_word(const hm2_stepgen *stepgen)
{
	const double rate = round(stepgen->velocity * stepgen->scale * 4294967296.0 / stepgen->clock_hz);
	return (uint32_t)(int32_t)limited(rate, 2147483647.0);
}

void hm2_stepgen_update(hm2_stepgen *stepgen, uint32_t accumulator, int64_t now_ns)
{
	const double period = (double)(now_ns - stepgen->last_ns) * 1e-9;
	const int first = !stepgen->valid;
	if (!first)
		stepgen->subcounts += (int32_t)(accumulator - stepgen->accumulator);
	stepgen->accumulator = accumulator;
	stepgen->position = (double)stepgen->subcounts / SUBCOUNTS / stepgen->scale;
	if (first || !stepgen->enable)
		stepgen->velocity = 0.0;
	else if (period > 0.0)
		stepgen->velocity = next_velocity(stepgen, period);
	stepgen->rate = rate_word(stepgen);
	/* while off, the command's own motion is no reason to jump when switched on */
	stepgen->last_command = stepgen->position_command;
	stepgen->last_ns = now_ns;
	stepgen->valid = 1;
}

static hm2_transfer burst(uint32_t address, uint32_t count, uint16_t flags, uint32_t *words)
{
	const hm2_transfer transfer = {address, (uint16_t)count, flags, words};
	return transfer;
}

static size_t stepgens_reads(void *self, hm2_transfer *transfers, size_t capacity)
{
	const hm2_stepgens *all = self;
	if (capacity)
		transfers[0] = burst(all->accumulator_address, all->count, HM2_TRANSFER_READ, all->words);
	return 1;
}

static size_t stepgens_writes(void *self, hm2_transfer *transfers, size_t capacity)
{
	const hm2_stepgens *all = self;
	uint32_t *rates = all->words + all->count;
	for (uint32_t i = 0; i < all->count; i++)
		rates[i] = all->stepgens[i].enable ? all->stepgens[i].rate : 0;
	if (capacity)
		transfers[0] = burst(all->rate_address, all->count, HM2_TRANSFER_WRITE, rates);
	return 1;
}

static void stepgens_process(void *self, int64_t now_ns)
{
	const hm2_stepgens *all = self;
	for (uint32_t i = 0; i < all->count; i++)
		hm2_stepgen_update(&all->stepgens[i], all->words[i], now_ns);
}

void hm2_stepgens_part(hm2_stepgens *stepgens, hm2_cyclic *part)
{
	part->self = stepgens;
	part->reads = stepgens_reads;
	part->writes = stepgens_writes;
	part->process = stepgens_process;
}
