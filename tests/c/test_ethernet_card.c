/* An emulated card behind the LBP16 engine: a reload of its FPGA switches everything off, and what no card has does
 * not exist. */
#include <string.h>

#include "check.h"
#include "hm2.h"

enum { IOPORT = 0x1000, WATCHDOG = 0x0C00, COMMAND = 0x5A00 };

static hm2_emulator *card;
static struct hm2_ethernet *ethernet;

static void open_card(uint8_t sserial_tag, uint32_t registers)
{
	const uint32_t idrom[49] = {3, 64, 100, 0x4153454D, 0x54534554, 9, 144, 1, 24, 24, 33333333, 200000000,
	                            4, 64, 256, 256,
	                            0x01010003, 0x00050000 | IOPORT, 0x1F,
	                            0x01010002, 0x00030000 | WATCHDOG, 0,
	                            0x01010000u | sserial_tag, registers << 16 | COMMAND | 0x10000000, 0x3F,};
	const hm2_emulator_options options = {.clock = HM2_CLOCK_VIRTUAL, .wire_off = 1, .sserial_channels = 2};
	const hm2_ethernet_config config = {.name = "7I92", .flash_id = 0x13, .lbp_version = 3, .firmware_version = 15};
	hm2_ethernet_card face;
	uint32_t words[49];
	hm2_error error;
	memcpy(words, idrom, sizeof words);
	for (int i = 0; i < 24; i++)
		words[25 + i] = 0x03000000;
	CHECK_EQUAL(hm2_emulator_new(words, 49, &options, &card, &error), HM2_OK);
	hm2_ethernet_emulator(card, &face);
	ethernet = hm2_ethernet_new(&config, &face);
	CHECK(ethernet != NULL);
}

static void close_card(void)
{
	hm2_ethernet_free(ethernet);
	hm2_emulator_free(card);
}

static uint32_t read_word(uint32_t address)
{
	uint32_t word = 0;
	hm2_error error;
	CHECK_EQUAL(hm2_emulator_read(card, address, &word, 1, &error), HM2_OK);
	return word;
}

static void write_word(uint32_t address, uint32_t word)
{
	hm2_error error;
	CHECK_EQUAL(hm2_emulator_write(card, address, &word, 1, &error), HM2_OK);
}

/* A DOIT; how many answers the remote gave. */
static uint64_t transfer(const hm2_remote *remote)
{
	const uint64_t before = hm2_remote_answers(remote, NULL);
	write_word(COMMAND, 0x1001);
	hm2_emulator_advance_ps(card, 10000000000);
	return hm2_remote_answers(remote, NULL) - before;
}

/* Both kinds of smart serial: a channel that ran is stopped. */
static void test_a_reload_stops_everything(uint8_t tag, uint32_t registers)
{
	hm2_remote *remote = hm2_remote_new();
	open_card(tag, registers);
	CHECK_EQUAL(hm2_emulator_attach(card, 0, 0, remote, 0), HM2_OK);
	hm2_emulator_advance_ps(card, 2000000000);
	write_word(COMMAND, 0x0901);
	hm2_emulator_advance_ps(card, 100000000000);
	CHECK_EQUAL(read_word(COMMAND), 0);
	CHECK(transfer(remote) > 0);
	write_word(IOPORT, 1);
	write_word(IOPORT + 0x100, 1);
	CHECK_EQUAL(hm2_emulator_pin_level(card, 0), HM2_LEVEL_HIGH);
	hm2_emulator_pin_drive(card, 0, HM2_LEVEL_LOW);
	CHECK_EQUAL(hm2_emulator_pin_level(card, 0), HM2_LEVEL_CONTENTION);
	hm2_ethernet_power_up(ethernet);
	CHECK_EQUAL(hm2_emulator_pin_level(card, 0), HM2_LEVEL_LOW); /* nothing drives against it */
	hm2_emulator_pin_drive(card, 0, HM2_LEVEL_HIGH);
	CHECK_EQUAL(hm2_emulator_pin_level(card, 0), HM2_LEVEL_HIGH);
	hm2_emulator_advance_ps(card, 2000000000);
	CHECK_EQUAL(transfer(remote), 0);
	close_card();
	hm2_remote_free(remote);
}

static void test_words_that_no_space_has(void)
{
	open_card(0xC1, 6);
	for (int space = -1; space <= 8; space++)
		for (uint32_t address = 0x100; address < 0x20000; address <<= 1) {
			hm2_ethernet_poke(ethernet, space, address, 0x1234);
			CHECK_EQUAL(hm2_ethernet_peek(ethernet, space, address), 0);
		}
	uint8_t byte = 0;
	const uint32_t size = hm2_ethernet_flash_size(ethernet);
	CHECK_EQUAL(hm2_ethernet_flash_read(ethernet, size, &byte, 1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_ethernet_flash_read(ethernet, size + 1, &byte, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_ethernet_flash_write(ethernet, size, &byte, 1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_ethernet_flash_write(ethernet, size - 1, &byte, 1), HM2_OK);
	close_card();
	const hm2_ethernet_config small = {.flash_id = 0x0F}, large = {.flash_id = 0x19};
	CHECK(hm2_ethernet_new(&small, NULL) == NULL);
	CHECK(hm2_ethernet_new(&large, NULL) == NULL);
}

int main(void)
{
	test_a_reload_stops_everything(0xC1, 6);
	test_a_reload_stops_everything(0xC6, 10);
	test_words_that_no_space_has();
	return CHECK_RESULT();
}
