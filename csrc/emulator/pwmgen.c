/* PWMGen: a reference counter of ClockHigh and generators that compare with it (fact sheet registers.md
 * 2.6, card observed 7).
 *
 * Two 16-bit rate accumulators run on ClockHigh. A carry of the first moves the 13-bit reference counter,
 * a carry of the second lets the density generators add. Levels follow from the counter two and three
 * ClockHigh edges ago, so they are computed when somebody looks. What the host writes crosses from
 * ClockLow: it acts with the third ClockHigh edge, buffered values with the second behind the edge that
 * sees a cycle start. */
#include <stdlib.h>

#include "card_modules.h"

#define SYMMETRIC HM2_PWMGEN_MODE_SYMMETRIC_MASK
#define DOUBLE_BUFFER HM2_PWMGEN_MODE_DOUBLE_BUFFER_MASK
#define MODE_BITS 0x3Fu
#define NARROWEST 9
#define VALUE_BITS 12
#define CROSSING 2 /* edges behind the first that sees the request */

/* Carries of a 16-bit accumulator, exact through changes of its rate. */
struct rate {
	uint32_t value;
	int64_t since;    /* ClockHigh edge the value acts from */
	uint64_t sum;     /* at `since`; its upper bits count the carries */
	uint32_t old_value;
	int64_t old_since;
	uint64_t old_sum;
	uint32_t written;
	int64_t due;      /* the edge that takes what was written; CARD_NEVER */
};

struct generator {
	uint32_t value; /* acts in comparisons behind edge `value_since` */
	uint32_t old_value;
	int64_t value_since;
	uint8_t down;
	uint32_t mode;
	uint32_t old_mode;
	int64_t mode_since;
	uint32_t written_value;
	int64_t value_request; /* the first edge that can see the request; CARD_NEVER */
	int64_t value_due;
	uint32_t written_mode;
	int64_t mode_due;
	int64_t density_edge;  /* the density sum is that behind this edge */
	uint32_t density;      /* 12 bits and the carry of the last addition */
};

struct pwmgen {
	struct hm2_emulator *card;
	int count;
	int has_enable_pins;
	uint32_t enable;
	struct rate reference;
	struct rate slots;
	struct generator units[];
};

/* ---- the rates -------------------------------------------------------------------------------- */

static int64_t carries(const struct rate *rate, int64_t h)
{
	if (h >= rate->since)
		return (int64_t)((rate->sum + (uint64_t)(h - rate->since) * rate->value) >> 16);
	return (int64_t)((rate->old_sum + (uint64_t)(h - rate->old_since) * rate->old_value) >> 16);
}

/* The reference counter moves with the edge behind a carry. */
static int64_t reference(const struct rate *rate, int64_t h)
{
	return h < 1 ? 0 : carries(rate, h - 1);
}

/* Additions of the density generators up to edge h: their enable is a register of its own. */
static int64_t additions(const struct rate *rate, int64_t h)
{
	return h < 2 ? 0 : carries(rate, h - 2);
}

static void rate_take(struct rate *rate)
{
	rate->old_value = rate->value;
	rate->old_since = rate->since;
	rate->old_sum = rate->sum;
	rate->sum += (uint64_t)(rate->due - rate->since) * rate->value;
	rate->since = rate->due;
	rate->value = rate->written;
	rate->due = CARD_NEVER;
}

/* ---- levels ----------------------------------------------------------------------------------- */

static uint32_t mode_at(const struct generator *unit, int64_t h)
{
	return h < unit->mode_since ? unit->old_mode : unit->mode;
}

static int width(uint32_t mode)
{
	return NARROWEST + (int)(mode & HM2_PWMGEN_MODE_WIDTH_SELECT_MASK);
}

/* The bit of the reference that splits it into cycles. */
static int toggle(const struct pwmgen *pwm, const struct generator *unit, int64_t h)
{
	return (int)(reference(&pwm->reference, h) >> width(mode_at(unit, h))) & 1;
}

static int pwm_level(const struct pwmgen *pwm, const struct generator *unit, int64_t h)
{
	uint32_t mode = mode_at(unit, h - 2);
	uint32_t count = (uint32_t)reference(&pwm->reference, h - 2);
	if ((mode & SYMMETRIC) && toggle(pwm, unit, h - 2))
		count = ~count;
	uint32_t mask = (UINT32_C(1) << width(mode_at(unit, h - 1))) - 1;
	return (count & mask) < (h - 1 < unit->value_since ? unit->old_value : unit->value);
}

static void add_density(const struct pwmgen *pwm, struct generator *unit, int64_t h)
{
	int64_t count = additions(&pwm->slots, h) - additions(&pwm->slots, unit->density_edge);
	uint32_t below = (UINT32_C(1) << VALUE_BITS) - 1;
	if (count > 0) {
		uint32_t before = (unit->density + (uint32_t)((uint64_t)(count - 1) * unit->value)) & below;
		unit->density = before + unit->value;
	}
	unit->density_edge = h;
}

/* ---- what the host has written -------------------------------------------------------------------- */

static int cycle_starts(const struct pwmgen *pwm, const struct generator *unit, int64_t h)
{
	int now = toggle(pwm, unit, h);
	int before = toggle(pwm, unit, h - 1);
	return mode_at(unit, h) & SYMMETRIC ? !now && before : now != before;
}

/* The first edge from h on that sees a cycle start, if the reference goes on as it does. */
static int64_t next_cycle_start(const struct pwmgen *pwm, const struct generator *unit, int64_t h)
{
	const struct rate *rate = &pwm->reference;
	if (cycle_starts(pwm, unit, h - 1))
		return h;
	if (rate->value == 0)
		return CARD_NEVER;
	int bits = width(unit->mode) + (unit->mode & SYMMETRIC ? 1 : 0);
	int64_t count = reference(rate, h - 1);
	int64_t target = ((count >> bits) + 1) << bits;
	uint64_t need = ((uint64_t)target << 16) - rate->sum;
	int64_t carried = rate->since + (int64_t)((need + rate->value - 1) / rate->value);
	return carried + 2; /* one edge to count, one to be seen */
}

static void plan_value(const struct pwmgen *pwm, struct generator *unit)
{
	if (unit->value_request == CARD_NEVER)
		return;
	int64_t seen = unit->value_request;
	if (unit->mode & DOUBLE_BUFFER)
		seen = next_cycle_start(pwm, unit, seen);
	unit->value_due = seen == CARD_NEVER ? CARD_NEVER : seen + CROSSING;
}

static void take_value(const struct pwmgen *pwm, struct generator *unit)
{
	add_density(pwm, unit, unit->value_due);
	unit->old_value = unit->value;
	unit->value = (unit->written_value >> 16) & ((UINT32_C(1) << VALUE_BITS) - 1);
	unit->value_since = unit->value_due;
	unit->down = (uint8_t)(unit->written_value >> 31);
	unit->value_due = unit->value_request = CARD_NEVER;
}

static void take_mode(const struct pwmgen *pwm, struct generator *unit)
{
	unit->old_mode = unit->mode;
	unit->mode = unit->written_mode;
	unit->mode_since = unit->mode_due;
	unit->mode_due = CARD_NEVER;
	if (unit->value_due <= unit->mode_since + CROSSING)
		return; /* seen before the mode changed */
	if (unit->value_request <= unit->mode_since)
		unit->value_request = unit->mode_since + 1;
	plan_value(pwm, unit);
}

static void plan_all(struct pwmgen *pwm, int64_t h)
{
	for (int i = 0; i < pwm->count; i++) {
		struct generator *unit = &pwm->units[i];
		if (unit->value_request != CARD_NEVER && unit->value_due > h + CROSSING) {
			if (unit->value_request < h)
				unit->value_request = h;
			plan_value(pwm, unit);
		}
	}
}

/* The earliest of what is due by h is taken; 0 when there is none. */
static int take_next(struct pwmgen *pwm, int64_t h)
{
	int64_t *first = &pwm->reference.due;
	struct generator *owner = NULL;
	if (pwm->slots.due < *first)
		first = &pwm->slots.due;
	for (int i = 0; i < pwm->count; i++) {
		struct generator *unit = &pwm->units[i];
		if (unit->mode_due < *first) {
			first = &unit->mode_due;
			owner = unit;
		}
		if (unit->value_due < *first) {
			first = &unit->value_due;
			owner = unit;
		}
	}
	if (*first > h)
		return 0;
	if (first == &pwm->reference.due) {
		int64_t at = *first;
		rate_take(&pwm->reference);
		plan_all(pwm, at);
	} else if (first == &pwm->slots.due) {
		for (int i = 0; i < pwm->count; i++)
			add_density(pwm, &pwm->units[i], *first);
		rate_take(&pwm->slots);
	} else if (first == &owner->mode_due) {
		take_mode(pwm, owner);
	} else {
		take_value(pwm, owner);
	}
	return 1;
}

static int64_t edge_at(const struct pwmgen *pwm, int64_t ps)
{
	int64_t period = pwm->card->high_period_ps;
	return (ps + period / 2) / period;
}

static void advance_to(struct pwmgen *pwm, int64_t h)
{
	while (take_next(pwm, h))
		;
}

static void pwmgen_advance(void *self, int64_t clock)
{
	struct pwmgen *pwm = self;
	advance_to(pwm, edge_at(pwm, card_edge_ps(pwm->card, clock)));
}

/* ---- registers and pins --------------------------------------------------------------------------- */

static void forget(struct pwmgen *pwm, int64_t h)
{
	pwm->reference = pwm->slots = (struct rate){.since = h, .old_since = h, .due = CARD_NEVER};
	for (int i = 0; i < pwm->count; i++)
		pwm->units[i] = (struct generator){.value_request = CARD_NEVER, .value_due = CARD_NEVER,
		                                   .mode_due = CARD_NEVER, .density_edge = h};
	pwm->enable = 0;
}

static void pwmgen_power_up(void *self)
{
	struct pwmgen *pwm = self;
	forget(pwm, edge_at(pwm, pwm->card->now_ps));
}

static void *pwmgen_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	size_t count = descriptor->instances;
	struct pwmgen *pwm = calloc(1, sizeof *pwm + count * sizeof pwm->units[0]);
	if (pwm == NULL)
		return NULL;
	pwm->card = card;
	pwm->count = (int)count;
	forget(pwm, 0);
	for (int i = 0; i < card->pin_count; i++)
		if (card->pins[i].tag == HM2_GTAG_PWMGEN && card->pins[i].number == HM2_PWMGEN_PIN_NOT_ENABLE)
			pwm->has_enable_pins = 1;
	return pwm;
}

static void pwmgen_destroy(void *self)
{
	free(self);
}

static uint32_t pwmgen_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct pwmgen *pwm = self;
	(void)offset;
	if (reg != HM2_PWMGEN_ENABLE || !pwm->has_enable_pins)
		return 0;
	*value = pwm->enable;
	return CARD_ALL_DRIVEN;
}

/* The first ClockHigh edge behind the ClockLow edge that took the write. */
static int64_t request_edge(const struct pwmgen *pwm)
{
	return edge_at(pwm, card_edge_ps(pwm->card, pwm->card->clock)) + 1;
}

static void write_rate(struct pwmgen *pwm, struct rate *rate, uint32_t value)
{
	rate->written = value & 0xFFFF;
	if (rate->due == CARD_NEVER)
		rate->due = request_edge(pwm) + CROSSING;
}

static int write_unit(struct pwmgen *pwm, int reg, int index, uint32_t value)
{
	if (index >= pwm->count)
		return 0;
	struct generator *unit = &pwm->units[index];
	if (reg == HM2_PWMGEN_VALUE) {
		unit->written_value = value;
		if (unit->value_request == CARD_NEVER)
			unit->value_request = request_edge(pwm);
		plan_value(pwm, unit);
	} else {
		unit->written_mode = value & MODE_BITS;
		if (unit->mode_due == CARD_NEVER)
			unit->mode_due = request_edge(pwm) + CROSSING;
	}
	return 1;
}

static int pwmgen_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct pwmgen *pwm = self;
	switch (reg) {
	case HM2_PWMGEN_PWM_RATE:
		write_rate(pwm, &pwm->reference, value);
		return 1;
	case HM2_PWMGEN_PDM_RATE:
		write_rate(pwm, &pwm->slots, value);
		return 1;
	case HM2_PWMGEN_ENABLE:
		pwm->enable = pwm->count >= 32 ? value : value & ((UINT32_C(1) << pwm->count) - 1);
		return 1;
	default:
		return write_unit(pwm, reg, (int)(offset >> 2), value);
	}
}

static int pwmgen_output(void *self, int u, int number)
{
	struct pwmgen *pwm = self;
	if (u >= pwm->count)
		return 0;
	struct generator *unit = &pwm->units[u];
	int64_t h = edge_at(pwm, pwm->card->now_ps);
	advance_to(pwm, h);
	add_density(pwm, unit, h);
	if (number == HM2_PWMGEN_PIN_NOT_ENABLE)
		return !((pwm->enable >> u) & 1);
	int first = number == HM2_PWMGEN_PIN_A;
	int output = (int)(unit->mode >> HM2_PWMGEN_MODE_OUTPUT_LSB) & 3;
	int pulse = output == HM2_PWMGEN_OUTPUT_PDM_DIRECTION ? (int)(unit->density >> VALUE_BITS) & 1
	                                                      : pwm_level(pwm, unit, h);
	if (output == HM2_PWMGEN_OUTPUT_UP_DOWN)
		return first == unit->down && pulse;
	return first == (output != HM2_PWMGEN_OUTPUT_DIRECTION_PWM) ? pulse : unit->down;
}

const struct card_module_type pwmgen_type = {
	.create = pwmgen_create,
	.destroy = pwmgen_destroy,
	.read = pwmgen_read,
	.write = pwmgen_write,
	.advance = pwmgen_advance,
	.output = pwmgen_output,
	.power_up = pwmgen_power_up,
};
