/* How long a port waits for a DOIT: it learns from good transfers when to look, so that few looks are needed and the
 * end is seen at once, and is not taken in by what is no DOIT's duration. */
#include "mailbox.h"

enum { DOIT_NS = 100000, MOST_NS = 510000 };

static struct mailbox box;

static void start(int64_t exchange_ns, int64_t takes_ns)
{
	mailbox_open(&box);
	CHECK_EQUAL(hm2_sserial_start(box.port, 1, HM2_SSERIAL_NORMAL, &box.error), 0);
	box.exchange_ns = exchange_ns;
	box.takes_ns = takes_ns;
}

/* Exchanges of the last of so many transfers. */
static int transfer(int count)
{
	for (int i = 0; i < count; i++) {
		box.exchanges = 0;
		CHECK_EQUAL(hm2_sserial_doit(box.port, 1, &box.error), 0);
	}
	return box.exchanges;
}

static int64_t last_doit_ns(void)
{
	hm2_sserial_counters counters;
	hm2_sserial_get_counters(box.port, &counters);
	return counters.last_doit_ns;
}

/* A network: one exchange writes, one reads everything, and the wait is hardly longer than the DOIT. */
static void test_where_a_look_is_dear_one_is_enough(void)
{
	start(50000, DOIT_NS);
	CHECK(transfer(1) > 2);
	CHECK_EQUAL(transfer(200), 2);
	const int64_t before_ns = box.now_ns;
	CHECK_EQUAL(transfer(100), 2);
	CHECK((box.now_ns - before_ns) / 100 <= DOIT_NS + 2 * 50000 + 5000);
	mailbox_free(&box);
}

/* A card in memory: the end is seen within a microsecond or two, for few looks. */
static void test_where_a_look_is_cheap_looks_follow_each_other(void)
{
	start(200, DOIT_NS);
	(void)transfer(2000);
	for (int i = 0; i < 100; i++) {
		CHECK(transfer(1) <= 12);
		CHECK(last_doit_ns() <= DOIT_NS + 3000);
	}
	mailbox_free(&box);
}

/* One transfer that takes so long is answered by waits that are hardly longer than before. */
static void check_hiccup(int64_t takes_ns, int times, int64_t usual_ns)
{
	box.takes_ns = takes_ns;
	(void)transfer(times);
	box.takes_ns = DOIT_NS;
	(void)transfer(1);
	if (box.exchange_ns < 1000)
		CHECK(last_doit_ns() <= DOIT_NS + 5000);
	const int64_t before_ns = box.now_ns;
	(void)transfer(10);
	CHECK(box.now_ns - before_ns <= usual_ns + usual_ns / 3);
}

static void test_a_hiccup_is_not_learned(int64_t exchange_ns)
{
	start(exchange_ns, DOIT_NS);
	(void)transfer(2000);
	const int64_t before_ns = box.now_ns;
	(void)transfer(10);
	const int64_t usual_ns = box.now_ns - before_ns;
	check_hiccup(400000, 1, usual_ns);
	(void)transfer(1000);
	check_hiccup(MOST_NS + 100000, 3, usual_ns); /* longer than any DOIT takes: the host was away */
	mailbox_free(&box);
}

/* Unlike a hiccup, what takes a little longer is waited for from then on. */
static void test_a_doit_that_takes_a_little_longer_is_learned_at_once(void)
{
	start(5000, DOIT_NS);
	(void)transfer(3000);
	box.takes_ns = DOIT_NS + 15000;
	CHECK(transfer(1) > 2);
	const int64_t before_ns = box.now_ns;
	CHECK_EQUAL(transfer(1), 2);
	CHECK(box.now_ns - before_ns <= box.takes_ns + 20000);
	mailbox_free(&box);
}

/* Shorter DOITs are found again, without haste. */
static void test_the_wait_creeps_back(void)
{
	start(50000, 300000);
	(void)transfer(100);
	box.takes_ns = DOIT_NS;
	const int64_t before_ns = box.now_ns;
	(void)transfer(1);
	const int64_t first_ns = box.now_ns - before_ns;
	(void)transfer(5000);
	const int64_t later_ns = box.now_ns;
	(void)transfer(1);
	CHECK(box.now_ns - later_ns < first_ns - 100000);
	mailbox_free(&box);
}

/* ---- pipelined ---- */

static void test_a_doit_is_never_written_over_one_at_work(void)
{
	uint32_t requested;
	start(1000, DOIT_NS);
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), 0);
	box.count = 0;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), HM2_ERR_BUSY);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_TOO_SOON);
	CHECK_EQUAL(box.count, 0);
	box.now_ns += DOIT_NS;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), 0);
	CHECK_EQUAL(requested, 1);
	CHECK_EQUAL(box.count, 1);
	box.now_ns += MOST_NS; /* it must be over: results and the next DOIT in one exchange */
	box.exchanges = 0;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), 0);
	CHECK_EQUAL(box.exchanges, 1);
	box.now_ns += DOIT_NS;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 0, &requested, &box.error), 0); /* the last result, nothing new */
	CHECK_EQUAL(requested, 1);
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 0, &requested, &box.error), 0);
	CHECK_EQUAL(requested, 0);
	CHECK_EQUAL(box.count, 2);
	mailbox_free(&box);
}

static void test_a_pipelined_doit_that_never_ends_is_dug_out(void)
{
	uint32_t requested;
	start(1000, 1000000000);
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), 0);
	int status = HM2_ERR_BUSY;
	for (int i = 0; i < 5 && status == HM2_ERR_BUSY; i++) { /* one that was delivered late gets a few cycles */
		box.now_ns += 4 * MOST_NS + 1;
		status = hm2_sserial_cycle(box.port, 1, &requested, &box.error);
	}
	CHECK_EQUAL(status, HM2_ERR_TIMEOUT);
	CHECK_EQUAL(hm2_sserial_started(box.port), 0);
	mailbox_free(&box);
}

/* A pipelined DOIT whose exchange did not come back. The network lets it go just before the next look, long after its
 * limit. */
static void in_doubt(int64_t takes_ns)
{
	uint32_t requested;
	start(1000, DOIT_NS);
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), 0);
	box.now_ns += 4 * MOST_NS;
	box.fail_next = 1;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), HM2_ERR_IO);
	box.now_ns += 4 * MOST_NS + 1;
	box.words[COMMAND / 4] = 0x1001;
	box.done_ns = box.now_ns + takes_ns;
}

static void test_a_pipelined_doit_that_begins_late_is_waited_for(void)
{
	uint32_t requested;
	in_doubt(DOIT_NS);
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), HM2_ERR_BUSY);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_TOO_SOON);
	box.now_ns += DOIT_NS;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), 0);
	CHECK_EQUAL(requested, 1);
	mailbox_free(&box);
}

/* By any other command as well. */
static void test_a_command_waits_for_a_doit_that_begins_late(void)
{
	in_doubt(DOIT_NS);
	CHECK_EQUAL(hm2_sserial_doit(box.port, 1, &box.error), 0);
	CHECK_EQUAL(hm2_sserial_started(box.port), 1);
	mailbox_free(&box);
}

/* It has the time of a DOIT once, not with each look. */
static void test_one_that_begins_late_and_never_ends_is_dug_out(void)
{
	uint32_t requested;
	in_doubt(1000 * MOST_NS);
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), HM2_ERR_BUSY);
	box.now_ns += 4 * MOST_NS + 1;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(hm2_sserial_started(box.port), 0);
	mailbox_free(&box);
}

/* What ends a cycle before the bus sees it, when its port has been asked already: the part behind it in the list, or an
 * exchange that this thread has not finished. */
enum spoiling { ASKS_FOR_TOO_MUCH, SHUTS_THE_GATE, BETWEEN, SPOILINGS };
static enum spoiling spoiling;
static int spoils;

static size_t spoil(void *self, hm2_transfer *transfers, size_t capacity)
{
	(void)self;
	(void)transfers;
	if (spoils && spoiling == SHUTS_THE_GATE)
		hm2_board_set_gate(box.board, 1);
	return spoils && spoiling == ASKS_FOR_TOO_MUCH ? capacity + 1 : 0;
}

static void run_spoiled(struct hm2_cycle *cycle)
{
	const int statuses[SPOILINGS] = {HM2_ERR_RANGE, HM2_ERR_GATED, HM2_ERR_BUSY};
	uint32_t word;
	const hm2_transfer other = {0x100, 1, HM2_TRANSFER_READ, &word};
	if (spoiling == BETWEEN)
		CHECK_EQUAL(hm2_begin(box.board, &other, 1, NULL), HM2_OK);
	spoils = 1;
	CHECK_EQUAL(hm2_cycle_run(cycle, NULL), statuses[spoiling]);
	spoils = 0;
	if (spoiling == BETWEEN)
		CHECK_EQUAL(hm2_finish(box.board, box.now_ns, NULL), HM2_OK);
	hm2_board_set_gate(box.board, 0);
	box.now_ns += MOST_NS;
}

static void test_a_cycle_that_never_got_to_the_bus_has_brought_no_inputs(void)
{
	const hm2_cyclic spoiler = {NULL, NULL, spoil, NULL};
	for (spoiling = 0; spoiling < SPOILINGS; spoiling++) {
		uint32_t requested;
		hm2_cyclic part;
		struct hm2_cycle *cycle;
		start(1000, DOIT_NS);
		hm2_sserial_part(box.port, &part);
		CHECK_EQUAL(hm2_cycle_new(box.board, &cycle, NULL), HM2_OK);
		CHECK_EQUAL(hm2_cycle_add(cycle, &part, NULL), HM2_OK);
		CHECK_EQUAL(hm2_cycle_add(cycle, &spoiler, NULL), HM2_OK);
		hm2_sserial_set_cyclic(box.port, 1);
		run_spoiled(cycle);
		CHECK_EQUAL(hm2_cycle_run(cycle, NULL), HM2_OK);
		(void)hm2_sserial_cyclic_result(box.port, &requested, NULL);
		CHECK_EQUAL(requested, 0);
		for (int i = 0; i < 2; i++, box.now_ns += MOST_NS)
			CHECK_EQUAL(hm2_cycle_run(cycle, NULL), HM2_OK);
		(void)hm2_sserial_cyclic_result(box.port, &requested, NULL);
		CHECK_EQUAL(requested, 1);
		hm2_cycle_free(cycle);
		mailbox_free(&box);
	}
}

int main(void)
{
	test_where_a_look_is_dear_one_is_enough();
	test_where_a_look_is_cheap_looks_follow_each_other();
	test_a_hiccup_is_not_learned(50000);
	test_a_hiccup_is_not_learned(200);
	test_a_doit_that_takes_a_little_longer_is_learned_at_once();
	test_the_wait_creeps_back();
	test_a_doit_is_never_written_over_one_at_work();
	test_a_pipelined_doit_that_never_ends_is_dug_out();
	test_a_pipelined_doit_that_begins_late_is_waited_for();
	test_a_command_waits_for_a_doit_that_begins_late();
	test_one_that_begins_late_and_never_ends_is_dug_out();
	test_a_cycle_that_never_got_to_the_bus_has_brought_no_inputs();
	return CHECK_RESULT();
}
