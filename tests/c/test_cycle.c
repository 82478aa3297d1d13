/* A cycle is one exchange: reads before writes, readings of good exchanges only, no writes behind a shut gate, and
 * never more than there is room for. */
#include <string.h>

#include "check.h"
#include "hm2.h"

enum { STATUS = 0x0D00, RESET = 0x0E00 };

struct bench {
	hm2_transfer seen[HM2_CYCLE_TRANSFERS]; /* of the last exchange */
	size_t count;
	int begin_status, finish_status;
	uint32_t status; /* what STATUS reads */
	struct hm2_board *board;
	struct hm2_cycle *cycle;
	hm2_error error;
};

static struct bench bench;

static int bench_begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	struct bench *b = self;
	(void)error;
	memcpy(b->seen, transfers, count * sizeof *transfers);
	b->count = count;
	for (size_t i = 0; i < count; i++)
		if (transfers[i].address == STATUS)
			*transfers[i].words = b->status;
	return b->begin_status;
}

static int bench_finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	(void)deadline_ns;
	(void)error;
	return ((struct bench *)self)->finish_status;
}

static int64_t bench_now_ns(void *self)
{
	(void)self;
	return 1234;
}

static void bench_pause_ns(void *self, int64_t ns)
{
	(void)self;
	(void)ns;
}

static void bench_close(void *self)
{
	(void)self;
}

struct counted {
	size_t transfers; /* lists so many of each direction */
	int processed;
	int64_t now_ns;
	uint32_t words[2];
};

static size_t list(struct counted *part, hm2_transfer *transfers, size_t capacity, uint16_t flags)
{
	for (size_t i = 0; i < part->transfers && i < capacity; i++)
		transfers[i] = (hm2_transfer){flags ? 0x2000u : 0x1000u, 1, flags, &part->words[flags]};
	return part->transfers;
}

static size_t counted_reads(void *self, hm2_transfer *transfers, size_t capacity)
{
	return list(self, transfers, capacity, HM2_TRANSFER_READ);
}

static size_t counted_writes(void *self, hm2_transfer *transfers, size_t capacity)
{
	return list(self, transfers, capacity, HM2_TRANSFER_WRITE);
}

static void counted_process(void *self, int64_t now_ns)
{
	struct counted *part = self;
	part->processed++;
	part->now_ns = now_ns;
}

/* Lists nothing and counts how often it was asked. */
static size_t asked_for_writes(void *self, hm2_transfer *transfers, size_t capacity)
{
	(void)transfers;
	(void)capacity;
	((struct counted *)self)->processed++;
	return 0;
}

static void start(void)
{
	const hm2_bus bus = {&bench, bench_begin, bench_finish, bench_now_ns, bench_pause_ns, bench_close, NULL};
	memset(&bench, 0, sizeof bench);
	CHECK_EQUAL(hm2_board_open(&bus, &bench.board, NULL), HM2_OK);
	CHECK_EQUAL(hm2_cycle_new(bench.board, &bench.cycle, NULL), HM2_OK);
}

static void end(void)
{
	hm2_cycle_free(bench.cycle);
	hm2_board_free(bench.board);
}

static void add(struct counted *part)
{
	const hm2_cyclic cyclic = {part, counted_reads, counted_writes, counted_process};
	CHECK_EQUAL(hm2_cycle_add(bench.cycle, &cyclic, &bench.error), HM2_OK);
}

static void test_all_reads_come_before_all_writes(void)
{
	struct counted one = {.transfers = 1}, two = {.transfers = 2};
	start();
	add(&one);
	add(&two);
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, &bench.error), HM2_OK);
	CHECK_EQUAL(bench.count, 6);
	for (size_t i = 0; i < 6; i++)
		CHECK_EQUAL(bench.seen[i].flags, i < 3 ? HM2_TRANSFER_READ : HM2_TRANSFER_WRITE);
	CHECK_EQUAL(one.processed, 1);
	CHECK_EQUAL(one.now_ns, 1234);
	CHECK_EQUAL(hm2_cycle_write(bench.cycle, &bench.error), HM2_OK);
	CHECK_EQUAL(bench.count, 3);
	CHECK_EQUAL(two.processed, 1); /* nothing was read */
	CHECK_EQUAL(hm2_cycle_read(bench.cycle, &bench.error), HM2_OK);
	CHECK_EQUAL(two.processed, 2);
	end();
}

static void test_a_failed_exchange_brings_no_readings(void)
{
	struct counted part = {.transfers = 1};
	hm2_cycle_counters counters;
	start();
	add(&part);
	bench.finish_status = HM2_ERR_TIMEOUT;
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, &bench.error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(part.processed, 0);
	bench.finish_status = HM2_OK;
	bench.begin_status = HM2_ERR_IO;
	CHECK_EQUAL(hm2_cycle_begin(bench.cycle, &bench.error), HM2_ERR_IO);
	CHECK_EQUAL(part.processed, 0);
	bench.begin_status = HM2_OK;
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, NULL), HM2_OK);
	CHECK_EQUAL(part.processed, 1);
	hm2_cycle_get_counters(bench.cycle, &counters);
	CHECK_EQUAL(counters.cycles, 1);
	CHECK_EQUAL(counters.failures, 2);
	end();
}

static void test_a_shut_gate_leaves_the_reads(void)
{
	struct counted part = {.transfers = 1};
	start();
	add(&part);
	hm2_board_set_gate(bench.board, 1);
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, &bench.error), HM2_OK);
	CHECK_EQUAL(bench.count, 1);
	CHECK_EQUAL(bench.seen[0].flags, HM2_TRANSFER_READ);
	end();
}

static void test_there_is_room_for_so_many_and_no_more(void)
{
	struct counted most = {.transfers = HM2_CYCLE_TRANSFERS}, half = {.transfers = HM2_CYCLE_TRANSFERS / 2};
	static struct counted parts[HM2_CYCLE_PARTS];
	const hm2_cyclic none = {&half, NULL, NULL, NULL};
	start();
	add(&most); /* its reads fill the list */
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, &bench.error), HM2_ERR_RANGE);
	CHECK_EQUAL(bench.error.expected, HM2_CYCLE_TRANSFERS);
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, NULL), HM2_ERR_RANGE);
	CHECK_EQUAL(most.processed, 0);
	end();
	start();
	add(&half);
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, &bench.error), HM2_OK);
	for (int i = 1; i < HM2_CYCLE_PARTS; i++)
		add(&parts[i]);
	CHECK_EQUAL(hm2_cycle_add(bench.cycle, &none, &bench.error), HM2_ERR_RANGE);
	CHECK_EQUAL(bench.error.expected, HM2_CYCLE_PARTS);
	CHECK_EQUAL(hm2_cycle_add(bench.cycle, &none, NULL), HM2_ERR_RANGE);
	end();
	hm2_cycle_free(NULL);
}

static void test_a_part_need_not_do_everything(void)
{
	const hm2_cyclic none = {NULL, NULL, NULL, NULL};
	start();
	CHECK_EQUAL(hm2_cycle_add(bench.cycle, &none, &bench.error), HM2_OK);
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, &bench.error), HM2_OK);
	CHECK_EQUAL(bench.count, 0);
	end();
}

static void test_the_watchdog_is_reloaded_until_it_bites(void)
{
	hm2_watchdog watchdog = {.status_address = STATUS, .reset_address = RESET};
	hm2_cyclic part;
	start();
	watchdog.board = bench.board;
	hm2_watchdog_part(&watchdog, &part);
	CHECK_EQUAL(hm2_cycle_add(bench.cycle, &part, NULL), HM2_OK);
	bench.status = 1; /* as after configuration: no bite of one that was not armed */
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, NULL), HM2_OK);
	CHECK_EQUAL(bench.count, 1);
	CHECK_EQUAL(watchdog.has_bitten, 0);
	bench.status = 0;
	watchdog.armed = 1;
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, NULL), HM2_OK);
	CHECK_EQUAL(bench.count, 2);
	CHECK_EQUAL(bench.seen[1].address, RESET);
	CHECK_EQUAL(*bench.seen[1].words, 0x5A000000);
	bench.status = 1;
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, NULL), HM2_OK);
	CHECK_EQUAL(watchdog.has_bitten, 1);
	CHECK_EQUAL(watchdog.armed, 0); /* nor is it reloaded when the gate is opened again */
	CHECK_EQUAL(hm2_board_gate_is_shut(bench.board), 1);
	hm2_board_set_gate(bench.board, 0);
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, NULL), HM2_OK);
	CHECK_EQUAL(bench.count, 1);
	end();
}

static void test_plain_words_take_part_while_enabled(void)
{
	uint32_t word = 7;
	hm2_cyclic_words in = {.transfer = {0x1000, 1, HM2_TRANSFER_READ, &word}, .enabled = 1};
	hm2_cyclic_words out = {.transfer = {0x2000, 1, HM2_TRANSFER_WRITE, &word}, .enabled = 1};
	hm2_cyclic part;
	start();
	hm2_cyclic_words_part(&in, &part);
	CHECK(part.writes == NULL);
	CHECK_EQUAL(part.reads(part.self, NULL, 0), 1);
	hm2_cycle_add(bench.cycle, &part, NULL);
	hm2_cyclic_words_part(&out, &part);
	CHECK(part.reads == NULL);
	CHECK_EQUAL(part.writes(part.self, NULL, 0), 1);
	hm2_cycle_add(bench.cycle, &part, NULL);
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, NULL), HM2_OK);
	CHECK_EQUAL(bench.count, 2);
	in.enabled = out.enabled = 0;
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, NULL), HM2_OK);
	CHECK_EQUAL(bench.count, 0);
	end();
}

/* Refused before anybody's writes are asked for: some are only listed once. */
static void test_words_without_room_are_refused(void)
{
	uint32_t word = 7;
	struct counted none = {.transfers = 0};
	hm2_cyclic_words in = {.transfer = {0x1000, 1, HM2_TRANSFER_READ, &word}, .enabled = 1};
	struct counted most = {.transfers = HM2_CYCLE_TRANSFERS};
	const hm2_cyclic filler = {&most, counted_reads, NULL, NULL}, writer = {&none, NULL, asked_for_writes, NULL};
	hm2_cycle_counters counters;
	hm2_cyclic part;
	start();
	hm2_cyclic_words_part(&in, &part);
	CHECK_EQUAL(hm2_cycle_add(bench.cycle, &filler, NULL), HM2_OK);
	CHECK_EQUAL(hm2_cycle_add(bench.cycle, &part, NULL), HM2_OK);
	CHECK_EQUAL(hm2_cycle_add(bench.cycle, &writer, NULL), HM2_OK);
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, &bench.error), HM2_ERR_RANGE);
	CHECK_EQUAL(bench.error.expected, HM2_CYCLE_TRANSFERS);
	CHECK_EQUAL(bench.count, 0);
	CHECK_EQUAL(none.processed, 0);
	hm2_cycle_get_counters(bench.cycle, &counters); /* they lie behind the list */
	CHECK_EQUAL(counters.cycles, 0);
	CHECK_EQUAL(counters.failures, 1);
	in.enabled = 0;
	CHECK_EQUAL(hm2_cycle_run(bench.cycle, &bench.error), HM2_OK);
	CHECK_EQUAL(bench.count, HM2_CYCLE_TRANSFERS);
	CHECK_EQUAL(none.processed, 1);
	end();
}

int main(void)
{
	test_words_without_room_are_refused();
	test_all_reads_come_before_all_writes();
	test_a_failed_exchange_brings_no_readings();
	test_a_shut_gate_leaves_the_reads();
	test_there_is_room_for_so_many_and_no_more();
	test_a_part_need_not_do_everything();
	test_the_watchdog_is_reloaded_until_it_bites();
	test_plain_words_take_part_while_enabled();
	return CHECK_RESULT();
}
