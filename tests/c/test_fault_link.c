/* The network that damages datagrams on request: each damage is what its number says, at its ends too, and nothing else
 * is damaged. */
#include <errno.h>
#include <string.h>

#include "check.h"
#include "hm2.h"

enum { LATENCY_NS = 1000, ALL = HM2_LBP16_MAX_PAYLOAD };

static const uint8_t cookie[4] = {0x01, 0x42, 0x00, 0x01}; /* asks for the four bytes at 0x100 */
static struct hm2_ethernet *ethernet;
static struct hm2_fault_link *network;
static hm2_carrier carrier;
static int64_t clock_ns;

static int64_t now_ns(void *self)
{
	(void)self;
	return clock_ns;
}

static void pause_ns(void *self, int64_t ns)
{
	(void)self;
	clock_ns += ns;
}

static void start(const hm2_fault *fault, uint64_t limit)
{
	const hm2_ethernet_config config = {.name = "7I92", .flash_id = 0x13, .lbp_version = 3};
	const hm2_bus card = {.now_ns = now_ns, .pause_ns = pause_ns};
	clock_ns = 0;
	ethernet = hm2_ethernet_new(&config, NULL);
	network = hm2_fault_link_new(ethernet, &card, LATENCY_NS, &carrier);
	CHECK(network != NULL);
	hm2_fault_link_set(network, fault, fault != NULL, limit);
}

static void end(void)
{
	hm2_fault_link_free(network);
	hm2_ethernet_free(ethernet);
}

static int receive(uint8_t *bytes)
{
	return carrier.receive(carrier.self, bytes, ALL);
}

/* The answer to a question, damaged like this: its length. */
static int answer(int kind, int64_t value, uint8_t *bytes)
{
	const hm2_fault fault = {.step = 2, .kind = kind, .value = value};
	memset(bytes, 0, ALL);
	start(&fault, 0);
	CHECK_EQUAL(carrier.send(carrier.self, cookie, 4), 0);
	CHECK_EQUAL(receive(bytes), -EAGAIN);
	carrier.wait(carrier.self, 10 * LATENCY_NS);
	CHECK_EQUAL(clock_ns, 2 * LATENCY_NS); /* there and back */
	const int length = receive(bytes);
	end();
	return length;
}

static void test_each_damage(void)
{
	static const struct {
		int kind;
		int64_t value;
		int length, damaged; /* the byte of this place, -1: none */
	} cases[] = {{HM2_FAULT_NONE, 0, 4, -1},   {HM2_FAULT_CORRUPT, 1, 4, 3},   {HM2_FAULT_CORRUPT, 4, 4, 0},
	             {HM2_FAULT_CORRUPT, 5, 4, -1}, {HM2_FAULT_CORRUPT, 0, 4, -1}, {HM2_FAULT_SHORT, 3, 1, -1},
	             {HM2_FAULT_SHORT, 4, 0, -1},   {HM2_FAULT_SHORT, 99, 0, -1},  {HM2_FAULT_LONG, 3, 7, -1},
	             {HM2_FAULT_LONG, 9999, ALL, -1}};
	uint8_t good[ALL], bytes[ALL];
	CHECK_EQUAL(answer(HM2_FAULT_NONE, 0, good), 4);
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		CHECK_EQUAL(answer(cases[i].kind, cases[i].value, bytes), cases[i].length);
		for (int k = 0; k < cases[i].length; k++)
			CHECK_EQUAL(bytes[k], k == cases[i].damaged ? good[k] ^ 0x55 : good[k]);
	}
}

static void test_behind_its_limit_a_network_is_dead(void)
{
	uint8_t bytes[ALL];
	for (uint64_t limit = 0; limit < 3; limit++) {
		start(NULL, limit);
		CHECK_EQUAL(carrier.send(carrier.self, cookie, 4), 0);
		carrier.wait(carrier.self, 10 * LATENCY_NS);
		CHECK_EQUAL(receive(bytes), limit == 1 ? -EAGAIN : 4);
		CHECK_EQUAL(hm2_fault_link_steps(network, NULL), 2);
		end();
	}
}

static void test_what_has_no_room_is_lost(void)
{
	uint8_t bytes[ALL + 1] = {0};
	int answers = 0, more = 0;
	start(NULL, 0);
	CHECK_EQUAL(carrier.send(carrier.self, bytes, ALL + 1), -EMSGSIZE);
	for (int i = 0; i < 500; i++)
		CHECK_EQUAL(carrier.send(carrier.self, cookie, 4), 0);
	carrier.pause_ns(carrier.self, 10 * LATENCY_NS);
	while (receive(bytes) == 4)
		answers++;
	CHECK(answers >= 8 && answers < 500);
	for (int i = 0; i < answers; i++)
		CHECK_EQUAL(carrier.send(carrier.self, cookie, 4), 0);
	carrier.pause_ns(carrier.self, 10 * LATENCY_NS);
	while (receive(bytes) == 4)
		more++;
	CHECK_EQUAL(more, answers); /* there is room again */
	end();
}

int main(void)
{
	test_each_damage();
	test_behind_its_limit_a_network_is_dead();
	test_what_has_no_room_is_lost();
	return CHECK_RESULT();
}
