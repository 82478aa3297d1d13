/* Three-phase PWM (fact sheet registers.md 2.9): a triangle of 2048 PWM clocks from ClockHigh, duties
 * taken at the start of a cycle, dead time behind each change of a phase. A fault that lasts clears the
 * enable and sets the flag. Where in the cycle the on-time lies is ours: around its start. */
#include <stdlib.h>

#include "card_modules.h"

#define CYCLE 2048
#define FAULT_FILTER 7 /* clocks */
#define PHASES 3

struct bridge {
	uint32_t value;
	uint32_t written;
	int64_t cycle; /* in which it was written */
	uint32_t enable;
	uint32_t setup;
	int fault_pin; /* -1: none */
	int64_t fault_since;
};

struct tp_pwm {
	struct hm2_emulator *card;
	int count;
	uint32_t rate;
	int64_t since; /* ClockHigh edge of the last change of the rate */
	int64_t sum;   /* 1/65536 PWM clocks up to there */
	struct bridge units[];
};

static void *tp_pwm_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	struct tp_pwm *pwm = calloc(1, sizeof *pwm + descriptor->instances * sizeof pwm->units[0]);
	if (pwm == NULL)
		return NULL;
	pwm->card = card;
	pwm->count = descriptor->instances;
	for (int i = 0; i < pwm->count; i++) {
		pwm->units[i].fault_since = CARD_NEVER;
		pwm->units[i].fault_pin = card_pin_of(card, HM2_GTAG_TP_PWM, i, HM2_TP_PWM_PIN_FAULT);
	}
	return pwm;
}

static void tp_pwm_destroy(void *self)
{
	free(self);
}

static int64_t high_edge(const struct tp_pwm *pwm)
{
	return pwm->card->now_ps / pwm->card->high_period_ps;
}

static int64_t sum_now(const struct tp_pwm *pwm)
{
	return pwm->sum + (high_edge(pwm) - pwm->since) * pwm->rate;
}

static int64_t pwm_clock(const struct tp_pwm *pwm)
{
	return sum_now(pwm) >> 16;
}

static int fault_input(const struct tp_pwm *pwm, const struct bridge *bridge)
{
	if (bridge->fault_pin < 0)
		return 0;
	int high_is_fault = (bridge->setup & HM2_TP_PWM_SETUP_FAULT_POLARITY_MASK) != 0;
	return ioport_reads_high(pwm->card->ioport, bridge->fault_pin) == high_is_fault;
}

static void look_at_fault(const struct tp_pwm *pwm, struct bridge *bridge)
{
	if (!fault_input(pwm, bridge))
		bridge->fault_since = CARD_NEVER;
	else if (bridge->fault_since == CARD_NEVER)
		bridge->fault_since = pwm->card->clock;
}

static void trip(const struct tp_pwm *pwm, struct bridge *bridge)
{
	if (bridge->fault_since == CARD_NEVER || pwm->card->clock < bridge->fault_since + FAULT_FILTER)
		return;
	bridge->enable = HM2_TP_PWM_ENABLE_FAULT_MASK;
}

static void tp_pwm_pins_changed(void *self)
{
	struct tp_pwm *pwm = self;
	for (int i = 0; i < pwm->count; i++)
		look_at_fault(pwm, &pwm->units[i]);
}

static int64_t tp_pwm_next_event(void *self)
{
	const struct tp_pwm *pwm = self;
	int64_t next = CARD_NEVER;
	for (int i = 0; i < pwm->count; i++) {
		const struct bridge *bridge = &pwm->units[i];
		if (bridge->fault_since == CARD_NEVER || bridge->enable == HM2_TP_PWM_ENABLE_FAULT_MASK)
			continue;
		if (bridge->fault_since + FAULT_FILTER < next)
			next = bridge->fault_since + FAULT_FILTER;
	}
	return next;
}

static void tp_pwm_fire(void *self)
{
	struct tp_pwm *pwm = self;
	for (int i = 0; i < pwm->count; i++)
		trip(pwm, &pwm->units[i]);
	card_pins_changed(pwm->card);
}

static void take(const struct tp_pwm *pwm, struct bridge *bridge)
{
	if (pwm_clock(pwm) / CYCLE != bridge->cycle)
		bridge->value = bridge->written;
}

static uint32_t tp_pwm_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct tp_pwm *pwm = self;
	int index = (int)(offset >> 2);
	if (reg != HM2_TP_PWM_ENABLE || index >= pwm->count)
		return 0;
	*value = pwm->units[index].enable;
	return CARD_ALL_DRIVEN;
}

static void write_rate(struct tp_pwm *pwm, uint32_t value)
{
	for (int i = 0; i < pwm->count; i++)
		take(pwm, &pwm->units[i]);
	pwm->sum = sum_now(pwm);
	pwm->since = high_edge(pwm);
	pwm->rate = value & HM2_TP_PWM_RATE_RATE_MASK;
}

static void write_value(const struct tp_pwm *pwm, struct bridge *bridge, uint32_t value)
{
	take(pwm, bridge);
	bridge->written = value;
	bridge->cycle = pwm_clock(pwm) / CYCLE;
}

static int tp_pwm_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct tp_pwm *pwm = self;
	int index = (int)(offset >> 2);
	if (reg == HM2_TP_PWM_RATE) {
		write_rate(pwm, value);
		return 1;
	}
	if (index >= pwm->count)
		return 0;
	struct bridge *bridge = &pwm->units[index];
	if (reg == HM2_TP_PWM_VALUE)
		write_value(pwm, bridge, value);
	else if (reg == HM2_TP_PWM_SETUP)
		bridge->setup = value;
	else
		bridge->enable = value & (HM2_TP_PWM_ENABLE_ENABLE_MASK | HM2_TP_PWM_ENABLE_FAULT_MASK);
	look_at_fault(pwm, bridge); /* the polarity may be another */
	trip(pwm, bridge);
	return 1;
}

/* A gate is on while its side is wanted and has been for the dead time. */
static int gate(const struct tp_pwm *pwm, struct bridge *bridge, int phase, int low_side)
{
	take(pwm, bridge);
	int64_t duty = (bridge->value >> (10 * phase)) & HM2_TP_PWM_VALUE_A_MASK;
	int64_t dead = 2 * (int64_t)(bridge->setup & HM2_TP_PWM_SETUP_DEAD_TIME_MASK);
	int64_t at = (pwm_clock(pwm) + duty) % CYCLE; /* since the high side was wanted */
	return low_side ? at >= 2 * duty + dead : at >= dead && at < 2 * duty;
}

static int tp_pwm_output(void *self, int unit, int number)
{
	struct tp_pwm *pwm = self;
	if (unit >= pwm->count)
		return 0;
	struct bridge *bridge = &pwm->units[unit];
	int enabled = (bridge->enable & HM2_TP_PWM_ENABLE_ENABLE_MASK) != 0;
	if (number == HM2_TP_PWM_PIN_ENABLE)
		return !enabled;
	int gate_number = number - (int)HM2_TP_PWM_PIN_A_HIGH;
	if (!enabled || gate_number < 0 || gate_number >= 2 * PHASES)
		return 0;
	return gate(pwm, bridge, gate_number % PHASES, gate_number >= PHASES);
}

static void tp_pwm_power_up(void *self)
{
	struct tp_pwm *pwm = self;
	for (int i = 0; i < pwm->count; i++)
		pwm->units[i] = (struct bridge){.fault_pin = pwm->units[i].fault_pin, .fault_since = CARD_NEVER};
	pwm->rate = 0;
	pwm->sum = 0;
	pwm->since = high_edge(pwm);
}

const struct card_module_type tp_pwm_type = {
	.create = tp_pwm_create,
	.destroy = tp_pwm_destroy,
	.read = tp_pwm_read,
	.write = tp_pwm_write,
	.next_event = tp_pwm_next_event,
	.fire = tp_pwm_fire,
	.output = tp_pwm_output,
	.pins_changed = tp_pwm_pins_changed,
	.power_up = tp_pwm_power_up,
};
