/* MuxedQCount and MuxedQCountSel: two encoders share each A, B, Z group of pins; the daughter card's
 * multiplexer follows the card's own Sel0 pin (fact sheet registers.md 2.4, card observed 4).
 *
 * A select counter moves with every filter tick. Its bit 0 reaches the Sel0 pins two clocks later. The
 * lines are sampled as the phase ends: with deskew d, d + 2 clocks behind the tick; a step to 1 takes the
 * even encoder, a step to 0 the odd one. */
#include <stdlib.h>

#include "encoder_bank.h"
#include "wave.h"

#define TICK_HZ 8000000
#define RATE_BITS 12
#define SPANS 8
#define PIN_DELAY 2
#define MAX_DESKEW 15

enum select_mode { SELECT_LOW, SELECT_HIGH, SELECT_FOLLOWS, SELECT_INVERTED, SELECT_NONE };

struct unit {
	struct encoder_pins pins;
	int select_pin; /* of the multiplexer these lines come from; -1: there is none */
	enum select_mode select;
	enum select_mode old_select; /* before select_since_ps */
	int64_t select_since_ps;
};

struct muxed_encoder {
	struct encoder_bank bank; /* first: the bank's owner is found by casting */
	struct {
		int64_t from;
		struct divider divider;
	} spans[SPANS]; /* the filter divider's past, newest first: sampling looks back some clocks */
	int deskew;
	int old_deskew;
	int64_t deskew_since;
	int64_t unsteady_until; /* up to this edge every sample is looked at on its own */
	struct unit units[];
};

static int64_t select_count(const struct muxed_encoder *m, int64_t n)
{
	for (int i = 0; i < SPANS - 1; i++)
		if (n >= m->spans[i].from)
			return n < 0 ? 0 : divider_count(&m->spans[i].divider, n);
	return 0;
}

static int select_bit(const struct muxed_encoder *m, int64_t n)
{
	return (int)(select_count(m, n) & 1);
}

/* Sample time as the deskew delay line shows it behind edge n. */
static int sample_phase(const struct muxed_encoder *m, int64_t n)
{
	int deskew = n < m->deskew_since ? m->old_deskew : m->deskew;
	return select_bit(m, n - 1 - deskew);
}

/* Whether edge n samples the encoders of this phase (0 even, 1 odd). */
static int samples(const struct muxed_encoder *m, int phase, int64_t n)
{
	int now = sample_phase(m, n - 1);
	int before = sample_phase(m, n - 2);
	return now != before && now == !phase;
}

/* The first edge >= n that samples this phase. */
static int64_t next_sample(const struct muxed_encoder *m, int phase, int64_t n)
{
	for (; n <= m->unsteady_until; n++)
		if (samples(m, phase, n))
			return n;
	const struct divider *divider = &m->bank.filter;
	int64_t tick = divider_next(divider, n - PIN_DELAY - m->deskew);
	if ((divider_count(divider, tick) & 1) == phase)
		tick += divider->period;
	return tick + PIN_DELAY + m->deskew;
}

/* The level of the unit's Sel0 pin just before t. */
static int select_level(const struct muxed_encoder *m, const struct unit *unit, int64_t t)
{
	enum select_mode mode = t <= unit->select_since_ps ? unit->old_select : unit->select;
	if (mode == SELECT_LOW || mode == SELECT_NONE)
		return 0;
	if (mode == SELECT_HIGH)
		return 1;
	int64_t n = card_clock_at(m->bank.card, t - 1);
	return select_bit(m, n - PIN_DELAY) ^ (mode == SELECT_INVERTED);
}

/* The encoder whose lines the unit's pins carry just before t. */
static struct wave *wave_at(const struct muxed_encoder *m, int u, int64_t t)
{
	const struct unit *unit = &m->units[u];
	int index = 2 * u + select_level(m, unit, t);
	return &m->bank.card->waves[m->bank.first_wave + index];
}

static int64_t line_ps(const struct muxed_encoder *m, int64_t n)
{
	return card_edge_ps(m->bank.card, n) - m->bank.card->mux_delay_ps;
}

static uint8_t sample(const struct muxed_encoder *m, int u, int64_t n)
{
	const struct encoder_pins *pins = &m->units[u].pins;
	int64_t t = line_ps(m, n);
	return (uint8_t)((wave_bits(wave_at(m, u, t), t) & ~pins->fixed) | pins->level);
}

static int64_t feed_next(void *self, int index, int64_t n, uint8_t lines)
{
	const struct muxed_encoder *m = self;
	const struct hm2_emulator *card = m->bank.card;
	int phase = index & 1;
	int u = index / 2;
	int64_t at = next_sample(m, phase, n + 1);
	if (at <= m->unsteady_until || sample(m, u, at) != lines)
		return at;
	int64_t t = line_ps(m, at);
	int64_t change = wave_next(wave_at(m, u, t), t);
	if (change == WAVE_NEVER || (m->units[u].pins.fixed & 7) == 7)
		return CARD_NEVER;
	/* Seen by the first sample whose line time is behind the change. */
	return next_sample(m, phase, card_clock_at(card, change + card->mux_delay_ps) + 1);
}

static uint8_t feed_at(void *self, int index, int64_t n)
{
	return sample(self, index / 2, n);
}

static void unsteady(struct muxed_encoder *m)
{
	const struct hm2_emulator *card = m->bank.card;
	int64_t until = card->clock + MAX_DESKEW + 2 * PIN_DELAY + 2 + card->mux_delay_ps / card->period_ps;
	if (until > m->unsteady_until)
		m->unsteady_until = until;
}

static void set_rate(struct encoder_bank *bank, uint32_t value)
{
	struct muxed_encoder *m = (struct muxed_encoder *)bank;
	int64_t now = bank->card->clock;
	uint32_t reload = value & HM2_MUXED_ENCODER_FILTER_RATE_DIVIDER_MASK;
	divider_reload(&bank->filter, now, encoder_bank_period(reload, RATE_BITS));
	if (m->spans[0].from < now)
		for (int i = SPANS - 1; i > 0; i--)
			m->spans[i] = m->spans[i - 1];
	m->spans[0].from = now;
	m->spans[0].divider = bank->filter;
	m->old_deskew = m->deskew;
	m->deskew = (int)(value >> HM2_MUXED_ENCODER_FILTER_RATE_DESKEW_LSB);
	m->deskew_since = now;
	unsteady(m);
}

static int find_select(const struct hm2_emulator *card, const struct encoder_pins *pins)
{
	for (int i = 0; i < card->pin_count; i++)
		if (card->pins[i].tag == HM2_GTAG_MUXED_ENCODER_SELECT && card->pins[i].number == HM2_MUXED_ENCODER_SELECT_PIN_SELECT_0 &&
		    i / card->port_width == pins->line[0] / card->port_width)
			return i;
	return -1;
}

static void muxed_destroy(void *self)
{
	struct muxed_encoder *m = self;
	encoder_bank_free(&m->bank);
	free(m);
}

static void *muxed_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	size_t units = ((size_t)descriptor->instances + 1) / 2;
	struct muxed_encoder *m = calloc(1, sizeof *m + units * sizeof m->units[0]);
	if (m == NULL)
		return NULL;
	if (!encoder_bank_init(&m->bank, card, descriptor, TICK_HZ)) {
		muxed_destroy(m);
		return NULL;
	}
	m->bank.feed = (struct counter_feed){m, 1, &m->bank.probe, feed_next, feed_at};
	m->bank.set_rate = set_rate;
	m->spans[0].divider = m->bank.filter;
	m->spans[0].from = INT64_MIN;
	for (size_t u = 0; u < units; u++) {
		encoder_pins_find(&m->units[u].pins, &m->bank, (int)u);
		m->units[u].select_pin = find_select(card, &m->units[u].pins);
	}
	m->unsteady_until = MAX_DESKEW + 2 * PIN_DELAY;
	return m;
}

static enum select_mode select_mode(const struct muxed_encoder *m, int pin)
{
	struct ioport *port = m->bank.card->ioport;
	if (pin < 0)
		return SELECT_NONE;
	int follows = ioport_follows(port, pin);
	if (follows)
		return follows > 0 ? SELECT_FOLLOWS : SELECT_INVERTED;
	return ioport_reads_high(port, pin) ? SELECT_HIGH : SELECT_LOW;
}

static void muxed_pins_changed(void *self)
{
	struct muxed_encoder *m = self;
	const struct hm2_emulator *card = m->bank.card;
	for (int u = 0; u < (m->bank.count + 1) / 2; u++) {
		struct unit *unit = &m->units[u];
		const struct wave *even = &card->waves[m->bank.first_wave + 2 * u];
		int odd = 2 * u + 1 < m->bank.count && even[1].plugged;
		encoder_pins_update(&unit->pins, &m->bank, even->plugged || odd);
		enum select_mode mode = select_mode(m, unit->select_pin);
		if (mode == unit->select)
			continue;
		unit->old_select = unit->select;
		unit->select = mode;
		unit->select_since_ps = card_edge_ps(card, card->clock);
		unsteady(m);
	}
	encoder_bank_pins_changed(&m->bank);
}

static int muxed_outside(void *self, int unit, int number, int *level)
{
	const struct muxed_encoder *m = self;
	if (2 * unit >= m->bank.count || number < 1 || number > ENCODER_LINES)
		return 0;
	const struct wave *even = &m->bank.card->waves[m->bank.first_wave + 2 * unit];
	if (!even->plugged && !(2 * unit + 1 < m->bank.count && even[1].plugged))
		return 0;
	int64_t t = m->bank.card->now_ps - m->bank.card->mux_delay_ps + 1;
	struct wave *wave = wave_at(m, unit, t);
	uint8_t bit = (uint8_t)(1u << (number - 1));
	*level = (wave_bits(wave, t) & bit) != 0;
	return wave->plugged && !(wave->span.floating & bit);
}

static void muxed_advance(void *self, int64_t clock)
{
	encoder_bank_advance(self, clock);
}

static uint32_t muxed_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	return encoder_bank_read(self, reg, offset, value);
}

static int muxed_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	return encoder_bank_write(self, reg, offset, value);
}

static void muxed_power_up(void *self)
{
	encoder_bank_power_up(self);
}

const struct card_module_type muxed_encoder_type = {
	.create = muxed_create,
	.destroy = muxed_destroy,
	.read = muxed_read,
	.write = muxed_write,
	.advance = muxed_advance,
	.outside = muxed_outside,
	.pins_changed = muxed_pins_changed,
	.power_up = muxed_power_up,
	.extra_registers = 1,
};

/* ---- the select pins: a module of its own in the descriptors, without registers --------------- */

static void *select_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	(void)descriptor;
	return card;
}

static void select_destroy(void *self)
{
	(void)self;
}

static uint32_t select_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	(void)self;
	(void)reg;
	(void)offset;
	(void)value;
	return 0;
}

static int select_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	(void)self;
	(void)reg;
	(void)offset;
	(void)value;
	return 0;
}

static int select_output(void *self, int unit, int number)
{
	struct hm2_emulator *card = self;
	const struct card_module *module = card_find(card, HM2_GTAG_MUXED_ENCODER);
	(void)unit;
	if (module == NULL)
		return 0;
	int64_t count = select_count(module->self, card->clock - PIN_DELAY);
	return (int)(number == HM2_MUXED_ENCODER_SELECT_PIN_SELECT_1 ? count >> 1 : count) & 1;
}

const struct card_module_type muxed_select_type = {
	.create = select_create,
	.destroy = select_destroy,
	.read = select_read,
	.write = select_write,
	.output = select_output,
};
