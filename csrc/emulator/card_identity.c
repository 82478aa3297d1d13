/* Cookie, configuration name, IDROM and LEDs: the registers every card has (fact sheet registers.md
 * 1.2, 1.3, 2.3; card observed 1). */
#include <string.h>

#include "card_modules.h"

#define IDROM_OFFSET 0x400u

uint32_t card_idrom_field(const struct hm2_emulator *card, uint32_t offset)
{
	return card->idrom[offset / 4];
}

static int bad(hm2_error *error, uint32_t offset, uint32_t expected, uint32_t received)
{
	if (error)
		*error = (hm2_error){.status = HM2_ERR_FORMAT, .index = -1, .address = IDROM_OFFSET + offset,
		                     .expected = expected, .received = received, .where = "emulated idrom"};
	return HM2_ERR_FORMAT;
}

static int load_pins(struct hm2_emulator *card, hm2_error *error)
{
	uint32_t offset = card_idrom_field(card, HM2_IDROM_PIN_OFFSET);
	uint32_t width = card_idrom_field(card, HM2_IDROM_IO_WIDTH);
	if (width > CARD_MAX_PINS || offset % 4 != 0 || offset > 4 * (CARD_IDROM_WORDS - width))
		return bad(error, HM2_IDROM_IO_WIDTH, CARD_MAX_PINS, width);
	for (uint32_t i = 0; i < width; i++) {
		uint32_t word = card->idrom[offset / 4 + i];
		if (word >> 24 != HM2_GTAG_IOPORT)
			return bad(error, offset + 4 * i, HM2_GTAG_IOPORT, word >> 24);
		card->pins[i].number = (uint8_t)word;
		card->pins[i].tag = (uint8_t)(word >> 8);
		card->pins[i].unit = (uint8_t)(word >> 16);
	}
	card->pin_count = (int)width;
	return HM2_OK;
}

int card_identity_load(struct hm2_emulator *card, const uint32_t *idrom, size_t words, hm2_error *error)
{
	if (words < 16 || words > CARD_IDROM_WORDS)
		return bad(error, 0, CARD_IDROM_WORDS, (uint32_t)words);
	memcpy(card->idrom, idrom, words * sizeof *idrom);
	memcpy(card->configured_idrom, card->idrom, sizeof card->idrom);
	uint32_t low = card_idrom_field(card, HM2_IDROM_CLOCK_LOW);
	uint32_t high = card_idrom_field(card, HM2_IDROM_CLOCK_HIGH);
	uint32_t ports = card_idrom_field(card, HM2_IDROM_IO_PORTS);
	uint32_t width = card_idrom_field(card, HM2_IDROM_PORT_WIDTH);
	if (low < 1000000)
		return bad(error, HM2_IDROM_CLOCK_LOW, 1000000, low);
	if (high < 1000000)
		return bad(error, HM2_IDROM_CLOCK_HIGH, 1000000, high);
	if (ports < 1 || ports > CARD_MAX_PORTS)
		return bad(error, HM2_IDROM_IO_PORTS, CARD_MAX_PORTS, ports);
	if (width < 1 || width > 32 || card_idrom_field(card, HM2_IDROM_IO_WIDTH) != ports * width)
		return bad(error, HM2_IDROM_PORT_WIDTH, ports * width, card_idrom_field(card, HM2_IDROM_IO_WIDTH));
	card->ports = (int)ports;
	card->port_width = (int)width;
	card->period_ps = (int64_t)((1000000000000u + low / 2) / low);
	card->high_period_ps = (int64_t)((1000000000000u + high / 2) / high);
	return load_pins(card, error);
}

void card_identity_power_up(struct hm2_emulator *card)
{
	memcpy(card->idrom, card->configured_idrom, sizeof card->idrom);
	card->idrom_writable = 0;
	card->led_latch = 0;
}

static uint32_t id_word(uint32_t address)
{
	static const uint32_t block[4] = {HM2_ID_WORD_COOKIE, HM2_ID_WORD_CONFIG_NAME_LOW,
	                                 HM2_ID_WORD_CONFIG_NAME_HIGH, IDROM_OFFSET};
	return block[(address >> 2) & 3];
}

uint32_t card_identity_read(struct hm2_emulator *card, uint32_t address, uint32_t *value)
{
	uint32_t page = address >> 8;
	if (page == 0x01)
		*value = id_word(address);
	else if (page >= 0x04 && page <= 0x07)
		*value = card->idrom[(address - IDROM_OFFSET) / 4];
	else if (page == 0x08)
		*value = (uint32_t)card->idrom_writable;
	else
		return 0;
	return CARD_ALL_DRIVEN;
}

int card_identity_write(struct hm2_emulator *card, uint32_t address, uint32_t value)
{
	uint32_t page = address >> 8;
	if (page >= 0x04 && page <= 0x07) {
		if (card->idrom_writable)
			card->idrom[(address - IDROM_OFFSET) / 4] = value;
	} else if (page == 0x08) {
		card->idrom_writable = (int)(value & 1);
	} else if (page == 0x02) {
		card->led_latch = value;
	} else {
		return page == 0x01;
	}
	return 1;
}

uint32_t hm2_emulator_leds(const hm2_emulator *card)
{
	CARD_HOLD(card);
	uint32_t lit = 0;
	for (int n = 0; n < card->options.leds; n++)
		if (card->led_latch & (UINT32_C(1) << (31 - n)))
			lit |= UINT32_C(1) << n;
	return lit;
}
