/* Resolvers behind their signal processor (fact sheet registers.md 2.10): angles and velocities, measured
 * once per excitation period. How long a command takes is ours, and so is that the flags are 0. */
#include <math.h>
#include <stdlib.h>

#include "card_modules.h"

#define CHANNELS 6
#define COMMAND_PS 100000000 /* 100 us */
#define TURN 4294967296.0
#define SLOWEST 20000 /* clocks of an excitation period at power up */

struct shaft {
	uint32_t angle; /* 2^-32 turns at since_ps */
	double speed;   /* turns per second */
	int64_t since_ps;
};

struct resolver {
	struct hm2_emulator *card;
	int channels;
	uint32_t command;
	uint32_t data;
	int64_t busy_until_ps;
	int64_t excitation; /* clocks */
	uint32_t flags;
	int pdm_pin;
	struct shaft shafts[CHANNELS];
};

static void *resolver_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	(void)descriptor;
	struct resolver *all = calloc(1, sizeof *all);
	if (all == NULL)
		return NULL;
	all->card = card;
	all->channels = CHANNELS;
	all->excitation = SLOWEST;
	all->pdm_pin = card_pin_of(card, HM2_GTAG_RESOLVER, 0, HM2_RESOLVER_PIN_PDM_POSITIVE);
	return all;
}

static void resolver_destroy(void *self)
{
	free(self);
}

static uint32_t angle_at(const struct shaft *shaft, int64_t ps)
{
	double turns = shaft->speed * ((double)(ps - shaft->since_ps) * 1e-12);
	return shaft->angle + (uint32_t)((turns - floor(turns)) * TURN);
}

/* Without excitation on its pins nothing comes back. */
static int excited(const struct resolver *all)
{
	return all->pdm_pin < 0 || ioport_is_switched(all->card->ioport, all->pdm_pin, 1);
}

static uint32_t position(const struct resolver *all, int channel)
{
	int64_t measured = all->card->clock - all->card->clock % all->excitation;
	const struct shaft *shaft = &all->shafts[channel];
	int64_t ps = card_edge_ps(all->card, measured);
	return excited(all) ? angle_at(shaft, ps > shaft->since_ps ? ps : shaft->since_ps) : 0;
}

static uint32_t velocity(const struct resolver *all, int channel)
{
	double seconds = (double)(all->excitation * all->card->period_ps) * 1e-12;
	return excited(all) ? (uint32_t)(int64_t)llround(all->shafts[channel].speed * seconds * TURN) : 0;
}

static uint32_t resolver_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct resolver *all = self;
	int channel = (int)(offset >> 2);
	if (channel >= (reg >= HM2_RESOLVER_VELOCITY ? all->channels : 1))
		return 0;
	switch (reg) {
	case HM2_RESOLVER_COMMAND:
		*value = all->card->now_ps < all->busy_until_ps ? all->command : 0;
		return CARD_ALL_DRIVEN;
	case HM2_RESOLVER_DATA:
		*value = all->data;
		return CARD_ALL_DRIVEN;
	case HM2_RESOLVER_STATUS:
		*value = all->flags;
		return HM2_RESOLVER_STATUS_FLAGS_MASK;
	case HM2_RESOLVER_VELOCITY:
		*value = velocity(all, channel);
		return CARD_ALL_DRIVEN;
	default:
		*value = position(all, channel);
		return CARD_ALL_DRIVEN;
	}
}

static int resolver_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct resolver *all = self;
	if (offset != 0 || reg > HM2_RESOLVER_DATA)
		return 0;
	if (reg == HM2_RESOLVER_DATA) {
		all->data = value;
		return 1;
	}
	all->command = value;
	all->busy_until_ps = all->card->now_ps + COMMAND_PS;
	if (value == HM2_RESOLVER_EXCITATION_KHZ_10)
		all->excitation = 5000;
	if (value == HM2_RESOLVER_EXCITATION_KHZ_5)
		all->excitation = 10000;
	if (value == HM2_RESOLVER_EXCITATION_KHZ_2_5)
		all->excitation = 20000;
	return 1;
}

static struct resolver *resolver_of(hm2_emulator *card, int channel)
{
	return channel < 0 || channel >= CHANNELS ? NULL : card_instances(card, HM2_GTAG_RESOLVER, 0);
}

int hm2_emulator_resolver_set(hm2_emulator *card, int channel, uint32_t angle, double turns_per_second)
{
	CARD_HOLD(card);
	struct resolver *all = resolver_of(card, channel);
	if (all == NULL || !(fabs(turns_per_second) <= 1e6))
		return HM2_ERR_RANGE;
	all->shafts[channel] = (struct shaft){angle, turns_per_second, card->now_ps};
	return HM2_OK;
}

int hm2_emulator_resolver_flag(hm2_emulator *card, int channel, int flag)
{
	CARD_HOLD(card);
	struct resolver *all = resolver_of(card, channel);
	if (all == NULL)
		return HM2_ERR_RANGE;
	all->flags = (all->flags & ~(UINT32_C(1) << channel)) | (uint32_t)(flag != 0) << channel;
	return HM2_OK;
}

int hm2_emulator_resolver_angle(hm2_emulator *card, int channel, uint32_t *angle)
{
	CARD_HOLD(card);
	const struct resolver *all = resolver_of(card, channel);
	if (all == NULL)
		return HM2_ERR_RANGE;
	*angle = angle_at(&all->shafts[channel], card->now_ps);
	return HM2_OK;
}

const struct card_module_type resolver_type = {
	.create = resolver_create,
	.destroy = resolver_destroy,
	.read = resolver_read,
	.write = resolver_write,
};
