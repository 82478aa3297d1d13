/* A port in a board's cycle: nothing is written over a DOIT at work, no result is told twice or of another DOIT, and a
 * DOIT that never ends is told once. */
#include "mailbox.h"

enum { DOIT_NS = 100000, MOST_NS = 510000 };

static struct mailbox box;
static struct hm2_cycle *cycle;

/* Channels 0 and 1 run, `mask` of them in the cycle; a DOIT takes so long. */
static void start(int mode, uint32_t mask, int64_t takes_ns)
{
	hm2_cyclic part;
	mailbox_open(&box);
	CHECK_EQUAL(hm2_sserial_start(box.port, 3, mode, &box.error), 0);
	box.count = 0;
	box.takes_ns = takes_ns;
	hm2_sserial_part(box.port, &part);
	CHECK_EQUAL(hm2_cycle_new(box.board, &cycle, NULL), HM2_OK);
	CHECK_EQUAL(hm2_cycle_add(cycle, &part, NULL), HM2_OK);
	hm2_sserial_set_cyclic(box.port, mask);
}

static void end(void)
{
	hm2_cycle_free(cycle);
	mailbox_free(&box);
}

/* A cycle so long after the last one. Returns the channels whose result it brought. */
static uint32_t run(int64_t after_ns)
{
	uint32_t requested = 0xFFFF;
	box.now_ns += after_ns;
	CHECK_EQUAL(hm2_cycle_run(cycle, &box.error), HM2_OK);
	CHECK_EQUAL(hm2_sserial_cyclic_result(box.port, &requested, &box.error), 0);
	return requested;
}

static hm2_sserial_counters counters(void)
{
	hm2_sserial_counters all;
	hm2_sserial_get_counters(box.port, &all);
	return all;
}

static void test_each_result_is_told_once(void)
{
	start(HM2_SSERIAL_NORMAL, 3, DOIT_NS);
	CHECK_EQUAL(run(0), 0);
	for (uint32_t i = 1; i <= 3; i++) {
		uint32_t requested = 0;
		box.words[USER0 / 4] = i;
		CHECK_EQUAL(run(MOST_NS), 3);
		CHECK_EQUAL(hm2_sserial_get_image(box.port)->inputs[0][0], i);
		CHECK_EQUAL(hm2_sserial_cyclic_result(box.port, &requested, &box.error), 0);
		CHECK_EQUAL(requested, 0);
	}
	CHECK_EQUAL(box.count, 4);
	CHECK_EQUAL(box.commands[3], 0x1003);
	end();
}

/* In one exchange with the last result's reads, other channels would answer with what is not theirs. */
static void test_other_channels_are_asked_when_the_last_have_answered(void)
{
	start(HM2_SSERIAL_NORMAL, 1, DOIT_NS);
	CHECK_EQUAL(run(0), 0);
	hm2_sserial_set_cyclic(box.port, 3);
	CHECK_EQUAL(run(MOST_NS), 1);
	CHECK_EQUAL(box.count, 1);
	CHECK_EQUAL(counters().too_soon, 1);
	CHECK_EQUAL(run(MOST_NS), 0);
	CHECK_EQUAL(run(MOST_NS), 3);
	CHECK_EQUAL(box.commands[1], 0x1003);
	end();
}

/* Behind an exchange the result comes too late to be sure; the next one writes. */
static void test_a_cycle_that_comes_soon_only_looks(void)
{
	start(HM2_SSERIAL_NORMAL, 1, DOIT_NS);
	CHECK_EQUAL(run(0), 0);
	CHECK_EQUAL(run(DOIT_NS), 1);
	CHECK_EQUAL(box.count, 1);
	CHECK_EQUAL(counters().too_soon, 1);
	CHECK_EQUAL(run(DOIT_NS), 0);
	CHECK_EQUAL(box.count, 2);
	end();
}

/* Who only writes never sees a DOIT end. */
static void test_a_cycle_that_only_writes_does_not_write_over_a_doit(void)
{
	start(HM2_SSERIAL_NORMAL, 1, DOIT_NS);
	CHECK_EQUAL(hm2_cycle_write(cycle, &box.error), HM2_OK);
	box.now_ns += MOST_NS;
	CHECK_EQUAL(hm2_cycle_write(cycle, &box.error), HM2_OK);
	CHECK_EQUAL(box.count, 1);
	CHECK_EQUAL(counters().too_soon, 1);
	CHECK_EQUAL(run(MOST_NS), 1);
	end();
}

/* There a DOIT is a memory access. */
static void test_a_port_in_setup_mode_takes_no_part(void)
{
	start(HM2_SSERIAL_SETUP, 3, 0);
	CHECK_EQUAL(run(0), 0);
	CHECK_EQUAL(run(MOST_NS), 0);
	CHECK_EQUAL(box.count, 0);
	end();
}

static void test_a_doit_that_never_ends_is_told_and_not_written_over(void)
{
	uint32_t requested = 0xFFFF;
	start(HM2_SSERIAL_NORMAL, 1, INT64_MAX / 2);
	CHECK_EQUAL(run(0), 0);
	box.now_ns += MOST_NS;
	CHECK_EQUAL(hm2_cycle_run(cycle, &box.error), HM2_OK); /* written over: it must have been over */
	CHECK_EQUAL(counters().overwritten, 1);
	for (int i = 0; i < 3; i++) {
		box.now_ns += 4 * MOST_NS + 1;
		CHECK_EQUAL(hm2_cycle_run(cycle, &box.error), HM2_OK);
	}
	CHECK_EQUAL(box.count, 2);
	box.takes_ns = 0; /* what rescues it works */
	CHECK_EQUAL(hm2_sserial_cyclic_result(box.port, &requested, &box.error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_UNJAMMED);
	CHECK_EQUAL(box.error.received, 0x1001);
	CHECK_EQUAL(requested, 0);
	CHECK_EQUAL(hm2_sserial_started(box.port), 0);
	CHECK_EQUAL(hm2_sserial_cyclic_result(box.port, &requested, &box.error), 0); /* once */
	CHECK_EQUAL(counters().hung, 1);
	end();
}

/* Seen by one who only reads; nothing helps, and that too is told once. */
static void test_nothing_is_written_over_a_doit_that_was_seen_to_hang(void)
{
	uint32_t requested = 0xFFFF;
	start(HM2_SSERIAL_NORMAL, 1, INT64_MAX / 2);
	CHECK_EQUAL(run(0), 0);
	box.now_ns += 4 * MOST_NS + 1;
	CHECK_EQUAL(hm2_cycle_read(cycle, &box.error), HM2_OK);
	CHECK_EQUAL(hm2_cycle_run(cycle, &box.error), HM2_OK);
	CHECK_EQUAL(box.count, 1);
	CHECK_EQUAL(hm2_sserial_cyclic_result(box.port, &requested, &box.error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_DEAD);
	CHECK_EQUAL(hm2_sserial_cyclic_result(box.port, &requested, &box.error), 0);
	end();
}

static size_t fill(void *self, hm2_transfer *transfers, size_t capacity)
{
	static uint32_t word;
	const size_t count = HM2_CYCLE_TRANSFERS - *(const size_t *)self;
	for (size_t i = 0; i < count && i < capacity; i++)
		transfers[i] = (hm2_transfer){0x100, 1, HM2_TRANSFER_READ, &word};
	return count;
}

static void test_a_cycle_without_room_for_a_port_is_refused(void)
{
	size_t left = 1;
	hm2_cyclic part;
	const hm2_cyclic filler = {&left, fill, NULL, NULL};
	start(HM2_SSERIAL_NORMAL, 1, DOIT_NS);
	CHECK_EQUAL(run(0), 0);
	hm2_cycle_free(cycle);
	hm2_sserial_part(box.port, &part);
	CHECK_EQUAL(hm2_cycle_new(box.board, &cycle, NULL), HM2_OK);
	CHECK_EQUAL(hm2_cycle_add(cycle, &filler, NULL), HM2_OK);
	CHECK_EQUAL(hm2_cycle_add(cycle, &part, NULL), HM2_OK);
	const int before = box.exchanges;
	box.now_ns += MOST_NS;
	CHECK_EQUAL(hm2_cycle_run(cycle, &box.error), HM2_ERR_RANGE);
	CHECK_EQUAL(box.error.expected, HM2_CYCLE_TRANSFERS);
	CHECK_EQUAL(box.exchanges, before);
	left = 20;
	CHECK_EQUAL(hm2_cycle_run(cycle, &box.error), HM2_OK);
	end();
}

/* ---- pipelined without a cycle ---- */

/* A network delivers a DOIT again while its successor is at work: the firmware ends one and shows nothing of the other. */
static void test_a_result_that_was_hidden_is_not_taken(void)
{
	uint32_t requested = 0;
	start(HM2_SSERIAL_NORMAL, 0, DOIT_NS);
	box.words[USER0 / 4] = 0x11;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), 0);
	box.now_ns += MOST_NS;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), 0);
	CHECK_EQUAL(requested, 1);
	box.now_ns += MOST_NS;
	box.words[COMMAND / 4] = 0x1001;
	box.done_ns = box.now_ns + DOIT_NS;
	box.words[USER0 / 4] = 0x22;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), HM2_ERR_BUSY);
	CHECK_EQUAL(counters().overwritten, 1);
	box.now_ns += MOST_NS;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), 0);
	CHECK_EQUAL(requested, 0);
	CHECK_EQUAL(counters().hidden, 1);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->inputs[0][0], 0x11);
	box.now_ns += MOST_NS;
	CHECK_EQUAL(hm2_sserial_cycle(box.port, 1, &requested, &box.error), 0);
	CHECK_EQUAL(requested, 1);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->inputs[0][0], 0x22);
	end();
}

int main(void)
{
	test_each_result_is_told_once();
	test_other_channels_are_asked_when_the_last_have_answered();
	test_a_cycle_that_comes_soon_only_looks();
	test_a_cycle_that_only_writes_does_not_write_over_a_doit();
	test_a_port_in_setup_mode_takes_no_part();
	test_a_doit_that_never_ends_is_told_and_not_written_over();
	test_nothing_is_written_over_a_doit_that_was_seen_to_hang();
	test_a_cycle_without_room_for_a_port_is_refused();
	test_a_result_that_was_hidden_is_not_taken();
	return CHECK_RESULT();
}
