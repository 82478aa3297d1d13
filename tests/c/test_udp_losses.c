/* What an Ethernet link makes of answers that come late, twice, in another order or not at all. */
#include "network.h"
#include "registers.h"

enum { TWO_READS = 700 }; /* words: more than one datagram's answer holds */

static uint32_t there[TWO_READS], got[TWO_READS];

static const hm2_transfer two_reads[] = {{0x1000, TWO_READS, HM2_TRANSFER_READ, got}};

/* Two datagrams of reads are under way, their answers wait in the queue. */
static void begin_two_reads(hm2_udp_config config)
{
	open_link(&config);
	for (uint32_t i = 0; i < TWO_READS; i++) {
		there[i] = 0x9E3779B9u * (i + 1);
		got[i] = 0;
	}
	CHECK_EQUAL(hm2_write(board, 0x1000, there, TWO_READS, &error), HM2_OK);
	net.sends = 0;
	CHECK_EQUAL(hm2_begin(board, two_reads, 1, &error), HM2_OK);
	CHECK_EQUAL(net.sends, 2);
	CHECK_EQUAL(net.count, 2);
}

static void finish_two_reads(void)
{
	CHECK_EQUAL(hm2_finish(board, net.now_ns + HM2_BOARD_TIMEOUT_NS, &error), HM2_OK);
	CHECK(memcmp(got, there, sizeof there) == 0);
}

static void drop_first_reply(void)
{
	net.first = (net.first + 1) % QUEUE;
	net.count--;
}

static void test_only_what_is_unanswered_is_asked_for_again(void)
{
	begin_two_reads(quick());
	drop_first_reply();
	finish_two_reads();
	CHECK_EQUAL(counters().retries, 1);
	CHECK_EQUAL(net.sends, 3);
	CHECK_EQUAL(counters().requests_lost, 0); /* the card carried out both */
	close_link();
}

static void test_a_refused_repeat_ends_the_exchange(void)
{
	begin_two_reads(quick());
	net.count = 0;
	net.refuse_send = 3;
	CHECK_EQUAL(hm2_finish(board, net.now_ns + HM2_BOARD_TIMEOUT_NS, &error), HM2_ERR_IO);
	CHECK_EQUAL(error.os_errno, ENETUNREACH);
	CHECK_EQUAL(net.sends, 3); /* the second is not tried */
	close_link();
}

static void test_answers_in_another_order_are_taken(void)
{
	static uint8_t first[HM2_LBP16_MAX_PAYLOAD];
	begin_two_reads(quick());
	const size_t at = net.first, other = (net.first + 1) % QUEUE, length = net.lengths[at];
	memcpy(first, net.replies[at], length);
	memcpy(net.replies[at], net.replies[other], net.lengths[other]);
	net.lengths[at] = net.lengths[other];
	memcpy(net.replies[other], first, length);
	net.lengths[other] = length;
	finish_two_reads();
	CHECK_EQUAL(counters().retries, 0);
	CHECK_EQUAL(counters().requests_lost + counters().out_of_order + counters().foreign, 0);
	close_link();
}

static void test_an_answer_that_comes_twice_is_taken_once(void)
{
	begin_two_reads(quick());
	const size_t last = (net.first + 1) % QUEUE, behind = (net.first + 2) % QUEUE;
	memcpy(net.replies[behind], net.replies[last], net.lengths[last]);
	net.lengths[behind] = net.lengths[last];
	memcpy(net.replies[last], net.replies[net.first], net.lengths[net.first]);
	net.lengths[last] = net.lengths[net.first];
	net.count = 3;
	const uint64_t replies = counters().replies;
	finish_two_reads();
	CHECK_EQUAL(counters().replies - replies, 2);
	CHECK_EQUAL(counters().discarded, 1);
	close_link();
}

static void test_reads_behind_an_answered_write_are_asked_for_again(void)
{
	static uint32_t words[400];
	const hm2_transfer list[] = {{0x1000, 300, HM2_TRANSFER_WRITE, there}, {0x1000, 400, HM2_TRANSFER_READ, words}};
	const hm2_udp_config config = quick();
	open_link(&config);
	CHECK_EQUAL(hm2_begin(board, list, 2, &error), HM2_OK);
	CHECK_EQUAL(net.count, 2);
	net.count = 1;
	CHECK_EQUAL(hm2_finish(board, net.now_ns + HM2_BOARD_TIMEOUT_NS, &error), HM2_OK);
	CHECK_EQUAL(counters().retries, 1);
	CHECK_EQUAL(net.sends, 3); /* nothing is probed */
	CHECK(memcmp(words, there, 4 * 300) == 0);
	close_link();
}

/* A probe tells about the newest datagram only: an older one with a write is left to the deadline. */
static void test_an_older_write_is_not_repeated(void)
{
	static uint32_t words[400];
	const hm2_transfer list[] = {{0x1000, 300, HM2_TRANSFER_WRITE, words}, {0x2000, 400, HM2_TRANSFER_READ, words}};
	const hm2_udp_config config = quick();
	for (uint32_t dropped = 1; dropped <= 2; dropped++) {
		open_link(&config);
		CHECK_EQUAL(hm2_begin(board, list, 2, &error), HM2_OK);
		CHECK_EQUAL(net.count, 2);
		for (uint32_t i = 0; i < dropped; i++)
			drop_first_reply();
		CHECK_EQUAL(hm2_finish(board, net.now_ns + HM2_BOARD_TIMEOUT_NS, &error), HM2_ERR_TIMEOUT);
		CHECK_EQUAL(error.expected, 2);
		CHECK_EQUAL(error.received, 2 - dropped);
		CHECK_EQUAL(net.sends, 2);
		close_link();
	}
}

/* Commands without an address go on where the last ones ended: asked for twice, they would give other words. */
static void test_commands_that_go_on_are_not_repeated(void)
{
	static const uint8_t go_on[] = {0x01, 0x02};
	uint8_t reply[4];
	const hm2_udp_config config = quick();
	open_link(&config);
	net.deaf = 1;
	CHECK_EQUAL(hm2_udp_lbp16(udp, go_on, 2, reply, 4, net.now_ns + HM2_BOARD_TIMEOUT_NS, &error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(net.sends, 1);
	close_link();
}

/* The second question about a lost write, or its repeat, is refused by the system. */
static void test_a_refused_question_is_told(void)
{
	const hm2_udp_config config = quick();
	const uint32_t word = 1;
	for (int number = 2; number <= 4; number++) {
		open_link(&config);
		CHECK_EQUAL(hm2_write(board, 0x1000, &word, 1, &error), HM2_OK);
		net.lost = 1;
		net.sends = 0;
		net.refuse_send = number;
		CHECK_EQUAL(hm2_write(board, 0x1000, &word, 1, &error), HM2_ERR_IO);
		CHECK_EQUAL(error.os_errno, ENETUNREACH);
		CHECK_EQUAL(net.sends, number);
		close_link();
	}
}

static void lose(int exchanges, int write)
{
	uint32_t word = 0;
	net.silent = 1;
	for (int i = 0; i < exchanges; i++)
		CHECK_EQUAL(write ? hm2_write(board, 0x1000, &word, 1, &error) : hm2_read(board, 0x1000, &word, 1, &error),
		            HM2_ERR_TIMEOUT);
	net.silent = 0;
}

static hm2_udp_config patient(void)
{
	hm2_udp_config config = quick();
	config.error_limit = 0;
	config.retry_ns = 0;
	return config;
}

/* Of 64 requests is remembered whether they wrote; of more a write is assumed, so that settings are written anew. */
static void test_a_write_is_in_doubt_when_more_were_lost_than_are_remembered(void)
{
	static const struct {
		int count, write;
		uint64_t writes_lost;
	} losses[] = {{10, 0, 0}, {10, 1, 1}, {63, 0, 0}, {70, 0, 1}};
	const hm2_udp_config config = patient();
	uint32_t word;
	for (int i = 0; i < 4; i++) {
		open_link(&config);
		CHECK_EQUAL(hm2_read(board, 0x1000, &word, 1, &error), HM2_OK);
		lose(losses[i].count, losses[i].write);
		CHECK_EQUAL(hm2_read(board, 0x1000, &word, 1, &error), HM2_OK);
		CHECK_EQUAL(counters().requests_lost, losses[i].count);
		CHECK_EQUAL(counters().writes_lost, losses[i].writes_lost);
		close_link();
	}
}

/* A minute without a network: losses after it are told as losses again. */
static void test_a_long_outage_is_over_with_the_first_answer(void)
{
	const hm2_udp_config config = patient();
	uint32_t word;
	open_link(&config);
	CHECK_EQUAL(hm2_read(board, 0x1000, &word, 1, &error), HM2_OK);
	lose(0x10010, 0);
	CHECK_EQUAL(hm2_read(board, 0x1000, &word, 1, &error), HM2_OK);
	CHECK_EQUAL(counters().foreign, 1); /* too far away to be told from another program's */
	lose(2, 0);
	CHECK_EQUAL(hm2_read(board, 0x1000, &word, 1, &error), HM2_OK);
	CHECK_EQUAL(counters().requests_lost, 2);
	CHECK_EQUAL(counters().out_of_order, 0);
	close_link();
}

/* Requests of every length around the longest there is: none is cut, none too long. */
static void test_a_datagram_is_filled_to_its_end(void)
{
	static uint32_t words[600], back[600];
	const hm2_udp_config config = quick();
	open_link(&config);
	for (uint16_t last = 100; last <= 110; last++) {
		const hm2_transfer list[] = {{0x1000, 254, HM2_TRANSFER_WRITE, words},
		                             {0x1000 + 4 * 254, last, HM2_TRANSFER_WRITE, words + 254},
		                             {0x1000 + 4u * (254u + last), 100, HM2_TRANSFER_WRITE, words + 254 + last}};
		for (uint32_t i = 0; i < 600; i++)
			words[i] = 0x01000193u * (i + last);
		CHECK_EQUAL(hm2_exchange(board, list, 3, &error), HM2_OK);
		CHECK_EQUAL(hm2_read(board, 0x1000, back, 354u + last, &error), HM2_OK);
		CHECK(memcmp(back, words, 4 * (354u + last)) == 0);
	}
	close_link();
}

static void test_an_exchange_of_nothing_sends_nothing(void)
{
	static const hm2_carrier carrier = {NULL, net_send, net_receive, net_pause, net_now, net_pause, net_close};
	const hm2_udp_config config = quick();
	hm2_bus bus;
	memset(&net, 0, sizeof net);
	CHECK_EQUAL(hm2_udp_carrier_bus(&carrier, &config, &bus, &udp, &error), HM2_OK);
	CHECK_EQUAL(bus.begin(bus.self, NULL, 0, &error), HM2_OK);
	CHECK_EQUAL(bus.finish(bus.self, 0, &error), HM2_OK);
	CHECK_EQUAL(net.sends + net.receives, 0);
	bus.close(bus.self);
}

int main(void)
{
	test_only_what_is_unanswered_is_asked_for_again();
	test_a_refused_repeat_ends_the_exchange();
	test_answers_in_another_order_are_taken();
	test_an_answer_that_comes_twice_is_taken_once();
	test_reads_behind_an_answered_write_are_asked_for_again();
	test_an_older_write_is_not_repeated();
	test_commands_that_go_on_are_not_repeated();
	test_a_refused_question_is_told();
	test_a_write_is_in_doubt_when_more_were_lost_than_are_remembered();
	test_a_long_outage_is_over_with_the_first_answer();
	test_a_datagram_is_filled_to_its_end();
	test_an_exchange_of_nothing_sends_nothing();
	return CHECK_RESULT();
}
