/* Any contents of a card's smart-serial registers, and exchanges that fail at any time, under the driver: every
 * operation ends within its limits, reports what is possible, and takes no inputs of a channel that failed.
 * Input: the size of the port, operations, and the words that reads find, all from one stream. */
#include <stdlib.h>
#include <string.h>

#include "hm2.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length);

#define OPERATIONS 24
#define BASE 0x5A00u
#define SECONDS 1000000000ll

struct card {
	const uint8_t *bytes;
	size_t left;
	int64_t now_ns;
	int flying; /* the next transfer may bring what a pipelined one has left behind */
};

static void require(int condition)
{
	if (!condition)
		abort();
}

static uint8_t next(struct card *card)
{
	if (card->left == 0)
		return 0;
	card->left--;
	return *card->bytes++;
}

/* Mostly a word that means something: 0, a few bits, or four bytes. */
static uint32_t word(struct card *card)
{
	const uint8_t kind = next(card);

	if (kind < 0x80)
		return kind & 0x0F;
	if (kind < 0xC0)
		return (uint32_t)next(card) << (kind & 24);
	uint32_t value = 0;
	for (int i = 0; i < 4; i++)
		value = value << 8 | next(card);
	return value;
}

static int card_begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	struct card *card = self;

	card->now_ns += 1000;
	if (next(card) == 0xEE) {
		if (error)
			memset(error, 0, sizeof *error);
		return HM2_ERR_TIMEOUT;
	}
	for (size_t i = 0; i < count; i++) {
		require(transfers[i].address >= BASE && transfers[i].address + 4u * transfers[i].count <= BASE + 0xA00u);
		for (uint32_t n = 0; !(transfers[i].flags & HM2_TRANSFER_WRITE) && n < transfers[i].count; n++)
			transfers[i].words[n] = word(card);
	}
	return HM2_OK;
}

static int card_finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	(void)error;
	require(deadline_ns >= ((struct card *)self)->now_ns);
	return HM2_OK;
}

static int64_t card_now_ns(void *self)
{
	return ((struct card *)self)->now_ns;
}

static void card_pause_ns(void *self, int64_t ns)
{
	require(ns >= 0);
	((struct card *)self)->now_ns += ns;
}

static void card_close(void *self)
{
	(void)self;
}

static int is_status(int status)
{
	return status == HM2_OK || status == HM2_ERR_TIMEOUT || status == HM2_ERR_PROTOCOL || status == HM2_ERR_RANGE ||
	       status == HM2_ERR_BUSY || status == HM2_ERR_FORMAT;
}

static void doit(struct card *card, struct hm2_sserial *port, uint32_t mask, int pipelined)
{
	const hm2_sserial_image *image = hm2_sserial_get_image(port);
	hm2_sserial_image before = *image;
	hm2_error error;
	uint32_t requested = mask;
	const int status = pipelined ? hm2_sserial_cycle(port, mask, &requested, &error) : hm2_sserial_doit(port, mask, &error);

	require(status >= 0 || is_status(status));
	for (int c = 0; status >= 0 && !pipelined && !card->flying && c < 8; c++)
		if (status & 1 << c)
			require(memcmp(before.inputs[c], image->inputs[c], sizeof before.inputs[c]) == 0);
	card->flying = pipelined || (card->flying && status < 0);
}

static void remote_memory(struct card *card, struct hm2_sserial *port)
{
	static hm2_toc_record records[HM2_TOC_ENTRIES];
	const uint32_t channel = next(card) & 7, address = word(card) & 0xFFFF;
	uint64_t value = 0;
	size_t count;
	hm2_error error;

	require(is_status(hm2_sserial_read_remote(port, channel, next(card) & 3, address, 1u << (next(card) & 3), &value,
	                                          &error)));
	require(is_status(hm2_sserial_write_remote(port, channel, 0, address, 2, value, &error)));
	require(is_status(hm2_sserial_access(port, channel, next(card), address, &value, &error)));
	if (next(card) & 1)
		require(is_status(hm2_sserial_read_toc(port, channel, address, HM2_PTOC, NULL, 0, records, HM2_TOC_ENTRIES,
		                                       &count, &error)));
}

static void operate(struct card *card, struct hm2_sserial *port)
{
	hm2_sserial_event events[4];
	uint8_t local[4];
	uint64_t lost;
	hm2_error error;
	const uint8_t op = next(card), mask = next(card);
	const int64_t start_ns = card->now_ns;

	switch (op & 7) {
	case 0: require(is_status(hm2_sserial_reset(port, &error))); break;
	case 1: require(is_status(hm2_sserial_stop(port, mask, &error))); break;
	case 2:
	case 3: {
		const int status = hm2_sserial_start(port, mask, op & 8 ? HM2_SSERIAL_SETUP : HM2_SSERIAL_NORMAL, &error);
		require(status < 0 ? is_status(status) : (status & ~0xFF) == 0);
		break;
	}
	case 4: doit(card, port, mask, 0); break;
	case 5: doit(card, port, mask, 1); break;
	case 6: remote_memory(card, port); break;
	default:
		require(is_status(hm2_sserial_read_local(port, mask, local, 1 + (op >> 4 & 3), &error)));
		require(hm2_sserial_take_events(port, events, 4, &lost) <= 4);
		break;
	}
	require((hm2_sserial_started(port) & ~0xFFu) == 0);
	require(card->now_ns - start_ns < 600 * SECONDS);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
	struct card card = {bytes, length, 0, 0};
	const hm2_bus bus = {&card, card_begin, card_finish, card_now_ns, card_pause_ns, card_close, NULL};
	const uint8_t kind = next(&card);
	const hm2_sserial_config config = {BASE, 0x100, 0x40, 0, 1 + (kind & 7u), kind & 8 ? 7 : 3};
	struct hm2_board *board = NULL;
	struct hm2_sserial *port = NULL;
	hm2_error error;

	require(hm2_board_open(&bus, &board, &error) == HM2_OK);
	require(hm2_sserial_open(board, &config, &port, &error) == HM2_OK);
	for (int i = 0; i < OPERATIONS && card.left; i++)
		operate(&card, port);
	hm2_sserial_free(port);
	hm2_board_free(board);
	return 0;
}
