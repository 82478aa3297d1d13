/* Counts and timestamps of one encoder, extended from 16 bits, and its position and velocity. */
#include "encoder_index.h"
#include "registers.h"

#include <math.h>

/* A count may be read a little after TSCount, so its stamp may lie this far ahead (at 10 MHz: 400 us). */
#define STAMP_AHEAD_TICKS 4096

void hm2_timebase_update(hm2_timebase *timebase, uint32_t timestamp_count, int64_t now_ns)
{
	const uint16_t step = (uint16_t)((uint16_t)timestamp_count - (uint16_t)timebase->ticks);
	if (!timebase->valid) {
		timebase->ticks = (uint16_t)timestamp_count;
		timebase->now_ns = now_ns;
		timebase->valid = 1;
		return;
	}
	const double elapsed = (double)(now_ns - timebase->now_ns) * 1e-9 / timebase->seconds_per_tick;
	const double wraps = floor((elapsed - step) / 65536.0 + 0.5);
	timebase->ticks += step + (wraps > 0 ? (int64_t)wraps * 65536 : 0);
	timebase->now_ns = now_ns;
}

static int64_t stamp_ticks(const hm2_timebase *timebase, uint32_t count)
{
	const uint16_t stamp = (uint16_t)(count >> HM2_ENCODER_COUNT_TIMESTAMP_LSB);
	const uint16_t ahead = (uint16_t)(stamp - (uint16_t)timebase->ticks);
	return timebase->ticks + (ahead < STAMP_AHEAD_TICKS ? ahead : (int64_t)ahead - 65536);
}

static void first_update(hm2_encoder *encoder, uint32_t count)
{
	encoder->raw_count = (uint16_t)count;
	encoder->zero = encoder->raw_count;
	encoder->latched = encoder->raw_count;
	encoder->moving = 0;
	encoder->velocity = 0.0;
	encoder->valid = 1;
}

static void set_event(hm2_encoder *encoder, int64_t ticks)
{
	encoder->event_count = encoder->raw_count;
	encoder->event_ticks = ticks;
}

/* Reciprocal method: counts between two changes over the time between their stamps. A single count
 * back the way it came is an edge dithering under a resting axis, not motion. */
static void moved(hm2_encoder *encoder, const hm2_timebase *timebase, uint32_t count)
{
	const int64_t ticks = stamp_ticks(timebase, count);
	const int64_t step = encoder->raw_count - encoder->event_count;
	const int64_t duration = ticks - encoder->event_ticks;
	const int32_t direction = step > 0 ? 1 : -1;
	if (!encoder->moving) {
		encoder->moving = 1;
		encoder->direction = 0;
		set_event(encoder, ticks);
		return;
	}
	if (step == direction && direction == -encoder->direction)
		encoder->velocity = 0.0;
	else if (duration > 0)
		encoder->velocity =
			(double)step / (encoder->scale * (double)duration * timebase->seconds_per_tick);
	encoder->direction = direction;
	set_event(encoder, ticks);
}

/* No count since the last event: the speed is at most one count in the time that has passed. */
static void waited(hm2_encoder *encoder, const hm2_timebase *timebase)
{
	const double seconds = (double)(timebase->ticks - encoder->event_ticks) * timebase->seconds_per_tick;
	if (seconds >= encoder->velocity_timeout) {
		encoder->velocity = 0.0;
		encoder->moving = 0;
	} else if (seconds > 0.0) {
		const double limit = fabs(1.0 / (encoder->scale * seconds));
		if (fabs(encoder->velocity) > limit)
			encoder->velocity = copysign(limit, encoder->velocity);
	}
}

static void set_position(hm2_encoder *encoder, const hm2_timebase *timebase)
{
	encoder->position = (double)(encoder->raw_count - encoder->zero) / encoder->scale;
	encoder->interpolated = encoder->position;
	if (encoder->moving)
		encoder->interpolated += encoder->velocity * timebase->seconds_per_tick *
		                         (double)(timebase->ticks - encoder->event_ticks);
}

void hm2_encoder_zero(hm2_encoder *encoder)
{
	encoder->zero = encoder->raw_count;
	encoder->position = 0.0;
	encoder->interpolated = 0.0;
}

void hm2_encoder_update(hm2_encoder *encoder, const hm2_timebase *timebase, uint32_t count, uint32_t control)
{
	const int first = !encoder->valid;
	if (first)
		first_update(encoder, count);
	const int64_t previous = encoder->raw_count;
	const int16_t step = (int16_t)(uint16_t)((uint16_t)count - (uint16_t)previous);
	encoder->raw_count = previous + step;
	encoder->control = control;
	/* the flag is up after power-up on open inputs; only what happens from now on is an error */
	if (!first && (control & HM2_ENCODER_CONTROL_QUAD_ERROR_MASK))
		encoder->quad_error = 1;
	hm2_encoder_index_update(encoder, previous, control);
	if (first || (control & HM2_ENCODER_CONTROL_QUAD_ERROR_MASK))
		encoder->write_control = 1; /* written with bit 15 clear: clears the hardware's flag */
	if (step)
		moved(encoder, timebase, count);
	else if (encoder->moving)
		waited(encoder, timebase);
	set_position(encoder, timebase);
}
