/* The quadrature counter, edge by edge (fact sheet registers.md 2.4, card observed 4 and 5).
 *
 * Facts it is built on: each line passes one register. At every filter tick an integrator of 0..N moves
 * towards its line, and the filtered level follows where the integrator stood before the tick. Behind the
 * filter are two more registers; what they show as an edge takes effect with the next clock. The index
 * is conditioned (polarity, gate by A and B) before its filter, on the registered lines.
 *
 * Between edges that can change anything the state stands still, so such spans are skipped. */
#include "counter.h"

#include "registers.h"

enum {
	QUAD_ERROR = HM2_ENCODER_CONTROL_QUAD_ERROR_MASK,
	AB_MASK_POLARITY = HM2_ENCODER_CONTROL_AB_MASK_POLARITY_MASK,
	LATCH_ON_PROBE = HM2_ENCODER_CONTROL_LATCH_ON_PROBE_MASK,
	PROBE_POLARITY = HM2_ENCODER_CONTROL_PROBE_POLARITY_MASK,
	FILTER = HM2_ENCODER_CONTROL_FILTER_MASK,
	COUNTER_MODE = HM2_ENCODER_CONTROL_COUNTER_MODE_MASK,
	USE_INDEX_MASK = HM2_ENCODER_CONTROL_USE_INDEX_MASK_MASK,
	INDEX_MASK_POLARITY = HM2_ENCODER_CONTROL_INDEX_MASK_POLARITY_MASK,
	AB_GATE_INDEX = HM2_ENCODER_CONTROL_AB_GATE_INDEX_MASK,
	JUST_ONCE = HM2_ENCODER_CONTROL_JUST_ONCE_MASK,
	CLEAR_ON_INDEX = HM2_ENCODER_CONTROL_CLEAR_ON_INDEX_MASK,
	LATCH_ON_INDEX = HM2_ENCODER_CONTROL_LATCH_ON_INDEX_MASK,
	INDEX_POLARITY = HM2_ENCODER_CONTROL_INDEX_POLARITY_MASK,
	LIVE = HM2_ENCODER_CONTROL_INPUT_INDEX_MASK | HM2_ENCODER_CONTROL_INPUT_B_MASK |
	       HM2_ENCODER_CONTROL_INPUT_A_MASK
};

#define PROBE_BITS (LATCH_ON_PROBE | PROBE_POLARITY)
#define AB (COUNTER_A | COUNTER_B)

enum { CLEAR_NONE, CLEAR_BY_INDEX, CLEAR_BY_WRITE };

/* What the filters look at: the registered lines with the index conditioned. */
static uint8_t conditioned(const struct counter *c)
{
	uint8_t lines = c->registered & (uint8_t)~COUNTER_Z;
	int index = (c->registered & COUNTER_Z) != 0;
	if (!(c->control & INDEX_POLARITY))
		index = !index;
	if (c->control & AB_GATE_INDEX)
		index = index && (c->registered & AB) == (c->control & AB_MASK_POLARITY ? AB : 0);
	return index ? lines | COUNTER_Z : lines;
}

static int limit(const struct counter *c)
{
	return c->control & FILTER ? 15 : 3;
}

static int settled(const struct counter *c)
{
	uint8_t lines = conditioned(c);
	if (lines != c->filtered)
		return 0;
	int top = limit(c);
	for (int i = 0; i < COUNTER_INPUTS; i++) {
		int rests = (lines >> i) & 1 ? c->integrator[i] >= top : c->integrator[i] == 0;
		if (!rests)
			return 0;
	}
	return 1;
}

static int quiet(const struct counter *c, const struct counter_feed *feed)
{
	return c->filtered == c->stage1 && c->stage1 == c->stage2 && c->clearing == CLEAR_NONE &&
	       c->registered == (c->sampled | *feed->probe);
}

static void sample(struct counter *c, const struct counter_feed *feed, int64_t n)
{
	uint8_t before = c->sampled;
	if (n == c->next_input) {
		c->sampled = feed->at(feed->self, c->index, n);
		c->next_input = 0;
	}
	c->registered = (feed->sampled ? before : c->sampled) | *feed->probe;
}

static void filter_tick(struct counter *c)
{
	uint8_t lines = conditioned(c);
	int top = limit(c);
	for (int i = 0; i < COUNTER_INPUTS; i++) {
		uint8_t bit = (uint8_t)(1u << i);
		uint8_t before = c->integrator[i];
		if (before >= top)
			c->filtered |= bit;
		if (before == 0)
			c->filtered &= (uint8_t)~bit;
		if ((lines & bit) && before < top)
			c->integrator[i]++;
		else if (!(lines & bit) && before > 0)
			c->integrator[i]--;
	}
}

/* How many ticks from here on move integrators and nothing else. */
static int ticks_alone(const struct counter *c)
{
	uint8_t lines = conditioned(c);
	int top = limit(c);
	int ticks = top;
	for (int i = 0; i < COUNTER_INPUTS; i++) {
		int level = (lines >> i) & 1;
		int filtered = (c->filtered >> i) & 1;
		int stands = c->integrator[i];
		if ((stands == 0 && filtered) || (stands >= top && !filtered))
			return 0;
		int way = level ? top - stands : stands;
		if (way > 0 && way < ticks)
			ticks = way;
	}
	return ticks;
}

static void move_integrators(struct counter *c, int ticks)
{
	uint8_t lines = conditioned(c);
	int top = limit(c);
	for (int i = 0; i < COUNTER_INPUTS; i++) {
		int stands = c->integrator[i];
		if ((lines >> i) & 1)
			c->integrator[i] = (uint8_t)(stands < top ? stands + ticks : stands);
		else
			c->integrator[i] = (uint8_t)(stands > 0 ? stands - ticks : 0);
	}
}

/* Ticks up to `last` that only move integrators, all at once. 0: there are none. */
static int run_integrators(struct counter *c, const struct divider *filter, int64_t last)
{
	int alone = c->next_tick <= last ? ticks_alone(c) : 0;
	if (alone == 0)
		return 0;
	int64_t ticks = (last - c->next_tick) / filter->period + 1;
	if (ticks > alone)
		ticks = alone;
	move_integrators(c, (int)ticks);
	c->clock = c->next_tick + (ticks - 1) * filter->period;
	c->next_tick = c->clock + filter->period;
	return 1;
}

/* Counts of the edge between the two registers: 0, +1 or -1. A and B together count nothing. */
static int movement(const struct counter *c)
{
	uint8_t old = c->stage2 & AB;
	uint8_t now = c->stage1 & AB;
	if (c->control & COUNTER_MODE) {
		if ((old & COUNTER_A) || !(now & COUNTER_A))
			return 0;
		return old & COUNTER_B ? 1 : -1;
	}
	uint8_t changed = old ^ now;
	if (changed != COUNTER_A && changed != COUNTER_B)
		return 0;
	int a = (now & COUNTER_A) != 0;
	int b = (now & COUNTER_B) != 0;
	return (changed == COUNTER_A) == (a != b) ? 1 : -1;
}

static int index_event(const struct counter *c)
{
	if (!(c->stage1 & COUNTER_Z) || (c->stage2 & COUNTER_Z))
		return 0;
	return !(c->control & USE_INDEX_MASK) || c->index_mask == ((c->control & INDEX_MASK_POLARITY) != 0);
}

static int probe_event(const struct counter *c)
{
	if (((c->stage1 ^ c->stage2) & COUNTER_PROBE) == 0)
		return 0;
	return ((c->stage1 & COUNTER_PROBE) != 0) == ((c->control & PROBE_POLARITY) != 0);
}

static void take_latch(struct counter *c, uint16_t count, int enable)
{
	c->latch = count;
	if (c->control & JUST_ONCE)
		c->control &= (uint16_t)~enable;
}

/* Everything the two registers of the last clock bring about with this edge. */
static void count_edge(struct counter *c, uint16_t timestamp)
{
	uint16_t before = c->count;
	int index = index_event(c);
	int moved = c->clearing ? 0 : movement(c);
	int clear = (c->control & CLEAR_ON_INDEX) && index;
	if (!(c->control & COUNTER_MODE) && ((c->stage1 ^ c->stage2) & AB) == AB)
		c->control |= QUAD_ERROR;
	if (moved) {
		c->count = (uint16_t)(c->count + moved);
		c->stamp = timestamp;
	}
	if (c->clearing || (clear && c->has_probe))
		c->count = 0;
	c->clearing = clear && !c->has_probe ? CLEAR_BY_INDEX : CLEAR_NONE;
	if ((c->control & LATCH_ON_INDEX) && index)
		take_latch(c, before, LATCH_ON_INDEX);
	if (clear && (c->control & JUST_ONCE))
		c->control &= (uint16_t)~CLEAR_ON_INDEX;
	if (c->has_probe && (c->control & LATCH_ON_PROBE) && probe_event(c))
		take_latch(c, before, LATCH_ON_PROBE);
}

static void step(struct counter *c, const struct counter_feed *feed, const struct divider *filter,
                 const struct divider *timestamp, int64_t n)
{
	if (c->stage1 != c->stage2 || c->clearing != CLEAR_NONE)
		count_edge(c, (uint16_t)divider_count(timestamp, n - 1));
	c->stage2 = c->stage1;
	c->stage1 = c->filtered;
	if (n == c->next_tick) {
		filter_tick(c);
		c->next_tick = n + filter->period;
	}
	sample(c, feed, n);
	c->clock = n;
}

void counter_advance(struct counter *c, const struct counter_feed *feed, const struct divider *filter,
                     const struct divider *timestamp, int64_t to)
{
	while (c->clock < to) {
		if (c->next_input == 0)
			c->next_input = feed->next(feed->self, c->index, c->clock, c->sampled);
		int rests = quiet(c, feed);
		int at_rest = rests && settled(c);
		if (at_rest && c->next_input > to) {
			c->clock = to;
			c->next_tick = 0;
			return;
		}
		if (at_rest)
			c->clock = c->next_input - 1;
		if (c->next_tick <= c->clock)
			c->next_tick = divider_next(filter, c->clock + 1);
		int64_t n = c->clock + 1;
		if (rests && !at_rest) {
			if (run_integrators(c, filter, c->next_input <= to ? c->next_input - 1 : to))
				continue;
			n = c->next_tick < c->next_input ? c->next_tick : c->next_input;
			if (n > to) {
				c->clock = to;
				return;
			}
		}
		step(c, feed, filter, timestamp, n);
	}
}

void counter_forget(struct counter *c)
{
	c->next_input = 0;
	c->next_tick = 0;
}

/* The lines are found anew: open ones rise together, which is a quadrature error. */
void counter_power_up(struct counter *c)
{
	*c = (struct counter){.index = c->index, .has_probe = c->has_probe, .clock = c->clock, .index_mask = c->index_mask};
}

void counter_clear(struct counter *c)
{
	if (c->has_probe)
		c->count = 0;
	else
		c->clearing = CLEAR_BY_WRITE;
	if (c->control & JUST_ONCE)
		c->control &= (uint16_t)~CLEAR_ON_INDEX;
}

void counter_set_control(struct counter *c, uint32_t value)
{
	c->control = (uint16_t)(value & ~(uint32_t)LIVE);
	if (!c->has_probe)
		c->control &= (uint16_t)~PROBE_BITS;
}

uint32_t counter_value(const struct counter *c)
{
	/* A host that reads back its clear in the same clock sees it done. */
	uint16_t count = c->clearing == CLEAR_BY_WRITE ? 0 : c->count;
	return (uint32_t)c->stamp << 16 | count;
}

uint32_t counter_control(const struct counter *c, uint32_t *value)
{
	*value = (uint32_t)c->latch << 16 | c->control | (c->stage1 & LIVE);
	return c->has_probe ? 0xFFFFFFFFu : ~(uint32_t)PROBE_BITS;
}
