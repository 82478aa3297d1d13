/* SSR and OutM: a bit in a register is a pin (fact sheet registers.md 2.17). The SSR's carrier, which
 * keeps its isolating transformers going, shows on the reference pin only: an output's pin shows whether
 * its relay conducts, which takes the carrier. */
#include <stdlib.h>
#include <string.h>

#include "card_modules.h"

#define INSTANCES 16

struct outputs {
	struct hm2_emulator *card;
	int is_ssr;
	int count;
	uint32_t data[INSTANCES];
	uint32_t rate[INSTANCES];
	int64_t since[INSTANCES];
};

static void *create(struct hm2_emulator *card, const struct card_descriptor *descriptor, int is_ssr)
{
	struct outputs *outputs = calloc(1, sizeof *outputs);
	if (outputs == NULL)
		return NULL;
	outputs->card = card;
	outputs->is_ssr = is_ssr;
	outputs->count = descriptor->instances < INSTANCES ? descriptor->instances : INSTANCES;
	return outputs;
}

static void *ssr_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	return create(card, descriptor, 1);
}

static void *outm_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	return create(card, descriptor, 0);
}

static void outputs_destroy(void *self)
{
	free(self);
}

static uint32_t outputs_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct outputs *outputs = self;
	int index = (int)(offset >> 2);
	if (index >= outputs->count || reg > HM2_SSR_RATE)
		return 0;
	*value = reg == HM2_SSR_DATA ? outputs->data[index] : outputs->rate[index];
	return CARD_ALL_DRIVEN;
}

static int outputs_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct outputs *outputs = self;
	int index = (int)(offset >> 2);
	if (index >= outputs->count || reg > HM2_SSR_RATE)
		return 0;
	if (reg == HM2_SSR_DATA) {
		outputs->data[index] = value;
	} else {
		outputs->rate[index] = value & (HM2_SSR_RATE_ENABLE_MASK | HM2_SSR_RATE_DIVIDER_MASK);
		outputs->since[index] = outputs->card->clock;
	}
	return 1;
}

/* Half a period is divider + 2 clocks. */
static int reference_level(const struct outputs *outputs, int unit)
{
	int64_t half = (int64_t)(outputs->rate[unit] & HM2_SSR_RATE_DIVIDER_MASK) + 2;
	return (int)((outputs->card->clock - outputs->since[unit]) / half) & 1;
}

static int outputs_output(void *self, int unit, int number)
{
	const struct outputs *outputs = self;
	int bit = number - (int)HM2_SSR_PIN_OUT_0;
	if (unit >= outputs->count || bit < 0 || bit > 31)
		return 0;
	int carrier = !outputs->is_ssr || (outputs->rate[unit] & HM2_SSR_RATE_ENABLE_MASK) != 0;
	if (outputs->is_ssr && number == HM2_SSR_PIN_AC_REFERENCE)
		return carrier && reference_level(outputs, unit);
	return carrier && ((outputs->data[unit] >> bit) & 1);
}

static void outputs_power_up(void *self)
{
	struct outputs *outputs = self;
	memset(outputs->data, 0, sizeof outputs->data);
	memset(outputs->rate, 0, sizeof outputs->rate);
}

const struct card_module_type ssr_type = {
	.create = ssr_create,
	.destroy = outputs_destroy,
	.read = outputs_read,
	.write = outputs_write,
	.output = outputs_output,
	.power_up = outputs_power_up,
};

const struct card_module_type outm_type = {
	.create = outm_create,
	.destroy = outputs_destroy,
	.read = outputs_read,
	.write = outputs_write,
	.output = outputs_output,
	.power_up = outputs_power_up,
};
