/* FIFOs of emulated modules that have no room: what is too much is lost, said where the hardware says it, and neither
 * what was there before nor what comes later is touched. No pins: what is sent gets out. */
#include <string.h>

#include "check.h"
#include "hm2.h"
#include "registers.h"

enum { STRIDE = 0x100, TX = 0x1000, RX = 0x2000, PACKETS_TX = 0x3000, PACKETS_RX = 0x4000, SPI = 0x5000, PINS = 24 };
enum { TX_MODE = HM2_UART_TX_MODE * STRIDE, TX_COUNT = HM2_UART_TX_COUNT * STRIDE, FASTEST = 0xFFFFF };

static hm2_emulator *card;

static void start(void)
{
	static const struct {
		uint32_t gtag, registers, base;
	} modules[] = {{HM2_GTAG_UART_TX, 4, TX}, {HM2_GTAG_UART_RX, 4, RX}, {HM2_GTAG_PKTUART_TX, 4, PACKETS_TX},
	               {HM2_GTAG_PKTUART_RX, 4, PACKETS_RX}, {HM2_GTAG_BSPI, 3, SPI}, {HM2_GTAG_IOPORT, 5, 0x6000}};
	static const uint32_t header[16] = {3,    64, 4 * (256 - PINS), 0x4153454D, 0x54534554, 9,  144, 1,
	                                    PINS, 24, 33333333,         200000000,  4,          64, STRIDE, STRIDE};
	const hm2_emulator_options options = {.clock = HM2_CLOCK_VIRTUAL, .strict = 1};
	uint32_t idrom[256] = {0};
	memcpy(idrom, header, sizeof header);
	for (uint32_t i = 0; i < sizeof modules / sizeof *modules; i++) {
		idrom[16 + 3 * i] = 1u << 24 | 1u << 16 | modules[i].gtag;
		idrom[17 + 3 * i] = modules[i].registers << 16 | modules[i].base;
		idrom[18 + 3 * i] = 0xFFF;
	}
	for (uint32_t i = 256 - PINS; i < 256; i++)
		idrom[i] = HM2_GTAG_IOPORT << 24; /* GPIO */
	CHECK_EQUAL(hm2_emulator_new(idrom, 256, &options, &card, NULL), HM2_OK);
}

static void end(void)
{
	hm2_emulator_free(card);
}

static void put(uint32_t address, uint32_t word)
{
	CHECK_EQUAL(hm2_emulator_write(card, address, &word, 1, NULL), HM2_OK);
}

static uint32_t get(uint32_t address)
{
	uint32_t word = 0;
	CHECK_EQUAL(hm2_emulator_read(card, address, &word, 1, NULL), HM2_OK);
	return word;
}

static void pass_ms(int64_t ms)
{
	hm2_emulator_advance_ps(card, ms * 1000000000);
}

static void test_a_uarts_fifo_takes_sixteen_entries(void)
{
	uint8_t bytes[64];
	size_t count = 0;
	start();
	for (uint32_t i = 0; i < 17; i++) {
		CHECK_EQUAL(get(TX + TX_MODE) & HM2_UART_TX_MODE_FIFO_ERROR_MASK, 0);
		put(TX, i);
	}
	CHECK_EQUAL(get(TX + TX_MODE), HM2_UART_TX_MODE_FIFO_ERROR_MASK);
	CHECK_EQUAL(get(TX + TX_COUNT), 16);
	put(TX + HM2_UART_TX_BIT_RATE * STRIDE, FASTEST);
	pass_ms(10);
	CHECK_EQUAL(get(TX + TX_COUNT), 0);
	CHECK_EQUAL(hm2_emulator_uart_received(card, 0, bytes, sizeof bytes, &count), HM2_OK);
	CHECK_EQUAL(count, 16);
	for (uint8_t i = 0; i < 16; i++)
		CHECK_EQUAL(bytes[i], i);
	end();
}

/* Bytes on their way are not delayed by those put behind them, and none at all are no bytes. */
static void test_bytes_for_a_uart_queue_up(void)
{
	static const uint8_t bytes[] = {1, 2, 3};
	start();
	put(RX + HM2_UART_RX_BIT_RATE * STRIDE, 105); /* 3 ms a byte */
	CHECK_EQUAL(hm2_emulator_uart_send(card, 0, bytes, 2), HM2_OK);
	pass_ms(2);
	CHECK_EQUAL(hm2_emulator_uart_send(card, 0, bytes + 2, 1), HM2_OK);
	CHECK_EQUAL(hm2_emulator_uart_send(card, 0, NULL, 0), HM2_OK);
	pass_ms(6);
	CHECK_EQUAL(get(RX + HM2_UART_RX_COUNT * STRIDE), 2);
	pass_ms(2);
	CHECK_EQUAL(get(RX + HM2_UART_RX_COUNT * STRIDE), 3);
	for (uint32_t i = 1; i <= 3; i++)
		CHECK_EQUAL(get(RX), i);
	CHECK_EQUAL(get(RX + HM2_UART_RX_COUNT * STRIDE), 0);
	end();
}

static void test_a_packet_uart_takes_sixteen_frames(void)
{
	static uint8_t bytes[1023];
	size_t count = 0;
	start();
	for (uint32_t i = 0; i < 17; i++) {
		CHECK_EQUAL(get(PACKETS_TX + TX_MODE) & HM2_PKTUART_TX_MODE_FRAME_FIFO_ERROR_MASK, 0);
		put(PACKETS_TX, i);
		put(PACKETS_TX + HM2_PKTUART_TX_FRAME_COUNT * STRIDE, 1);
	}
	CHECK(get(PACKETS_TX + TX_MODE) & HM2_PKTUART_TX_MODE_FRAME_FIFO_ERROR_MASK);
	put(PACKETS_TX + HM2_PKTUART_TX_BIT_RATE * STRIDE, FASTEST);
	pass_ms(10);
	for (uint32_t i = 0; i < 16; i++) {
		CHECK_EQUAL(hm2_emulator_pktuart_received(card, 0, bytes, sizeof bytes, &count), 1);
		CHECK_EQUAL(count, 1);
		CHECK_EQUAL(bytes[0], i);
	}
	CHECK_EQUAL(hm2_emulator_pktuart_received(card, 0, bytes, sizeof bytes, &count), 0);
	end();
}

/* 2 KiB of data: what does not fit is not sent. */
static void test_a_packet_uart_takes_so_many_words(void)
{
	static uint8_t bytes[1023];
	size_t count = 0;
	start();
	for (uint32_t i = 0; i < 520; i++)
		put(PACKETS_TX, 0x01010101 * (i < 512 ? i / 256 + 1 : 9));
	for (int i = 0; i < 2; i++)
		put(PACKETS_TX + HM2_PKTUART_TX_FRAME_COUNT * STRIDE, 1020);
	put(PACKETS_TX + HM2_PKTUART_TX_BIT_RATE * STRIDE, FASTEST);
	pass_ms(100);
	for (int i = 0; i < 2; i++) {
		CHECK_EQUAL(hm2_emulator_pktuart_received(card, 0, bytes, sizeof bytes, &count), 1);
		CHECK_EQUAL(count, 1020);
		CHECK(bytes[1016] < 9);
	}
	end();
}

static void test_a_packet_uart_that_is_not_read_loses_frames(void)
{
	static const uint8_t frame[900];
	for (int few_and_long = 0; few_and_long < 2; few_and_long++) {
		const size_t size = few_and_long ? sizeof frame : 1;
		const uint32_t room = few_and_long ? 2 : 16;
		start();
		put(PACKETS_RX + TX_MODE, HM2_PKTUART_RX_MODE_RECEIVE_ENABLE_MASK);
		for (uint32_t i = 0; i <= room; i++) {
			CHECK_EQUAL(get(PACKETS_RX + TX_MODE) & HM2_PKTUART_RX_MODE_FRAME_FIFO_ERROR_MASK, 0);
			CHECK_EQUAL(hm2_emulator_pktuart_send(card, 0, frame, size, 0), HM2_OK);
		}
		const uint32_t mode = get(PACKETS_RX + TX_MODE);
		CHECK(mode & HM2_PKTUART_RX_MODE_FRAME_FIFO_ERROR_MASK);
		CHECK_EQUAL((mode & HM2_PKTUART_RX_MODE_FRAMES_WAITING_MASK) >> HM2_PKTUART_RX_MODE_FRAMES_WAITING_LSB, room);
		end();
	}
}

/* What nobody takes from the outside is kept up to a number, and the module goes on. */
static void test_nobody_takes_what_is_sent(void)
{
	static uint8_t bytes[1023];
	static hm2_spi_record records[300];
	size_t count = 0, frames = 0;
	start();
	put(PACKETS_TX + HM2_PKTUART_TX_BIT_RATE * STRIDE, FASTEST);
	put(SPI + HM2_BSPI_DESCRIPTOR_FIFO * STRIDE, 7); /* 8 bits of channel 15 */
	for (uint32_t i = 0; i < 300; i++) {
		put(PACKETS_TX, i);
		put(PACKETS_TX + HM2_PKTUART_TX_FRAME_COUNT * STRIDE, 1);
		put(SPI + 4 * 15, i & 0xFF);
		pass_ms(1);
	}
	CHECK_EQUAL(get(SPI + HM2_BSPI_COUNT * STRIDE), 16 << HM2_BSPI_COUNT_RECEIVE_LSB); /* echoes: as many as there is room for */
	CHECK_EQUAL(hm2_emulator_bspi_sent(card, 0, records, 300, &count), HM2_OK);
	CHECK_EQUAL(count, 256);
	CHECK_EQUAL(records[255].value, 255);
	while (hm2_emulator_pktuart_received(card, 0, bytes, sizeof bytes, &count) == 1)
		CHECK_EQUAL(bytes[0], frames++ & 0xFF);
	CHECK_EQUAL(frames, 64);
	end();
}

static void test_nobody_takes_what_a_uart_sends(void)
{
	static uint8_t bytes[5000];
	size_t count = 0;
	start();
	put(TX + HM2_UART_TX_BIT_RATE * STRIDE, FASTEST);
	for (uint32_t i = 0; i < 1100; i++) {
		put(TX + 4 * 3, 0x01010101 * (i & 0x7F));
		pass_ms(1);
	}
	CHECK_EQUAL(hm2_emulator_uart_received(card, 0, bytes, sizeof bytes, &count), HM2_OK);
	CHECK_EQUAL(count, 4096);
	CHECK_EQUAL(bytes[4095], 1023 & 0x7F);
	put(TX, 0x55);
	pass_ms(1);
	CHECK_EQUAL(hm2_emulator_uart_received(card, 0, bytes, sizeof bytes, &count), HM2_OK);
	CHECK_EQUAL(count, 1);
	CHECK_EQUAL(bytes[0], 0x55);
	end();
}

static void test_a_spis_fifo_takes_sixteen_words(void)
{
	hm2_spi_record records[32];
	size_t count = 0;
	start();
	put(SPI + HM2_BSPI_DESCRIPTOR_FIFO * STRIDE, 7 | HM2_BSPI_DESCRIPTOR_FIFO_DIVIDER_MASK);
	for (uint32_t i = 0; i < 20; i++)
		put(SPI + 4 * 15, i);
	CHECK_EQUAL(get(SPI + HM2_BSPI_COUNT * STRIDE), 16 << HM2_BSPI_COUNT_TRANSMIT_LSB);
	pass_ms(10);
	CHECK_EQUAL(hm2_emulator_bspi_sent(card, 0, records, 32, &count), HM2_OK);
	CHECK_EQUAL(count, 16);
	CHECK_EQUAL(records[15].value, 15);
	end();
}

int main(void)
{
	test_a_uarts_fifo_takes_sixteen_entries();
	test_bytes_for_a_uart_queue_up();
	test_a_packet_uart_takes_sixteen_frames();
	test_a_packet_uart_takes_so_many_words();
	test_a_packet_uart_that_is_not_read_loses_frames();
	test_nobody_takes_what_is_sent();
	test_nobody_takes_what_a_uart_sends();
	test_a_spis_fifo_takes_sixteen_words();
	return CHECK_RESULT();
}
