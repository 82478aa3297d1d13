/* StepGen: registers and pins of the step generators (fact sheet registers.md 2.7, card observed 6).
 * Versions 0x42 and 0xC2 can swap their outputs, 0xC2 latches at index and probe; so does the older
 * variant of the published HDL, which is told by its index and probe pins. */
#include <stdlib.h>

#include "card_modules.h"
#include "stepper.h"


#define TIME_MASK HM2_STEPGEN_PULSE_LENGTH_PERIODS_MASK
#define VERSION_SWAP 0x42
#define VERSION_LATCH 0xC2
#define OLD_MODE_BITS 0x7Fu
#define OLD_LATCH_BITS 0xFFFF0000u
#define C2_LATCH_BITS HM2_STEPGEN_MODE_LATCH_MASK
#define TIMER_SELECT_MASK (HM2_STEPGEN_TIMER_SELECT_ENABLE_MASK | HM2_STEPGEN_TIMER_SELECT_TIMER_MASK)
#define OUTPUTS 8

struct stepgen {
	struct hm2_emulator *card;
	int count;
	int version;
	int timers;
	uint32_t timer_select;
	int64_t latched;
	struct master_rate master;
	uint32_t *latches; /* accumulators at the timer's last event */
	struct stepper units[];
};

static void stepgen_destroy(void *self)
{
	struct stepgen *stepgen = self;
	free(stepgen->latches);
	free(stepgen);
}

static int input_of(const struct card_pin *pin)
{
	if (pin->number == HM2_STEPGEN_PIN_INDEX || pin->number == HM2_STEPGEN_PIN_INDEX_A)
		return 0;
	return pin->number == HM2_STEPGEN_PIN_PROBE || pin->number == HM2_STEPGEN_PIN_PROBE_A ? 1 : -1;
}

static int has_inputs(const struct hm2_emulator *card)
{
	for (int i = 0; i < card->pin_count; i++)
		if (card->pins[i].tag == HM2_GTAG_STEPGEN && input_of(&card->pins[i]) >= 0)
			return 1;
	return 0;
}

static void *stepgen_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	size_t count = descriptor->instances;
	struct stepgen *stepgen = calloc(1, sizeof *stepgen + count * sizeof stepgen->units[0]);
	if (stepgen == NULL)
		return NULL;
	stepgen->card = card;
	stepgen->count = (int)count;
	stepgen->version = descriptor->version;
	stepgen->timers = card_samples_by_timer(card);
	stepgen->latches = calloc(count + 1, sizeof *stepgen->latches);
	if (stepgen->latches == NULL) {
		stepgen_destroy(stepgen);
		return NULL;
	}
	int latches = has_inputs(card) ? STEPPER_LATCH_OLD : STEPPER_NO_LATCH;
	if (descriptor->version == VERSION_LATCH)
		latches = STEPPER_LATCH_C2;
	for (size_t i = 0; i < count; i++)
		stepgen->units[i].latches = (uint8_t)latches;
	return stepgen;
}

static void advance_units(struct stepgen *stepgen, int64_t clock)
{
	for (int i = 0; i < stepgen->count; i++)
		stepper_advance(&stepgen->units[i], &stepgen->master, clock);
}

static uint32_t position(const struct stepper *stepper)
{
	return (uint32_t)((uint64_t)stepper->accumulator >> 16);
}

static void take_latches(struct stepgen *stepgen, int64_t event)
{
	advance_units(stepgen, event);
	for (int i = 0; i < stepgen->count; i++)
		stepgen->latches[i] = position(&stepgen->units[i]);
	stepgen->latched = event;
}

static void stepgen_advance(void *self, int64_t clock)
{
	struct stepgen *stepgen = self;
	if (stepgen->timer_select >> 15) {
		int64_t event = dpll_last_event(stepgen->card, (int)(stepgen->timer_select >> 12) & 7, clock);
		if (event > stepgen->latched)
			take_latches(stepgen, event);
	}
	advance_units(stepgen, clock);
}

static uint32_t read_mode(const struct stepper *stepper, uint32_t *value)
{
	switch (stepper->latches) {
	case STEPPER_LATCH_OLD:
		*value = (stepper->latch & OLD_LATCH_BITS) | (stepper->mode & OLD_MODE_BITS);
		return OLD_LATCH_BITS | OLD_MODE_BITS;
	case STEPPER_LATCH_C2:
		*value = (stepper->latch & C2_LATCH_BITS) | stepper->mode;
		return CARD_ALL_DRIVEN;
	default:
		return 0;
	}
}

static uint32_t stepgen_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct stepgen *stepgen = self;
	int index = (int)(offset >> 2);
	if (reg == HM2_STEPGEN_MASTER_DDS) {
		*value = stepgen->master.rate;
		return CARD_ALL_DRIVEN;
	}
	if (reg == HM2_STEPGEN_TIMER_SELECT && stepgen->timers) {
		*value = stepgen->timer_select;
		return CARD_ALL_DRIVEN;
	}
	if (index >= stepgen->count)
		return 0;
	if (reg == HM2_STEPGEN_MODE)
		return read_mode(&stepgen->units[index], value);
	if (reg != HM2_STEPGEN_ACCUMULATOR)
		return 0;
	*value = stepgen->timer_select >> 15 ? stepgen->latches[index] : position(&stepgen->units[index]);
	return CARD_ALL_DRIVEN;
}

static void write_unit(struct stepper *unit, int reg, uint32_t value)
{
	uint16_t time = (uint16_t)(value & TIME_MASK);
	switch (reg) {
	case HM2_STEPGEN_RATE:
		unit->rate = (int32_t)value;
		break;
	case HM2_STEPGEN_ACCUMULATOR:
		stepper_write_accumulator(unit, value);
		break;
	case HM2_STEPGEN_MODE:
		unit->mode = (uint8_t)(unit->latches == STEPPER_LATCH_OLD ? value & OLD_MODE_BITS : value);
		break;
	case HM2_STEPGEN_DIRECTION_SETUP:
		unit->setup_time = time;
		break;
	case HM2_STEPGEN_DIRECTION_HOLD:
		unit->hold_time = time;
		break;
	case HM2_STEPGEN_PULSE_LENGTH:
		unit->pulse_time = time;
		break;
	case HM2_STEPGEN_PULSE_IDLE:
		unit->idle_time = time;
		break;
	case HM2_STEPGEN_TABLE_DATA:
		stepper_push_table(unit, value);
		break;
	default:
		unit->table_last = (uint8_t)(value & (STEPPER_TABLE - 1));
		unit->table_pointer = 0;
		break;
	}
}

static int stepgen_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct stepgen *stepgen = self;
	int index = (int)(offset >> 2);
	if (reg == HM2_STEPGEN_MASTER_DDS) {
		master_rate_write(&stepgen->master, stepgen->card->clock, value);
		return 1;
	}
	if (reg == HM2_STEPGEN_TIMER_SELECT) {
		if (!stepgen->timers)
			return 0;
		stepgen->timer_select = value & TIMER_SELECT_MASK;
		take_latches(stepgen, stepgen->card->clock);
		return 1;
	}
	if (index >= stepgen->count)
		return 0;
	write_unit(&stepgen->units[index], reg, value);
	return 1;
}

static void stepgen_pins_changed(void *self)
{
	struct stepgen *stepgen = self;
	struct hm2_emulator *card = stepgen->card;
	for (int i = 0; i < card->pin_count; i++) {
		const struct card_pin *pin = &card->pins[i];
		int input = pin->tag == HM2_GTAG_STEPGEN ? input_of(pin) : -1;
		if (input < 0)
			continue;
		uint8_t bit = (uint8_t)(1u << input);
		int high = ioport_reads_high(card->ioport, i);
		for (int u = 0; u < stepgen->count; u++)
			if ((pin->unit & CARD_SHARED_UNIT) || pin->unit == u)
				stepgen->units[u].inputs =
					(uint8_t)((stepgen->units[u].inputs & ~bit) | (high ? bit : 0));
	}
}

static void stepgen_power_up(void *self)
{
	struct stepgen *stepgen = self;
	master_rate_write(&stepgen->master, stepgen->card->clock, 0);
	stepgen->timer_select = 0;
	for (int i = 0; i < stepgen->count; i++)
		stepper_power_up(&stepgen->units[i]);
}

static int stepgen_output(void *self, int unit, int number)
{
	const struct stepgen *stepgen = self;
	int bit = (number & 0x7F) - 1;
	if (unit >= stepgen->count || bit < 0 || bit >= OUTPUTS)
		return 0;
	int swaps = stepgen->version == VERSION_SWAP || stepgen->version == VERSION_LATCH;
	return (int)(stepper_outputs(&stepgen->units[unit], swaps) >> bit) & 1;
}

const struct card_module_type stepgen_type = {
	.create = stepgen_create,
	.destroy = stepgen_destroy,
	.read = stepgen_read,
	.write = stepgen_write,
	.advance = stepgen_advance,
	.output = stepgen_output,
	.pins_changed = stepgen_pins_changed,
	.power_up = stepgen_power_up,
	.extra_registers = 1,
};
