/* The outside of the emulated card: levels on pads, encoders on their lines. */
#include "card_modules.h"

#define RATE_MAX (INT64_C(1) << 50) /* 2^-20 counts per second: a thousand million counts per second */

void *card_instances(struct hm2_emulator *card, uint8_t gtag, int unit)
{
	struct card_module *module = card_find(card, gtag);
	if (module == NULL || unit < 0 || unit >= module->descriptor.instances)
		return NULL;
	hm2_emulator_sync(card);
	return module->self;
}

int hm2_emulator_pins(const hm2_emulator *card)
{
	return card->pin_count;
}

int hm2_emulator_pin_drive(hm2_emulator *card, int pin, int level)
{
	CARD_HOLD(card);
	if (pin < 0 || pin >= card->pin_count || level < HM2_LEVEL_RELEASE || level > HM2_LEVEL_HIGH)
		return HM2_ERR_RANGE;
	hm2_emulator_sync(card);
	int port = pin / card->port_width;
	uint32_t bit = UINT32_C(1) << (pin % card->port_width);
	card->ioport->outside[port] &= ~bit;
	card->ioport->outside_level[port] &= ~bit;
	if (level != HM2_LEVEL_RELEASE)
		card->ioport->outside[port] |= bit;
	if (level == HM2_LEVEL_HIGH)
		card->ioport->outside_level[port] |= bit;
	card_pins_changed(card);
	return HM2_OK;
}

int hm2_emulator_pin_level(hm2_emulator *card, int pin)
{
	CARD_HOLD(card);
	if (pin < 0 || pin >= card->pin_count)
		return HM2_ERR_RANGE;
	hm2_emulator_sync(card);
	return ioport_level(card->ioport, pin);
}

int hm2_emulator_encoders(const hm2_emulator *card)
{
	return card->wave_count;
}

/* Everybody is up to now before a wave changes, and looks at the lines again afterwards. */
static struct wave *begin_change(hm2_emulator *card, int encoder)
{
	if (encoder < 0 || encoder >= card->wave_count)
		return NULL;
	hm2_emulator_sync(card);
	return &card->waves[encoder];
}

static int end_change(hm2_emulator *card, struct wave *wave)
{
	wave->plugged = 1;
	card_pins_changed(card);
	return HM2_OK;
}

int hm2_emulator_encoder_run(hm2_emulator *card, int encoder, int64_t edge_period_ps, int64_t counts)
{
	CARD_HOLD(card);
	struct wave *wave = begin_change(card, encoder);
	if (wave == NULL || edge_period_ps <= 0)
		return HM2_ERR_RANGE;
	wave_run(wave, card->now_ps, edge_period_ps, counts);
	return end_change(card, wave);
}

int hm2_emulator_encoder_pulses(hm2_emulator *card, int encoder, int64_t period_ps, int64_t pulses)
{
	CARD_HOLD(card);
	struct wave *wave = begin_change(card, encoder);
	if (wave == NULL || period_ps < 2)
		return HM2_ERR_RANGE;
	wave_steps(wave, card->now_ps, period_ps, pulses);
	return end_change(card, wave);
}

int hm2_emulator_encoder_rate(hm2_emulator *card, int encoder, int64_t rate)
{
	CARD_HOLD(card);
	struct wave *wave = begin_change(card, encoder);
	if (wave == NULL || rate > RATE_MAX || rate < -RATE_MAX)
		return HM2_ERR_RANGE;
	wave_rate(wave, card->now_ps, rate);
	return end_change(card, wave);
}

int hm2_emulator_encoder_set(hm2_emulator *card, int encoder, int a, int b, int z)
{
	CARD_HOLD(card);
	struct wave *wave = begin_change(card, encoder);
	if (wave == NULL || a < -1 || b < -1 || z < -1 || a > 1 || b > 1 || z > 1)
		return HM2_ERR_RANGE;
	wave_set(wave, card->now_ps, a, b, z);
	return end_change(card, wave);
}

int hm2_emulator_encoder_index(hm2_emulator *card, int encoder, int64_t every, int64_t width)
{
	CARD_HOLD(card);
	struct wave *wave = begin_change(card, encoder);
	if (wave == NULL || every < 0 || width < 0)
		return HM2_ERR_RANGE;
	wave_index(wave, every, width);
	return end_change(card, wave);
}

int hm2_emulator_encoder_preset(hm2_emulator *card, int encoder, int64_t position)
{
	CARD_HOLD(card);
	struct wave *wave = begin_change(card, encoder);
	if (wave == NULL)
		return HM2_ERR_RANGE;
	wave_preset(wave, card->now_ps, position);
	return end_change(card, wave);
}

int hm2_emulator_encoder_plug(hm2_emulator *card, int encoder, int plugged)
{
	CARD_HOLD(card);
	struct wave *wave = begin_change(card, encoder);
	if (wave == NULL)
		return HM2_ERR_RANGE;
	end_change(card, wave);
	wave->plugged = plugged != 0;
	card_pins_changed(card);
	return HM2_OK;
}

int hm2_emulator_encoder_position(hm2_emulator *card, int encoder, int64_t *position)
{
	CARD_HOLD(card);
	if (encoder < 0 || encoder >= card->wave_count)
		return HM2_ERR_RANGE;
	card_touch(card);
	*position = wave_position(&card->waves[encoder], card->now_ps + 1);
	return HM2_OK;
}

int hm2_emulator_set_mux_delay_ps(hm2_emulator *card, int64_t delay_ps)
{
	CARD_HOLD(card);
	if (delay_ps < 0 || delay_ps > 1000000000)
		return HM2_ERR_RANGE;
	hm2_emulator_sync(card);
	card->mux_delay_ps = delay_ps;
	card_pins_changed(card);
	return HM2_OK;
}
