/* Pulse timers (fact sheet registers.md 2.19): two per instance, each started by an edge of its source.
 * Brought from event to event when somebody looks. That a timer without enable or in reset is low is ours. */
#include <stdlib.h>

#include "card_modules.h"
#include "dpll.h"

#define TIMERS 2
#define SECOND 16           /* timer 2's fields lie this much higher */
#define HALF (UINT64_C(1) << 31)
#define DPLL_LOOK 2048      /* clocks; the DPLL remembers two events */
#define EXTERNAL_READ (HM2_ONESHOT_CONTROL_EXTERNAL_1_MASK | HM2_ONESHOT_CONTROL_EXTERNAL_2_MASK)
#define OUTPUT_READ (HM2_ONESHOT_CONTROL_OUTPUT_1_MASK | HM2_ONESHOT_CONTROL_OUTPUT_2_MASK)
#define TRIGGER_WRITE (HM2_ONESHOT_CONTROL_SOFTWARE_TRIGGER_1_MASK | HM2_ONESHOT_CONTROL_SOFTWARE_TRIGGER_2_MASK)

struct timer {
	uint32_t width;
	uint32_t filter;
	int64_t end;      /* high before this clock */
	int source;       /* its level when last looked at */
	int pin;          /* external trigger; -1: none */
	int level;        /* of the pin */
	int filtered;
	int64_t changed;  /* when the pin last changed */
};

struct unit {
	int64_t clock;
	uint32_t control;
	uint32_t rate;
	uint64_t phase;   /* of the rate generator at `clock`, 32 bits */
	struct timer timers[TIMERS];
};

struct oneshot {
	struct hm2_emulator *card;
	int count;
	struct unit units[];
};

static void *oneshot_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	struct oneshot *all = calloc(1, sizeof *all + descriptor->instances * sizeof all->units[0]);
	if (all == NULL)
		return NULL;
	all->card = card;
	all->count = descriptor->instances;
	for (int i = 0; i < all->count; i++)
		for (int t = 0; t < TIMERS; t++)
			all->units[i].timers[t].pin =
				card_pin_of(card, HM2_GTAG_ONESHOT, i, (int)HM2_ONESHOT_PIN_TRIGGER_1 + t);
	return all;
}

static void oneshot_destroy(void *self)
{
	free(self);
}

static uint32_t fields(const struct unit *unit, int t)
{
	return unit->control >> (SECOND * t);
}

static uint32_t source_of(const struct unit *unit, int t)
{
	return fields(unit, t) & HM2_ONESHOT_CONTROL_TRIGGER_1_MASK;
}

static int high(const struct unit *unit, int t)
{
	return unit->clock < unit->timers[t].end;
}

static int dpll_timer(const struct unit *unit, int t)
{
	return (int)((fields(unit, t) & HM2_ONESHOT_CONTROL_TIMER_1_MASK) >> HM2_ONESHOT_CONTROL_TIMER_1_LSB);
}

static int64_t last_before(const int64_t times[2], int64_t clock)
{
	return times[0] <= clock ? times[0] : times[1];
}

static int dpll_level_at(const struct oneshot *all, int timer, int64_t clock)
{
	const struct dpll *dpll = dpll_of(all->card);
	if (dpll == NULL || timer > DPLL_TIMERS)
		return 0;
	return last_before(dpll->rise[timer], clock) > last_before(dpll->fall[timer], clock);
}

static int source_level(const struct oneshot *all, const struct unit *unit, int t)
{
	switch (source_of(unit, t)) {
	case HM2_ONESHOT_TRIGGER_SOFTWARE:
		return (fields(unit, t) & HM2_ONESHOT_CONTROL_SOFTWARE_TRIGGER_1_MASK) != 0;
	case HM2_ONESHOT_TRIGGER_EXTERNAL:
		return unit->timers[t].filtered;
	case HM2_ONESHOT_TRIGGER_DPLL:
		return dpll_level_at(all, dpll_timer(unit, t), unit->clock);
	case HM2_ONESHOT_TRIGGER_RATE:
		return (unit->phase & HALF) != 0;
	case HM2_ONESHOT_TRIGGER_TIMER_1:
		return high(unit, 0);
	case HM2_ONESHOT_TRIGGER_TIMER_2:
		return high(unit, 1);
	default:
		return 0;
	}
}

static void trigger(struct unit *unit, int t, int level)
{
	struct timer *timer = &unit->timers[t];
	uint32_t on = fields(unit, t);
	uint32_t edge = level ? HM2_ONESHOT_CONTROL_RISE_1_MASK : HM2_ONESHOT_CONTROL_FALL_1_MASK;
	if (!(on & edge) || !(on & HM2_ONESHOT_CONTROL_ENABLE_1_MASK) || (on & HM2_ONESHOT_CONTROL_RESET_1_MASK))
		return;
	if (!high(unit, t) || (on & HM2_ONESHOT_CONTROL_RETRIGGER_1_MASK))
		timer->end = unit->clock + timer->width;
}

/* What the sources show at unit->clock; twice, as one timer may start the other. */
static void look(const struct oneshot *all, struct unit *unit)
{
	for (int pass = 0; pass < TIMERS; pass++) {
		for (int t = 0; t < TIMERS; t++) {
			struct timer *timer = &unit->timers[t];
			int level = source_level(all, unit, t);
			if (level != timer->source)
				trigger(unit, t, level);
			timer->source = level;
		}
	}
}

static int64_t sooner(int64_t next, int64_t at, int64_t now)
{
	return at > now && at < next ? at : next;
}

static int64_t next_of_timer(const struct oneshot *all, const struct unit *unit, int t, int64_t next)
{
	const struct timer *timer = &unit->timers[t];
	next = sooner(next, timer->end, unit->clock);
	if (timer->filtered != timer->level)
		next = sooner(next, timer->changed + timer->filter, unit->clock);
	const struct dpll *dpll = dpll_of(all->card);
	int selected = dpll_timer(unit, t);
	if (source_of(unit, t) != HM2_ONESHOT_TRIGGER_DPLL || dpll == NULL || selected > DPLL_TIMERS)
		return next;
	for (int i = 0; i < 2; i++) {
		next = sooner(next, dpll->rise[selected][i], unit->clock);
		next = sooner(next, dpll->fall[selected][i], unit->clock);
	}
	return next;
}

static int64_t next_change(const struct oneshot *all, const struct unit *unit)
{
	int64_t next = CARD_NEVER;
	for (int t = 0; t < TIMERS; t++) {
		next = next_of_timer(all, unit, t, next);
		if (source_of(unit, t) == HM2_ONESHOT_TRIGGER_RATE && unit->rate) {
			uint64_t left = HALF - unit->phase % HALF;
			next = sooner(next, unit->clock + (int64_t)((left + unit->rate - 1) / unit->rate), unit->clock);
		}
	}
	return next;
}

static void move(struct unit *unit, int64_t clock)
{
	unit->phase = (unit->phase + (uint64_t)(clock - unit->clock) * unit->rate) & (2 * HALF - 1);
	unit->clock = clock;
	for (int t = 0; t < TIMERS; t++) {
		struct timer *timer = &unit->timers[t];
		if (clock >= timer->changed + timer->filter)
			timer->filtered = timer->level;
	}
}

static void oneshot_advance(void *self, int64_t clock)
{
	struct oneshot *all = self;
	struct dpll *dpll = dpll_of(all->card);
	if (dpll != NULL)
		dpll_advance(dpll, clock);
	for (int i = 0; i < all->count; i++) {
		struct unit *unit = &all->units[i];
		int64_t at;
		while ((at = next_change(all, unit)) <= clock) {
			move(unit, at);
			look(all, unit);
		}
		if (clock > unit->clock)
			move(unit, clock);
	}
}

/* Only so that no event of the DPLL is forgotten before it is looked at. */
static int64_t oneshot_next_event(void *self)
{
	const struct oneshot *all = self;
	for (int i = 0; i < all->count; i++)
		for (int t = 0; t < TIMERS; t++)
			if (source_of(&all->units[i], t) == HM2_ONESHOT_TRIGGER_DPLL)
				return all->units[i].clock + DPLL_LOOK;
	return CARD_NEVER;
}

static void oneshot_fire(void *self)
{
	(void)self;
}

static void oneshot_pins_changed(void *self)
{
	struct oneshot *all = self;
	for (int i = 0; i < all->count; i++) {
		for (int t = 0; t < TIMERS; t++) {
			struct timer *timer = &all->units[i].timers[t];
			if (timer->pin < 0 || ioport_reads_high(all->card->ioport, timer->pin) == timer->level)
				continue;
			timer->level = !timer->level;
			timer->changed = all->card->clock;
		}
	}
}

static uint32_t control_read(const struct unit *unit)
{
	uint32_t value = unit->control & ~(EXTERNAL_READ | OUTPUT_READ | TRIGGER_WRITE);
	for (int t = 0; t < TIMERS; t++) {
		value |= (high(unit, t) ? HM2_ONESHOT_CONTROL_OUTPUT_1_MASK : 0) << (SECOND * t);
		value |= (unit->timers[t].filtered ? HM2_ONESHOT_CONTROL_EXTERNAL_1_MASK : 0) << (SECOND * t);
	}
	return value;
}

static uint32_t oneshot_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct oneshot *all = self;
	int index = (int)(offset >> 2);
	if (index >= all->count || reg > HM2_ONESHOT_CONTROL)
		return 0;
	const struct unit *unit = &all->units[index];
	const uint32_t values[] = {unit->timers[0].width,  unit->timers[1].width, unit->timers[0].filter,
	                           unit->timers[1].filter, unit->rate,            control_read(unit)};
	*value = values[reg];
	return CARD_ALL_DRIVEN;
}

static void write_control(const struct oneshot *all, struct unit *unit, uint32_t value)
{
	unit->control = value & ~(EXTERNAL_READ | OUTPUT_READ);
	for (int t = 0; t < TIMERS; t++) {
		uint32_t on = fields(unit, t);
		if (!(on & HM2_ONESHOT_CONTROL_ENABLE_1_MASK) || (on & HM2_ONESHOT_CONTROL_RESET_1_MASK))
			unit->timers[t].end = 0;
	}
	look(all, unit);
}

static int oneshot_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct oneshot *all = self;
	int index = (int)(offset >> 2);
	if (index >= all->count || reg > HM2_ONESHOT_CONTROL)
		return 0;
	struct unit *unit = &all->units[index];
	if (reg == HM2_ONESHOT_WIDTH1 || reg == HM2_ONESHOT_WIDTH2)
		unit->timers[reg - HM2_ONESHOT_WIDTH1].width = value & HM2_ONESHOT_WIDTH1_PERIODS_MASK;
	else if (reg == HM2_ONESHOT_FILTER1 || reg == HM2_ONESHOT_FILTER2)
		unit->timers[reg - HM2_ONESHOT_FILTER1].filter = value & HM2_ONESHOT_FILTER1_PERIODS_MASK;
	else if (reg == HM2_ONESHOT_RATE)
		unit->rate = value;
	else
		write_control(all, unit, value);
	return 1;
}

static int oneshot_output(void *self, int unit, int number)
{
	const struct oneshot *all = self;
	int t = (number & 0x7F) - (int)HM2_ONESHOT_PIN_OUT_1;
	return unit < all->count && t >= 0 && t < TIMERS && high(&all->units[unit], t);
}

const struct card_module_type oneshot_type = {
	.create = oneshot_create,
	.destroy = oneshot_destroy,
	.read = oneshot_read,
	.write = oneshot_write,
	.advance = oneshot_advance,
	.next_event = oneshot_next_event,
	.fire = oneshot_fire,
	.output = oneshot_output,
	.pins_changed = oneshot_pins_changed,
};
