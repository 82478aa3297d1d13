/* Servo pulses (fact sheet registers.md 2.21): each repetition starts with a pulse of 16 * (width + 1)
 * clocks. That a new width waits for the next pulse is ours. */
#include <stdlib.h>

#include "card_modules.h"

#define STEP 16

struct servo {
	uint32_t width;
	uint32_t written;
	int64_t cycle; /* in which it was written */
};

struct rcpwm {
	struct hm2_emulator *card;
	int count;
	uint32_t rate;
	int64_t since; /* clock 0 of the repetitions */
	struct servo units[];
};

static void *rcpwm_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	struct rcpwm *rcpwm = calloc(1, sizeof *rcpwm + descriptor->instances * sizeof rcpwm->units[0]);
	if (rcpwm == NULL)
		return NULL;
	rcpwm->card = card;
	rcpwm->count = descriptor->instances;
	return rcpwm;
}

static void rcpwm_destroy(void *self)
{
	free(self);
}

static int64_t period(const struct rcpwm *rcpwm)
{
	return (int64_t)rcpwm->rate + 2;
}

static int64_t cycle(const struct rcpwm *rcpwm)
{
	return (rcpwm->card->clock - rcpwm->since) / period(rcpwm);
}

static void take(const struct rcpwm *rcpwm, struct servo *servo)
{
	if (cycle(rcpwm) != servo->cycle)
		servo->width = servo->written;
}

static uint32_t rcpwm_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	(void)self;
	(void)reg;
	(void)offset;
	(void)value;
	return 0; /* written only */
}

static int rcpwm_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct rcpwm *rcpwm = self;
	int index = (int)(offset >> 2);
	if (reg == HM2_RCPWM_RATE) {
		for (int i = 0; i < rcpwm->count; i++)
			rcpwm->units[i].width = rcpwm->units[i].written;
		rcpwm->rate = value;
		rcpwm->since = rcpwm->card->clock;
		for (int i = 0; i < rcpwm->count; i++)
			rcpwm->units[i].cycle = 0;
		return 1;
	}
	if (reg != HM2_RCPWM_WIDTH || index >= rcpwm->count)
		return 0;
	take(rcpwm, &rcpwm->units[index]);
	rcpwm->units[index].written = value & HM2_RCPWM_WIDTH_PERIODS_MASK;
	rcpwm->units[index].cycle = cycle(rcpwm);
	return 1;
}

static int rcpwm_output(void *self, int unit, int number)
{
	struct rcpwm *rcpwm = self;
	if (unit >= rcpwm->count || number != HM2_RCPWM_PIN_PWM)
		return 0;
	take(rcpwm, &rcpwm->units[unit]);
	int64_t at = (rcpwm->card->clock - rcpwm->since) % period(rcpwm);
	return at < STEP * ((int64_t)rcpwm->units[unit].width + 1);
}

const struct card_module_type rcpwm_type = {
	.create = rcpwm_create,
	.destroy = rcpwm_destroy,
	.read = rcpwm_read,
	.write = rcpwm_write,
	.output = rcpwm_output,
};
