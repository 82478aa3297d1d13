/* Any bytes to a remote of any kind, on the line with pauses and as whole frames: no overrun, no answer
 * without a good CRC, and afterwards it still tells its cookie. */
#include <stdlib.h>
#include <string.h>

#include "hm2.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length);

static const uint8_t COOKIE_FRAME[] = {0xDF, 0x16};
static const uint8_t COOKIE_ANSWER[] = {0x5A, 0xA5};

static uint8_t crc8(const uint8_t *bytes, size_t length)
{
	uint8_t crc = 0;

	for (size_t i = 0; i < length; i++) {
		crc ^= bytes[i];
		for (int bit = 0; bit < 8; bit++)
			crc = (uint8_t)(crc & 1 ? crc >> 1 ^ 0x8C : crc >> 1);
	}
	return crc;
}

static void require(int condition)
{
	if (!condition)
		abort();
}

/* A remote as the first byte says: model, CRC, modes with elements, EEPROM, limits. */
static hm2_remote *make(uint8_t kind)
{
	hm2_remote *remote = hm2_remote_new();

	require(remote != NULL);
	hm2_remote_set(remote, HM2_REMOTE_MODEL, kind & 3);
	hm2_remote_set(remote, HM2_REMOTE_TRANSMIT_SIZE, kind & 4 ? 255 : 4);
	hm2_remote_set(remote, HM2_REMOTE_RECEIVE_SIZE, kind & 4 ? 255 : 8);
	if (kind & 8) {
		hm2_remote_add_flash(remote, 4096, 10, 8);
		hm2_remote_add_eeprom(remote, 128);
		hm2_remote_add_copy(remote, 0, 0x100, 4);
		hm2_remote_set(remote, HM2_REMOTE_WATCHDOG_ADDRESS, 0x100);
		hm2_remote_set(remote, HM2_REMOTE_BAUD_ADDRESS, 4);
		hm2_remote_set(remote, HM2_REMOTE_PWM_ADDRESS, 44);
		hm2_remote_set(remote, HM2_REMOTE_SUPERVISED, 1);
	}
	if (kind & 16) {
		hm2_remote_add_mode(remote, 0, 9, 8, 0x200, 0x210);
		hm2_remote_add_element(remote, 0, 13, 0x80, 0x300);
		hm2_remote_add_element(remote, 0, 51, 0x40, 0x302);
		hm2_remote_add_mode(remote, 1, 2, 1, 0x200, 0x210);
		hm2_remote_add_element(remote, 1, 3, 0x40, 0xFFFF);
	}
	if (kind & 32)
		hm2_remote_allow(remote, 0, 0x200, 0x7FF, 1);
	hm2_remote_set(remote, HM2_REMOTE_FAULT_GATES, kind >> 6 & 1);
	hm2_remote_set(remote, HM2_REMOTE_CRC, !(kind >> 7));
	return remote;
}

static size_t drain(hm2_remote *remote, uint8_t *heard, size_t capacity)
{
	hm2_line_byte byte;
	size_t count = 0;
	int64_t before = INT64_MIN;

	while (hm2_remote_line_peek(remote, &byte)) {
		require(byte.start_ps >= before);
		before = byte.start_ps;
		if (count < capacity)
			heard[count++] = byte.value;
		hm2_remote_line_pop(remote);
	}
	return count;
}

static int64_t send(hm2_remote *remote, int64_t now_ps, uint8_t value)
{
	int64_t bit_ps = 1000000000000 / hm2_remote_get(remote, HM2_REMOTE_BAUD);
	hm2_line_byte byte = {.start_ps = now_ps, .bit_ps = bit_ps, .value = value};

	hm2_remote_line_receive(remote, &byte);
	return now_ps + 10 * bit_ps;
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
	uint8_t answer[1200];
	hm2_remote *remote;
	int64_t now_ps = 0;
	size_t got;

	if (length == 0)
		return 0;
	remote = make(bytes[0]);
	got = hm2_remote_exchange(remote, bytes + 1, length - 1, answer, sizeof answer);
	if (hm2_remote_get(remote, HM2_REMOTE_CRC))
		require(crc8(answer, got) == 0);
	for (size_t i = 1; i < length; i++) {
		if (bytes[i] == 0xA5)
			now_ps += 3000000000; /* a pause longer than any timeout */
		now_ps = send(remote, now_ps, bytes[i]);
		hm2_remote_advance(remote, now_ps);
	}
	drain(remote, answer, sizeof answer);
	if (hm2_remote_get(remote, HM2_REMOTE_CRC)) {
		hm2_remote_set(remote, HM2_REMOTE_TIMEOUT_BITS, 40);
		now_ps += 30000000000;
		for (size_t i = 0; i < sizeof COOKIE_FRAME; i++)
			now_ps = send(remote, now_ps, COOKIE_FRAME[i]);
		require(drain(remote, answer, sizeof answer) == sizeof COOKIE_ANSWER);
		require(memcmp(answer, COOKIE_ANSWER, sizeof COOKIE_ANSWER) == 0);
	}
	hm2_remote_free(remote);
	return 0;
}
