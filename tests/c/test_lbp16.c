/* The LBP16 codec against the vectors of fact sheet lbp16.md 7. */
#include <string.h>

#include "check.h"
#include "hm2.h"

static void command_words_are_those_of_the_sheet(void)
{
	hm2_lbp16_command cookie = {.address = 0x0100, .has_address = 1, .element_size = 4, .count = 1};
	hm2_lbp16_command decoded;
	uint8_t packet[4];
	size_t length = 0;

	CHECK(hm2_lbp16_encode(&cookie) == 0x4201);
	CHECK(hm2_lbp16_put(packet, sizeof packet, &length, &cookie, NULL) == HM2_OK);
	CHECK(length == 4 && memcmp(packet, "\x01\x42\x00\x01", 4) == 0);
	hm2_lbp16_decode(0xC285, &decoded);
	CHECK(decoded.write && decoded.increment && decoded.element_size == 4 && decoded.count == 5);
}

static void a_packet_that_does_not_fit_is_left_alone(void)
{
	hm2_lbp16_command write = {.has_address = 1, .write = 1, .element_size = 4, .count = 2};
	uint8_t packet[11] = {0};
	uint8_t data[8] = {1, 2, 3, 4, 5, 6, 7, 8};
	size_t length = 0;

	CHECK(hm2_lbp16_put(packet, sizeof packet, &length, &write, data) == HM2_ERR_RANGE);
	CHECK(length == 0 && packet[0] == 0);
	length = sizeof packet + 1; /* what is there already is too long */
	CHECK(hm2_lbp16_put(packet, sizeof packet, &length, &write, data) == HM2_ERR_RANGE);
	CHECK(length == sizeof packet + 1);
}

static void reply_sizes_count_reads_only(void)
{
	const uint8_t tail[] = {0x01, 0x59, 0x08, 0x00, 0x82, 0xd1, 0x10, 0x00, 7, 0, 0, 0, 0x84, 0x51, 0x10, 0x00};
	size_t size;

	CHECK(hm2_lbp16_reply_size(tail, sizeof tail, &size) == HM2_OK && size == 10);
	CHECK(hm2_lbp16_reply_size(tail, 9, &size) == HM2_ERR_RANGE);
	CHECK(hm2_lbp16_reply_size((const uint8_t *)"\x80\x42\x00\x01", 4, &size) == HM2_ERR_FORMAT);
}

static void nothing_is_read_beyond_a_packet(void)
{
	const uint8_t cookie[4] = {0x01, 0x42, 0x00, 0x01};
	hm2_lbp16_command command;
	const uint8_t *data;

	for (size_t offset = 3; offset < 6; offset++) {
		size_t at = offset;

		CHECK(hm2_lbp16_next(cookie, sizeof cookie, &at, &command, &data) == HM2_ERR_FORMAT);
		CHECK(at == offset && data == NULL);
	}
}

int main(void)
{
	nothing_is_read_beyond_a_packet();
	command_words_are_those_of_the_sheet();
	a_packet_that_does_not_fit_is_left_alone();
	reply_sizes_count_reads_only();
	return check_failures != 0;
}
