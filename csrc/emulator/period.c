/* Period meter (fact sheet registers.md 2.20): clocks between rising edges and high time, summed over
 * whole windows of so many periods. A signal from outside is a function of time, or a pin driven by hand.
 * That windows follow each other, and that an edge of either kind keeps the value valid, is ours. */
#include <stdlib.h>

#include "card_modules.h"

struct meter {
	uint32_t mode;
	uint32_t limit;
	int pin;
	/* the filtered signal */
	int level;
	int64_t rise;       /* clock of the last rising edge; -1: none */
	int64_t edge;       /* of any */
	/* the window */
	int64_t start;      /* its first rising edge */
	uint32_t periods;   /* in it so far */
	uint32_t high_sum;
	uint32_t period;    /* of the last whole window */
	uint32_t width;
	int measured;
	/* by hand */
	int pin_level;
	int64_t changed;
	/* a signal: rises at origin + k * period_ps */
	int64_t period_ps;  /* 0: none */
	int64_t high_ps;
	int64_t origin_ps;
	int64_t cycle;      /* k of the next edge */
	int falls_next;
};

struct period {
	struct hm2_emulator *card;
	int count;
	struct meter meters[];
};

static void *period_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	struct period *all = calloc(1, sizeof *all + descriptor->instances * sizeof all->meters[0]);
	if (all == NULL)
		return NULL;
	all->card = card;
	all->count = descriptor->instances;
	for (int i = 0; i < all->count; i++) {
		all->meters[i].pin = card_pin_of(card, HM2_GTAG_PERIOD, i, HM2_PERIOD_PIN_IN);
		all->meters[i].rise = all->meters[i].edge = -1;
	}
	return all;
}

static void period_destroy(void *self)
{
	free(self);
}

static uint32_t averages(const struct meter *meter)
{
	return ((meter->mode & HM2_PERIOD_MODE_AVERAGES_MASK) >> HM2_PERIOD_MODE_AVERAGES_LSB) + 1;
}

static int64_t filter(const struct meter *meter)
{
	return (int64_t)((meter->mode & HM2_PERIOD_MODE_FILTER_MASK) >> HM2_PERIOD_MODE_FILTER_LSB);
}

static void forget(struct meter *meter)
{
	meter->rise = -1;
	meter->periods = 0;
	meter->high_sum = 0;
	meter->measured = 0;
}

static void rising(struct meter *meter, int64_t clock)
{
	if (meter->rise < 0) {
		meter->start = clock;
	} else if (++meter->periods == averages(meter)) {
		meter->period = (uint32_t)(clock - meter->start);
		meter->width = meter->high_sum;
		meter->measured = 1;
		meter->start = clock;
		meter->periods = meter->high_sum = 0;
	}
	meter->rise = clock;
}

static void expire(struct meter *meter, int64_t clock)
{
	if (clock - meter->edge > (int64_t)meter->limit)
		forget(meter);
}

static void take_edge(struct meter *meter, int64_t clock, int line)
{
	int level = line ^ (int)(meter->mode & HM2_PERIOD_MODE_POLARITY_MASK);
	if (level == meter->level)
		return;
	expire(meter, clock);
	meter->level = level;
	meter->edge = clock;
	if (level)
		rising(meter, clock);
	else if (meter->rise >= 0)
		meter->high_sum += (uint32_t)(clock - meter->rise);
}

/* The first clock that sees what happens at a time. */
static int64_t seen(const struct period *all, int64_t ps)
{
	int64_t p = all->card->period_ps;
	return (ps + p / 2 + p - 1) / p;
}

static int64_t edge_clock(const struct period *all, const struct meter *meter)
{
	int64_t ps = meter->origin_ps + meter->cycle * meter->period_ps + (meter->falls_next ? meter->high_ps : 0);
	return seen(all, ps) + filter(meter);
}

static int passes_filter(const struct period *all, const struct meter *meter)
{
	int64_t least = filter(meter) * all->card->period_ps;
	return meter->period_ps && meter->high_ps >= least && meter->period_ps - meter->high_ps >= least;
}

/* At the start of a window whole windows may be left out, all but the last two. */
static void skip(const struct period *all, struct meter *meter, int64_t clock)
{
	if (meter->periods != 0 || meter->rise < 0 || meter->falls_next)
		return;
	int64_t window = averages(meter);
	int64_t cycles = (clock * all->card->period_ps - meter->origin_ps) / meter->period_ps - meter->cycle;
	if (cycles > 4 * window + 4)
		meter->cycle += (cycles / window - 3) * window;
	else
		return;
	/* the window in progress started one period before the next rising edge */
	int64_t start_ps = meter->origin_ps + (meter->cycle - 1) * meter->period_ps;
	meter->rise = meter->start = seen(all, start_ps) + filter(meter);
	meter->edge = seen(all, start_ps + meter->high_ps) + filter(meter);
	meter->high_sum = (uint32_t)(meter->edge - meter->rise);
}

static void advance_signal(const struct period *all, struct meter *meter, int64_t clock)
{
	if (!passes_filter(all, meter))
		return;
	int64_t at;
	while ((at = edge_clock(all, meter)) <= clock) {
		int inverted = (int)(meter->mode & HM2_PERIOD_MODE_POLARITY_MASK);
		if (!inverted)
			skip(all, meter, clock);
		at = edge_clock(all, meter);
		take_edge(meter, at, !meter->falls_next);
		meter->cycle += meter->falls_next;
		meter->falls_next = !meter->falls_next;
	}
}

static void period_advance(void *self, int64_t clock)
{
	struct period *all = self;
	for (int i = 0; i < all->count; i++) {
		struct meter *meter = &all->meters[i];
		if (meter->period_ps)
			advance_signal(all, meter, clock);
		else if (clock >= meter->changed + filter(meter))
			take_edge(meter, meter->changed + filter(meter), meter->pin_level);
		expire(meter, clock);
	}
}

static void period_pins_changed(void *self)
{
	struct period *all = self;
	for (int i = 0; i < all->count; i++) {
		struct meter *meter = &all->meters[i];
		if (meter->pin < 0 || ioport_reads_high(all->card->ioport, meter->pin) == meter->pin_level)
			continue;
		meter->pin_level = !meter->pin_level;
		meter->changed = all->card->clock;
	}
}

static uint32_t period_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct period *all = self;
	int index = (int)(offset >> 2);
	if (index >= all->count || reg > HM2_PERIOD_LIMIT)
		return 0;
	const struct meter *meter = &all->meters[index];
	uint32_t mode = (meter->measured ? HM2_PERIOD_MODE_VALID_MASK : 0) | (meter->level ? HM2_PERIOD_MODE_INPUT_MASK : 0);
	const uint32_t values[] = {mode, meter->period, meter->width, meter->limit};
	*value = values[reg];
	return reg == HM2_PERIOD_MODE ? HM2_PERIOD_MODE_VALID_MASK | HM2_PERIOD_MODE_INPUT_MASK : CARD_ALL_DRIVEN;
}

static int period_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct period *all = self;
	int index = (int)(offset >> 2);
	if (index >= all->count)
		return 0;
	struct meter *meter = &all->meters[index];
	if (reg == HM2_PERIOD_MODE) {
		uint32_t turned = (meter->mode ^ value) & HM2_PERIOD_MODE_POLARITY_MASK;
		meter->mode = value;
		meter->level ^= (int)turned;
		forget(meter);
	} else if (reg == HM2_PERIOD_LIMIT) {
		meter->limit = value;
	} else {
		return 0;
	}
	return 1;
}

static int period_outside(void *self, int unit, int number, int *level)
{
	const struct period *all = self;
	const struct meter *meter = unit < all->count ? &all->meters[unit] : NULL;
	if (meter == NULL || number != HM2_PERIOD_PIN_IN || !meter->period_ps)
		return 0;
	int64_t at = all->card->now_ps - meter->origin_ps;
	*level = at >= 0 && at % meter->period_ps < meter->high_ps;
	return 1;
}

int hm2_emulator_period_signal(hm2_emulator *card, int unit, int64_t period_ps, int64_t high_ps)
{
	CARD_HOLD(card);
	struct period *all = card_instances(card, HM2_GTAG_PERIOD, unit);
	if (all == NULL || period_ps < 0 || high_ps < 0 || high_ps > period_ps)
		return HM2_ERR_RANGE;
	struct meter *meter = &all->meters[unit];
	meter->period_ps = period_ps;
	meter->high_ps = high_ps;
	meter->origin_ps = card->now_ps;
	meter->cycle = meter->falls_next = 0;
	card_pins_changed(card);
	meter->pin_level = meter->pin < 0 || ioport_reads_high(card->ioport, meter->pin);
	meter->changed = card->clock; /* the line as it is without a signal */
	return HM2_OK;
}

const struct card_module_type period_type = {
	.create = period_create,
	.destroy = period_destroy,
	.read = period_read,
	.write = period_write,
	.advance = period_advance,
	.outside = period_outside,
	.pins_changed = period_pins_changed,
};
