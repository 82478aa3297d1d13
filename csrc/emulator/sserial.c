/* SSERIAL: the register window and the pins of the SSLBP instances (fact sheet sserial.md 1). */
#include <stdlib.h>

#include "card_modules.h"
#include "sslbp.h"

#define MAX_INSTANCES 4
#define MAX_CHANNELS 8
#define NO_PIN (-1)
#define TRANSMIT 0x80 /* of a pin's number, beside its channel + 1 */

struct line {
	int receive_pin;
	int transmit_pin;
	int enable_pin;
	int through_pins;
};

struct instance {
	struct hm2_sslbp *sslbp;
	int channels;
	int slots; /* channels rounded up to a power of two: what the address decodes */
	struct line lines[MAX_CHANNELS];
};

struct sserial {
	struct hm2_emulator *card;
	int count;
	struct instance instances[MAX_INSTANCES];
};

static void sserial_destroy(void *self)
{
	struct sserial *sserial = self;
	for (int i = 0; i < sserial->count; i++)
		hm2_sslbp_free(sserial->instances[i].sslbp);
	free(sserial);
}

static void find_pins(struct sserial *sserial, uint8_t gtag, int unit)
{
	struct instance *instance = &sserial->instances[unit];
	for (int c = 0; c < MAX_CHANNELS; c++)
		instance->lines[c] = (struct line){NO_PIN, NO_PIN, NO_PIN, 1};
	for (int i = 0; i < sserial->card->pin_count; i++) {
		const struct card_pin *pin = &sserial->card->pins[i];
		int channel = (pin->number & 0x0F) - 1;
		if (pin->tag != gtag || pin->unit != unit || channel < 0 || channel >= MAX_CHANNELS)
			continue;
		if ((pin->number & 0xF0) == 0x00)
			instance->lines[channel].receive_pin = i;
		else if ((pin->number & 0xF0) == TRANSMIT)
			instance->lines[channel].transmit_pin = i;
		else if ((pin->number & 0xF0) == 0x90)
			instance->lines[channel].enable_pin = i;
		if ((pin->number & 0xF0) == 0x00 && channel >= instance->channels)
			instance->channels = channel + 1;
	}
}

static int create_instance(struct sserial *sserial, const struct card_descriptor *descriptor, int unit)
{
	struct instance *instance = &sserial->instances[unit];
	const struct hm2_emulator_options *options = &sserial->card->options;
	find_pins(sserial, descriptor->gtag, unit);
	if (options->sserial_channels > 0)
		instance->channels = options->sserial_channels;
	if (instance->channels < 1)
		instance->channels = 1;
	if (instance->channels > MAX_CHANNELS)
		instance->channels = MAX_CHANNELS;
	for (instance->slots = 1; instance->slots < instance->channels;)
		instance->slots *= 2;
	instance->sslbp = hm2_sslbp_new(instance->channels, descriptor->registers - 3, options->sserial_clock_hz);
	if (instance->sslbp == NULL)
		return 0;
	hm2_sslbp_set_wire(instance->sslbp, !options->wire_off);
	return 1;
}

static void *sserial_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	struct sserial *sserial = calloc(1, sizeof *sserial);
	if (sserial == NULL)
		return NULL;
	sserial->card = card;
	while (sserial->count < descriptor->instances && sserial->count < MAX_INSTANCES) {
		if (!create_instance(sserial, descriptor, sserial->count)) {
			sserial_destroy(sserial);
			return NULL;
		}
		sserial->count++;
	}
	return sserial;
}

static void sserial_advance(void *self, int64_t clock)
{
	struct sserial *sserial = self;
	/* The serial processor has a clock of its own: follow the card's time, not its edges. */
	int64_t now = sserial->card->now_ps;
	if (clock > sserial->card->clock)
		now = card_edge_ps(sserial->card, clock);
	for (int i = 0; i < sserial->count; i++)
		hm2_sslbp_advance(sserial->instances[i].sslbp, now);
}

static struct instance *decode(struct sserial *sserial, int reg, uint32_t offset, int *channel)
{
	int unit = (int)(offset >> 6);
	if (unit >= sserial->count)
		return NULL;
	struct instance *instance = &sserial->instances[unit];
	*channel = 0;
	if (reg >= HM2_SSERIAL_CS)
		*channel = (int)(offset >> 2) & 15 & (instance->slots - 1); /* a slot without a channel reads 0 */
	return instance;
}

static uint32_t sserial_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	int channel;
	struct instance *instance = decode(self, reg, offset, &channel);
	if (instance == NULL)
		return 0;
	*value = hm2_sslbp_read(instance->sslbp, reg, channel);
	return CARD_ALL_DRIVEN;
}

static int sserial_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	int channel;
	struct instance *instance = decode(self, reg, offset, &channel);
	if (instance == NULL)
		return 0;
	hm2_sslbp_write(instance->sslbp, reg, channel, value);
	return 1;
}

static int switched(const struct ioport *port, int pin, int output, int without)
{
	return pin == NO_PIN ? without : ioport_is_switched(port, pin, output);
}

static void sserial_pins_changed(void *self)
{
	struct sserial *sserial = self;
	const struct ioport *port = sserial->card->ioport;
	for (int i = 0; i < sserial->count; i++) {
		struct instance *instance = &sserial->instances[i];
		for (int c = 0; c < instance->channels; c++) {
			const struct line *line = &instance->lines[c];
			int receive = !line->through_pins || switched(port, line->receive_pin, 0, 0);
			int transmit = !line->through_pins || (switched(port, line->transmit_pin, 1, 0) &&
			                                       switched(port, line->enable_pin, 1, 1));
			hm2_sslbp_connect(instance->sslbp, c, receive, transmit);
		}
	}
}

/* What a transmit enable shows no source says. */
static int sserial_output(void *self, int unit, int number)
{
	const struct sserial *sserial = self;
	int channel = (number & 0x0F) - 1;
	if (unit >= sserial->count || (number & 0xF0) != TRANSMIT || channel < 0 ||
	    channel >= sserial->instances[unit].channels)
		return 0;
	return hm2_sslbp_transmit_level(sserial->instances[unit].sslbp, channel, sserial->card->now_ps);
}

int sserial_attach(const struct card_module *module, int instance, int channel, struct hm2_remote *remote,
                   int through_pins)
{
	struct sserial *sserial = module->self;
	if (instance < 0 || instance >= sserial->count)
		return HM2_ERR_RANGE;
	if (channel < 0 || channel >= sserial->instances[instance].channels)
		return HM2_ERR_RANGE;
	sserial->instances[instance].lines[channel].through_pins = through_pins;
	sserial_pins_changed(sserial);
	hm2_sslbp_attach(sserial->instances[instance].sslbp, channel, remote);
	return HM2_OK;
}

int sserial_channels(const struct card_module *module, int instance)
{
	const struct sserial *sserial = module->self;
	return instance >= 0 && instance < sserial->count ? sserial->instances[instance].channels : 0;
}

size_t sserial_line_records(const struct card_module *module, int instance, hm2_line_record *records,
                            size_t capacity)
{
	const struct sserial *sserial = module->self;
	if (instance < 0 || instance >= sserial->count)
		return 0;
	return hm2_sslbp_line_records(sserial->instances[instance].sslbp, records, capacity);
}

static void sserial_power_up(void *self)
{
	struct sserial *sserial = self;
	for (int i = 0; i < sserial->count; i++)
		hm2_sslbp_power_up(sserial->instances[i].sslbp);
}

const struct card_module_type sserial_type = {
	.create = sserial_create,
	.destroy = sserial_destroy,
	.read = sserial_read,
	.write = sserial_write,
	.advance = sserial_advance,
	.output = sserial_output,
	.pins_changed = sserial_pins_changed,
	.power_up = sserial_power_up,
};
