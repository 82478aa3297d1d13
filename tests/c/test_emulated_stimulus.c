/* The outside of an emulated card and of a remote: what there is none of, and what no signal can be, is refused. */
#include <string.h>

#include "check.h"
#include "hm2.h"

static hm2_emulator *new_card(const uint8_t *tags, uint32_t count)
{
	static const uint32_t header[16] = {3, 64, 928, 0x4153454D, 0x54534554, 9, 144, 1, 24, 24, 33333333, 200000000,
	                                    4, 64, 256, 256};
	const hm2_emulator_options options = {.clock = HM2_CLOCK_VIRTUAL, .leds = 4};
	uint32_t idrom[256] = {0};
	hm2_emulator *card = NULL;
	hm2_error error;
	memcpy(idrom, header, sizeof header);
	for (uint32_t i = 0; i < count; i++) {
		idrom[16 + 3 * i] = 0x02010000u | tags[i];
		idrom[17 + 3 * i] = (tags[i] == 0xC1 ? 6u : 5u) << 16 | (0x1000 + 0xA00 * i);
	}
	idrom[16] = 0x01010003; /* the IOPort comes first */
	for (uint32_t i = 0; i < 24; i++)
		idrom[232 + i] = 0x03000000;
	CHECK_EQUAL(hm2_emulator_new(idrom, 256, &options, &card, &error), HM2_OK);
	return card;
}

/* Everything that names an instance: OK for a number that exists, HM2_ERR_RANGE for others. */
static void check_instance(hm2_emulator *card, int instance, int expected)
{
	static uint8_t bytes[2048];
	hm2_remote *remote = NULL;
	hm2_spi_record record;
	uint32_t angle, word = 1;
	int64_t position;
	size_t count;
	CHECK_EQUAL(hm2_emulator_encoder_run(card, instance, 1000, 1), expected);
	CHECK_EQUAL(hm2_emulator_encoder_pulses(card, instance, 1000, 1), expected);
	CHECK_EQUAL(hm2_emulator_encoder_rate(card, instance, 1), expected);
	CHECK_EQUAL(hm2_emulator_encoder_set(card, instance, 0, 1, 0), expected);
	CHECK_EQUAL(hm2_emulator_encoder_index(card, instance, 10, 1), expected);
	CHECK_EQUAL(hm2_emulator_encoder_preset(card, instance, 1), expected);
	CHECK_EQUAL(hm2_emulator_encoder_plug(card, instance, 1), expected);
	CHECK_EQUAL(hm2_emulator_encoder_position(card, instance, &position), expected);
	CHECK_EQUAL(hm2_emulator_inmux_set(card, instance, 1), expected);
	CHECK_EQUAL(hm2_emulator_period_signal(card, instance, 1000, 500), expected);
	CHECK_EQUAL(hm2_emulator_resolver_set(card, instance, 1, 1), expected);
	CHECK_EQUAL(hm2_emulator_resolver_flag(card, instance, 1), expected);
	CHECK_EQUAL(hm2_emulator_resolver_angle(card, instance, &angle), expected);
	CHECK_EQUAL(hm2_emulator_ssi_set(card, instance, 1, 1), expected);
	CHECK_EQUAL(hm2_emulator_uart_send(card, instance, bytes, 1), expected);
	CHECK_EQUAL(hm2_emulator_uart_received(card, instance, bytes, sizeof bytes, &count), expected);
	CHECK_EQUAL(hm2_emulator_pktuart_send(card, instance, bytes, 1, 0), expected);
	CHECK_EQUAL(hm2_emulator_pktuart_received(card, instance, bytes, sizeof bytes, &count), expected);
	CHECK_EQUAL(hm2_emulator_bspi_answer(card, instance, &word, 1), expected);
	CHECK_EQUAL(hm2_emulator_bspi_sent(card, instance, &record, 1, &count), expected);
	CHECK_EQUAL(hm2_emulator_attach(card, instance, 0, remote, 0), expected);
	CHECK_EQUAL(hm2_emulator_sserial_channels(card, instance) > 0, expected == HM2_OK);
}

static const uint8_t tags[] = {0x03, 0x04, 0x08, 0x09, 0x0A, 0x0E, 0x1B, 0x1C, 0x1E, 0xC0, 0xC1, 0xC8};

static void test_instances_that_are_there_and_others(void)
{
	hm2_emulator *card = new_card(tags, sizeof tags), *bare = new_card(tags, 1);
	hm2_line_record record;
	check_instance(card, 0, HM2_OK);
	check_instance(card, 1, HM2_OK);
	check_instance(card, 99, HM2_ERR_RANGE);
	check_instance(card, -1, HM2_ERR_RANGE);
	check_instance(bare, 0, HM2_ERR_RANGE); /* the module itself is missing */
	CHECK_EQUAL(hm2_emulator_attach(card, 0, -1, NULL, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_attach(card, 0, 8, NULL, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_line_records(card, 0, &record, 1), 0);
	CHECK_EQUAL(hm2_emulator_line_records(card, 9, &record, 1), 0);
	CHECK_EQUAL(hm2_emulator_line_records(bare, 0, &record, 1), 0);
	CHECK_EQUAL(hm2_emulator_interrupt(bare), 0);
	hm2_emulator_free(bare);
	hm2_emulator_free(card);
}

static void test_signals_that_cannot_be(void)
{
	static uint8_t bytes[5000];
	static uint32_t words[257];
	hm2_emulator *card = new_card(tags, sizeof tags);
	size_t count;
	CHECK_EQUAL(hm2_emulator_pin_drive(card, -1, HM2_LEVEL_LOW), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_pin_drive(card, hm2_emulator_pins(card), HM2_LEVEL_LOW), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_pin_drive(card, 0, HM2_LEVEL_FLOATING), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_pin_drive(card, 0, -2), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_pin_level(card, -1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_pin_level(card, hm2_emulator_pins(card)), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_encoder_run(card, 0, 0, 1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_encoder_pulses(card, 0, 1, 1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_encoder_rate(card, 0, INT64_MAX), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_encoder_rate(card, 0, INT64_MIN), HM2_ERR_RANGE);
	for (int i = 0; i < 3; i++)
		for (int wrong = -2; wrong <= 2; wrong += 4)
			CHECK_EQUAL(hm2_emulator_encoder_set(card, 0, i == 0 ? wrong : 0, i == 1 ? wrong : 0, i == 2 ? wrong : 0),
			            HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_encoder_index(card, 0, -1, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_encoder_index(card, 0, 0, -1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_set_mux_delay_ps(card, -1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_set_mux_delay_ps(card, 1000000001), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_period_signal(card, 0, -1, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_period_signal(card, 0, 1, -1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_period_signal(card, 0, 1, 2), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_resolver_set(card, 0, 0, 1e7), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_uart_send(card, 0, bytes, 4097), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_uart_send(card, 0, bytes, 4096), HM2_OK);
	CHECK_EQUAL(hm2_emulator_uart_send(card, 0, bytes, 1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_pktuart_send(card, 0, bytes, 0, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_pktuart_send(card, 0, bytes, 1024, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_pktuart_received(card, 0, bytes, 1022, &count), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_bspi_answer(card, 0, words, 257), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_emulator_bspi_answer(card, 0, words, 256), HM2_OK);
	CHECK_EQUAL(hm2_emulator_bspi_answer(card, 0, words, 1), HM2_ERR_RANGE);
	hm2_emulator_free(card);
}

static void test_a_level_put_on_a_pad_is_seen_and_let_go(void)
{
	hm2_emulator *card = new_card(tags, sizeof tags);
	const uint32_t ddr = 1, one = 1;
	hm2_error error;
	CHECK_EQUAL(hm2_emulator_pin_level(card, 0), HM2_LEVEL_FLOATING);
	CHECK_EQUAL(hm2_emulator_pin_drive(card, 0, HM2_LEVEL_LOW), HM2_OK);
	CHECK_EQUAL(hm2_emulator_pin_level(card, 0), HM2_LEVEL_LOW);
	CHECK_EQUAL(hm2_emulator_pin_drive(card, 0, HM2_LEVEL_HIGH), HM2_OK);
	CHECK_EQUAL(hm2_emulator_pin_level(card, 0), HM2_LEVEL_HIGH);
	CHECK_EQUAL(hm2_emulator_pin_drive(card, 0, HM2_LEVEL_LOW), HM2_OK);
	CHECK_EQUAL(hm2_emulator_write(card, 0x1000, &one, 1, &error), HM2_OK);
	CHECK_EQUAL(hm2_emulator_write(card, 0x1100, &ddr, 1, &error), HM2_OK);
	CHECK_EQUAL(hm2_emulator_pin_level(card, 0), HM2_LEVEL_CONTENTION);
	CHECK_EQUAL(hm2_emulator_pin_drive(card, 0, HM2_LEVEL_RELEASE), HM2_OK);
	CHECK_EQUAL(hm2_emulator_pin_level(card, 0), HM2_LEVEL_HIGH);
	hm2_emulator_free(card);
}

/* ---- remotes ---- */

static void test_remotes_that_cannot_be(void)
{
	static uint8_t bytes[256];
	hm2_remote *remote = hm2_remote_new();
	CHECK_EQUAL(hm2_remote_set(remote, -1, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_KNOBS, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_MODEL, 3), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_MODEL, -1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_set_inputs(remote, bytes, 256), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_peek(remote, 0, 0xFFFF, bytes, 2), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_poke(remote, 0, 0x10000, bytes, 1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_load(remote, 0xFFFF, bytes, 2), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_eeprom(remote, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_eeprom(remote, HM2_REMOTE_EEPROM_MAX + 1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_eeprom(remote, 64), HM2_OK);
	CHECK_EQUAL(hm2_remote_add_copy(remote, 60, 0, 5), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_copy(remote, 0, 0xFFFF, 2), HM2_ERR_RANGE);
	int copies = 0;
	while (hm2_remote_add_copy(remote, 0, 0, 4) == HM2_OK && copies < 100000)
		copies++;
	CHECK(copies > 0 && copies < 100000);
	CHECK_EQUAL(hm2_remote_allow(remote, 0, 2, 1, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_allow(remote, -1, 1, 2, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_allow(remote, 256, 1, 2, 0), HM2_ERR_RANGE);
	int ranges = 0;
	while (hm2_remote_allow(remote, 0, 1, 2, 0) == HM2_OK && ranges < 100000)
		ranges++;
	CHECK(ranges > 0 && ranges < 100000);
	hm2_remote_free(remote);
	hm2_remote_free(NULL);
}

static void test_flashes_that_cannot_be(void)
{
	static const int wrong[][3] = {{0x10000, 12, -1}, {0x10000, 12, 13}, {0x10000, 4, 8},        {0x10000, 21, 8},
	                               {0, 12, 8},        {0x1800, 12, 8},   {0x100000 * 2, 12, 8}};
	hm2_remote *remote = hm2_remote_new();
	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
		CHECK_EQUAL(hm2_remote_add_flash(remote, (size_t)wrong[i][0], wrong[i][1], wrong[i][2]), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_flash(remote, 0x10000, 12, 8), HM2_OK);
	CHECK_EQUAL(hm2_remote_add_flash(remote, 0x10000, 12, 8), HM2_ERR_RANGE); /* it has one */
	hm2_remote_free(remote);
}

static void test_modes_that_cannot_be(void)
{
	hm2_remote *remote = hm2_remote_new();
	CHECK_EQUAL(hm2_remote_add_element(remote, 0, 8, 0x80, 0), HM2_ERR_RANGE); /* no mode yet */
	CHECK_EQUAL(hm2_remote_add_mode(remote, 0, 0, 1, 0, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_mode(remote, 1, 5, 4, 0, 0), HM2_OK);
	CHECK_EQUAL(hm2_remote_add_element(remote, 0, 8, 0x80, 0), HM2_ERR_RANGE); /* not the last one */
	CHECK_EQUAL(hm2_remote_add_element(remote, 1, 0, 0x80, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_element(remote, 1, 32, 0x80, 0xFFFE), HM2_ERR_RANGE);
	for (int i = 0; i < 10; i++) { /* 255 bytes each way are the most; what was refused takes no room */
		const int fits = i < 8;
		CHECK_EQUAL(hm2_remote_add_element(remote, 1, 255, 0x80, 0x100), fits ? HM2_OK : HM2_ERR_RANGE);
	}
	for (int i = 0; i < 10; i++)
		CHECK_EQUAL(hm2_remote_add_element(remote, 1, 255, 0x00, 0x100), i < 8 ? HM2_OK : HM2_ERR_RANGE);
	int modes = 1;
	while (hm2_remote_add_mode(remote, (uint8_t)(modes + 1), 5, 4, 0, 0) == HM2_OK && modes < 1000)
		modes++;
	CHECK(modes < 1000);
	hm2_remote_free(remote);
}

int main(void)
{
	test_instances_that_are_there_and_others();
	test_signals_that_cannot_be();
	test_a_level_put_on_a_pad_is_seen_and_let_go();
	test_remotes_that_cannot_be();
	test_flashes_that_cannot_be();
	test_modes_that_cannot_be();
	return CHECK_RESULT();
}
