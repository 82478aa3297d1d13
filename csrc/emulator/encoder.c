/* QCount: plain encoders, their A, B and Z each on a pin of its own. */
#include <stdlib.h>

#include "encoder_bank.h"
#include "wave.h"

#define TICK_HZ 16000000
#define RATE_BITS 12

struct encoder {
	struct encoder_bank bank; /* first: the bank's owner is found by casting */
	struct encoder_pins pins[];
};

static struct wave *wave_of(const struct encoder *encoder, int index)
{
	return &encoder->bank.card->waves[encoder->bank.first_wave + index];
}

static uint8_t lines_before(const struct encoder *encoder, int index, int64_t n)
{
	const struct encoder_pins *pins = &encoder->pins[index];
	uint8_t bits = wave_bits(wave_of(encoder, index), card_edge_ps(encoder->bank.card, n));
	return (uint8_t)((bits & ~pins->fixed) | pins->level);
}

static int64_t feed_next(void *self, int index, int64_t n, uint8_t lines)
{
	const struct encoder *encoder = self;
	const struct hm2_emulator *card = encoder->bank.card;
	if (lines_before(encoder, index, n + 1) != lines)
		return n + 1;
	if ((encoder->pins[index].fixed & 7) == 7)
		return CARD_NEVER;
	int64_t change = wave_next(wave_of(encoder, index), card_edge_ps(card, n + 1));
	return change == WAVE_NEVER ? CARD_NEVER : card_clock_at(card, change) + 1;
}

static uint8_t feed_at(void *self, int index, int64_t n)
{
	return lines_before(self, index, n);
}

static void set_rate(struct encoder_bank *bank, uint32_t value)
{
	uint32_t reload = value & HM2_ENCODER_FILTER_RATE_DIVIDER_MASK;
	divider_reload(&bank->filter, bank->card->clock, encoder_bank_period(reload, RATE_BITS));
}

static void encoder_destroy(void *self)
{
	struct encoder *encoder = self;
	encoder_bank_free(&encoder->bank);
	free(encoder);
}

static void *encoder_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	struct encoder *encoder =
		calloc(1, sizeof *encoder + descriptor->instances * sizeof encoder->pins[0]);
	if (encoder == NULL)
		return NULL;
	if (!encoder_bank_init(&encoder->bank, card, descriptor, TICK_HZ)) {
		encoder_destroy(encoder);
		return NULL;
	}
	encoder->bank.feed = (struct counter_feed){encoder, 0, &encoder->bank.probe, feed_next, feed_at};
	encoder->bank.set_rate = set_rate;
	for (int i = 0; i < encoder->bank.count; i++)
		encoder_pins_find(&encoder->pins[i], &encoder->bank, i);
	return encoder;
}

static void encoder_pins_changed(void *self)
{
	struct encoder *encoder = self;
	for (int i = 0; i < encoder->bank.count; i++)
		encoder_pins_update(&encoder->pins[i], &encoder->bank, wave_of(encoder, i)->plugged);
	encoder_bank_pins_changed(&encoder->bank);
}

static int encoder_outside(void *self, int unit, int number, int *level)
{
	const struct encoder *encoder = self;
	if (unit >= encoder->bank.count || number < 1 || number > ENCODER_LINES)
		return 0;
	struct wave *wave = wave_of(encoder, unit);
	uint8_t bit = (uint8_t)(1u << (number - 1));
	*level = (wave_bits(wave, encoder->bank.card->now_ps + 1) & bit) != 0;
	return wave->plugged && !(wave->span.floating & bit);
}

static void encoder_advance(void *self, int64_t clock)
{
	encoder_bank_advance(self, clock);
}

static uint32_t encoder_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	return encoder_bank_read(self, reg, offset, value);
}

static int encoder_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	return encoder_bank_write(self, reg, offset, value);
}

static void encoder_power_up(void *self)
{
	encoder_bank_power_up(self);
}

const struct card_module_type encoder_type = {
	.create = encoder_create,
	.destroy = encoder_destroy,
	.read = encoder_read,
	.write = encoder_write,
	.advance = encoder_advance,
	.outside = encoder_outside,
	.pins_changed = encoder_pins_changed,
	.power_up = encoder_power_up,
	.extra_registers = 1,
};
