/* Any replies to the driver, in virtual time: whatever a card, a bad network or a stranger sends, only memory of the
 * transfers is written, only by a reply with the number and length asked for, and every exchange ends. Input: a kind
 * of exchange, then what each look for a datagram finds; true replies are made from the requests, or no fuzzer would
 * find their numbers. */
#include <errno.h>
#include <stdlib.h>
#include <string.h>

#include "hm2.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length);

#define GUARD 0xA5A5A5A5u
#define WORDS 800
#define EXCHANGES 12
#define KEPT 8

struct network {
	const uint8_t *bytes;
	size_t left;
	int64_t now_ns;
	uint8_t requests[KEPT][HM2_LBP16_MAX_PAYLOAD];
	size_t lengths[KEPT];
	uint32_t sent;
};

static void require(int condition)
{
	if (!condition)
		abort();
}

static uint8_t next(struct network *network)
{
	if (network->left == 0)
		return 0;
	network->left--;
	return *network->bytes++;
}

static uint32_t get32(const uint8_t *from)
{
	return (uint32_t)from[0] | (uint32_t)from[1] << 8 | (uint32_t)from[2] << 16 | (uint32_t)from[3] << 24;
}

static void put32(uint8_t *to, uint32_t value)
{
	for (int i = 0; i < 4; i++)
		to[i] = (uint8_t)(value >> 8 * i);
}

static int send_request(void *self, const uint8_t *bytes, size_t length)
{
	struct network *network = self;
	size_t reply;

	require(length <= HM2_LBP16_MAX_PAYLOAD);
	require(hm2_lbp16_reply_size(bytes, length, &reply) == HM2_OK && reply <= HM2_LBP16_MAX_PAYLOAD);
	memcpy(network->requests[network->sent % KEPT], bytes, length);
	network->lengths[network->sent++ % KEPT] = length;
	return network->left && *network->bytes == 0xFF ? -ENETDOWN : 0;
}

/* The reply to one of the last requests, as the card would give it, but for `before` and what is done to it. */
static size_t true_reply(struct network *network, uint8_t *reply, uint32_t back, int8_t before)
{
	const uint8_t *request = network->requests[(network->sent - 1 - back) % KEPT];
	const size_t length = network->lengths[(network->sent - 1 - back) % KEPT];
	size_t size = 0;

	hm2_lbp16_reply_size(request, length, &size);
	if (size < 8)
		return 0;
	memset(reply, network->sent & 0xFF, size);
	if (length == 12) { /* a probe: its number is the first thing written */
		put32(reply + 4, get32(request + 4));
		put32(reply, get32(network->requests[(network->sent - 2) % KEPT] + network->lengths[(network->sent - 2) % KEPT] - 8) +
		                 (uint32_t)before);
		return size;
	}
	put32(reply + size - 4, get32(request + length - 8));
	put32(reply, get32(request + length - 8) - 1 + (uint32_t)before);
	return size;
}

static int receive_reply(void *self, uint8_t *bytes, size_t capacity)
{
	struct network *network = self;
	const uint8_t kind = next(network), detail = next(network);
	uint8_t reply[HM2_LBP16_MAX_PAYLOAD + 300];
	size_t size = 0;

	network->now_ns += 5000;
	if ((kind & 7) == 0 || network->sent == 0)
		return network->left ? -EAGAIN : (network->now_ns += 100000, -EAGAIN);
	if ((kind & 7) == 7)
		return detail == 0xEE ? -ECONNREFUSED : -EAGAIN;
	if ((kind & 7) < 6)
		size = true_reply(network, reply, (kind & 7) == 5 ? detail % KEPT % network->sent : 0,
		                  (kind & 7) == 1 || (kind & 7) == 5 ? 0 : (int8_t)detail);
	if ((kind & 7) == 3)
		size = detail < size ? size - detail : 0;
	if ((kind & 7) == 4 || (kind & 7) == 6)
		for (int i = 0; i < detail; i++)
			reply[size++] = next(network);
	require(capacity >= HM2_LBP16_MAX_PAYLOAD);
	size = size < capacity ? size : capacity;
	memcpy(bytes, reply, size);
	return (int)size;
}

static void wait_for_one(void *self, int64_t ns)
{
	((struct network *)self)->now_ns += ns > 20000 ? 20000 : ns;
}

static int64_t network_now_ns(void *self)
{
	return ((struct network *)self)->now_ns;
}

static void network_pause_ns(void *self, int64_t ns)
{
	((struct network *)self)->now_ns += ns;
}

static void network_close(void *self)
{
	(void)self;
}

static void exchange(struct network *network, const hm2_bus *bus, uint8_t kind)
{
	static uint32_t words[WORDS + 2];
	uint32_t out[2] = {7, 8}, fifo[2] = {GUARD, GUARD};
	const hm2_transfer list[4] = {
		{0x2000, kind & 8 ? WORDS : 3, HM2_TRANSFER_READ, words + 1},
		{0x1000, 2, HM2_TRANSFER_WRITE, out},
		{0x3000, 2, HM2_TRANSFER_SAME_ADDRESS, fifo},
		{0x1004, 1, HM2_TRANSFER_WRITE | HM2_TRANSFER_SAME_ADDRESS, out},
	};
	const size_t count = 1 + (kind & 3u);
	hm2_error error;

	memset(words, 0xA5, sizeof words);
	if (bus->begin(bus->self, list, count, &error) != HM2_OK)
		return;
	const int status = bus->finish(bus->self, network->now_ns + 2000000, &error);
	require(status == HM2_OK || status == HM2_ERR_TIMEOUT || status == HM2_ERR_IO || status == HM2_ERR_LINK);
	require(words[0] == GUARD && words[WORDS + 1] == GUARD && out[0] == 7 && out[1] == 8);
	require(count > 2 || fifo[0] == GUARD);
	if (status != HM2_OK && !(kind & 8))
		require(words[1] == GUARD && fifo[0] == GUARD); /* one datagram: no half answer */
}

static void own_commands(struct network *network, struct hm2_udp *udp)
{
	static const uint8_t commands[2][4] = {{0x01, 0x42, 0x00, 0x01}, {0x84, 0x49, 0x02, 0x00}};
	uint8_t reply[16];
	hm2_error error;
	const uint8_t which = next(network) & 1;

	memset(reply, 0xA5, sizeof reply);
	hm2_udp_lbp16(udp, commands[which], 4, reply, which ? 8 : 4, network->now_ns + 2000000, &error);
	require(reply[8] == 0xA5);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
	static struct network network;
	const hm2_carrier carrier = {&network,       send_request,     receive_reply, wait_for_one,
	                             network_now_ns, network_pause_ns, network_close};
	hm2_udp_config config = {.spin_ns = 0, .retry_ns = 150000};
	hm2_udp_counters counters;
	struct hm2_udp *udp = NULL;
	hm2_bus bus;
	hm2_error error;

	memset(&network, 0, sizeof network);
	network.bytes = bytes;
	network.left = length;
	require(hm2_udp_carrier_bus(&carrier, &config, &bus, &udp, &error) == HM2_OK);
	for (int i = 0; i < EXCHANGES && network.left; i++) {
		const uint8_t kind = next(&network);

		if ((kind & 0x30) == 0x30)
			own_commands(&network, udp);
		else if (kind == 0xFE)
			hm2_udp_clear(udp);
		else
			exchange(&network, &bus, kind);
	}
	hm2_udp_get_counters(udp, &counters);
	require(counters.replies <= counters.requests);
	bus.close(bus.self);
	return 0;
}
