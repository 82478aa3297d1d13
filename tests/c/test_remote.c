/* The emulated remote's parser and element mapping under the sanitizers: limits rather than vectors. */
#include <string.h>

#include "check.h"
#include "hm2.h"

#define BIT_PS 400000
#define BYTE_PS (10 * BIT_PS)

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

static int64_t send(hm2_remote *remote, int64_t now_ps, const uint8_t *bytes, size_t length)
{
	for (size_t i = 0; i < length; i++, now_ps += BYTE_PS) {
		hm2_line_byte byte = {.start_ps = now_ps, .bit_ps = BIT_PS, .value = bytes[i]};

		hm2_remote_line_receive(remote, &byte);
	}
	return now_ps;
}

static size_t drain(hm2_remote *remote)
{
	hm2_line_byte byte;
	size_t count = 0;

	for (; hm2_remote_line_peek(remote, &byte); count++)
		hm2_remote_line_pop(remote);
	return count;
}

static void the_longest_process_data_goes_both_ways(void)
{
	hm2_remote *remote = hm2_remote_new();
	uint8_t frame[1 + 255 + 1] = {0xBD};
	uint8_t inputs[254], answer[256], outputs[255];

	memset(frame + 1, 0xA7, 255);
	frame[256] = crc8(frame, 256);
	memset(inputs, 0x3C, sizeof inputs);
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_RECEIVE_SIZE, 255), HM2_OK);
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_TRANSMIT_SIZE, 255), HM2_OK);
	CHECK_EQUAL(hm2_remote_set_inputs(remote, inputs, sizeof inputs), HM2_OK);
	CHECK_EQUAL(hm2_remote_exchange(remote, frame, sizeof frame, answer, sizeof answer), 256);
	CHECK_EQUAL(crc8(answer, 256), 0);
	CHECK_EQUAL(hm2_remote_exchange(remote, frame, sizeof frame, answer, 255), 0);
	CHECK_EQUAL(hm2_remote_outputs(remote, outputs, sizeof outputs), 255);
	CHECK_EQUAL(outputs[254], 0xA7);
	send(remote, 0, frame, sizeof frame);
	CHECK_EQUAL(drain(remote), 256);
	hm2_remote_free(remote);
}

static void a_frame_that_never_ends_is_dropped_and_counted(void)
{
	hm2_remote *remote = hm2_remote_new();
	uint8_t noise[2000];
	int64_t now_ps;

	memset(noise, 0xD0, sizeof noise); /* good commands, never their CRC */
	now_ps = send(remote, 0, noise, sizeof noise);
	CHECK(hm2_remote_get(remote, HM2_REMOTE_STATUS) & 0x10);
	drain(remote);
	send(remote, now_ps + 100 * BIT_PS, (const uint8_t *)"\xDF\x16", 2);
	CHECK_EQUAL(drain(remote), 2);
	hm2_remote_free(remote);
}

static void answers_nobody_takes_do_not_overrun_the_queue(void)
{
	hm2_remote *remote = hm2_remote_new();
	const uint8_t read[] = {0x47, 0x00, 0x02, 0xF7};
	int64_t now_ps = 0;

	for (int i = 0; i < 500; i++)
		now_ps = send(remote, now_ps, read, sizeof read);
	CHECK(hm2_remote_get(remote, HM2_REMOTE_STATUS) & 0x10);
	CHECK_EQUAL(drain(remote), 1024 / 9 * 9);
	hm2_remote_free(remote);
}

static void memory_ends_where_it_ends(void)
{
	hm2_remote *remote = hm2_remote_new();
	uint8_t bytes[8] = {0};

	CHECK_EQUAL(hm2_remote_peek(remote, 0, 0xFFF8, bytes, 8), HM2_OK);
	CHECK_EQUAL(hm2_remote_peek(remote, 0, 0xFFF9, bytes, 8), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_poke(remote, 1, 0xFC00, bytes, 1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_eeprom(remote, HM2_REMOTE_EEPROM_MAX + 1), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_eeprom(remote, 16), HM2_OK);
	CHECK_EQUAL(hm2_remote_peek(remote, 1, 9, bytes, 8), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_copy(remote, 9, 0x100, 8), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_copy(remote, 8, 0xFFFF, 8), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_peek(remote, 7, 0, bytes, 1), HM2_ERR_RANGE);
	hm2_remote_free(remote);
}

static void elements_that_do_not_fit_are_refused(void)
{
	hm2_remote *remote = hm2_remote_new();

	CHECK_EQUAL(hm2_remote_add_element(remote, 0, 8, 0x80, 0x100), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_mode(remote, 0, 1, 255, 0, 0), HM2_OK);
	CHECK_EQUAL(hm2_remote_add_element(remote, 1, 8, 0x80, 0x100), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_element(remote, 0, 0, 0x80, 0x100), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_add_element(remote, 0, 17, 0x80, 0xFFFE), HM2_ERR_RANGE);
	for (int i = 0; i < 8; i++)
		CHECK_EQUAL(hm2_remote_add_element(remote, 0, 255, 0x80, 0x100), HM2_OK);
	CHECK_EQUAL(hm2_remote_add_element(remote, 0, 1, 0x80, 0x100), HM2_ERR_RANGE);
	hm2_remote_free(remote);
}

static void the_log_keeps_the_last_writes_and_counts_all(void)
{
	static hm2_remote_write writes[HM2_REMOTE_WRITES_KEPT];
	hm2_remote *remote = hm2_remote_new();
	uint8_t frame[] = {0x65, 0x00, 0x02, 0, 0, 0};
	uint8_t answer[8];
	size_t count;

	for (int i = 0; i < HM2_REMOTE_WRITES_KEPT + 3; i++) {
		frame[3] = (uint8_t)i;
		frame[4] = (uint8_t)(i >> 8);
		frame[5] = crc8(frame, 5);
		CHECK_EQUAL(hm2_remote_exchange(remote, frame, sizeof frame, answer, sizeof answer), 1);
	}
	CHECK_EQUAL(hm2_remote_writes(remote, writes, HM2_REMOTE_WRITES_KEPT, &count), HM2_REMOTE_WRITES_KEPT + 3);
	CHECK_EQUAL(count, HM2_REMOTE_WRITES_KEPT);
	CHECK_EQUAL(writes[0].data[0], 3);
	CHECK_EQUAL(hm2_remote_writes(remote, writes, 2, &count), HM2_REMOTE_WRITES_KEPT + 3);
	CHECK_EQUAL(count, 2);
	CHECK_EQUAL(writes[1].data[0], 2);
	hm2_remote_free(remote);
}

static void knobs_refuse_what_they_cannot_hold(void)
{
	hm2_remote *remote = hm2_remote_new();

	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_KNOBS, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_set(remote, -1, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_RECEIVE_SIZE, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_set(remote, HM2_REMOTE_BAUD, 0), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_remote_get(remote, HM2_REMOTE_KNOBS), -1);
	hm2_remote_free(remote);
	hm2_remote_free(NULL);
}

int main(void)
{
	the_longest_process_data_goes_both_ways();
	a_frame_that_never_ends_is_dropped_and_counted();
	answers_nobody_takes_do_not_overrun_the_queue();
	memory_ends_where_it_ends();
	elements_that_do_not_fit_are_refused();
	the_log_keeps_the_last_writes_and_counts_all();
	knobs_refuse_what_they_cannot_hold();
	return CHECK_RESULT();
}
