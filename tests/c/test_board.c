/* The board over a bus that notes what reaches it: checks, the two halves, counters, closing. */
#include <pthread.h>
#include <string.h>
#include <time.h>

#include "check.h"
#include "hm2.h"

struct bus {
	int begins, finishes, closes, begin_status, finish_status;
	int64_t deadline_ns;
};

static int begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	struct bus *bus = self;
	(void)transfers;
	(void)count;
	(void)error;
	bus->begins++;
	return bus->begin_status;
}

static int finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	struct bus *bus = self;
	(void)error;
	bus->finishes++;
	bus->deadline_ns = deadline_ns;
	return bus->finish_status;
}

static int64_t now_ns(void *self)
{
	(void)self;
	return 1000;
}

static void pause_ns(void *self, int64_t ns)
{
	(void)self;
	(void)ns;
}

static void close_bus(void *self)
{
	((struct bus *)self)->closes++;
}

static struct hm2_board *board_on(struct bus *bus)
{
	const hm2_bus interface = {bus, begin, finish, now_ns, pause_ns, close_bus, NULL};
	struct hm2_board *board = NULL;
	memset(bus, 0, sizeof *bus);
	CHECK(hm2_board_open(&interface, &board, NULL) == HM2_OK);
	return board;
}

static uint64_t three(void *self)
{
	(void)self;
	return 3;
}

static void test_old_requests_are_counted_by_a_bus_that_can_tell(void)
{
	struct bus bus;
	struct hm2_board *board = board_on(&bus);
	CHECK(hm2_board_disturbances(board) == 0);
	hm2_board_free(board);
	const hm2_bus telling = {&bus, begin, finish, now_ns, pause_ns, close_bus, three};
	CHECK(hm2_board_open(&telling, &board, NULL) == HM2_OK);
	CHECK(hm2_board_disturbances(board) == 3);
	hm2_board_close(board);
	CHECK(hm2_board_disturbances(board) == 0);
	hm2_board_free(board);
}

static void test_a_bad_transfer_keeps_the_whole_list_from_the_bus(void)
{
	struct bus bus;
	struct hm2_board *board = board_on(&bus);
	uint32_t word = 0;
	hm2_error error;
	hm2_transfer list[2] = {{0x100, 1, HM2_TRANSFER_WRITE, &word}, {0x102, 1, HM2_TRANSFER_READ, &word}};
	CHECK(hm2_exchange(board, list, 2, &error) == HM2_ERR_ALIGN);
	CHECK(error.index == 1 && error.address == 0x102);
	list[1] = (hm2_transfer){0xFFFC, 2, HM2_TRANSFER_READ, &word};
	CHECK(hm2_exchange(board, list, 2, &error) == HM2_ERR_RANGE);
	CHECK(error.expected == 1 && error.received == 2);
	list[1] = (hm2_transfer){0xFFFC, 0, HM2_TRANSFER_READ, &word};
	CHECK(hm2_exchange(board, list, 2, NULL) == HM2_ERR_RANGE);
	list[1] = (hm2_transfer){0x100, 1, 4, &word};
	CHECK(hm2_exchange(board, list, 2, NULL) == HM2_ERR_RANGE);
	list[1] = (hm2_transfer){0x100, 1, HM2_TRANSFER_READ, NULL};
	CHECK(hm2_exchange(board, list, 2, NULL) == HM2_ERR_RANGE);
	CHECK(bus.begins == 0);
	list[1] = (hm2_transfer){0xFFFC, 99, HM2_TRANSFER_READ | HM2_TRANSFER_SAME_ADDRESS, &word};
	CHECK(hm2_exchange(board, list, 2, NULL) == HM2_OK);
	CHECK(bus.begins == 1);
	hm2_board_free(board);
}

static void test_the_halves_come_in_pairs(void)
{
	struct bus bus;
	struct hm2_board *board = board_on(&bus);
	uint32_t word = 0;
	const hm2_transfer read = {0x100, 1, HM2_TRANSFER_READ, &word};
	CHECK(hm2_finish(board, 0, NULL) == HM2_ERR_BUSY);
	CHECK(hm2_begin(board, &read, 1, NULL) == HM2_OK);
	CHECK(hm2_begin(board, &read, 1, NULL) == HM2_ERR_BUSY);
	CHECK(hm2_read(board, 0x100, &word, 1, NULL) == HM2_ERR_BUSY);
	CHECK(hm2_finish(board, 5, NULL) == HM2_OK && bus.deadline_ns == 5);
	bus.finish_status = HM2_ERR_TIMEOUT;
	CHECK(hm2_begin(board, &read, 1, NULL) == HM2_OK);
	CHECK(hm2_finish(board, 5, NULL) == HM2_ERR_TIMEOUT);
	CHECK(hm2_begin(board, &read, 1, NULL) == HM2_OK);
	hm2_board_free(board);
}

static void test_only_what_came_back_is_counted(void)
{
	struct bus bus;
	struct hm2_board *board = board_on(&bus);
	uint32_t words[4] = {0};
	hm2_board_counters counters;
	hm2_board_set_timeout_ns(board, 7);
	CHECK(hm2_read(board, 0x100, words, 3, NULL) == HM2_OK && bus.deadline_ns == 1007);
	CHECK(hm2_write(board, 0x100, words, 2, NULL) == HM2_OK);
	bus.finish_status = HM2_ERR_TIMEOUT;
	CHECK(hm2_read(board, 0x100, words, 4, NULL) == HM2_ERR_TIMEOUT);
	bus.begin_status = HM2_ERR_IO;
	CHECK(hm2_write(board, 0x100, words, 4, NULL) == HM2_ERR_IO);
	hm2_board_get_counters(board, &counters);
	CHECK(counters.exchanges == 2 && counters.failures == 2);
	CHECK(counters.words_read == 3 && counters.words_written == 2);
	hm2_board_free(board);
}

static void test_closing_happens_once_and_ends_everything(void)
{
	struct bus bus;
	struct hm2_board *board = board_on(&bus);
	uint32_t word = 0;
	hm2_board_close(board);
	hm2_board_close(board);
	CHECK(bus.closes == 1);
	CHECK(hm2_read(board, 0x100, &word, 1, NULL) == HM2_ERR_CLOSED);
	CHECK(hm2_write(board, 0x101, &word, 1, NULL) == HM2_ERR_CLOSED);
	CHECK(hm2_finish(board, 0, NULL) == HM2_ERR_CLOSED);
	CHECK(hm2_board_now_ns(board) == 0);
	hm2_board_free(board);
	CHECK(bus.closes == 1 && bus.begins == 0);
	hm2_board_close(NULL);
	hm2_board_free(NULL);
}

struct waiting {
	struct hm2_board *board;
	int status;
};

static void *read_one(void *self)
{
	struct waiting *waiting = self;
	uint32_t word;
	waiting->status = hm2_read(waiting->board, 0x100, &word, 1, NULL);
	return NULL;
}

/* What it waited for is gone, and the bus with it. */
static void test_who_waits_for_a_board_that_is_closed_gets_nothing(void)
{
	struct bus bus;
	struct waiting waiting = {board_on(&bus), HM2_OK};
	const struct timespec a_while = {0, 20000000};
	uint32_t word;
	const hm2_transfer transfer = {0x100, 1, HM2_TRANSFER_READ, &word};
	pthread_t thread;
	CHECK_EQUAL(hm2_begin(waiting.board, &transfer, 1, NULL), HM2_OK);
	CHECK(pthread_create(&thread, NULL, read_one, &waiting) == 0);
	nanosleep(&a_while, NULL);
	hm2_board_close(waiting.board);
	CHECK(pthread_join(thread, NULL) == 0);
	CHECK_EQUAL(waiting.status, HM2_ERR_CLOSED);
	CHECK_EQUAL(bus.begins, 1);
	hm2_board_free(waiting.board);
}

int main(void)
{
	test_who_waits_for_a_board_that_is_closed_gets_nothing();
	test_old_requests_are_counted_by_a_bus_that_can_tell();
	test_a_bad_transfer_keeps_the_whole_list_from_the_bus();
	test_the_halves_come_in_pairs();
	test_only_what_came_back_is_counted();
	test_closing_happens_once_and_ends_everything();
	return check_failures != 0;
}
