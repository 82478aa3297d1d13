/* What the engine and the UDP transport are measured against: as many wakes, exchanges and records as were asked for,
 * and a failure ends a measurement. */
#include <string.h>

#include "check.h"
#include "hm2.h"
#include "mailbox.h"

static struct mailbox box;
static hm2_error error;

static void test_wakes_are_counted_and_missed_periods_left_out(void)
{
	static hm2_histogram lateness;
	hm2_floor_wake(200000, 50000, 20, &lateness);
	CHECK_EQUAL(lateness.count, 20);
	CHECK(lateness.minimum_ns >= 0);
	hm2_histogram_reset(&lateness);
	hm2_floor_wake(100, 0, 20, &lateness); /* no thread wakes that often */
	CHECK_EQUAL(lateness.count, 20);
	hm2_histogram_reset(&lateness);
	hm2_floor_wake(200000, 200000, 20, &lateness); /* awake all the time, and never too early */
	CHECK_EQUAL(lateness.count, 20);
	CHECK(lateness.minimum_ns >= 0);
}

static void test_a_failure_ends_a_measurement(void)
{
	uint32_t word;
	uint64_t ns[4] = {0};
	const hm2_transfer transfer = {0x1000, 1, HM2_TRANSFER_READ, &word};
	mailbox_open(&box);
	CHECK_EQUAL(hm2_floor_exchanges(box.board, &transfer, 1, 4, ns, &error), HM2_OK);
	CHECK_EQUAL(box.exchanges, 4);
	box.fail_at = 6;
	CHECK_EQUAL(hm2_floor_exchanges(box.board, &transfer, 1, 4, ns, &error), HM2_ERR_IO);
	CHECK_EQUAL(box.exchanges, 6);
	mailbox_free(&box);
}

static void test_records_find_room_or_are_dropped(void)
{
	const uint64_t record = 7;
	struct hm2_record_ring *ring = NULL;
	hm2_record_ring_counters counters;
	CHECK_EQUAL(hm2_record_ring_new(4, sizeof record, &ring, &error), HM2_OK);
	(void)hm2_floor_pushes(ring, &record, 6);
	hm2_record_ring_get_counters(ring, &counters);
	CHECK_EQUAL(counters.pushed, 4);
	CHECK_EQUAL(counters.dropped, 2);
	hm2_record_ring_free(ring);
}

/* ---- cycles beside the UDP floor ---- */

static struct hm2_process_data *data;
static double value;
static uint64_t raw;
static uint32_t word;

static void open_cycle(hm2_udp_floor_cycle *cycle, hm2_cyclic_words *words)
{
	const hm2_field field = {.kind = HM2_FIELD_UNSIGNED, .partner = -1, .bits = 8, .scale = 255, .high = 255};
	const hm2_image in = {&word, 1, 1, 1, 1, 1}, none = {0};
	hm2_cyclic part;
	mailbox_open(&box);
	memset(cycle, 0, sizeof *cycle);
	*words = (hm2_cyclic_words){{0x1000, 1, HM2_TRANSFER_READ, &word}, 1};
	CHECK_EQUAL(hm2_cycle_new(box.board, &cycle->cycle, &error), HM2_OK);
	hm2_cyclic_words_part(words, &part);
	CHECK_EQUAL(hm2_cycle_add(cycle->cycle, &part, &error), HM2_OK);
	CHECK_EQUAL(hm2_process_data_new(&field, 1, &in, &none, &value, &raw, &data, &error), HM2_OK);
}

static void close_cycle(hm2_udp_floor_cycle *cycle)
{
	hm2_process_data_free(data);
	hm2_cycle_free(cycle->cycle);
	mailbox_free(&box);
}

static void test_values_are_those_of_good_cycles(void)
{
	hm2_udp_floor_cycle cycle;
	hm2_cyclic_words words;
	uint64_t ns[3];
	open_cycle(&cycle, &words);
	box.words[0x1000 / 4] = 5;
	CHECK_EQUAL(hm2_udp_floor_cycles(&cycle, 3, ns), HM2_OK); /* without process data: nothing is unpacked */
	CHECK_EQUAL(raw, 0);
	cycle.process_data = data;
	CHECK_EQUAL(hm2_udp_floor_cycles(&cycle, 3, ns), HM2_OK);
	CHECK(value == 5.0);
	box.words[0x1000 / 4] = 6;
	box.fail_next = 1;
	CHECK_EQUAL(hm2_udp_floor_cycles(&cycle, 3, ns), HM2_ERR_IO);
	CHECK_EQUAL(cycle.error.status, HM2_ERR_IO);
	CHECK(value == 5.0);
	close_cycle(&cycle);
	hm2_udp_floor_nothing(3, ns);
}

static void test_late_cycles_are_told_apart(void)
{
	hm2_udp_floor_cycle cycle;
	hm2_cyclic_words words;
	hm2_udp_floor_late lates[2];
	hm2_udp_floor_timing timing = {.capacity = 2, .lates = lates};
	open_cycle(&cycle, &words);
	cycle.process_data = data;
	box.fail_next = 1;
	hm2_udp_floor_periodic(&cycle, 500000, 5, &timing);
	CHECK_EQUAL(timing.cycles, 5);
	CHECK_EQUAL(timing.lost, 1);
	timing = (hm2_udp_floor_timing){.capacity = 2, .lates = lates};
	cycle.process_data = NULL;
	hm2_udp_floor_periodic(&cycle, 1, 5, &timing); /* a nanosecond: every cycle is late, each period left out */
	CHECK_EQUAL(timing.cycles, 5);
	CHECK_EQUAL(timing.late, 5);
	CHECK_EQUAL(timing.recorded, 2);
	CHECK(timing.skipped > 5);
	for (int i = 0; i < 2; i++)
		for (int stage = 0; stage < HM2_UDP_FLOOR_STAGES; stage++)
			CHECK(lates[i].ns[stage] <= lates[i].ns[lates[i].stage]);
	close_cycle(&cycle);
}

int main(void)
{
	test_wakes_are_counted_and_missed_periods_left_out();
	test_a_failure_ends_a_measurement();
	test_records_find_room_or_are_dropped();
	test_values_are_those_of_good_cycles();
	test_late_cycles_are_told_apart();
	return CHECK_RESULT();
}
