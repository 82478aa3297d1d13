/* SSI master and the encoders on its lines (fact sheet registers.md 2.14). A transfer clocks out so many
 * bits, the first the most significant; its data is there when it is over. What the data line shows when
 * within a bit is ours. */
#include <stdlib.h>

#include "card_modules.h"

#define HIGH_WORD 32
#define STORED                                                                                            \
	(HM2_SSI_CONTROL_BITS_MASK | HM2_SSI_CONTROL_PROGRAM_START_MASK | HM2_SSI_CONTROL_TIMER_START_MASK | \
	 HM2_SSI_CONTROL_TIMER_MASK | HM2_SSI_CONTROL_RATE_MASK)

struct channel {
	uint32_t control;
	uint64_t data;
	int available;
	int busy;
	int64_t started;
	int64_t timer_seen; /* the DPLL event that last started it */
	int plugged;
	uint64_t value;     /* what the encoder sends */
	uint64_t sent;      /* latched at the start */
	int clock_pin;
	int data_pin;
};

struct ssi {
	struct hm2_emulator *card;
	int count;
	struct channel channels[];
};

static void *ssi_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	struct ssi *all = calloc(1, sizeof *all + descriptor->instances * sizeof all->channels[0]);
	if (all == NULL)
		return NULL;
	all->card = card;
	all->count = descriptor->instances;
	for (int i = 0; i < all->count; i++) {
		all->channels[i].clock_pin = card_pin_of(card, HM2_GTAG_SSI, i, HM2_SSI_PIN_CLOCK);
		all->channels[i].data_pin = card_pin_of(card, HM2_GTAG_SSI, i, HM2_SSI_PIN_DATA);
	}
	return all;
}

static void ssi_destroy(void *self)
{
	free(self);
}

static int bits(const struct channel *channel)
{
	return (int)(channel->control & HM2_SSI_CONTROL_BITS_MASK);
}

static int64_t rate(const struct channel *channel)
{
	return channel->control >> HM2_SSI_CONTROL_RATE_LSB;
}

/* A rate of 0 never ends. */
static int64_t ends(const struct channel *channel)
{
	if (rate(channel) == 0)
		return CARD_NEVER;
	return channel->started + (bits(channel) * INT64_C(65536) + rate(channel) - 1) / rate(channel);
}

static uint64_t low_bits(uint64_t value, int count)
{
	return count >= 64 ? value : value & ((UINT64_C(1) << count) - 1);
}

static int by_hand(const struct ssi *all, const struct channel *channel, int *level)
{
	return channel->data_pin >= 0 && ioport_outside(all->card->ioport, channel->data_pin, level);
}

static void start(struct ssi *all, struct channel *channel, int64_t clock)
{
	int level;
	if (channel->busy)
		return;
	channel->busy = 1;
	channel->started = clock;
	int clocked = channel->clock_pin < 0 || ioport_is_switched(all->card->ioport, channel->clock_pin, 1);
	channel->sent = channel->plugged && clocked ? channel->value : UINT64_MAX; /* a floating line is high */
	if (by_hand(all, channel, &level))
		channel->sent = level ? UINT64_MAX : 0;
}

static void finish(struct channel *channel)
{
	channel->busy = 0;
	channel->data = low_bits(channel->sent, bits(channel));
	channel->available = 1;
}

static void start_by_timer(struct ssi *all, struct channel *channel, int64_t clock)
{
	int timer = (int)((channel->control & HM2_SSI_CONTROL_TIMER_MASK) >> HM2_SSI_CONTROL_TIMER_LSB);
	int64_t event = dpll_last_event(all->card, timer, clock);
	if (event <= channel->timer_seen)
		return;
	channel->timer_seen = event;
	if (channel->control & HM2_SSI_CONTROL_TIMER_START_MASK)
		start(all, channel, event);
}

static void ssi_advance(void *self, int64_t clock)
{
	struct ssi *all = self;
	for (int i = 0; i < all->count; i++) {
		struct channel *channel = &all->channels[i];
		for (int again = 0; again < 2; again++) {
			if (channel->busy && clock >= ends(channel))
				finish(channel);
			if (card_has(all->card, HM2_GTAG_DPLL))
				start_by_timer(all, channel, clock);
		}
	}
}

static uint32_t busy_flags(const struct ssi *all)
{
	uint32_t flags = 0;
	for (int i = 0; i < all->count; i++)
		flags |= (uint32_t)all->channels[i].busy << i;
	return flags;
}

static uint32_t ssi_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	struct ssi *all = self;
	int index = (int)(offset >> 2);
	if (reg == HM2_SSI_GLOBAL_START) {
		*value = busy_flags(all);
		return CARD_ALL_DRIVEN;
	}
	if (index >= all->count || reg > HM2_SSI_CONTROL)
		return 0;
	struct channel *channel = &all->channels[index];
	if (reg == HM2_SSI_CONTROL) {
		*value = channel->control | (channel->busy ? HM2_SSI_CONTROL_BUSY_MASK : 0) |
		         (channel->available ? HM2_SSI_CONTROL_DATA_AVAILABLE_MASK : 0);
		return CARD_ALL_DRIVEN;
	}
	if (reg == HM2_SSI_DATA0)
		channel->available = 0;
	*value = (uint32_t)(channel->data >> (reg == HM2_SSI_DATA1 ? HIGH_WORD : 0));
	return CARD_ALL_DRIVEN;
}

static int ssi_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct ssi *all = self;
	int index = (int)(offset >> 2);
	if (reg == HM2_SSI_GLOBAL_START) {
		for (int i = 0; i < all->count; i++)
			if (all->channels[i].control & HM2_SSI_CONTROL_PROGRAM_START_MASK)
				start(all, &all->channels[i], all->card->clock);
		return 1;
	}
	if (index >= all->count)
		return 0;
	if (reg == HM2_SSI_CONTROL)
		all->channels[index].control = value & STORED;
	else if (reg == HM2_SSI_DATA0)
		start(all, &all->channels[index], all->card->clock);
	else
		return 0;
	return 1;
}

static int ssi_output(void *self, int unit, int number)
{
	const struct ssi *all = self;
	if (unit >= all->count)
		return 0;
	const struct channel *channel = &all->channels[unit];
	int64_t since = all->card->clock - channel->started;
	switch (number) {
	case HM2_SSI_PIN_CLOCK: /* high between transfers, falls first */
		return !channel->busy || ((since * rate(channel) * 2) >> 16) % 2 != 0;
	case HM2_SSI_PIN_CLOCK_ENABLE:
		return 1;
	case HM2_SSI_PIN_DATA_AVAILABLE:
		return channel->available;
	default:
		return 0;
	}
}

static int ssi_outside(void *self, int unit, int number, int *level)
{
	const struct ssi *all = self;
	if (unit >= all->count || number != HM2_SSI_PIN_DATA || !all->channels[unit].plugged)
		return 0;
	const struct channel *channel = &all->channels[unit];
	int64_t bit = bits(channel) - 1 - (((all->card->clock - channel->started) * rate(channel)) >> 16);
	*level = !channel->busy || bit < 0 || bit > 63 || ((channel->sent >> bit) & 1);
	return 1;
}

int hm2_emulator_ssi_set(hm2_emulator *card, int channel, int plugged, uint64_t value)
{
	CARD_HOLD(card);
	struct ssi *all = card_instances(card, HM2_GTAG_SSI, channel);
	if (all == NULL)
		return HM2_ERR_RANGE;
	all->channels[channel].plugged = plugged != 0;
	all->channels[channel].value = value;
	card_pins_changed(card);
	return HM2_OK;
}

const struct card_module_type ssi_type = {
	.create = ssi_create,
	.destroy = ssi_destroy,
	.read = ssi_read,
	.write = ssi_write,
	.advance = ssi_advance,
	.output = ssi_output,
	.outside = ssi_outside,
};
