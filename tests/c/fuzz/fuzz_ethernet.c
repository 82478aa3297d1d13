/* Any datagrams into the emulated card's LBP16 engine: a reply has the length the packet asks for and fits
 * a frame, and the engine still answers afterwards. Input: pieces, each with its length (16 bits) before. */
#include <stdlib.h>
#include <string.h>

#include "hm2.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length);

static uint32_t words[0x4000];

static uint32_t *place(uint32_t address, size_t count)
{
	if (address % 4 || address > 0xFFFC || count > (0x10000 - address) / 4)
		abort();
	return words + address / 4;
}

static void read_words(void *self, uint32_t address, uint32_t *to, size_t count)
{
	(void)self;
	memcpy(to, place(address, count), 4 * count);
}

static void write_words(void *self, uint32_t address, const uint32_t *from, size_t count)
{
	(void)self;
	memcpy(place(address, count), from, 4 * count);
}

static void pass_time(void *self, int64_t us)
{
	(void)self;
	if (us < 0)
		abort();
}

static struct hm2_ethernet *engine(int efinix)
{
	const hm2_ethernet_config config = {.name = "7I92", .jumpers = 1, .flash_id = 0x10, .lbp_version = 3,
	                                    .firmware_version = 15, .efinix = (uint8_t)efinix};
	const hm2_ethernet_card card = {.read = read_words, .write = write_words, .pause_us = pass_time};

	return hm2_ethernet_new(&config, &card);
}

static void one_packet(struct hm2_ethernet *ethernet, const uint8_t *bytes, size_t length)
{
	uint8_t *packet = malloc(length + 1); /* its own block, so that reading past its end is noticed */
	uint8_t *reply = malloc(HM2_LBP16_MAX_PAYLOAD);
	size_t expected = 0;
	size_t size;

	memcpy(packet, bytes, length);
	size = hm2_ethernet_process(ethernet, packet, length, reply);
	if (size > HM2_LBP16_MAX_PAYLOAD)
		abort();
	if (size && (hm2_lbp16_reply_size(packet, length & ~(size_t)1, &expected) != HM2_OK || expected != size))
		abort();
	free(reply);
	free(packet);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
	static const uint8_t cookie_read[4] = {0x01, 0x42, 0x00, 0x01};
	static struct hm2_ethernet *engines[2]; /* two for the whole run: making the flash takes longer than a packet */
	uint8_t reply[HM2_LBP16_MAX_PAYLOAD];
	struct hm2_ethernet **ethernet = &engines[length & 1];

	if (!*ethernet)
		*ethernet = engine(length & 1);
	while (length >= 2) {
		size_t piece = (size_t)(bytes[0] | bytes[1] << 8) % 1600;

		bytes += 2;
		length -= 2;
		if (piece > length)
			piece = length;
		one_packet(*ethernet, bytes, piece);
		bytes += piece;
		length -= piece;
	}
	if (hm2_ethernet_image(*ethernet) == HM2_ETHERNET_IMAGE_NONE) {
		hm2_ethernet_free(*ethernet);
		*ethernet = NULL;
	} else if (hm2_ethernet_process(*ethernet, cookie_read, sizeof cookie_read, reply) != 4) {
		abort();
	}
	return 0;
}
