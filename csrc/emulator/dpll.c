/* HM2DPLL: an accumulator that follows the host's sync reads, and timers at phases of it (fact sheet
 * registers.md 2.8, card observed 8).
 *
 * With every prescale tick the 42-bit accumulator takes the base rate less the correction; the phase
 * error sampled last is bounded, and every so many ticks the leaky integrator takes a 256th of it. The
 * correction, integrator plus a 16th of the bounded error, is a register: one clock late. Timer outputs
 * are registers too. As long as bounded error, integrator and correction stand, the accumulator grows
 * linearly and any number of ticks is one multiplication. */
#include "dpll.h"

#include <stdlib.h>
#include <string.h>

#include "card_modules.h"

#define BITS 42
#define WHOLE (INT64_C(1) << BITS)
#define SIZE_FIELD 42u
#define FILTER_TOP 15
#define PHASE_SHIFT (BITS - 32)

__extension__ typedef __int128 wide;

static int64_t wrap(int64_t value)
{
	return value & (WHOLE - 1);
}

static int32_t signed24(uint32_t value)
{
	return (int32_t)(value << 8) >> 8;
}

static uint32_t top32(const struct dpll *d)
{
	return (uint32_t)(d->accumulator >> PHASE_SHIFT);
}

static int64_t reload(uint32_t value, int64_t full)
{
	return value == 0 ? full : (int64_t)value;
}

static int32_t bounded(const struct dpll *d)
{
	int32_t error = (int32_t)d->phase_error >> 8;
	if (error > d->limit)
		return d->limit;
	return error < -d->limit ? -d->limit : error;
}

static int32_t wanted_correction(const struct dpll *d)
{
	return signed24((uint32_t)(d->integrator + (d->bounded_error >> 4)));
}

/* The accumulator with a timer's offset: its top bit is the timer's output, inverted. Timer 0 is the
 * reference output, without offset. */
static int64_t offset_of(const struct dpll *d, int timer)
{
	return timer == 0 ? 0 : (int64_t)d->timer[timer - 1] << (BITS - 16);
}

static int high_half(int64_t accumulator, int64_t offset)
{
	return (int)(wrap(accumulator + offset) >> (BITS - 1)) & 1;
}

static void record(struct dpll *d, int timer, int rises, int64_t clock)
{
	int64_t *last = rises ? d->rise[timer] : d->fall[timer];
	last[1] = last[0];
	last[0] = clock;
}

/* ---- one edge --------------------------------------------------------------------------------- */

static void filter_sync(struct dpll *d)
{
	uint8_t before = d->sync_filter;
	if (d->sync_registered && before < FILTER_TOP)
		d->sync_filter++;
	else if (!d->sync_registered && before > 0)
		d->sync_filter--;
	if (before == FILTER_TOP)
		d->sync_seen = (uint8_t)((d->sync_seen << 1 | 1) & 3);
	if (before == 0)
		d->sync_seen = (uint8_t)((d->sync_seen << 1) & 3);
	d->sync_registered = d->sync_level;
}

static int sync_rests(const struct dpll *d)
{
	uint8_t level = d->sync_level;
	return d->sync_registered == level && d->sync_filter == (level ? FILTER_TOP : 0) &&
	       d->sync_seen == (level ? 3 : 0);
}

static void tick(struct dpll *d)
{
	int32_t old_bounded = d->bounded_error;
	d->accumulator = wrap(d->accumulator + (int64_t)d->base_rate - d->correction);
	d->bounded_error = bounded(d);
	if (--d->filter_left == 0) {
		d->filter_left = reload(d->filter_prescale, 65536);
		d->integrator = signed24((uint32_t)(d->integrator + (old_bounded >> 8) - (d->integrator >> 8)));
	}
}

static void single_edge(struct dpll *d)
{
	int64_t n = d->clock + 1;
	int32_t correction = wanted_correction(d);
	int64_t before = d->accumulator;
	uint32_t phase = top32(d);
	int sampled = d->sync_seen == 1 || d->sync_strobe;
	d->sync_strobe = 0;
	d->before = before;
	filter_sync(d);
	if (--d->prescale_left == 0) {
		d->prescale_left = reload(d->prescale, 256);
		tick(d);
	}
	d->correction = correction;
	if (sampled)
		d->phase_error = phase;
	if (high_half(before, 0) != high_half(d->accumulator, 0))
		record(d, 0, high_half(before, 0), n);
	for (int timer = 1; timer <= DPLL_TIMERS; timer++) {
		uint8_t bit = (uint8_t)high_half(before, offset_of(d, timer));
		if (bit != d->timer_register[timer - 1])
			record(d, timer, !bit, n);
		d->timer_register[timer - 1] = bit;
	}
	d->clock = n;
}

/* ---- spans ------------------------------------------------------------------------------------ */

/* Record the last two times the accumulator's top bit changed one way while it took `step` with each of
 * `ticks` ticks. fall: of the top bit, which is a rise of the output. */
static void record_span(struct dpll *d, int timer, int fall, int64_t step, int64_t ticks, int64_t first_tick)
{
	int64_t start = wrap(d->accumulator + offset_of(d, timer));
	if (step < 0) { /* downwards, seen in a mirror */
		start = wrap(WHOLE / 2 - 1 - start);
		step = -step;
	}
	if (!fall)
		start = wrap(start + WHOLE / 2);
	int64_t turns = (int64_t)((start + (wide)step * ticks) >> BITS);
	int64_t period = reload(d->prescale, 256);
	for (int64_t turn = turns > 1 ? turns - 1 : 1; turn <= turns; turn++) {
		wide need = (wide)turn * WHOLE - start;
		int64_t number = (int64_t)((need + step - 1) / step);
		record(d, timer, fall, first_tick + (number - 1) * period + (timer != 0));
	}
}

/* Whether a span can be taken at once, and how many edges long it may be. */
static int64_t span(const struct dpll *d)
{
	if (d->sync_strobe || !sync_rests(d) || d->correction != wanted_correction(d) || d->bounded_error != bounded(d))
		return 0;
	for (int timer = 1; timer <= DPLL_TIMERS; timer++)
		if (d->timer_register[timer - 1] != high_half(d->accumulator, offset_of(d, timer)))
			return 0;
	if ((d->integrator >> 8) == (d->bounded_error >> 8))
		return INT64_MAX / 4;
	/* up to the edge before the integrator moves */
	return d->prescale_left - 1 + (d->filter_left - 1) * reload(d->prescale, 256);
}

static void count_ticks(struct dpll *d, int64_t ticks)
{
	int64_t period = reload(d->filter_prescale, 65536);
	d->filter_left -= ticks;
	if (d->filter_left <= 0)
		d->filter_left += ((-d->filter_left) / period + 1) * period;
}

static void skip(struct dpll *d, int64_t edges)
{
	int64_t period = reload(d->prescale, 256);
	int64_t step = (int64_t)d->base_rate - d->correction;
	int64_t first = d->clock + d->prescale_left;
	int64_t ticks = edges < d->prescale_left ? 0 : (edges - d->prescale_left) / period + 1;
	int64_t last_edge_ticks = ticks > 0 && first + (ticks - 1) * period == d->clock + edges;
	for (int timer = 0; step != 0 && timer <= DPLL_TIMERS; timer++) {
		int64_t seen = timer == 0 ? ticks : ticks - last_edge_ticks; /* by registers, a clock later */
		record_span(d, timer, 1, step, seen, first);
		record_span(d, timer, 0, step, seen, first);
	}
	d->before = wrap((int64_t)(((wide)step * (ticks - last_edge_ticks) + d->accumulator) & (WHOLE - 1)));
	d->accumulator = wrap(d->before + last_edge_ticks * step);
	d->prescale_left += ticks * period - edges;
	count_ticks(d, ticks);
	d->clock += edges;
	for (int timer = 1; timer <= DPLL_TIMERS; timer++)
		d->timer_register[timer - 1] = (uint8_t)high_half(d->before, offset_of(d, timer));
}

void dpll_advance(struct dpll *d, int64_t to)
{
	while (d->clock < to) {
		int64_t edges = span(d);
		if (edges > to - d->clock)
			edges = to - d->clock;
		if (edges > 1)
			skip(d, edges);
		else
			single_edge(d);
	}
}

/* ---- registers -------------------------------------------------------------------------------- */

static void dpll_power_up(void *self)
{
	struct dpll *d = self;
	*d = (struct dpll){.card = d->card, .clock = d->clock, .sync_pin = d->sync_pin, .sync_level = d->sync_level};
	d->prescale_left = 256; /* both counters start at 0 */
	d->filter_left = 65536;
	memset(d->rise, 0xFF, sizeof d->rise);
	memset(d->fall, 0xFF, sizeof d->fall);
}

static void *dpll_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	(void)descriptor;
	struct dpll *d = calloc(1, sizeof *d);
	if (d == NULL)
		return NULL;
	d->card = card;
	d->sync_pin = -1;
	dpll_power_up(d);
	for (int i = 0; i < card->pin_count; i++)
		if (card->pins[i].tag == HM2_GTAG_DPLL && card->pins[i].number == HM2_DPLL_PIN_SYNC)
			d->sync_pin = i;
	return d;
}

static void dpll_destroy(void *self)
{
	free(self);
}

static uint32_t dpll_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	struct dpll *d = self;
	(void)offset;
	switch (reg) {
	case HM2_DPLL_BASE_RATE:
		*value = d->base_rate;
		break;
	case HM2_DPLL_CONTROL0:
		*value = d->prescale << HM2_DPLL_CONTROL0_PRESCALE_LSB |
		         ((uint32_t)d->correction & HM2_DPLL_CONTROL0_CORRECTION_MASK);
		break;
	case HM2_DPLL_CONTROL1:
		*value = d->filter_prescale << HM2_DPLL_CONTROL1_FILTER_PRESCALE_LSB | SIZE_FIELD;
		break;
	case HM2_DPLL_TIMER_12:
	case HM2_DPLL_TIMER_34:
		*value = d->timer[2 * (reg - HM2_DPLL_TIMER_12)] | (uint32_t)d->timer[2 * (reg - HM2_DPLL_TIMER_12) + 1] << 16;
		break;
	default:
		*value = top32(d);
		d->sync_strobe |= reg == HM2_DPLL_SYNC; /* sampled with the edge that ends the read */
		break;
	}
	return CARD_ALL_DRIVEN;
}

static void write_control0(struct dpll *d, uint32_t value)
{
	d->limit = signed24(value);
	d->prescale = value >> HM2_DPLL_CONTROL0_PRESCALE_LSB;
	d->integrator = 0;
	d->phase_error = 0;
	d->sync_strobe = 0;
}

static int dpll_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct dpll *d = self;
	(void)offset;
	switch (reg) {
	case HM2_DPLL_BASE_RATE:
		d->base_rate = value;
		break;
	case HM2_DPLL_PHASE:
		d->accumulator = (int64_t)value << PHASE_SHIFT | (d->accumulator & ((1 << PHASE_SHIFT) - 1));
		break;
	case HM2_DPLL_CONTROL0:
		write_control0(d, value);
		break;
	case HM2_DPLL_CONTROL1:
		d->filter_prescale = value >> HM2_DPLL_CONTROL1_FILTER_PRESCALE_LSB;
		break;
	case HM2_DPLL_TIMER_12:
	case HM2_DPLL_TIMER_34:
		d->timer[2 * (reg - HM2_DPLL_TIMER_12)] = (uint16_t)value;
		d->timer[2 * (reg - HM2_DPLL_TIMER_12) + 1] = (uint16_t)(value >> 16);
		break;
	default: /* the write's own edge samples what stood before it */
		d->phase_error = (uint32_t)(d->before >> PHASE_SHIFT);
		break;
	}
	return 1;
}

static void advance(void *self, int64_t clock)
{
	dpll_advance(self, clock);
}

static void dpll_pins_changed(void *self)
{
	struct dpll *d = self;
	if (d->sync_pin >= 0)
		d->sync_level = (uint8_t)ioport_reads_high(d->card->ioport, d->sync_pin);
}

int dpll_level(const struct dpll *d, int timer)
{
	if (timer == 0)
		return !high_half(d->accumulator, 0);
	return !d->timer_register[timer - 1];
}

static int dpll_output(void *self, int unit, int number)
{
	int timer = number - (int)HM2_DPLL_PIN_REFERENCE;
	(void)unit;
	return timer >= 0 && timer <= DPLL_TIMERS ? dpll_level(self, timer) : 0;
}

struct dpll *dpll_of(struct hm2_emulator *card)
{
	const struct card_module *module = card_find(card, HM2_GTAG_DPLL);
	return module == NULL ? NULL : module->self;
}

int64_t dpll_last_event(struct hm2_emulator *card, int timer, int64_t clock)
{
	struct dpll *d = dpll_of(card);
	if (d == NULL || timer > DPLL_TIMERS)
		return -1;
	dpll_advance(d, clock);
	return d->rise[timer][0];
}

const struct card_module_type dpll_type = {
	.create = dpll_create,
	.destroy = dpll_destroy,
	.read = dpll_read,
	.write = dpll_write,
	.advance = advance,
	.output = dpll_output,
	.pins_changed = dpll_pins_changed,
	.power_up = dpll_power_up,
};
