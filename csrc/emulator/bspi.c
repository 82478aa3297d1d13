/* Buffered SPI (fact sheet registers.md 2.11): words wait in a FIFO with their channel's descriptor, go out
 * one after the other and, with echo, leave a received word. What a slave answers is put there by hand;
 * without an answer the input floats high. A descriptor pushed more than 16 times goes round (ours). */
#include <stdlib.h>
#include <string.h>

#include "card_modules.h"

#define DEPTH 16
#define KEPT 256 /* words sent, answers */
#define FIFO_STRIDE_LSB 6
#define NO_DELAY 0x10u
#define FIELD(d, name) (((d) & HM2_BSPI_DESCRIPTOR_FIFO_##name##_MASK) >> HM2_BSPI_DESCRIPTOR_FIFO_##name##_LSB)

struct word {
	uint32_t value;
	uint32_t channel;
};

struct bus {
	uint32_t descriptors[DEPTH];
	int pushed;
	struct word transmit[DEPTH];
	int waiting;
	int64_t started;     /* of the first */
	uint32_t receive[DEPTH];
	int received;
	uint32_t answers[KEPT];
	int answer_count;
	hm2_spi_record sent[KEPT];
	int sent_count;
	int out_pin;
};

struct bspi {
	struct hm2_emulator *card;
	int count;
	struct bus buses[];
};

static void *create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	struct bspi *bspi = calloc(1, sizeof *bspi + descriptor->instances * sizeof bspi->buses[0]);
	if (bspi == NULL)
		return NULL;
	bspi->card = card;
	bspi->count = descriptor->instances;
	for (int i = 0; i < bspi->count; i++)
		bspi->buses[i].out_pin = card_pin_of(card, descriptor->gtag, i, HM2_BSPI_PIN_OUT);
	return bspi;
}

static void destroy(void *self)
{
	free(self);
}

static int64_t word_clocks(uint32_t descriptor)
{
	int64_t bit = 2 * ((int64_t)FIELD(descriptor, DIVIDER) + 1);
	int64_t delay = FIELD(descriptor, SELECT_DELAY);
	return ((int64_t)FIELD(descriptor, BITS) + 1) * bit + (delay >= NO_DELAY ? 0 : delay + 1);
}

static uint32_t of_bits(uint32_t value, uint32_t bits)
{
	return bits >= 32 ? value : value & ((UINT32_C(1) << bits) - 1);
}

static void shift_out(struct bspi *bspi, struct bus *bus)
{
	const struct word *word = &bus->transmit[0];
	uint32_t descriptor = bus->descriptors[word->channel];
	uint32_t bits = FIELD(descriptor, BITS) + 1;
	int switched = bus->out_pin < 0 || ioport_is_switched(bspi->card->ioport, bus->out_pin, 1);
	uint32_t answer = UINT32_MAX;
	if (switched && bus->answer_count) {
		answer = bus->answers[0];
		memmove(bus->answers, bus->answers + 1, (size_t)--bus->answer_count * sizeof bus->answers[0]);
	}
	if (switched && bus->sent_count < KEPT)
		bus->sent[bus->sent_count++] = (hm2_spi_record){of_bits(word->value, bits), bits,
		                                                FIELD(descriptor, CHIP_SELECT), word->channel};
	if (!(descriptor & HM2_BSPI_DESCRIPTOR_FIFO_NO_ECHO_MASK) && bus->received < DEPTH)
		bus->receive[bus->received++] = of_bits(answer, bits);
}

static void advance(void *self, int64_t clock)
{
	struct bspi *bspi = self;
	for (int i = 0; i < bspi->count; i++) {
		struct bus *bus = &bspi->buses[i];
		while (bus->waiting) {
			int64_t end = bus->started + word_clocks(bus->descriptors[bus->transmit[0].channel]);
			if (clock < end)
				break;
			shift_out(bspi, bus);
			bus->waiting--;
			memmove(bus->transmit, bus->transmit + 1, (size_t)bus->waiting * sizeof bus->transmit[0]);
			bus->started = end;
		}
	}
}

static uint32_t read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	struct bspi *bspi = self;
	int index = (int)(offset >> (reg == HM2_BSPI_DATA ? FIFO_STRIDE_LSB : 2));
	if (index >= bspi->count || (reg != HM2_BSPI_DATA && reg != HM2_BSPI_COUNT))
		return 0;
	struct bus *bus = &bspi->buses[index];
	if (reg == HM2_BSPI_COUNT) {
		*value = (uint32_t)bus->received << HM2_BSPI_COUNT_RECEIVE_LSB |
		         (uint32_t)bus->waiting << HM2_BSPI_COUNT_TRANSMIT_LSB;
		return CARD_ALL_DRIVEN;
	}
	*value = bus->received ? bus->receive[0] : 0;
	if (bus->received)
		memmove(bus->receive, bus->receive + 1, (size_t)--bus->received * sizeof bus->receive[0]);
	return CARD_ALL_DRIVEN;
}

static int write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct bspi *bspi = self;
	int index = (int)(offset >> (reg == HM2_BSPI_DATA ? FIFO_STRIDE_LSB : 2));
	if (index >= bspi->count || reg > HM2_BSPI_COUNT)
		return 0;
	struct bus *bus = &bspi->buses[index];
	if (reg == HM2_BSPI_DESCRIPTOR_FIFO) {
		bus->descriptors[DEPTH - 1 - bus->pushed % DEPTH] = value; /* the last channel comes first */
		bus->pushed++;
	} else if (reg == HM2_BSPI_COUNT) {
		bus->waiting = bus->received = 0;
	} else if (bus->waiting < DEPTH) {
		if (bus->waiting == 0)
			bus->started = bspi->card->clock;
		bus->transmit[bus->waiting++] = (struct word){value, offset >> 2 & (DEPTH - 1)};
	}
	return 1;
}

/* Selects and frame are low while a word of theirs goes out; clock and data idle low. */
static int output(void *self, int unit, int number)
{
	const struct bspi *bspi = self;
	if (unit >= bspi->count)
		return 0;
	const struct bus *bus = &bspi->buses[unit];
	uint32_t descriptor = bus->waiting ? bus->descriptors[bus->transmit[0].channel] : 0;
	int select = number - (int)HM2_BSPI_PIN_SELECT_0;
	if (number == HM2_BSPI_PIN_NOT_FRAME)
		return bus->waiting == 0;
	if (select >= 0)
		return bus->waiting == 0 || FIELD(descriptor, CHIP_SELECT) != (uint32_t)select;
	if (bus->waiting == 0)
		return 0;
	int64_t bit = (bspi->card->clock - bus->started) / (2 * ((int64_t)FIELD(descriptor, DIVIDER) + 1));
	int64_t shift = (int64_t)FIELD(descriptor, BITS) - bit;
	if (number == HM2_BSPI_PIN_OUT)
		return shift >= 0 && shift < 32 && ((bus->transmit[0].value >> shift) & 1);
	int half = (int)((bspi->card->clock - bus->started) / ((int64_t)FIELD(descriptor, DIVIDER) + 1)) & 1;
	return half ^ (int)FIELD(descriptor, CPOL);
}

static struct bus *bus_of(hm2_emulator *card, int unit)
{
	struct bspi *all = card_instances(card, card_find(card, HM2_GTAG_BSPI) ? HM2_GTAG_BSPI : HM2_GTAG_DBSPI, unit);
	return all ? &all->buses[unit] : NULL;
}

int hm2_emulator_bspi_answer(hm2_emulator *card, int unit, const uint32_t *words, size_t count)
{
	CARD_HOLD(card);
	struct bus *bus = bus_of(card, unit);
	if (bus == NULL || count > (size_t)(KEPT - bus->answer_count))
		return HM2_ERR_RANGE;
	for (size_t i = 0; i < count; i++)
		bus->answers[bus->answer_count++] = words[i];
	return HM2_OK;
}

int hm2_emulator_bspi_sent(hm2_emulator *card, int unit, hm2_spi_record *records, size_t capacity, size_t *count)
{
	CARD_HOLD(card);
	struct bus *bus = bus_of(card, unit);
	if (bus == NULL)
		return HM2_ERR_RANGE;
	*count = (size_t)bus->sent_count < capacity ? (size_t)bus->sent_count : capacity;
	memcpy(records, bus->sent, *count * sizeof records[0]);
	bus->sent_count = 0;
	return HM2_OK;
}

const struct card_module_type bspi_type = {
	.create = create,
	.destroy = destroy,
	.read = read,
	.write = write,
	.advance = advance,
	.output = output,
};
