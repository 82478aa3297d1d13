/* The emulated Ethernet card's memory spaces: which writes are refused, when an FPGA is configured anew and from which
 * image, what its flash says while it is programmed. */
#include <string.h>

#include "check.h"
#include "hm2.h"
#include "registers.h"

enum { FALLBACK = 0x10000, USER = 0x20000, KEY = HM2_LBP16_CONTROL_WRITE_KEY, ICAP = HM2_LBP16_CONTROL_ICAP };

static struct hm2_ethernet *card;
static int64_t paused_us;
static uint16_t key;

static void card_read(void *self, uint32_t address, uint32_t *words, size_t count)
{
	(void)self;
	(void)address;
	memset(words, 0, 4 * count);
}

static void card_write(void *self, uint32_t address, const uint32_t *words, size_t count)
{
	(void)self;
	(void)address;
	(void)words;
	(void)count;
}

static void pause_us(void *self, int64_t us)
{
	(void)self;
	paused_us += us;
}

static void start(uint8_t efinix, uint32_t erase_us)
{
	const hm2_ethernet_config config = {.name = "7I92", .flash_id = 0x13, .lbp_version = 3, .firmware_version = 15,
	                                    .efinix = efinix, .erase_us = erase_us};
	const hm2_ethernet_card face = {.read = card_read, .write = card_write, .pause_us = pause_us};
	paused_us = key = 0;
	card = hm2_ethernet_new(&config, &face);
	CHECK(card != NULL);
}

static void end(void)
{
	hm2_ethernet_free(card);
}

/* A word of a space. Returns what was read; the flags of the errors it caused are in `errors`. */
static uint16_t errors;

static uint32_t command(int space, uint32_t address, int write, uint32_t value)
{
	const uint8_t size = space == HM2_LBP16_SPACE_FLASH ? 4 : 2;
	const hm2_lbp16_command one = {.address = (uint16_t)address, .write = (uint8_t)write, .has_address = 1,
	                               .space = (uint8_t)space, .element_size = size, .increment = 1, .count = 1};
	const uint8_t data[4] = {(uint8_t)value, (uint8_t)(value >> 8), (uint8_t)(value >> 16), (uint8_t)(value >> 24)};
	uint8_t packet[16], reply[HM2_LBP16_MAX_PAYLOAD] = {0};
	size_t length = 0;
	hm2_ethernet_poke(card, HM2_LBP16_SPACE_CONTROL, HM2_LBP16_CONTROL_ERROR_FLAGS, 0);
	hm2_ethernet_poke(card, HM2_LBP16_SPACE_CONTROL, KEY, key); /* a card takes it back behind each packet */
	CHECK_EQUAL(hm2_lbp16_put(packet, sizeof packet, &length, &one, data), HM2_OK);
	CHECK_EQUAL(hm2_ethernet_process(card, packet, length, reply), write ? 0 : size);
	errors = hm2_ethernet_peek(card, HM2_LBP16_SPACE_CONTROL, HM2_LBP16_CONTROL_ERROR_FLAGS);
	return (uint32_t)reply[0] | (uint32_t)reply[1] << 8 | (uint32_t)reply[2] << 16 | (uint32_t)reply[3] << 24;
}

static void put(int space, uint32_t address, uint32_t value)
{
	(void)command(space, address, 1, value);
	CHECK_EQUAL(errors, 0);
}

static void icap(const uint16_t *words, size_t count)
{
	for (size_t i = 0; i < count; i++)
		(void)command(HM2_LBP16_SPACE_CONTROL, ICAP, 1, words[i]);
}

#define ICAP_WORDS(...) icap((const uint16_t[]){__VA_ARGS__}, sizeof((const uint16_t[]){__VA_ARGS__}) / 2)

static void flash(uint32_t address, const uint8_t *bytes, size_t count)
{
	CHECK_EQUAL(hm2_ethernet_flash_write(card, address, bytes, count), HM2_OK);
}

static const uint8_t sync_word[4] = {0xAA, 0x99, 0x55, 0x66}, none[4] = {0xFF, 0xFF, 0xFF, 0xFF};

/* A boot block that names this image. */
static void boot_block(uint32_t image)
{
	const uint8_t registers[8] = {0x32, 0x61, (uint8_t)(image >> 8), (uint8_t)image, 0x32, 0x81, 0x0B, (uint8_t)(image >> 16)};
	flash(0, sync_word, 4);
	flash(14, registers, 8);
}

static int image_after_power_up(void)
{
	hm2_ethernet_power_up(card);
	return hm2_ethernet_image(card);
}

static void test_an_address_behind_a_space_is_refused(void)
{
	start(0, 0);
	(void)command(HM2_LBP16_SPACE_TIMER, HM2_LBP16_TIMER_SIZE, 1, 7);
	CHECK_EQUAL(errors, HM2_LBP16_ERROR_MEMORY);
	(void)command(HM2_LBP16_SPACE_EEPROM, HM2_LBP16_EEPROM_SIZE, 1, 7);
	CHECK_EQUAL(errors, HM2_LBP16_ERROR_MEMORY);
	(void)command(HM2_LBP16_SPACE_TIMER, HM2_LBP16_TIMER_TIMESTAMP, 1, 7); /* is taken, and nothing else */
	CHECK_EQUAL(errors, 0);
	CHECK_EQUAL(hm2_ethernet_peek(card, HM2_LBP16_SPACE_TIMER, HM2_LBP16_TIMER_TIMESTAMP), 0);
	put(HM2_LBP16_SPACE_TIMER, HM2_LBP16_TIMER_WAIT, 25);
	CHECK_EQUAL(paused_us, 25);
	CHECK_EQUAL(command(HM2_LBP16_SPACE_TIMER, HM2_LBP16_TIMER_WAIT, 0, 0), 25);
	put(HM2_LBP16_SPACE_TIMER, HM2_LBP16_TIMER_SCRATCH, 0x1234);
	CHECK_EQUAL(command(HM2_LBP16_SPACE_TIMER, HM2_LBP16_TIMER_SCRATCH, 0, 0), 0x1234);
	CHECK_EQUAL(paused_us, 25); /* read, none of them waits */
	end();
}

static void test_the_users_key_does_not_open_name_and_mac(void)
{
	static const struct {
		uint16_t key, address;
		int taken;
	} cases[] = {{0, 0x28, 0}, {HM2_LBP16_KEY_EEPROM, 0x20, 1}, {HM2_LBP16_KEY_EEPROM, 0x1E, 0},
	             {HM2_LBP16_KEY_FLASH, 0x28, 0}, {HM2_LBP16_KEY_FACTORY, 0x02, 1}};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		start(0, 0);
		const uint16_t before = hm2_ethernet_peek(card, HM2_LBP16_SPACE_EEPROM, cases[i].address);
		key = cases[i].key;
		(void)command(HM2_LBP16_SPACE_EEPROM, cases[i].address, 1, 0x1234);
		CHECK_EQUAL(errors, cases[i].taken ? 0 : HM2_LBP16_ERROR_WRITE);
		CHECK_EQUAL(hm2_ethernet_peek(card, HM2_LBP16_SPACE_EEPROM, cases[i].address), cases[i].taken ? 0x1234 : before);
		end();
	}
}

static void test_only_a_reset_that_is_meant_resets(void)
{
	start(0, 0);
	put(HM2_LBP16_SPACE_TIMER, HM2_LBP16_TIMER_SCRATCH, 0x77);
	put(HM2_LBP16_SPACE_CONTROL, HM2_LBP16_CONTROL_RESET, 0);
	CHECK_EQUAL(hm2_ethernet_peek(card, HM2_LBP16_SPACE_TIMER, HM2_LBP16_TIMER_SCRATCH), 0x77);
	put(HM2_LBP16_SPACE_CONTROL, HM2_LBP16_CONTROL_RESET, 1);
	CHECK_EQUAL(hm2_ethernet_peek(card, HM2_LBP16_SPACE_TIMER, HM2_LBP16_TIMER_SCRATCH), 0);
	end();
}

static void test_a_flash_that_is_programmed_does_not_talk(uint32_t erase_us)
{
	start(0, erase_us);
	key = HM2_LBP16_KEY_FLASH;
	put(HM2_LBP16_SPACE_FLASH, HM2_LBP16_FLASH_ADDRESS, 0x100);
	put(HM2_LBP16_SPACE_FLASH, HM2_LBP16_FLASH_DATA, 0x11223344);
	CHECK_EQUAL(command(HM2_LBP16_SPACE_FLASH, HM2_LBP16_FLASH_DATA, 0, 0), 0xFFFFFFFF);
	put(HM2_LBP16_SPACE_FLASH, HM2_LBP16_FLASH_ADDRESS, 0x100);
	CHECK_EQUAL(command(HM2_LBP16_SPACE_FLASH, HM2_LBP16_FLASH_DATA, 0, 0), 0x11223344);
	CHECK_EQUAL(paused_us, 0);
	put(HM2_LBP16_SPACE_FLASH, HM2_LBP16_FLASH_ADDRESS, 0x100);
	put(HM2_LBP16_SPACE_FLASH, HM2_LBP16_FLASH_ERASE, 0);
	CHECK_EQUAL(paused_us, erase_us);
	CHECK_EQUAL(command(HM2_LBP16_SPACE_FLASH, HM2_LBP16_FLASH_DATA, 0, 0), 0xFFFFFFFF);
	end();
}

static void test_which_image_is_booted(void)
{
	start(0, 0);
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_NONE);
	flash(FALLBACK, sync_word, 4);
	flash(USER, sync_word, 4);
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_NONE); /* nothing names them */
	boot_block(USER);
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_USER);
	flash(0, none, 4); /* no boot block without its sync word, or without either half of the address */
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_NONE);
	boot_block(USER);
	flash(14, none, 4);
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_NONE);
	boot_block(USER);
	flash(18, none, 4);
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_NONE);
	boot_block(0xFF0000); /* behind the flash */
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_FALLBACK);
	flash(FALLBACK, none, 4);
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_NONE);
	end();
}

static void test_the_configuration_port_of_a_spartan(void)
{
	start(0, 0);
	boot_block(USER);
	flash(FALLBACK, sync_word, 4);
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_FALLBACK);
	flash(USER, sync_word, 4);
	ICAP_WORDS(0xAA99, 0x5567, 0x3261, 0x0000, 0x3281, 0x0B02, 0x30A1, 0x000E); /* not the sync word */
	CHECK_EQUAL(hm2_ethernet_image(card), HM2_ETHERNET_IMAGE_FALLBACK);
	ICAP_WORDS(0xAA99, 0x5566, 0x3261, 0x0000, 0x3281, 0x0B02, 0x30A1, 0x000D, 0x30C1, 0x000E); /* not this command */
	CHECK_EQUAL(hm2_ethernet_image(card), HM2_ETHERNET_IMAGE_FALLBACK);
	ICAP_WORDS(0x30A1, 0x000E);
	CHECK_EQUAL(hm2_ethernet_image(card), HM2_ETHERNET_IMAGE_USER);
	end();
}

static void test_the_configuration_port_of_an_efinix(void)
{
	static const uint8_t image[4] = {1, 2, 3, 4};
	start(1, 0);
	const uint32_t user = hm2_ethernet_flash_size(card) / 2;
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_NONE);
	flash(0, image, 4);
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_FALLBACK);
	flash(user, image, 4);
	ICAP_WORDS(0x0005, 0x000C, 0x0004, 0x000D); /* selects one and starts the other */
	CHECK_EQUAL(hm2_ethernet_image(card), HM2_ETHERNET_IMAGE_FALLBACK);
	ICAP_WORDS(0x0005, 0x000D);
	CHECK_EQUAL(hm2_ethernet_image(card), HM2_ETHERNET_IMAGE_USER);
	ICAP_WORDS(0x0005, 0x000C);
	CHECK_EQUAL(hm2_ethernet_image(card), HM2_ETHERNET_IMAGE_USER);
	ICAP_WORDS(0x0004, 0x000C);
	CHECK_EQUAL(hm2_ethernet_image(card), HM2_ETHERNET_IMAGE_FALLBACK);
	CHECK_EQUAL(image_after_power_up(), HM2_ETHERNET_IMAGE_USER);
	end();
}

int main(void)
{
	test_an_address_behind_a_space_is_refused();
	test_the_users_key_does_not_open_name_and_mac();
	test_only_a_reset_that_is_meant_resets();
	test_a_flash_that_is_programmed_does_not_talk(0);
	test_a_flash_that_is_programmed_does_not_talk(500);
	test_which_image_is_booted();
	test_the_configuration_port_of_a_spartan();
	test_the_configuration_port_of_an_efinix();
	return CHECK_RESULT();
}
