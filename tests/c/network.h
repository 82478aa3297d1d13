/* A link in virtual time to an emulated Ethernet card, over a network that loses what the test says. */
#ifndef HM2_TEST_NETWORK_H
#define HM2_TEST_NETWORK_H

#include <errno.h>
#include <string.h>

#include "check.h"
#include "hm2.h"

enum { QUEUE = 64 };

static struct {
	struct hm2_ethernet *card;
	int64_t now_ns;
	int silent;      /* the card hears nothing */
	int deaf;        /* the host hears nothing */
	int lost;        /* so many more datagrams do not arrive at the card */
	int refuse_send; /* the send of this number fails; 0: none */
	int sends, receives;
	int refuse_receive;
	uint8_t replies[QUEUE][HM2_LBP16_MAX_PAYLOAD];
	size_t lengths[QUEUE], first, count;
} net;

static int net_send(void *self, const uint8_t *bytes, size_t length)
{
	uint8_t reply[HM2_LBP16_MAX_PAYLOAD];
	const int lost = net.lost > 0;
	(void)self;
	if (++net.sends == net.refuse_send)
		return -ENETUNREACH;
	net.lost -= lost;
	const size_t size = net.silent || lost ? 0 : hm2_ethernet_process(net.card, bytes, length, reply);
	if (size && !net.deaf && net.count < QUEUE) {
		const size_t at = (net.first + net.count++) % QUEUE;
		memcpy(net.replies[at], reply, size);
		net.lengths[at] = size;
	}
	return 0;
}

static int net_receive(void *self, uint8_t *bytes, size_t capacity)
{
	(void)self;
	if (++net.receives == net.refuse_receive)
		return -ENETDOWN;
	if (!net.count)
		return -EAGAIN;
	const size_t length = net.lengths[net.first];
	CHECK(length <= capacity);
	memcpy(bytes, net.replies[net.first], length);
	net.first = (net.first + 1) % QUEUE;
	net.count--;
	return (int)length;
}

static void net_pause(void *self, int64_t ns)
{
	(void)self;
	net.now_ns += ns > 0 ? ns : 0;
}

static int64_t net_now(void *self)
{
	(void)self;
	return net.now_ns;
}

static void net_close(void *self)
{
	(void)self;
}

static struct hm2_udp *udp;
static struct hm2_board *board;
static hm2_error error;

static void open_link(const hm2_udp_config *config)
{
	static const hm2_carrier carrier = {NULL, net_send, net_receive, net_pause, net_now, net_pause, net_close};
	const hm2_ethernet_config card = {.name = "7I92", .flash_id = 0x13, .lbp_version = 3};
	hm2_bus bus;
	memset(&net, 0, sizeof net);
	net.card = hm2_ethernet_new(&card, NULL);
	CHECK_EQUAL(hm2_udp_carrier_bus(&carrier, config, &bus, &udp, &error), HM2_OK);
	CHECK_EQUAL(hm2_board_open(&bus, &board, &error), HM2_OK);
}

static void close_link(void)
{
	hm2_board_free(board);
	hm2_ethernet_free(net.card);
}

static hm2_udp_config quick(void)
{
	hm2_udp_config config;
	hm2_udp_defaults(&config);
	config.spin_ns = 0; /* a virtual clock stands still while one spins */
	return config;
}

static hm2_udp_counters counters(void)
{
	hm2_udp_counters all;
	hm2_udp_get_counters(udp, &all);
	return all;
}

#endif
