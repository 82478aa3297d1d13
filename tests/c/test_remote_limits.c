/* The emulated remote where its table, its flash, its memory and its frames end: what a host does wrong is refused and
 * noted, and changes nothing. Frames without CRC where nothing else is said. */
#include <string.h>

#include "check.h"
#include "hm2.h"

enum { BIT_PS = 400000, BYTE_PS = 10 * BIT_PS, BUFFER = 0x10, INVALID = 0x20 };

static hm2_remote *remote;
static uint8_t answer[400];
static int64_t now_ps;

static void start(int crc)
{
	now_ps = 0;
	remote = hm2_remote_new();
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_CRC, crc), HM2_OK);
}

static void end(void)
{
	hm2_remote_free(remote);
}

static size_t send(const uint8_t *frame, size_t length)
{
	return hm2_remote_exchange(remote, frame, length, answer, sizeof answer);
}

#define BYTES(...) (const uint8_t[]){__VA_ARGS__}, sizeof((const uint8_t[]){__VA_ARGS__})
#define SEND(...) send(BYTES(__VA_ARGS__))

/* Refused for this; the status is clear again. */
#define REFUSED(status, ...)                                                    \
	do {                                                                        \
		CHECK_EQUAL(SEND(__VA_ARGS__), 0);                                      \
		CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_STATUS), status);         \
		CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_STATUS, 0), HM2_OK);      \
	} while (0)

static uint8_t at(int space, uint32_t address)
{
	uint8_t byte = 0;
	CHECK_EQUAL(hm2_remote_peek(remote, space, address, &byte, 1), HM2_OK);
	return byte;
}

/* Byte by byte on the line, one right after the other. The bytes that came back. */
static size_t speak(const uint8_t *bytes, size_t length)
{
	hm2_line_byte byte;
	size_t count = 0;
	for (size_t i = 0; i < length; i++, now_ps += BYTE_PS) {
		byte = (hm2_line_byte){.start_ps = now_ps, .bit_ps = BIT_PS, .value = bytes[i]};
		hm2_remote_line_receive(remote, &byte);
	}
	for (; hm2_remote_line_peek(remote, &byte); hm2_remote_line_pop(remote))
		answer[count++] = byte.value;
	return count;
}

#define SPEAK(...) speak(BYTES(__VA_ARGS__))

static void test_a_write_with_too_few_bytes_writes_nothing(void)
{
	start(0);
	REFUSED(INVALID, 0x65, 0x00, 0x01, 0x55);
	CHECK_EQUAL(at(0, 0x100), 0);
	CHECK_EQUAL(SEND(0x65, 0x00, 0x01, 0x55, 0x66), 0);
	CHECK_EQUAL(at(0, 0x100), 0x55);
	end();
}

static void test_crc_is_told_as_it_is(void)
{
	static const uint8_t read_crc_enable[] = {0xC2, 0x76};
	start(1);
	CHECK_EQUAL(send(read_crc_enable, 2), 2);
	CHECK_EQUAL(answer[0], 0xFF);
	end();
}

/* The line knows how many bytes a stored RPC takes: those of its writes that do not carry their own. */
static void test_stored_rpcs_on_the_line(void)
{
	start(0);
	CHECK_EQUAL(SEND(0xEA, 1), 0);
	CHECK_EQUAL(SEND(0x66, 0, 0, 0x45, 0x00, 0x01, 0x00), 0);                         /* 0: read a word at 0x100 */
	CHECK_EQUAL(SEND(0x67, 8, 0, 0x74, 0x02, 0x01, 0x99, 0x64, 0x03, 0x01, 0x00), 0); /* 1: 0x99 to 0x102, one to 0x103 */
	CHECK_EQUAL(SEND(0x66, 16, 0, 0x40, 0x60, 0x00, 0x00), 0);                        /* 2: read, write at the pointer */
	CHECK_EQUAL(SEND(0x65, 24, 0, 0xC1, 0x00), 0);                                    /* 3: no data access */
	CHECK_EQUAL(SEND(0xEA, 0), 0);
	CHECK_EQUAL(SPEAK(0x80), 2);
	CHECK_EQUAL(SPEAK(0x81), 0);
	CHECK_EQUAL(at(0, 0x102), 0);
	CHECK_EQUAL(SPEAK(0x42), 0);
	CHECK_EQUAL(at(0, 0x102), 0x99);
	CHECK_EQUAL(at(0, 0x103), 0x42);
	CHECK_EQUAL(SPEAK(0x82), 0);
	CHECK_EQUAL(SPEAK(0x43), 1);
	CHECK_EQUAL(answer[0], 0x42); /* read before it is written */
	CHECK_EQUAL(at(0, 0x103), 0x43);
	CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_STATUS), 0);
	CHECK_EQUAL(SPEAK(0x83), 0);
	CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_STATUS), INVALID);
	end();
}

/* The last RPC ends with the table. */
static void test_a_stored_rpc_at_the_end_of_the_table(void)
{
	start(0);
	for (uint32_t i = 0; i < 8; i++)
		hm2_remote_poke(remote, 0, 0x100 + i, (const uint8_t[]){(uint8_t)(i + 1)}, 1);
	CHECK_EQUAL(SEND(0xEA, 1), 0);
	CHECK_EQUAL(SEND(0x67, 0xF8, 0x01, 0x44, 0x00, 0x01, 0x48, 0x48, 0x48, 0x48, 0x48), 0); /* six bytes from 0x100 */
	CHECK_EQUAL(SEND(0xEA, 0), 0);
	CHECK_EQUAL(SPEAK(0xBF), 6);
	CHECK_EQUAL(answer[0], 1);
	CHECK_EQUAL(answer[1], 1); /* only what follows moves the pointer */
	CHECK_EQUAL(answer[5], 5);
	CHECK_EQUAL(SEND(0xEA, 1), 0);
	CHECK_EQUAL(SEND(0x64, 0xFF, 0x01, 0x44), 0); /* its address would lie behind the table */
	CHECK_EQUAL(SEND(0xEA, 0), 0);
	CHECK_EQUAL(SPEAK(0xBF), 0);
	CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_STATUS), INVALID);
	end();
}

static void test_a_stored_rpc_reaches_no_further_than_others(void)
{
	start(0);
	CHECK_EQUAL(SEND(0xEA, 1), 0);
	CHECK_EQUAL(SEND(0x67, 0, 0, 0x44, 0x00, 0x02, 0x44, 0x00, 0x01, 0x00, 0x00), 0);
	CHECK_EQUAL(SEND(0xEA, 0), 0);
	CHECK_EQUAL(SEND(0x80), 2);
	CHECK_EQUAL(hm2_remote_allow(remote, 0, 0x100, 0x1FF, 0), HM2_OK);
	REFUSED(INVALID, 0x80);
	end();
}

/* ---- flash ---- */

enum { FLASH = 2, FLASH_SIZE = 0x1000 };

static void start_with_flash(void)
{
	start(0);
	CHECK_EQUAL(hm2_remote_add_flash(remote, FLASH_SIZE, 8, 6), HM2_OK); /* erased by 256 bytes, written by 64 */
	CHECK_EQUAL(SEND(0xEC, FLASH), 0);
}

static void test_the_window_of_a_flash(void)
{
	start_with_flash();
	CHECK_EQUAL(SEND(0x66, 0x00, 0x80, 0x40, 0x00, 0x00, 0x00), 0); /* to 0x40 */
	CHECK_EQUAL(SEND(0x46, 0x00, 0x80), 4);
	CHECK_EQUAL(answer[0], 0x40);
	CHECK_EQUAL(SEND(0x45, 0x04, 0x80), 2);
	CHECK_EQUAL(answer[0], 8);
	CHECK_EQUAL(answer[1], 6);
	REFUSED(INVALID, 0x46, 0x06, 0x80); /* beyond its registers */
	CHECK_EQUAL(SEND(0x44, 0x3F, 0x00), 1);
	REFUSED(INVALID, 0x45, 0x3F, 0x00); /* beyond the block */
	REFUSED(INVALID, 0x65, 0x3F, 0x00, 1, 2);
	REFUSED(INVALID, 0x65, 0x00, 0x80, 0x80, 0x00); /* half an offset */
	REFUSED(INVALID, 0x65, 0x07, 0x80, 0xFD, 0x00); /* a commit is one byte */
	CHECK_EQUAL(at(FLASH, 0x40), 0xFF);
	CHECK_EQUAL(SEND(0x64, 0x00, 0x00, 0x5A), 0);
	REFUSED(INVALID, 0x64, 0x07, 0x80, 0xFC); /* no such commit */
	CHECK_EQUAL(at(FLASH, 0x40), 0xFF);
	CHECK_EQUAL(SEND(0x64, 0x07, 0x80, 0xFD), 0);
	CHECK_EQUAL(at(FLASH, 0x40), 0x5A);
	CHECK_EQUAL(at(FLASH, 0x41), 0x00); /* what the buffer held */
	CHECK_EQUAL(at(FLASH, 0x80), 0xFF);
	CHECK_EQUAL(SEND(0x66, 0x00, 0x80, 0x00, 0x10, 0x00, 0x00), 0); /* behind the last byte */
	REFUSED(INVALID, 0x64, 0x07, 0x80, 0xFD);
	REFUSED(INVALID, 0x64, 0x07, 0x80, 0xFE);
	end();
}

static void test_a_remote_without_a_flash_has_no_window(void)
{
	uint8_t byte = 0;
	start(0);
	CHECK_EQUAL(SEND(0xEC, FLASH), 0);
	REFUSED(INVALID, 0x46, 0x00, 0x80);
	REFUSED(INVALID, 0x64, 0x00, 0x00, 0x5A);
	CHECK_EQUAL(hm2_remote_peek(remote, FLASH, 0, &byte, 1), HM2_ERR_RANGE);
	end();
}

/* The table goes before the flash. */
static void test_the_table_is_open_whatever_the_space(void)
{
	start_with_flash();
	CHECK_EQUAL(SEND(0xEA, 1), 0);
	CHECK_EQUAL(SEND(0x65, 0x00, 0x00, 0xDF, 0x00), 0);
	CHECK_EQUAL(SEND(0x44, 0x00, 0x00), 1);
	CHECK_EQUAL(answer[0], 0xDF);
	CHECK_EQUAL(SEND(0xEA, 0), 0);
	CHECK_EQUAL(SEND(0x44, 0x00, 0x00), 1);
	CHECK_EQUAL(answer[0], 0x00); /* the flash's buffer */
	CHECK_EQUAL(hm2_remote_peek(remote, FLASH, FLASH_SIZE + 1, answer, 1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_peek(remote, FLASH, FLASH_SIZE - 1, answer, 2), HM2_ERR_RANGE);
	end();
}

/* ---- the fault byte ---- */

static int64_t fault_after(const uint8_t *frame, size_t length)
{
	CHECK_EQUAL(send(frame, length), 0);
	return hm2_remote_get(remote, HM2_REMOTE_FAULT);
}

static void test_a_fault_byte_in_ram_is_written_where_faults_clear(void)
{
	start(0);
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_FAULT_ADDRESS, 0x104), HM2_OK);
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_FAULT, 0x21), HM2_OK);
	CHECK_EQUAL(fault_after(BYTES(0x66, 0x00, 0x01, 0, 0, 0, 0)), 0x21); /* right before it */
	CHECK_EQUAL(fault_after(BYTES(0x66, 0x05, 0x01, 0, 0, 0, 0)), 0x21); /* right behind it */
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_FAULT_CLEARS, 0), HM2_OK);
	CHECK_EQUAL(fault_after(BYTES(0x64, 0x04, 0x01, 0x01)), 0x21);
	CHECK_EQUAL(at(0, 0x104), 0x21);
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_FAULT_CLEARS, 1), HM2_OK);
	CHECK_EQUAL(fault_after(BYTES(0x66, 0x01, 0x01, 0, 0, 0, 0x02)), 0x02);
	CHECK_EQUAL(hm2_remote_add_mode(remote, 0, 1, 0, 0, 0), HM2_OK);
	CHECK_EQUAL(SEND(0xE6, 7), 0); /* no such mode: this cannot be cleared away */
	const int64_t illegal = fault_after(BYTES(0x64, 0x04, 0x01, 0x00));
	CHECK(illegal != 0);
	CHECK_EQUAL(at(0, 0x104), illegal);
	end();
}

/* ---- frames ---- */

static void test_answers_said_twice_or_with_more_end_with_their_room(void)
{
	const hm2_fault twice = {.step = 1, .kind = HM2_FAULT_TWICE}, longer = {.step = 1, .kind = HM2_FAULT_LONG, .value = 300};
	uint8_t frame[40];
	memset(frame, 0x43, sizeof frame); /* 8 bytes each */
	for (size_t i = 0; i < 2; i++) {
		start(0);
		CHECK_EQUAL(send(frame, 39), 312);
		hm2_remote_set_faults(remote, i ? &longer : &twice, 1);
		CHECK_EQUAL(send(frame, 39), 320);
		CHECK_EQUAL(answer[312], i ? 0xE0 : 0);
		end();
	}
}

static void test_frames_of_nothing_or_of_too_much(void)
{
	static const uint8_t zeroes[400];
	start(1);
	CHECK_EQUAL(send(zeroes, 0), 0);
	CHECK_EQUAL(send(zeroes, 1), 0); /* the CRC of nothing */
	CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_STATUS), 0);
	CHECK_EQUAL(send(zeroes, 321), 0);
	CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_STATUS), 0); /* not even looked at */
	end();
	start(0);
	CHECK_EQUAL(send(zeroes, 321), 0);
	CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_STATUS), 0);
	end();
}

static void test_a_line_without_a_timeout_waits_for_ever(void)
{
	for (int timeout = 0; timeout < 2; timeout++) {
		start(0);
		CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_TIMEOUT_BITS, timeout ? 40 : 0), HM2_OK);
		CHECK_EQUAL(SPEAK(0x44, 0x00), 0);
		now_ps += 1000 * (int64_t)BYTE_PS;
		CHECK_EQUAL(SPEAK(0x01), !timeout);
		CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_STATUS) != 0, timeout);
		end();
	}
}

static void test_a_line_discards_what_can_be_no_frame_until_a_gap(void)
{
	start(0);
	CHECK_EQUAL(SPEAK(0x00, 0xDF), 0); /* no such command */
	CHECK(hm2_remote_get(remote, HM2_REMOTE_STATUS) & INVALID);
	now_ps += 100 * (int64_t)BYTE_PS;
	CHECK_EQUAL(SPEAK(0xDF), 1);
	hm2_remote_line_pop(remote); /* nothing is there */
	CHECK_EQUAL(SPEAK(0xDF), 1);
	end();
	start(1);
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_TRANSMIT_SIZE, 255), HM2_OK);
	for (int i = 0; i < 100; i++)
		CHECK_EQUAL(SPEAK(0xDF), 0); /* 100 commands of a frame, and one that has no room */
	CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_STATUS), 0);
	CHECK_EQUAL(SPEAK(0xBD), 0);
	CHECK(hm2_remote_get(remote, HM2_REMOTE_STATUS) & BUFFER);
	end();
}

static uint8_t crc8_add(uint8_t crc, uint8_t byte)
{
	crc ^= byte;
	for (int bit = 0; bit < 8; bit++)
		crc = (uint8_t)(crc & 1 ? crc >> 1 ^ 0x8C : crc >> 1);
	return crc;
}

static void test_the_longest_frame_needs_its_crc(void)
{
	for (int good = 0; good < 2; good++) {
		uint8_t crc = 0;
		start(1);
		for (int i = 0; i < 159; i++) {
			const uint8_t command[] = {crc == 0xE4 ? 0xE5 : 0xE4, (uint8_t)i}; /* into a local register */
			CHECK_EQUAL(speak(command, 2), 0);
			crc = crc8_add(crc8_add(crc, command[0]), command[1]);
		}
		CHECK_EQUAL(SPEAK(0xDF), 0); /* 319 bytes; then comes their CRC, or it is no frame */
		crc = crc8_add(crc, 0xDF);
		CHECK_EQUAL(SPEAK(good ? crc : (uint8_t)~crc), good ? 2 : 0);
		CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_STATUS) & BUFFER, good ? 0 : BUFFER);
		end();
	}
}

int main(void)
{
	test_a_write_with_too_few_bytes_writes_nothing();
	test_crc_is_told_as_it_is();
	test_stored_rpcs_on_the_line();
	test_a_stored_rpc_at_the_end_of_the_table();
	test_a_stored_rpc_reaches_no_further_than_others();
	test_the_window_of_a_flash();
	test_a_remote_without_a_flash_has_no_window();
	test_the_table_is_open_whatever_the_space();
	test_a_fault_byte_in_ram_is_written_where_faults_clear();
	test_answers_said_twice_or_with_more_end_with_their_room();
	test_frames_of_nothing_or_of_too_much();
	test_a_line_without_a_timeout_waits_for_ever();
	test_a_line_discards_what_can_be_no_frame_until_a_gap();
	test_the_longest_frame_needs_its_crc();
	return CHECK_RESULT();
}
