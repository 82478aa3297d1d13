/* InM and InMux (fact sheet registers.md 2.18): inputs scanned at a rate, filtered by a number of equal
 * scans, and four quadrature counters of 8 bits on the first eight. What an InMux sees hangs on a
 * multiplexer behind its address pins. That counters look at unfiltered inputs, and that a scan looks at
 * all of them at once, is ours. */
#include <stdlib.h>

#include "card_modules.h"

#define INPUTS 32
#define COUNTERS 4
#define ADDRESSES 5
#define FIELD(value, name) (((value) & HM2_INM_CONTROL_##name##_MASK) >> HM2_INM_CONTROL_##name##_LSB)

struct bank {
	uint32_t control;
	uint32_t slow;
	uint32_t levels; /* on the lines */
	uint32_t raw;
	uint32_t filtered;
	int64_t changed[INPUTS]; /* scan of the last change of raw */
	int64_t scan;            /* last done */
	uint8_t counts[COUNTERS];
	uint32_t modes;
	uint32_t stimulus; /* what an InMux's multiplexer offers */
	int pins[INPUTS];
	int address_pins[ADDRESSES];
};

struct field_input {
	struct hm2_emulator *card;
	uint8_t gtag;
	int count;
	struct bank banks[];
};

static void find_pins(struct field_input *all, struct bank *bank, int unit)
{
	int last = -1;
	for (int i = 0; i < INPUTS; i++) {
		bank->pins[i] = card_pin_of(all->card, all->gtag, unit, (int)HM2_INM_PIN_IN_0 + i);
		if (bank->pins[i] >= 0)
			last = i;
	}
	int addresses = 0;
	for (int i = 0; i < ADDRESSES; i++) {
		bank->address_pins[i] = card_pin_of(all->card, all->gtag, unit, (int)HM2_INMUX_PIN_ADDRESS_0 + i);
		addresses += bank->address_pins[i] >= 0;
	}
	if (all->gtag == HM2_GTAG_INMUX)
		last = (1 << addresses) - 1;
	bank->control = (uint32_t)(last < 0 ? 0 : last) << HM2_INM_CONTROL_SCAN_WIDTH_LSB;
}

static void *create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	struct field_input *all = calloc(1, sizeof *all + descriptor->instances * sizeof all->banks[0]);
	if (all == NULL)
		return NULL;
	all->card = card;
	all->gtag = descriptor->gtag;
	all->count = descriptor->instances;
	for (int i = 0; i < all->count; i++)
		find_pins(all, &all->banks[i], i);
	return all;
}

static void destroy(void *self)
{
	free(self);
}

static int width(const struct bank *bank)
{
	return (int)FIELD(bank->control, SCAN_WIDTH) + 1;
}

static int64_t scan_clocks(const struct bank *bank)
{
	return 4 * (int64_t)width(bank) * ((int64_t)FIELD(bank->control, DIVIDER) + 1);
}

/* The input a multiplexer offers while `wanted` is on the address pins as far as they are switched. */
static int offered(const struct field_input *all, const struct bank *bank, int wanted)
{
	int address = 0;
	for (int k = 0; k < ADDRESSES; k++) {
		int pin = bank->address_pins[k];
		if (pin < 0)
			continue;
		int follows = ioport_follows(all->card->ioport, pin);
		int bit = follows ? ((wanted >> k) & 1) ^ (follows < 0) : ioport_reads_high(all->card->ioport, pin);
		address |= bit << k;
	}
	return (int)(bank->stimulus >> address) & 1;
}

static uint32_t lines(const struct field_input *all, const struct bank *bank)
{
	uint32_t levels = 0;
	for (int i = 0; i < width(bank); i++) {
		int level;
		if (all->gtag == HM2_GTAG_INMUX)
			level = offered(all, bank, i);
		else
			level = bank->pins[i] < 0 || ioport_reads_high(all->card->ioport, bank->pins[i]);
		levels |= (uint32_t)level << i;
	}
	return levels;
}

/* Gray code to a phase; once per cycle counts only between phase 3 and 0. */
static void count_edges(struct bank *bank, int k, uint32_t before, uint32_t now)
{
	static const int phase[4] = {0, 1, 3, 2};
	int from = phase[(before >> 2 * k) & 3];
	int to = phase[(now >> 2 * k) & 3];
	int step = (to - from) & 3;
	int every_edge = (int)(bank->modes >> 8 * k) & 1;
	if (step == 1 && (every_edge || to == 0))
		bank->counts[k]++;
	if (step == 3 && (every_edge || from == 0))
		bank->counts[k]--;
}

static void take_levels(struct bank *bank, int64_t scan)
{
	uint32_t mask = width(bank) == INPUTS ? UINT32_MAX : (UINT32_C(1) << width(bank)) - 1;
	uint32_t raw = (bank->control & HM2_INM_CONTROL_INVERT_MASK ? ~bank->levels : bank->levels) & mask;
	for (int k = 0; k < COUNTERS; k++)
		count_edges(bank, k, bank->raw, raw);
	for (int i = 0; i < INPUTS; i++)
		if (((raw ^ bank->raw) >> i) & 1)
			bank->changed[i] = scan;
	bank->raw = raw;
}

static void filter(struct bank *bank)
{
	for (int i = 0; i < INPUTS; i++) {
		int64_t scans = (bank->slow >> i) & 1 ? FIELD(bank->control, SLOW_SCANS) : FIELD(bank->control, FAST_SCANS);
		uint32_t bit = UINT32_C(1) << i;
		if (bank->scan >= bank->changed[i] + scans)
			bank->filtered = (bank->filtered & ~bit) | (bank->raw & bit);
	}
}

static void advance(void *self, int64_t clock)
{
	struct field_input *all = self;
	for (int i = 0; i < all->count; i++) {
		struct bank *bank = &all->banks[i];
		int64_t scan = clock / scan_clocks(bank);
		if (scan <= bank->scan)
			continue;
		int64_t first = bank->scan + 1;
		bank->scan = first; /* a filter that ends before the levels are looked at again */
		filter(bank);
		take_levels(bank, first);
		bank->scan = scan;
		filter(bank);
	}
}

static void pins_changed(void *self)
{
	struct field_input *all = self;
	for (int i = 0; i < all->count; i++)
		all->banks[i].levels = lines(all, &all->banks[i]);
}

static uint32_t read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct field_input *all = self;
	int index = (int)(offset >> 2);
	if (index >= all->count)
		return 0;
	const struct bank *bank = &all->banks[index];
	const uint32_t counts = bank->counts[0] | (uint32_t)bank->counts[1] << 8 | (uint32_t)bank->counts[2] << 16 |
	                        (uint32_t)bank->counts[3] << 24;
	const uint32_t values[] = {bank->control & HM2_INM_CONTROL_SCAN_WIDTH_MASK, bank->slow, bank->filtered,
	                           bank->raw, counts};
	if (reg > HM2_INM_MPG)
		return 0;
	*value = values[reg];
	return reg == HM2_INM_CONTROL ? HM2_INM_CONTROL_SCAN_WIDTH_MASK : CARD_ALL_DRIVEN;
}

static int write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct field_input *all = self;
	int index = (int)(offset >> 2);
	if (index >= all->count)
		return 0;
	struct bank *bank = &all->banks[index];
	if (reg == HM2_INM_CONTROL) {
		const uint32_t fixed = HM2_INM_CONTROL_SCAN_WIDTH_MASK;
		bank->control = (bank->control & fixed) | (value & ~fixed);
		bank->scan = all->card->clock / scan_clocks(bank);
		for (int i = 0; i < INPUTS; i++)
			bank->changed[i] = bank->scan;
		take_levels(bank, bank->scan);
	} else if (reg == HM2_INM_FILTER) {
		bank->slow = value;
	} else if (reg == HM2_INM_MPG) {
		bank->modes = value;
	} else {
		return 0;
	}
	return 1;
}

static int output(void *self, int unit, int number)
{
	const struct field_input *all = self;
	int bit = number - (int)HM2_INMUX_PIN_ADDRESS_0;
	if (all->gtag != HM2_GTAG_INMUX || unit >= all->count || bit < 0 || bit >= ADDRESSES)
		return 0;
	const struct bank *bank = &all->banks[unit];
	int64_t look = all->card->clock / (scan_clocks(bank) / width(bank));
	return (int)((look % width(bank)) >> bit) & 1;
}

static int outside(void *self, int unit, int number, int *level)
{
	const struct field_input *all = self;
	if (all->gtag != HM2_GTAG_INMUX || unit >= all->count || number != HM2_INMUX_PIN_DATA)
		return 0;
	const struct bank *bank = &all->banks[unit];
	int64_t look = all->card->clock / (scan_clocks(bank) / width(bank));
	*level = offered(all, bank, (int)(look % width(bank)));
	return 1;
}

int hm2_emulator_inmux_set(hm2_emulator *card, int unit, uint32_t levels)
{
	CARD_HOLD(card);
	struct field_input *all = card_instances(card, HM2_GTAG_INMUX, unit);
	if (all == NULL)
		return HM2_ERR_RANGE;
	all->banks[unit].stimulus = levels;
	card_pins_changed(card);
	return HM2_OK;
}

const struct card_module_type field_input_type = {
	.create = create,
	.destroy = destroy,
	.read = read,
	.write = write,
	.advance = advance,
	.output = output,
	.outside = outside,
	.pins_changed = pins_changed,
};
