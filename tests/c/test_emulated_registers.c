/* Every address of emulated cards with every module the emulator knows, in two generations of modules: what a card
 * decodes does not depend on how strict it is, what it does not decode reads as undriven and is refused by a strict one,
 * and no word written anywhere, at any time, gets it out of step with its twin. */
#include <string.h>

#include "check.h"
#include "emulator/card.h"
#include "hm2.h"

enum { PINS = 72, WORDS = HM2_ADDRESS_SPACE / 4, ROUNDS = 6 };

struct module {
	uint8_t gtag, version, instances, registers;
};

static const struct module first[] = {
	{0x01, 0, 1, 3}, {0x02, 0, 1, 3}, {0x03, 0, 3, 5}, {0x04, 2, 2, 5}, {0x05, 0, 2, 10}, {0x06, 0, 2, 5},
	{0x08, 0, 2, 3}, {0x09, 0, 2, 4}, {0x0A, 0, 2, 4}, {0x0C, 3, 2, 5}, {0x0D, 0, 1, 1}, {0x0E, 0, 2, 3},
	{0x13, 0, 2, 4}, {0x1A, 0, 1, 7}, {0x1B, 0, 2, 4}, {0x1C, 0, 2, 4}, {0x23, 0, 2, 5}, {0x2C, 0, 2, 2},
	{0x2D, 0, 1, 1}, {0xC0, 0, 1, 5}, {0xC1, 0, 2, 6}, {0xC3, 0, 1, 2}, {0xC7, 0, 2, 4}, {0xC8, 0, 2, 4},
};
static const struct module second[] = {
	{0x02, 0, 1, 3}, {0x03, 0, 3, 5}, {0x04, 0x83, 2, 5}, {0x05, 0xC2, 2, 10}, {0x06, 1, 2, 5}, {0x0C, 0x84, 2, 5},
	{0x0F, 0, 2, 3}, {0x1A, 0, 1, 7}, {0x1B, 1, 2, 4}, {0x1C, 1, 2, 4}, {0x1E, 0, 2, 5}, {0xC6, 0, 1, 10},
};

static uint32_t seed = 1;

static uint32_t random_word(void)
{
	seed ^= seed << 13;
	seed ^= seed >> 17;
	seed ^= seed << 5;
	return seed;
}

/* Pins of every module, as many of each as there is room for. */
static void describe_pins(uint32_t *idrom, const struct module *modules, uint32_t count)
{
	for (uint32_t i = 0; i < PINS; i++) {
		const struct module *module = &modules[i % count];
		const uint32_t number = i / count + 1, output = i % 2 ? 0x80 : 0;
		idrom[256 - PINS + i] = 0x03000000 | (i / count % module->instances) << 16 | (uint32_t)module->gtag << 8 |
		                        output | number;
	}
}

/* Any function, unit and number: what a module has no such thing for leaves the pin alone. */
static void describe_wild_pins(uint32_t *idrom, const struct module *modules, uint32_t count)
{
	for (uint32_t i = 0; i < PINS; i++) {
		const uint32_t unit = random_word() % 4 ? random_word() % 4 : random_word() % 256;
		const uint32_t number = random_word() % 4 ? random_word() % 40 : random_word() % 256;
		idrom[256 - PINS + i] = 0x03000000 | unit << 16 | (uint32_t)modules[random_word() % count].gtag << 8 | number;
	}
}

typedef void describer(uint32_t *idrom, const struct module *modules, uint32_t count);

static hm2_emulator *new_card(const struct module *modules, uint32_t count, int strict, describer *pins)
{
	static const uint32_t header[16] = {3,    64, 4 * (256 - PINS), 0x4153454D, 0x54534554, 9,  144, 3,
	                                    PINS, 24, 33333333,         200000000,  4,          64, 256, 256};
	const hm2_emulator_options options = {.clock = HM2_CLOCK_VIRTUAL, .strict = strict, .leds = 4, .interrupt = 1};
	uint32_t idrom[256] = {0};
	hm2_emulator *card = NULL;
	hm2_error error;
	memcpy(idrom, header, sizeof header);
	for (uint32_t i = 0; i < count; i++) {
		const struct module *module = &modules[i];
		idrom[16 + 3 * i] = (uint32_t)module->instances << 24 | 1u << 16 | (uint32_t)module->version << 8 | module->gtag;
		idrom[17 + 3 * i] = (uint32_t)module->registers << 16 | (0x1000 + 0xA00 * i);
		idrom[18 + 3 * i] = 0xFFF;
	}
	pins(idrom, modules, count);
	CHECK_EQUAL(hm2_emulator_new(idrom, 256, &options, &card, &error), HM2_OK);
	return card;
}

static void check_read(hm2_emulator *strict, hm2_emulator *lenient, uint32_t address)
{
	uint32_t one = 0, other = 0;
	hm2_error error;
	const int status = hm2_emulator_read(strict, address, &one, 1, &error);
	CHECK_EQUAL(hm2_emulator_read(lenient, address, &other, 1, &error), HM2_OK);
	CHECK(status == HM2_OK || status == HM2_ERR_PROTOCOL);
	CHECK_EQUAL(other, one);
	if (status != HM2_OK)
		CHECK_EQUAL(one, HM2_EMULATOR_UNDRIVEN);
}

static void check_write(hm2_emulator *strict, hm2_emulator *lenient, uint32_t address, uint32_t word)
{
	hm2_error error;
	const int status = hm2_emulator_write(strict, address, &word, 1, &error);
	CHECK_EQUAL(hm2_emulator_write(lenient, address, &word, 1, &error), HM2_OK);
	CHECK(status == HM2_OK || status == HM2_ERR_PROTOCOL);
}

/* Time passes, and sometimes the FPGA is configured anew before: nothing of then is still to come. */
static void pass(hm2_emulator *strict, hm2_emulator *lenient, int64_t ps)
{
	const int64_t before = hm2_emulator_now_ps(strict), clock = hm2_emulator_clocks(strict);
	if (random_word() % 8 == 0) {
		card_power_up(strict);
		card_power_up(lenient);
		CHECK_EQUAL(hm2_emulator_clocks(strict), clock);
	}
	hm2_emulator_advance_ps(strict, ps);
	hm2_emulator_advance_ps(lenient, ps);
	CHECK_EQUAL(hm2_emulator_now_ps(strict), before + ps);
	for (int pin = 0; pin < PINS; pin++)
		CHECK_EQUAL(hm2_emulator_pin_level(strict, pin), hm2_emulator_pin_level(lenient, pin));
	CHECK_EQUAL(hm2_emulator_interrupt(strict), hm2_emulator_interrupt(lenient));
}

/* Everything behind the IDROM; a page that no module has is refused whole. */
static void sweep(const struct module *modules, uint32_t count)
{
	hm2_emulator *strict = new_card(modules, count, 1, describe_pins);
	hm2_emulator *lenient = new_card(modules, count, 0, describe_pins);
	hm2_error error;
	uint32_t word;
	for (int round = 0; round < ROUNDS; round++) {
		const uint32_t end = 0x1000 + 0xA00 * count;
		for (uint32_t address = 0x900; address < end; address += 4) {
			check_read(strict, lenient, address);
			if (random_word() % 4)
				check_write(strict, lenient, address, random_word() >> random_word() % 32);
			if (random_word() % 64 == 0)
				pass(strict, lenient, random_word() % 5000000);
		}
		pass(strict, lenient, 100000000000); /* 0.1 s */
	}
	CHECK_EQUAL(hm2_emulator_read(strict, 0xFF00, &word, 1, &error), HM2_ERR_PROTOCOL);
	CHECK_EQUAL(error.address, 0xFF00);
	CHECK_EQUAL(hm2_emulator_write(strict, 0xFF00, &word, 1, &error), HM2_ERR_PROTOCOL);
	hm2_emulator_free(strict);
	hm2_emulator_free(lenient);
}

/* Whatever its pins are said to be: with all of them outputs of their functions, and inputs, too, levels are levels. */
static void sweep_wild_pins(const struct module *modules, uint32_t count)
{
	hm2_emulator *card = new_card(modules, count, 0, describe_wild_pins);
	hm2_error error;
	for (int round = 0; round < 3; round++) {
		for (uint32_t address = 0x900; address < 0x1000 + 0xA00 * count; address += 4) {
			const uint32_t word = random_word() % 2 ? UINT32_MAX : random_word() >> random_word() % 32;
			CHECK_EQUAL(hm2_emulator_write(card, address, &word, 1, &error), HM2_OK);
		}
		for (int pin = 0; pin < PINS; pin++)
			if (random_word() % 3 == 0)
				CHECK_EQUAL(hm2_emulator_pin_drive(card, pin, (int)(random_word() % 3) - 1), HM2_OK);
		hm2_emulator_advance_ps(card, random_word() % 50000000);
		for (int pin = 0; pin < PINS; pin++) {
			const int level = hm2_emulator_pin_level(card, pin);
			CHECK(level >= HM2_LEVEL_LOW && level <= HM2_LEVEL_CONTENTION);
		}
	}
	hm2_emulator_free(card);
}

int main(void)
{
	for (int i = 0; i < 40; i++) {
		sweep_wild_pins(first, sizeof first / sizeof first[0]);
		sweep_wild_pins(second, sizeof second / sizeof second[0]);
	}
	sweep(first, sizeof first / sizeof first[0]);
	sweep(second, sizeof second / sizeof second[0]);
	return CHECK_RESULT();
}
