/* Participants of a cycle: a list that does not fit is not begun, and nothing is taken for sent that was not; what a
 * watchdog, an absolute encoder and a resolver make of their words. */
#include <string.h>

#include "check.h"
#include "hm2.h"
#include "mailbox.h"

enum { COUNT = 2, POISON = 0x5A };

typedef size_t lister(void *self, hm2_transfer *transfers, size_t capacity);

/* How many there are, at whatever capacity; with too little room none is put down. */
static size_t check_list(lister *list, void *self, size_t expected)
{
	hm2_transfer transfers[HM2_CYCLE_TRANSFERS], blank;
	memset(&blank, POISON, sizeof blank);
	for (size_t capacity = 0; capacity < expected; capacity++) {
		memset(transfers, POISON, sizeof transfers);
		CHECK_EQUAL(list(self, transfers, capacity), expected);
		CHECK(memcmp(&transfers[0], &blank, sizeof blank) == 0);
	}
	memset(transfers, POISON, sizeof transfers);
	CHECK_EQUAL(list(self, transfers, HM2_CYCLE_TRANSFERS), expected);
	for (size_t i = 0; i < expected; i++)
		CHECK(transfers[i].address % 4 == 0 && transfers[i].count >= 1);
	CHECK(memcmp(&transfers[expected], &blank, sizeof blank) == 0);
	return expected;
}

static void check_part(const hm2_cyclic *part, size_t reads, size_t writes)
{
	CHECK(part->reads ? check_list(part->reads, part->self, reads) == reads : reads == 0);
	CHECK(part->writes ? check_list(part->writes, part->self, writes) == writes : writes == 0);
}

static void test_lists_that_do_not_fit_are_not_begun(void)
{
	static uint32_t words[64];
	static hm2_encoder encoder[COUNT];
	static hm2_stepgen stepgen[COUNT];
	static hm2_field_input input[COUNT];
	static hm2_resolver resolver[COUNT];
	static hm2_absolute absolute[COUNT];
	static hm2_watchdog watchdog;
	hm2_encoders encoders = {.encoders = encoder, .words = words, .count = COUNT, .timestamp_address = 0x3100,
	                         .count_address = 0x3000, .control_address = 0x3200, .instance_stride = 4};
	hm2_stepgens stepgens = {stepgen, words, COUNT, 0x2000, 0x2100};
	hm2_field_inputs inputs = {input, COUNT, 0x4000, 0x4100, 0x4200, 4};
	hm2_resolvers resolvers = {resolver, words, COUNT, 0x5000, 0x5100, 0x5200};
	hm2_absolutes absolutes = {.channels = absolute, .words = words, .count = COUNT, .start = 1};
	hm2_cyclic_words plain = {{0x100, 1, HM2_TRANSFER_READ, words}, 1};
	hm2_cyclic part;
	encoder[0].write_control = encoder[1].write_control = 1;
	hm2_encoders_part(&encoders, &part);
	check_part(&part, 3, 2);
	check_part(&part, 3, 0); /* written once */
	hm2_stepgens_part(&stepgens, &part);
	check_part(&part, 1, 1);
	hm2_field_inputs_part(&inputs, &part);
	check_part(&part, 3 * COUNT, 0);
	hm2_resolvers_part(&resolvers, &part);
	check_part(&part, 3, 0);
	hm2_absolutes_part(&absolutes, &part);
	check_part(&part, 4, 1);
	absolutes.start = 0;
	check_part(&part, 4, 0);
	hm2_watchdog_part(&watchdog, &part);
	check_part(&part, 1, 0);
	watchdog.armed = 1;
	check_part(&part, 1, 1);
	hm2_cyclic_words_part(&plain, &part);
	check_part(&part, 1, 0);
	plain.enabled = 0;
	check_part(&part, 0, 0);
}

/* More than there is room for is an error of the cycle, and the control words wait for one that has it. */
static void test_control_words_without_room_are_not_lost(void)
{
	static struct mailbox box;
	static uint32_t words[1 + 2 * COUNT];
	static hm2_encoder encoder[COUNT];
	hm2_encoders encoders = {.encoders = encoder, .words = words, .count = COUNT, .timestamp_address = 0x3100,
	                         .count_address = 0x3000, .control_address = 0x3200, .instance_stride = 4};
	struct hm2_cycle *cycle = NULL;
	hm2_cyclic part;
	mailbox_open(&box);
	CHECK_EQUAL(hm2_cycle_new(box.board, &cycle, NULL), HM2_OK);
	encoder[0] = encoder[1] = (hm2_encoder){.control_word = 7, .write_control = 1};
	hm2_encoders_part(&encoders, &part);
	hm2_transfer transfers[1];
	CHECK_EQUAL(part.writes(part.self, transfers, 1), 2);
	CHECK(encoder[0].write_control && encoder[1].write_control);
	CHECK_EQUAL(hm2_cycle_add(cycle, &part, NULL), HM2_OK);
	CHECK_EQUAL(hm2_cycle_write(cycle, NULL), HM2_OK);
	CHECK_EQUAL(box.words[0x3200 / 4], 7);
	CHECK_EQUAL(box.words[0x3204 / 4], 7);
	hm2_cycle_free(cycle);
	mailbox_free(&box);
}

/* A bite counts while the watchdog is armed, shuts the gate, and is not fed away. */
static void test_a_bite_shuts_the_gate_once_it_was_armed(void)
{
	static struct mailbox box;
	static hm2_watchdog watchdog;
	struct hm2_cycle *cycle = NULL;
	hm2_cyclic part;
	mailbox_open(&box);
	watchdog = (hm2_watchdog){.board = box.board, .status_address = 0xD00, .reset_address = 0xE00};
	CHECK_EQUAL(hm2_cycle_new(box.board, &cycle, NULL), HM2_OK);
	hm2_watchdog_part(&watchdog, &part);
	CHECK_EQUAL(hm2_cycle_add(cycle, &part, NULL), HM2_OK);
	box.words[0xD00 / 4] = 1;
	CHECK_EQUAL(hm2_cycle_run(cycle, NULL), HM2_OK);
	CHECK_EQUAL(watchdog.has_bitten, 0); /* left over from another program */
	CHECK_EQUAL(box.words[0xE00 / 4], 0);
	box.words[0xD00 / 4] = 0;
	watchdog.armed = 1;
	CHECK_EQUAL(hm2_cycle_run(cycle, NULL), HM2_OK);
	CHECK_EQUAL(box.words[0xE00 / 4], 0x5A000000);
	CHECK_EQUAL(hm2_board_gate_is_shut(box.board), 0);
	box.words[0xD00 / 4] = 1;
	CHECK_EQUAL(hm2_cycle_run(cycle, NULL), HM2_OK);
	CHECK_EQUAL(watchdog.has_bitten, 1);
	CHECK_EQUAL(watchdog.armed, 0);
	CHECK_EQUAL(hm2_board_gate_is_shut(box.board), 1);
	box.words[0xE00 / 4] = 0;
	CHECK_EQUAL(hm2_cycle_run(cycle, NULL), HM2_OK); /* looking goes on, nothing is written */
	CHECK_EQUAL(box.words[0xE00 / 4], 0);
	hm2_cycle_free(cycle);
	mailbox_free(&box);
}

static void test_an_absolute_reading_is_taken_when_it_is_new_and_whole(void)
{
	static uint32_t words[2 + 3 * COUNT];
	hm2_absolute channels[COUNT] = {{.bits = 12, .low_bits = 12}, {.bits = 0}};
	hm2_absolutes all = {.channels = channels, .words = words, .count = COUNT, .control_busy_mask = 0x100,
	                     .control_available_mask = 0x200};
	static const struct {
		uint32_t busy, control;
		int fresh;
	} cases[] = {{0, 0x200, 1}, {1, 0x200, 0}, {2, 0x200, 1}, {0, 0x300, 0}, {0, 0, 0}};
	uint32_t missed = 0;
	hm2_cyclic part;
	hm2_absolutes_part(&all, &part);
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		words[0] = cases[i].busy;
		words[1] = words[2] = cases[i].control;
		words[1 + 2 * COUNT] = 100 + (uint32_t)i;
		part.process(part.self, 0);
		missed = cases[i].fresh ? 0 : missed + 1;
		CHECK_EQUAL(channels[0].fresh, cases[i].fresh);
		CHECK_EQUAL(channels[0].missed, missed);
		CHECK_EQUAL(channels[0].data, cases[i].fresh ? 100 + i : channels[0].data);
		CHECK_EQUAL(channels[1].fresh, 0); /* not used */
	}
	CHECK_EQUAL(channels[0].count, 102);
}

/* Positions of two runs of bits, in Gray code, over the wrap, and none at all. */
static void test_absolute_positions(void)
{
	hm2_absolute split = {.bits = 64, .low_shift = 4, .low_bits = 4, .high_shift = 60, .high_bits = 4};
	hm2_absolute gray = {.bits = 8, .low_bits = 4, .gray = 1};
	hm2_absolute none = {.bits = 8}, beyond = {.bits = 64, .low_shift = 64, .low_bits = 8}, all = {.bits = 64, .low_bits = 64};
	hm2_absolute_update(&split, 0xA000000000000050);
	CHECK_EQUAL(split.count, 0xA5);
	hm2_absolute_update(&gray, 0x8); /* 15 */
	hm2_absolute_update(&gray, 0x0); /* and one on is 0: the wrap */
	CHECK_EQUAL(gray.count, 16);
	hm2_absolute_update(&gray, 0x8);
	CHECK_EQUAL(gray.count, 15);
	hm2_absolute_update(&none, 0xFF);
	CHECK_EQUAL(none.count, 0);
	CHECK_EQUAL(none.data, 0xFF);
	hm2_absolute_update(&beyond, UINT64_MAX);
	CHECK_EQUAL(beyond.count, 0);
	hm2_absolute upper = {.bits = 8, .high_shift = 4, .high_bits = 4}, wide = {.bits = 64, .low_bits = 60, .high_bits = 5};
	hm2_absolute_update(&upper, 0x7F);
	CHECK_EQUAL(upper.count, 7); /* its turns only */
	hm2_absolute_update(&wide, 5); /* more than a count holds: the data are all there is */
	CHECK_EQUAL(wide.count, 0);
	CHECK_EQUAL(wide.data, 5);
	hm2_absolute_update(&all, 5);
	hm2_absolute_update(&all, 3);
	CHECK_EQUAL(all.count, 3);
}

/* The index is where the angle passes zero, upwards at the upper end, downwards at the lower, and only when wanted. */
static void test_a_resolvers_index(void)
{
	hm2_resolver resolver = {.index_divisor = 1, .index_enable = 1};
	hm2_resolver_update(&resolver, 0xF0000000);
	CHECK_EQUAL(resolver.index_enable, 1); /* the first reading passes nothing */
	hm2_resolver_update(&resolver, 0x10000000);
	CHECK_EQUAL(resolver.index_enable, 0);
	CHECK_EQUAL(resolver.zero, INT64_C(1) << 32);
	resolver.index_enable = 1;
	hm2_resolver_update(&resolver, 0xF0000000);
	CHECK_EQUAL(resolver.zero, INT64_C(1) << 32);
	hm2_resolver_update(&resolver, 0x80000000);
	hm2_resolver_update(&resolver, 0x10000000);
	resolver.index_enable = 1;
	hm2_resolver_update(&resolver, 0xE0000000); /* below zero */
	CHECK_EQUAL(resolver.zero, 0);
	CHECK_EQUAL(resolver.turns, -0x20000000);
	hm2_resolver_update(&resolver, 0x20000000);
	CHECK_EQUAL(resolver.zero, 0); /* not asked for */
	resolver.valid = 0; /* a card that was away: its first reading is again no motion */
	resolver.index_enable = 1;
	resolver.turns = INT64_C(5) << 32;
	hm2_resolver_update(&resolver, 0x20000000);
	CHECK_EQUAL(resolver.index_enable, 1);
}

int main(void)
{
	test_lists_that_do_not_fit_are_not_begun();
	test_control_words_without_room_are_not_lost();
	test_a_bite_shuts_the_gate_once_it_was_armed();
	test_an_absolute_reading_is_taken_when_it_is_new_and_whole();
	test_absolute_positions();
	test_a_resolvers_index();
	return CHECK_RESULT();
}
