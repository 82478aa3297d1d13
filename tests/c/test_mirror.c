/* A card behind shared memory: what its driver writes arrives in list order, what it shows is the card's, and what
 * cannot be mirrored is refused. */
#include <string.h>

#include "check.h"
#include "hm2.h"

enum { DDR = 0x1100, DATA = 0x1000, NOWHERE = 0x8000 };

static uint32_t shared[HM2_ADDRESS_SPACE / 4];

static hm2_emulator *new_card(int strict)
{
	static const uint32_t idrom[43] = {3, 64, 76, 0x4153454D, 0x54534554, 9, 144, 1, 24, 24, 33333333, 200000000,
	                                   4, 64, 256, 256, 0x01010003, 0x00051000, 0x1F};
	const hm2_emulator_options options = {.clock = HM2_CLOCK_VIRTUAL, .strict = strict};
	uint32_t words[64];
	hm2_emulator *card = NULL;
	hm2_error error;
	memcpy(words, idrom, sizeof idrom);
	for (int i = 0; i < 24; i++)
		words[19 + i] = 0x03000000;
	CHECK_EQUAL(hm2_emulator_new(words, 43, &options, &card, &error), HM2_OK);
	memset(shared, 0, sizeof shared);
	return card;
}

static void test_writes_arrive_and_words_are_shown(void)
{
	hm2_emulator *card = new_card(1);
	hm2_mirror_word words[] = {{DATA, 0, 1}, {DDR, 0, 0}};
	uint32_t seen[2];
	hm2_error error;
	CHECK_EQUAL(hm2_emulator_mirror(card, shared, words, seen, 2, &error), HM2_OK);
	CHECK_EQUAL(shared[DATA / 4], 0xFFFFFF); /* floating pads */
	CHECK_EQUAL(shared[DDR / 4], HM2_EMULATOR_UNDRIVEN); /* not readable */
	shared[DATA / 4] = 5;
	shared[DDR / 4] = 7;
	CHECK_EQUAL(hm2_emulator_mirror_looks(card, shared, words, seen, 2, 2, 1000, &error), HM2_OK);
	CHECK_EQUAL(shared[DATA / 4], 0xFFFFFD);
	CHECK_EQUAL(hm2_emulator_pin_level(card, 0), HM2_LEVEL_HIGH);
	CHECK_EQUAL(hm2_emulator_pin_level(card, 1), HM2_LEVEL_LOW);
	CHECK_EQUAL(hm2_emulator_pin_level(card, 2), HM2_LEVEL_HIGH);
	hm2_emulator_free(card);
}

static void test_words_that_cannot_be_mirrored(void)
{
	hm2_emulator *card = new_card(1);
	hm2_mirror_word words[] = {{2, 0, 1}, {HM2_ADDRESS_SPACE, 0, 1}, {NOWHERE, 0, 1}, {NOWHERE, 0, 0}};
	uint32_t seen[1];
	hm2_error error;
	CHECK_EQUAL(hm2_emulator_mirror(card, shared, &words[0], seen, 1, &error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_mirror(card, shared, &words[1], seen, 1, &error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_mirror(card, shared, &words[2], seen, 1, &error), HM2_ERR_PROTOCOL); /* read */
	CHECK_EQUAL(error.address, NOWHERE);
	shared[NOWHERE / 4] = 1;
	CHECK_EQUAL(hm2_emulator_mirror_looks(card, shared, &words[3], seen, 1, 3, 0, &error), HM2_ERR_PROTOCOL);
	hm2_emulator_free(card);
}

/* Motors are parts of the card: when it has no room, the caller is told. */
static void test_a_card_takes_only_so_many_motors(void)
{
	static hm2_dc_motor motor = {.rotor = {.inertia = 1, .encoder = -1, .low_limit = 1}, .resistance = 1, .inductance = 1};
	static hm2_pm_motor brushless = {.rotor = {.inertia = 1, .encoder = 200, .low_limit = 1}};
	hm2_emulator *card = new_card(0);
	hm2_error error;
	int motors = 0;
	CHECK_EQUAL(hm2_emulator_add_pm_motor(card, &brushless, &error), HM2_OK);
	while (hm2_emulator_add_dc_motor(card, &motor, &error) == HM2_OK && motors < 1000)
		motors++;
	CHECK(motors > 0 && motors < 1000);
	CHECK_EQUAL(error.status, HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_add_dc_motor(card, &motor, NULL), HM2_ERR_RANGE);
	motor.rotor.load = brushless.rotor.load = 1.0;
	hm2_emulator_advance_ps(card, 1000000000); /* 1 ms at 1 rad/s^2, for each part that steps it */
	CHECK(brushless.rotor.speed > 0.0009 && brushless.rotor.speed < 0.0011);
	hm2_emulator_free(card);
}

int main(void)
{
	test_writes_arrive_and_words_are_shown();
	test_words_that_cannot_be_mirrored();
	test_a_card_takes_only_so_many_motors();
	return CHECK_RESULT();
}
