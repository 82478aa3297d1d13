/* The emulated card under the sanitizers: every register of a card with every module, written and read
 * at random with time and stimulus in between. What comes out is the business of other tests. */
#include "check.h"

#include <string.h>

#include "hm2.h"

#define GPIO 0x03000000u
#define ROUNDS 40000

static uint32_t seed = 1;

static uint32_t random_word(void)
{
	seed ^= seed << 13;
	seed ^= seed >> 17;
	seed ^= seed << 5;
	return seed;
}

static void module(uint32_t *idrom, int row, uint32_t gtag, uint32_t version, uint32_t instances, uint32_t base,
                   uint32_t registers)
{
	uint32_t *words = idrom + 16 + 3 * row;
	words[0] = instances << 24 | 1u << 16 | version << 8 | gtag;
	words[1] = (gtag == 0xC1 ? 0x10000000u : 0) | registers << 16 | base;
	words[2] = 0x3F;
}

static void describe(uint32_t *idrom)
{
	static const uint32_t header[16] = {3,  64, 448,      0x4153454D,  0x54534554, 9,  144, 3,
	                                    72, 24, 33333333, 200000000, 4,          64, 256, 256};
	static const uint32_t pins[] = {0xD81, 0xC01, 0xC02, 0xC03,  0x10C01, 0x10C02, 0x10C03, 0xC05,  0x401,
	                                0x402, 0x403, 0x404, 0x581,  0x582,   0x501,   0x502,   0x681,  0x682,
	                                0x683, 0x1A01, 0x1A82, 0x1A83, 0xC101, 0xC181, 0xC191, 0xC381, 0xC3A0};
	memset(idrom, 0, 256 * sizeof *idrom);
	memcpy(idrom, header, sizeof header);
	module(idrom, 0, 0x1A, 0, 1, 0x7000, 7);
	module(idrom, 1, 0x02, 0, 1, 0x0C00, 3);
	module(idrom, 2, 0x03, 0, 3, 0x1000, 5);
	module(idrom, 3, 0x04, 0x83, 3, 0x3000, 5);
	module(idrom, 4, 0x0C, 0x84, 5, 0x3600, 5);
	module(idrom, 5, 0x0D, 0, 1, 0, 0);
	module(idrom, 6, 0x05, 0xC2, 4, 0x2000, 10);
	module(idrom, 7, 0x06, 0, 3, 0x4100, 5);
	module(idrom, 8, 0xC1, 0, 1, 0x5B00, 6);
	module(idrom, 9, 0xC3, 0, 1, 0x7D00, 2);
	module(idrom, 10, 0x80, 0, 1, 0x0200, 1);
	for (size_t i = 0; i < 72; i++)
		idrom[448 / 4 + i] = GPIO | (i < sizeof pins / sizeof *pins ? pins[i] : 0);
}

static void stimulate(hm2_emulator *card)
{
	int encoder = (int)(random_word() % 10) - 1;
	int64_t value = (int32_t)random_word();
	switch (random_word() % 8) {
	case 0:
		hm2_emulator_encoder_run(card, encoder, value % 1000000, (int64_t)random_word() % 1000 - 500);
		break;
	case 1:
		hm2_emulator_encoder_rate(card, encoder, value * 1024);
		break;
	case 2:
		hm2_emulator_encoder_pulses(card, encoder, value % 1000000, value % 100);
		break;
	case 3:
		hm2_emulator_encoder_index(card, encoder, value % 1000, value % 10);
		break;
	case 4:
		hm2_emulator_encoder_set(card, encoder, (int)(value % 3), (int)(value >> 4) % 3, (int)(value >> 8) % 2);
		break;
	case 5:
		hm2_emulator_encoder_plug(card, encoder, (int)(value & 1));
		break;
	case 6:
		hm2_emulator_set_mux_delay_ps(card, value % 200000);
		break;
	default:
		hm2_emulator_pin_drive(card, (int)(random_word() % 80) - 2, (int)(random_word() % 4) - 1);
		break;
	}
}

static void one_round(hm2_emulator *card)
{
	hm2_error error;
	uint32_t words[4];
	uint32_t address = random_word() % 0x8000u & ~3u;
	if (random_word() % 4)
		address = (0x1000u + random_word() % 0x3C00u) & ~0xE3u;
	for (int i = 0; i < 4; i++)
		words[i] = random_word() >> random_word() % 32;
	size_t count = 1 + random_word() % 4;
	if (random_word() % 2)
		hm2_emulator_write(card, address, words, count, &error);
	else
		hm2_emulator_read(card, address, words, count, &error);
	if (random_word() % 8 == 0)
		stimulate(card);
	if (random_word() % 4 == 0)
		hm2_emulator_advance_ps(card, random_word() % 20000000);
	int pin = (int)(random_word() % 72);
	int level = hm2_emulator_pin_level(card, pin);
	CHECK(level >= HM2_LEVEL_LOW && level <= HM2_LEVEL_CONTENTION);
}

int main(void)
{
	uint32_t idrom[256];
	hm2_emulator *card = NULL;
	hm2_error error;
	hm2_emulator_options options = {.clock = HM2_CLOCK_VIRTUAL, .leds = 4, .interrupt = 1};
	describe(idrom);
	CHECK(hm2_emulator_new(idrom, 256, &options, &card, &error) == HM2_OK);
	CHECK(hm2_emulator_encoders(card) == 8);
	for (int i = 0; i < ROUNDS; i++)
		one_round(card);
	hm2_emulator_free(card);
	for (int i = 0; i < 2000; i++) { /* broken descriptions are refused or harmless */
		describe(idrom);
		idrom[random_word() % 140] = random_word() >> random_word() % 32;
		if (hm2_emulator_new(idrom, 256, &options, &card, &error) == HM2_OK) {
			one_round(card);
			hm2_emulator_free(card);
		}
	}
	return CHECK_RESULT();
}
