/* A remote obeys LBP commands, several in a frame: local registers, stored RPCs, and what it refuses. Frames without
 * CRC; their answers come without one, too (lbp_serial.md). */
#include <string.h>

#include "check.h"
#include "hm2.h"

static hm2_remote *remote;
static uint8_t answer[400];

static void start(void)
{
	remote = hm2_remote_new();
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_CRC, 0), HM2_OK);
}

static void end(void)
{
	hm2_remote_free(remote);
}

static size_t send(const uint8_t *frame, size_t length)
{
	return hm2_remote_exchange(remote, frame, length, answer, sizeof answer);
}

#define SEND(...) send((const uint8_t[]){__VA_ARGS__}, sizeof((const uint8_t[]){__VA_ARGS__}))

/* What is written to a local register is read back, but where the register means something else. */
static void test_local_registers(void)
{
	static const uint8_t kept[] = {0x00, 0x01, 0x03, 0x04, 0x05, 0x08, 0x09, 0x0B, 0x0C, 0x0D};
	start();
	for (size_t i = 0; i < sizeof kept; i++) {
		CHECK_EQUAL(SEND((uint8_t)(0xE0 | kept[i]), 0x15), 0);
		CHECK_EQUAL(SEND((uint8_t)(0xC0 | kept[i])), 1);
		CHECK_EQUAL(answer[0], 0x15);
		CHECK_EQUAL(SEND((uint8_t)(0xE0 | kept[i]), 0), 0);
	}
	CHECK_EQUAL(SEND(0xF8, 0x34), 0);
	CHECK_EQUAL(SEND(0xF9, 0x12), 0);
	CHECK_EQUAL(SEND(0xFA, 0x01), 0); /* adds to the pointer */
	CHECK_EQUAL(SEND(0xD8, 0xD9), 2);
	CHECK_EQUAL(answer[0], 0x35);
	CHECK_EQUAL(answer[1], 0x12);
	CHECK_EQUAL(SEND(0xE2, 0), 0); /* CRC enable: not the line's to change */
	CHECK_EQUAL(SEND(0xC2), 1);
	CHECK_EQUAL(answer[0], 0);
	CHECK_EQUAL(SEND(0xFD, 0x77), 0);
	CHECK_EQUAL(SEND(0xDB), 1);
	CHECK_EQUAL(answer[0], 0x77); /* written there, read here */
	CHECK_EQUAL(SEND(0xFE, 0x11), 0); /* not the key: no reset */
	CHECK_EQUAL(SEND(0xDB), 1);
	CHECK_EQUAL(answer[0], 0x77);
	CHECK_EQUAL(SEND(0xF7, 0x03), 0);
	CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_LEDS), 3);
	CHECK_EQUAL(SEND(0xE7, 0), 0); /* clears no faults */
	CHECK_EQUAL(SEND(0xFE, 0x5A), 0);
	CHECK_EQUAL(SEND(0xDB), 1);
	CHECK_EQUAL(answer[0], 0);
	end();
}

/* A list of commands in the remote's table, run by one byte; data of its writes come from the list or from the frame. */
static void test_stored_rpcs(void)
{
	uint8_t byte = 0;
	start();
	hm2_remote_poke(remote, 0, 0x100, (const uint8_t[]){0x11, 0x22}, 2);
	CHECK_EQUAL(SEND(0x80), 0); /* nothing stored there */
	CHECK_EQUAL(SEND(0xEA, 1), 0);
	CHECK_EQUAL(SEND(0x66, 0, 0, 0x45, 0x00, 0x01, 0x00), 0);             /* 0: read a word at 0x100 */
	CHECK_EQUAL(SEND(0x67, 8, 0, 0x74, 0x02, 0x01, 0x99, 0x64, 0x03, 0x01, 0x00), 0); /* 1: 0x99 to 0x102, a byte to 0x103 */
	CHECK_EQUAL(SEND(0x65, 16, 0, 0xC1, 0x00), 0);                        /* 2: no data access */
	CHECK_EQUAL(SEND(0x65, 24, 0, 0x44, 0xFF), 0);                        /* 3: its address ends beyond the table */
	CHECK_EQUAL(SEND(0x80), 0); /* the table is open */
	CHECK_EQUAL(SEND(0xEA, 0), 0);
	CHECK_EQUAL(SEND(0x80), 2);
	CHECK_EQUAL(answer[0], 0x11);
	CHECK_EQUAL(answer[1], 0x22);
	CHECK_EQUAL(SEND(0x81, 0x42), 0);
	hm2_remote_peek(remote, 0, 0x102, &byte, 1);
	CHECK_EQUAL(byte, 0x99);
	hm2_remote_peek(remote, 0, 0x103, &byte, 1);
	CHECK_EQUAL(byte, 0x42);
	CHECK_EQUAL(SEND(0x82), 0);
	CHECK_EQUAL(SEND(0xEA, 1), 0);
	CHECK_EQUAL(SEND(0x47, 0xFC, 0xFF), 0); /* the table is no such size */
	end();
}

static void test_what_cannot_be_is_refused_and_noted(void)
{
	start();
	CHECK_EQUAL(hm2_remote_allow(remote, 0, 0x100, 0x1FF, 0), HM2_OK);
	CHECK_EQUAL(SEND(0x44, 0x00, 0x01), 1);
	CHECK_EQUAL(SEND(0x64, 0x00, 0x01, 0x01), 0); /* not writable */
	CHECK(hm2_remote_get(remote, HM2_REMOTE_STATUS) != 0);
	hm2_remote_set(remote, HM2_REMOTE_STATUS, 0);
	CHECK_EQUAL(SEND(0x44, 0x00, 0x02), 0); /* not readable */
	CHECK(hm2_remote_get(remote, HM2_REMOTE_STATUS) != 0);
	hm2_remote_set(remote, HM2_REMOTE_STATUS, 0);
	CHECK_EQUAL(SEND(0x45, 0xFF, 0x01), 0); /* half of it */
	CHECK(hm2_remote_get(remote, HM2_REMOTE_STATUS) != 0);
	hm2_remote_set(remote, HM2_REMOTE_STATUS, 0);
	CHECK_EQUAL(SEND(0xE1), 0); /* no data */
	CHECK_EQUAL(SEND(0x00), 0); /* no command */
	CHECK(hm2_remote_get(remote, HM2_REMOTE_STATUS) != 0);
	end();
}

/* An answer has room for 319 bytes and its CRC: what is beyond it is an error, and nothing is answered. */
static void test_answers_too_long(void)
{
	static const uint8_t tails[] = {0xBB, 0xBC, 0xDF, 0x44, 0xBD};
	uint8_t frame[200];
	start();
	hm2_remote_set(remote, HM2_REMOTE_RECEIVE_SIZE, 200);
	for (size_t i = 0; i < sizeof tails; i++) {
		for (size_t doubles = 30; doubles <= 41; doubles++) {
			for (size_t bytes = 0; bytes < 8; bytes++) {
				size_t length = 0;
				for (size_t k = 0; k < doubles; k++)
					frame[length++] = 0x43; /* read 8 bytes where the pointer is */
				for (size_t k = 0; k < bytes; k++)
					frame[length++] = 0xDF;
				frame[length++] = tails[i];
				hm2_remote_set(remote, HM2_REMOTE_STATUS, 0);
				const size_t size = send(frame, length);
				CHECK(size == 0 || size > 8 * doubles + bytes);
				CHECK((size == 0) == (hm2_remote_get(remote, HM2_REMOTE_STATUS) != 0));
				CHECK(size < 320);
			}
		}
	}
	end();
}

int main(void)
{
	test_local_registers();
	test_stored_rpcs();
	test_what_cannot_be_is_refused_and_noted();
	test_answers_too_long();
	return CHECK_RESULT();
}
