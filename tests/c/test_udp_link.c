/* The link to an Ethernet card in virtual time: what is given up and when, what is repeated, what the system refuses at
 * any datagram of anything, and lists of any size. */
#include "network.h"
#include "registers.h"

enum { WORDS = 3000 };

static int read_one(hm2_error *evidence)
{
	uint32_t word;
	return hm2_read(board, 0x1000, &word, 1, evidence);
}

static void test_a_silent_card_is_given_up_and_taken_back(void)
{
	hm2_udp_config config = quick();
	uint8_t reply[4];
	static const uint8_t cookie[4] = {0x01, 0x42, 0x00, 0x01};
	config.error_increment = 4;
	config.error_limit = 10;
	open_link(&config);
	net.silent = 1;
	CHECK_EQUAL(read_one(&error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(error.expected, 1);
	CHECK_EQUAL(error.received, 0);
	CHECK_EQUAL(counters().error_level, 4);
	CHECK_EQUAL(read_one(NULL), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(read_one(&error), HM2_ERR_LINK);
	CHECK_EQUAL(error.expected, 10);
	CHECK_EQUAL(error.received, 10);
	net.silent = 0;
	const uint64_t requests = counters().requests;
	CHECK_EQUAL(read_one(NULL), HM2_ERR_LINK); /* nothing is sent any more */
	CHECK_EQUAL(hm2_udp_lbp16(udp, cookie, 4, reply, 4, INT64_MAX, &error), HM2_ERR_LINK);
	CHECK_EQUAL(counters().requests, requests);
	hm2_udp_clear(udp);
	CHECK_EQUAL(counters().failed, 0);
	CHECK_EQUAL(read_one(&error), HM2_OK);
	CHECK_EQUAL(hm2_udp_lbp16(udp, cookie, 4, reply, 4, INT64_MAX, &error), HM2_OK);
	close_link();
}

static void test_without_a_limit_a_link_is_never_given_up(void)
{
	hm2_udp_config config = quick();
	config.error_limit = 0;
	open_link(&config);
	net.deaf = 1;
	for (int i = 0; i < 100; i++)
		CHECK_EQUAL(read_one(&error), HM2_ERR_TIMEOUT);
	net.deaf = 0;
	CHECK_EQUAL(read_one(&error), HM2_OK);
	CHECK_EQUAL(counters().error_level, 100 * 2 - 1);
	close_link();
}

static void test_without_a_retry_time_nothing_is_repeated(void)
{
	hm2_udp_config config = quick();
	config.retry_ns = 0;
	open_link(&config);
	net.deaf = 1;
	CHECK_EQUAL(read_one(&error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(counters().requests, 1);
	CHECK_EQUAL(counters().retries, 0);
	close_link();
	config.retry_ns = HM2_BOARD_TIMEOUT_NS / 4;
	open_link(&config);
	net.deaf = 1;
	CHECK_EQUAL(read_one(&error), HM2_ERR_TIMEOUT);
	CHECK(counters().retries == 3 || counters().retries == 4);
	close_link();
}

static void test_commands_that_cannot_be(void)
{
	static const uint8_t read_two[4] = {0x01, 0x42, 0x00, 0x01}, cut[1] = {0x01};
	static uint8_t many[HM2_LBP16_MAX_PAYLOAD], zeroes[508], reply[2 * HM2_LBP16_MAX_PAYLOAD];
	const hm2_udp_config config = quick();
	hm2_lbp16_command big = {.has_address = 1, .element_size = 4, .increment = 1, .count = 127};
	size_t length = 0;
	open_link(&config);
	CHECK_EQUAL(hm2_udp_lbp16(udp, read_two, 4, reply, 2, INT64_MAX, &error), HM2_ERR_RANGE);
	CHECK(strcmp(error.where, "udp lbp16") == 0);
	CHECK_EQUAL(hm2_udp_lbp16(udp, cut, 1, reply, 0, INT64_MAX, NULL), HM2_ERR_RANGE);
	for (int i = 0; i < 3; i++)
		CHECK_EQUAL(hm2_lbp16_put(many, sizeof many, &length, &big, NULL), HM2_OK);
	CHECK_EQUAL(hm2_udp_lbp16(udp, many, length, reply, 3 * 508, INT64_MAX, &error), HM2_ERR_RANGE); /* too long an answer */
	big.write = 1;
	length = 0;
	for (int i = 0; i < 2; i++)
		CHECK_EQUAL(hm2_lbp16_put(many, sizeof many, &length, &big, zeroes), HM2_OK);
	CHECK_EQUAL(hm2_udp_lbp16(udp, many, length, reply, 0, INT64_MAX, &error), HM2_OK);
	big.count = 108;
	CHECK_EQUAL(hm2_lbp16_put(many, sizeof many, &length, &big, zeroes), HM2_OK);
	CHECK(length > HM2_LBP16_MAX_PAYLOAD - 20);
	CHECK_EQUAL(hm2_udp_lbp16(udp, many, length, reply, 0, INT64_MAX, &error), HM2_ERR_RANGE); /* no room for its number */
	CHECK_EQUAL(counters().requests, 1);
	close_link();
}

/* ---- lists ---- */

static uint32_t written[WORDS], got[WORDS];

static void check_list_of(size_t transfers, uint32_t words)
{
	static hm2_transfer list[300];
	uint32_t at = 0;
	for (uint32_t i = 0; i < WORDS; i++) {
		written[i] = 0x01000193u * (i + words);
		got[i] = 0;
	}
	for (size_t i = 0; i < transfers; i++, at += words)
		list[i] = (hm2_transfer){0x1000 + 4 * at, (uint16_t)words, HM2_TRANSFER_WRITE, written + at};
	for (int round = 0; round < 3; round++) { /* the second and third as remembered */
		CHECK_EQUAL(hm2_exchange(board, list, transfers, &error), HM2_OK);
		written[0] += 1;
	}
	written[0] -= 1;
	for (size_t i = 0; i < transfers; i++)
		list[i] = (hm2_transfer){list[i].address, (uint16_t)words, HM2_TRANSFER_READ, got + (list[i].address - 0x1000) / 4};
	CHECK_EQUAL(hm2_exchange(board, list, transfers, &error), HM2_OK);
	CHECK_EQUAL(hm2_exchange(board, list, transfers, &error), HM2_OK);
	CHECK(memcmp(got, written, 4 * at) == 0);
}

static void test_lists_of_any_size_arrive(void)
{
	const hm2_udp_config config = quick();
	open_link(&config);
	check_list_of(1, 1);
	check_list_of(1, 127);
	check_list_of(1, 128); /* two commands */
	check_list_of(1, 365); /* as much as fits one datagram's answer, more or less */
	check_list_of(1, 3000);
	check_list_of(129, 1); /* more than is remembered */
	check_list_of(300, 10);
	check_list_of(12, 250);
	close_link();
}

/* ---- the system refuses ---- */

/* Reads and writes in more datagrams than are under way at once. */
static int mixed_list(void)
{
	static uint32_t in[6000], out[2000];
	const hm2_transfer list[] = {{0x1000, 2000, HM2_TRANSFER_WRITE, out}, {0x1000, 6000, HM2_TRANSFER_READ, in},
	                             {0x1000, 1, HM2_TRANSFER_WRITE, out}};
	return hm2_exchange(board, list, 3, &error);
}

static int own_commands(void)
{
	static const uint8_t cookie[4] = {0x01, 0x42, 0x00, 0x01};
	uint8_t reply[4];
	return hm2_udp_lbp16(udp, cookie, 4, reply, 4, net.now_ns + HM2_BOARD_TIMEOUT_NS, &error);
}

static int write_one(void)
{
	const uint32_t word = 1;
	return hm2_write(board, 0x1000, &word, 1, &error);
}

static int read_it(void)
{
	return read_one(&error);
}

static void test_each_datagram_that_is_not_taken_is_told(void)
{
	static int (*const operations[])(void) = {mixed_list, own_commands, write_one, read_it};
	const hm2_udp_config config = quick();
	for (int i = 0; i < 4; i++) {
		for (int deaf = 0; deaf < 2; deaf++) { /* repeats and questions are datagrams, too */
			int failed = 1;
			for (int number = 1; failed; number++) {
				open_link(&config);
				net.deaf = deaf;
				net.refuse_send = number;
				const int status = operations[i]();
				failed = net.sends >= number;
				CHECK_EQUAL(status, failed ? HM2_ERR_IO : deaf ? HM2_ERR_TIMEOUT : HM2_OK);
				if (failed)
					CHECK_EQUAL(error.os_errno, ENETUNREACH);
				net.deaf = net.refuse_send = 0;
				net.count = 0;
				CHECK_EQUAL(operations[i](), HM2_OK); /* and the link goes on */
				close_link();
			}
		}
	}
}

static void test_each_look_that_fails_is_told(void)
{
	const hm2_udp_config config = quick();
	int failed = 1;
	for (int number = 1; failed; number++) {
		open_link(&config);
		net.refuse_receive = number;
		const int status = mixed_list();
		failed = net.receives >= number;
		CHECK_EQUAL(status, failed ? HM2_ERR_IO : HM2_OK);
		net.refuse_receive = 0;
		CHECK_EQUAL(mixed_list(), HM2_OK);
		close_link();
	}
}

/* Time itself goes by the carrier: pauses of the board, too. */
static void test_the_clock_is_the_carriers(void)
{
	const hm2_udp_config config = quick();
	open_link(&config);
	hm2_board_pause_ns(board, 1234);
	CHECK_EQUAL(hm2_board_now_ns(board), 1234);
	close_link();
}

/* Who else writes the card's number, another program or its restart, leaves nothing to tell by whether a lost write was
 * carried out: it is not sent again, and the deadline says so. */
static void test_a_write_is_not_repeated_on_somebody_elses_word(void)
{
	const hm2_udp_config config = quick();
	uint32_t word = 0x11, there = 0;
	open_link(&config);
	CHECK_EQUAL(hm2_write(board, 0x1000, &word, 1, &error), HM2_OK);
	for (uint32_t half = 0; half < 2; half++)
		hm2_ethernet_poke(net.card, HM2_LBP16_SPACE_TIMER, HM2_LBP16_TIMER_SCRATCH + 2 * half, 0x7777);
	net.lost = 1;
	word = 0x22;
	CHECK_EQUAL(hm2_write(board, 0x1000, &word, 1, &error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(counters().retries, 0);
	CHECK_EQUAL(hm2_read(board, 0x1000, &there, 1, &error), HM2_OK);
	CHECK_EQUAL(there, 0x11);
	close_link();
}

/* The same loss with a number that is ours. */
static void test_a_write_that_was_lost_is_sent_again(void)
{
	const hm2_udp_config config = quick();
	uint32_t word = 0x11, there = 0;
	open_link(&config);
	CHECK_EQUAL(hm2_write(board, 0x1000, &word, 1, &error), HM2_OK);
	net.lost = 1;
	word = 0x22;
	CHECK_EQUAL(hm2_write(board, 0x1000, &word, 1, &error), HM2_OK);
	CHECK_EQUAL(counters().retries, 1);
	CHECK_EQUAL(hm2_read(board, 0x1000, &there, 1, &error), HM2_OK);
	CHECK_EQUAL(there, 0x22);
	close_link();
}

int main(void)
{
	test_a_write_is_not_repeated_on_somebody_elses_word();
	test_a_write_that_was_lost_is_sent_again();
	test_a_silent_card_is_given_up_and_taken_back();
	test_without_a_limit_a_link_is_never_given_up();
	test_without_a_retry_time_nothing_is_repeated();
	test_commands_that_cannot_be();
	test_lists_of_any_size_arrive();
	test_each_datagram_that_is_not_taken_is_told();
	test_each_look_that_fails_is_told();
	test_the_clock_is_the_carriers();
	return CHECK_RESULT();
}
