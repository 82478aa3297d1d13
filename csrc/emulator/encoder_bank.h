/* What the plain and the multiplexed encoder module share: their registers, dividers and counters. */
#ifndef HM2_EMULATOR_ENCODER_BANK_H
#define HM2_EMULATOR_ENCODER_BANK_H

#include "card_modules.h"
#include "counter.h"

#define ENCODER_LINES 3 /* A, B, Z */

/* The pins of one A, B, Z group. Of a wave only the lines outside `fixed` get through. */
struct encoder_pins {
	int line[ENCODER_LINES]; /* -1: no such pin, reads 0 */
	uint8_t fixed;
	uint8_t level;
};

struct encoder_bank {
	struct hm2_emulator *card;
	uint8_t gtag;
	int count;
	int first_wave; /* index of counter 0's encoder in card->waves */
	struct counter *counters;
	struct counter_feed feed;
	struct divider filter;
	struct divider timestamp;
	uint16_t timestamp_reload;
	uint32_t default_rate;
	int probe_pin;
	uint8_t probe; /* COUNTER_PROBE or 0 */
	int *mask_pins;
	int timers;    /* has the timer select register and latches of a card with DPLL */
	uint32_t timer_select;
	struct encoder_latch *latches;
	/* The filter rate register is written. */
	void (*set_rate)(struct encoder_bank *bank, uint32_t value);
};

int encoder_bank_init(struct encoder_bank *bank, struct hm2_emulator *card,
                      const struct card_descriptor *descriptor, int64_t tick_hz);
void encoder_bank_free(struct encoder_bank *bank);
void encoder_bank_advance(struct encoder_bank *bank, int64_t clock);
uint32_t encoder_bank_read(struct encoder_bank *bank, int reg, uint32_t offset, uint32_t *value);
int encoder_bank_write(struct encoder_bank *bank, int reg, uint32_t offset, uint32_t value);
void encoder_bank_power_up(struct encoder_bank *bank);
void encoder_bank_pins_changed(struct encoder_bank *bank);
void encoder_bank_forget(struct encoder_bank *bank);
int64_t encoder_bank_period(uint32_t reload, int bits);

void encoder_pins_find(struct encoder_pins *pins, const struct encoder_bank *bank, int unit);
void encoder_pins_update(struct encoder_pins *pins, struct encoder_bank *bank, int plugged);

#endif
