/* Registers of the encoder modules (fact sheet registers.md 2.4, card observed 4 and 5). */
#include "encoder_bank.h"

#include <stdlib.h>

/* Both modules have the same registers and pins, so the plain one's names serve. */
#define HALFWORD 0xFFFFu
#define RATE_BITS 12
#define TIMESTAMP_BITS 16
#define PROBE_VERSION 0x80
#define FIRST_TICK 2 /* a divider starts at 0: one clock to pass it, one to be seen */
#define TIMER_SELECT_MASK (HM2_ENCODER_TIMER_SELECT_ENABLE_MASK | HM2_ENCODER_TIMER_SELECT_TIMER_MASK)

/* Clocks between ticks: reload + 2, or 1 when its top bit is set. */
int64_t encoder_bank_period(uint32_t reload, int bits)
{
	uint32_t top = UINT32_C(1) << (bits - 1);
	return reload & top ? 1 : (int64_t)(reload & (top - 1)) + 2;
}

static void find_shared_pins(struct encoder_bank *bank)
{
	bank->probe_pin = -1;
	for (int i = 0; i < bank->count; i++)
		bank->mask_pins[i] = -1;
	for (int i = 0; i < bank->card->pin_count; i++) {
		const struct card_pin *pin = &bank->card->pins[i];
		if (pin->tag != bank->gtag)
			continue;
		if (pin->number == HM2_ENCODER_PIN_PROBE)
			bank->probe_pin = i;
		if (pin->number == HM2_ENCODER_PIN_INDEX_MASK && pin->unit < bank->count)
			bank->mask_pins[pin->unit] = i;
	}
}

static void start_dividers(struct encoder_bank *bank, int64_t clock)
{
	const int64_t first = clock + FIRST_TICK;
	bank->filter = (struct divider){first, encoder_bank_period(bank->default_rate, RATE_BITS), 0};
	bank->timestamp = (struct divider){first, encoder_bank_period(0, TIMESTAMP_BITS), 0};
	bank->timestamp_reload = 0;
}

int encoder_bank_init(struct encoder_bank *bank, struct hm2_emulator *card,
                      const struct card_descriptor *descriptor, int64_t tick_hz)
{
	uint32_t clock_hz = card_idrom_field(card, HM2_IDROM_CLOCK_LOW);
	uint32_t reload = (uint32_t)((clock_hz + tick_hz / 2) / tick_hz) - 2;
	bank->card = card;
	bank->gtag = descriptor->gtag;
	bank->count = descriptor->instances;
	bank->timers = card_samples_by_timer(card);
	bank->counters = calloc((size_t)bank->count, sizeof *bank->counters);
	bank->mask_pins = calloc((size_t)bank->count, sizeof *bank->mask_pins);
	bank->latches = calloc((size_t)bank->count, sizeof *bank->latches);
	if (bank->counters == NULL || bank->mask_pins == NULL || bank->latches == NULL)
		return 0;
	if (card->wave_count + bank->count > CARD_MAX_ENCODERS)
		return 0;
	bank->first_wave = card->wave_count;
	card->wave_count += bank->count;
	bank->default_rate = reload & 0xFFF;
	start_dividers(bank, 0);
	for (int i = 0; i < bank->count; i++) {
		bank->counters[i].index = i;
		bank->counters[i].has_probe = (descriptor->version & PROBE_VERSION) != 0;
	}
	find_shared_pins(bank);
	return 1;
}

void encoder_bank_free(struct encoder_bank *bank)
{
	free(bank->counters);
	free(bank->mask_pins);
	free(bank->latches);
}

void encoder_bank_power_up(struct encoder_bank *bank)
{
	start_dividers(bank, bank->card->clock);
	bank->timer_select = 0;
	bank->set_rate(bank, bank->default_rate);
	for (int i = 0; i < bank->count; i++)
		counter_power_up(&bank->counters[i]);
}

static void advance_counters(struct encoder_bank *bank, int64_t clock)
{
	for (int i = 0; i < bank->count; i++)
		if (bank->counters[i].clock < clock)
			counter_advance(&bank->counters[i], &bank->feed, &bank->filter, &bank->timestamp, clock);
}

/* With a timer selected, what is read is what stood there at the timer's last event. */
static void take_latches(struct encoder_bank *bank, int64_t event)
{
	advance_counters(bank, event);
	for (int i = 0; i < bank->count; i++)
		bank->latches[i].count = counter_value(&bank->counters[i]);
	bank->latches[0].clock = event;
}

void encoder_bank_advance(struct encoder_bank *bank, int64_t clock)
{
	if (bank->timer_select >> 15 && bank->count > 0) {
		int timer = (int)(bank->timer_select >> 12) & 7;
		int64_t event = dpll_last_event(bank->card, timer, clock);
		if (event > bank->latches[0].clock)
			take_latches(bank, event);
	}
	advance_counters(bank, clock);
}

static uint32_t read_count(const struct encoder_bank *bank, int index, uint32_t *value)
{
	if (index >= bank->count)
		return 0;
	*value = bank->timer_select >> 15 ? bank->latches[index].count : counter_value(&bank->counters[index]);
	return CARD_ALL_DRIVEN;
}

uint32_t encoder_bank_read(struct encoder_bank *bank, int reg, uint32_t offset, uint32_t *value)
{
	int index = (int)(offset >> 2);
	switch (reg) {
	case HM2_ENCODER_COUNT:
		return read_count(bank, index, value);
	case HM2_ENCODER_CONTROL:
		return index < bank->count ? counter_control(&bank->counters[index], value) : 0;
	case HM2_ENCODER_TIMESTAMP_DIVIDER:
		*value = bank->timestamp_reload;
		return HALFWORD;
	case HM2_ENCODER_TIMESTAMP_COUNT:
		*value = (uint32_t)divider_count(&bank->timestamp, bank->card->clock) & HALFWORD;
		return HALFWORD;
	case HM2_ENCODER_TIMER_SELECT:
		*value = bank->timer_select;
		return bank->timers ? CARD_ALL_DRIVEN : 0;
	default:
		return 0;
	}
}

void encoder_bank_forget(struct encoder_bank *bank)
{
	for (int i = 0; i < bank->count; i++)
		counter_forget(&bank->counters[i]);
}

static int write_counter(struct encoder_bank *bank, int reg, int index, uint32_t value)
{
	if (index >= bank->count)
		return 0;
	if (reg == HM2_ENCODER_COUNT)
		counter_clear(&bank->counters[index]);
	else
		counter_set_control(&bank->counters[index], value);
	return 1;
}

static int write_timer_select(struct encoder_bank *bank, uint32_t value)
{
	if (!bank->timers)
		return 0;
	bank->timer_select = value & TIMER_SELECT_MASK;
	take_latches(bank, bank->card->clock);
	return 1;
}

int encoder_bank_write(struct encoder_bank *bank, int reg, uint32_t offset, uint32_t value)
{
	switch (reg) {
	case HM2_ENCODER_COUNT:
	case HM2_ENCODER_CONTROL:
		return write_counter(bank, reg, (int)(offset >> 2), value);
	case HM2_ENCODER_TIMESTAMP_DIVIDER:
		bank->timestamp_reload = (uint16_t)value;
		divider_reload(&bank->timestamp, bank->card->clock,
		               encoder_bank_period(value & HALFWORD, TIMESTAMP_BITS));
		return 1;
	case HM2_ENCODER_TIMESTAMP_COUNT:
		return 1; /* decoded, without effect */
	case HM2_ENCODER_FILTER_RATE:
		bank->set_rate(bank, value);
		encoder_bank_forget(bank);
		return 1;
	case HM2_ENCODER_TIMER_SELECT:
		return write_timer_select(bank, value);
	default:
		return 0;
	}
}

static uint8_t pin_high(struct encoder_bank *bank, int pin)
{
	if (pin < 0)
		return 0; /* an input that no pin drives stays 0 */
	return ioport_reads_high(bank->card->ioport, pin) ? 1 : 0;
}

void encoder_bank_pins_changed(struct encoder_bank *bank)
{
	bank->probe = pin_high(bank, bank->probe_pin) ? COUNTER_PROBE : 0;
	for (int i = 0; i < bank->count; i++)
		bank->counters[i].index_mask = pin_high(bank, bank->mask_pins[i]);
	encoder_bank_forget(bank);
}

void encoder_pins_find(struct encoder_pins *pins, const struct encoder_bank *bank, int unit)
{
	for (int k = 0; k < ENCODER_LINES; k++)
		pins->line[k] = -1;
	for (int i = 0; i < bank->card->pin_count; i++) {
		const struct card_pin *pin = &bank->card->pins[i];
		if (pin->tag == bank->gtag && pin->unit == unit && pin->number >= 1 && pin->number <= ENCODER_LINES)
			pins->line[pin->number - 1] = i;
	}
}

/* What is driven from outside by hand comes first, then an encoder, then what the card drives. */
void encoder_pins_update(struct encoder_pins *pins, struct encoder_bank *bank, int plugged)
{
	struct ioport *port = bank->card->ioport;
	pins->fixed = pins->level = 0;
	for (int k = 0; k < ENCODER_LINES; k++) {
		int pin = pins->line[k];
		uint8_t bit = (uint8_t)(1u << k);
		int outside;
		if (pin < 0) {
			pins->fixed |= bit;
		} else if (ioport_outside(port, pin, &outside)) {
			pins->fixed |= bit;
			pins->level |= outside ? bit : 0;
		} else if (!plugged) {
			pins->fixed |= bit;
			pins->level |= ioport_driver(port, pin) != HM2_LEVEL_LOW ? bit : 0;
		}
	}
}
