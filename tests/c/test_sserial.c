/* The SSERIAL port when its mailbox hangs, its bus fails or nobody takes its faults. */
#include "mailbox.h"
#include "registers.h"

static struct mailbox box;

static void check_commands(const uint32_t *expected, size_t count)
{
	CHECK_EQUAL(box.count, count);
	for (size_t i = 0; i < count && i < box.count; i++)
		CHECK_EQUAL(box.commands[i], expected[i]);
}

static void start(uint32_t mask)
{
	mailbox_open(&box);
	CHECK_EQUAL(hm2_sserial_start(box.port, mask, HM2_SSERIAL_NORMAL, &box.error), 0);
	box.count = 0;
}

static int not_a_doit(struct mailbox *mailbox, uint32_t command)
{
	(void)mailbox;
	return (command & 0xFF00) != 0x1000;
}

static void test_a_hung_doit_is_aborted_and_everything_stopped(void)
{
	static const uint32_t expected[] = {0x1003, 0x08FF, 0x0800};
	start(3);
	hm2_sserial_get_image(box.port)->outputs[0][0] = 0x1234;
	box.completes = not_a_doit;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 3, &box.error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_UNJAMMED);
	CHECK_EQUAL(box.error.received, 0x1003);
	check_commands(expected, 3);
	CHECK_EQUAL(hm2_sserial_started(box.port), 0);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->outputs[0][0], 0);
	mailbox_free(&box);
}

/* In reset nothing completes; the write that ends it clears the register. */
static int only_after_a_reset(struct mailbox *mailbox, uint32_t command)
{
	for (size_t i = 0; i < mailbox->count && i < COMMANDS; i++)
		if (mailbox->commands[i] == 0x4000)
			return command != 0x4000;
	return 0;
}

static void test_where_stopping_does_not_help_the_processor_is_reset(void)
{
	static const uint32_t expected[] = {0x1001, 0x08FF, 0x4000, 0x0001, 0x2003};
	start(1);
	box.completes = only_after_a_reset;
	box.words[DATA / 4] = 0x2B;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 1, &box.error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_RESET);
	check_commands(expected, 5);
	mailbox_free(&box);
}

static int never(struct mailbox *mailbox, uint32_t command)
{
	(void)mailbox;
	(void)command;
	return 0;
}

static void test_a_dead_processor_is_said_to_be_dead(void)
{
	start(1);
	box.completes = never;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 1, &box.error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_DEAD);
	CHECK_EQUAL(hm2_sserial_started(box.port), 0);
	mailbox_free(&box);
}

/* The doorbell of the first command after a reset is lost; written again it works. */
static int not_the_first_read(struct mailbox *mailbox, uint32_t command)
{
	if (command == 0x4000)
		return 0;
	return command != 0x2003 || mailbox->commands[mailbox->count - 2] == 0x2003;
}

static void test_a_command_lost_behind_a_reset_is_written_again(void)
{
	static const uint32_t expected[] = {0x4000, 0x0001, 0x2003, 0x2003};
	mailbox_open(&box);
	box.completes = not_the_first_read;
	box.words[DATA / 4] = 0x2B;
	CHECK_EQUAL(hm2_sserial_reset(box.port, &box.error), HM2_OK);
	check_commands(expected, 4);
	mailbox_free(&box);
}

static void test_a_revision_of_aa_is_not_believed(void)
{
	mailbox_open(&box);
	box.words[DATA / 4] = 0xAA;
	CHECK_EQUAL(hm2_sserial_reset(box.port, &box.error), HM2_ERR_PROTOCOL);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_NO_FIRMWARE);
	CHECK_EQUAL(box.error.received, 0xAA);
	CHECK_EQUAL(hm2_sserial_reset(box.port, NULL), HM2_ERR_PROTOCOL);
	mailbox_free(&box);
}

static int not_a_start(struct mailbox *mailbox, uint32_t command)
{
	(void)mailbox;
	return (command & 0xFF00) != 0x0900;
}

static void test_a_start_that_hangs_is_ended_for_those_that_are_not_ready(void)
{
	static const uint32_t expected[] = {0x0907, 0x08FF, 0x0804};
	mailbox_open(&box);
	box.words[CS / 4] = 0x003A0000;
	box.words[CS / 4 + 1] = 0x003B0000;
	box.words[CS / 4 + 2] = 0x00328100; /* waits for its flag */
	box.completes = not_a_start;
	CHECK_EQUAL(hm2_sserial_start(box.port, 7, HM2_SSERIAL_NORMAL, &box.error), 4);
	check_commands(expected, 3);
	CHECK_EQUAL(hm2_sserial_started(box.port), 3);
	mailbox_free(&box);
}

static void test_a_bus_that_fails_in_a_doit_leaves_the_port_usable(void)
{
	start(1);
	box.words[USER0 / 4] = 0x11;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 1, &box.error), 0);
	box.words[USER0 / 4] = 0x22;
	box.fail_next = 1;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 1, &box.error), HM2_ERR_IO);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->inputs[0][0], 0x11);
	CHECK_EQUAL(hm2_sserial_started(box.port), 1);
	CHECK_EQUAL(hm2_sserial_doit(box.port, 1, &box.error), 0);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->inputs[0][0], 0x22);
	mailbox_free(&box);
}

static void test_inputs_of_a_failed_transfer_are_not_taken(void)
{
	start(3);
	box.words[USER0 / 4] = 0x11;
	box.words[USER0 / 4 + 1] = 0x21;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 3, &box.error), 0);
	box.words[USER0 / 4] = 0x12;
	box.words[USER0 / 4 + 1] = 0x22;
	box.words[DATA / 4] = 2;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 3, &box.error), 2 | HM2_SSERIAL_NEWS);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->inputs[0][0], 0x12);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->inputs[1][0], 0x21);
	mailbox_free(&box);
}

static int fails(struct mailbox *mailbox, uint32_t command)
{
	mailbox->words[DATA / 4] = (command & 0xFF00) == 0x0900 ? command & 2 : 0;
	return 1;
}

static void test_a_channel_that_failed_is_stopped_before_it_is_started_again(void)
{
	static const uint32_t expected[] = {0x0903, 0x0802, 0x0902};
	mailbox_open(&box);
	box.completes = fails;
	CHECK_EQUAL(hm2_sserial_start(box.port, 3, HM2_SSERIAL_NORMAL, &box.error), 2);
	CHECK_EQUAL(hm2_sserial_start(box.port, 3, HM2_SSERIAL_NORMAL, &box.error), 2);
	check_commands(expected, 3);
	CHECK_EQUAL(hm2_sserial_started(box.port), 1);
	mailbox_free(&box);
}

static void test_errors_of_a_start_that_worked_are_reported_once(void)
{
	hm2_sserial_event event;
	uint64_t lost = 0;
	mailbox_open(&box);
	/* a retry left its bits, and the fault byte is one of before: that shows at the first transfer only */
	box.words[CS / 4] = 0x203A2008;
	CHECK_EQUAL(hm2_sserial_start(box.port, 1, HM2_SSERIAL_NORMAL, &box.error), 0);
	CHECK_EQUAL(hm2_sserial_take_events(box.port, &event, 1, &lost), 1);
	CHECK_EQUAL(event.transfer, 0);
	CHECK_EQUAL(event.rising, 0x00002008);
	box.words[CS / 4] = 0x00422008;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 1, &box.error), 0);
	box.words[CS / 4] = 0x20422148;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 1, &box.error), HM2_SSERIAL_NEWS);
	CHECK_EQUAL(hm2_sserial_take_events(box.port, &event, 1, &lost), 1);
	CHECK_EQUAL(event.rising, 0x20000140);
	mailbox_free(&box);
}

static void test_faults_that_nobody_takes_are_counted(void)
{
	hm2_sserial_event events[HM2_SSERIAL_EVENTS];
	uint64_t lost = 0;
	start(1);
	for (uint32_t i = 0; i < HM2_SSERIAL_EVENTS + 10; i++) {
		box.words[CS / 4] = 0x00420000 | (i % 2 ? 0 : 0x01000000u);
		CHECK(hm2_sserial_doit(box.port, 1, &box.error) >= 0);
	}
	/* a live bit that comes and goes is new every other time: nothing is lost yet */
	CHECK_EQUAL(hm2_sserial_take_events(box.port, events, HM2_SSERIAL_EVENTS, &lost), HM2_SSERIAL_EVENTS / 2 + 5);
	CHECK_EQUAL(lost, 0);
	CHECK_EQUAL(events[0].rising, 0x01000000u);
	CHECK_EQUAL(events[0].transfer, 1);
	CHECK_EQUAL(events[1].transfer, 3);
	for (uint32_t i = 0; i < 2 * HM2_SSERIAL_EVENTS + 20; i++) {
		box.words[CS / 4] = 0x00420000 | (i % 2 ? 0 : 0x01000000u);
		CHECK(hm2_sserial_doit(box.port, 1, &box.error) >= 0);
	}
	CHECK_EQUAL(hm2_sserial_take_events(box.port, events, HM2_SSERIAL_EVENTS, &lost), HM2_SSERIAL_EVENTS);
	CHECK_EQUAL(lost, 10);
	CHECK_EQUAL(hm2_sserial_doit(box.port, 1, &box.error) & HM2_SSERIAL_NEWS, 0);
	mailbox_free(&box);
}

static void test_the_ignored_write_is_no_command(void)
{
	start(1);
	CHECK_EQUAL(hm2_sserial_ignored_write(box.port, &box.error), HM2_OK);
	CHECK_EQUAL(box.count, 0);
	mailbox_free(&box);
}

static void test_arguments_outside_their_range(void)
{
	uint64_t value = 0;
	uint8_t byte = 0;
	start(1);
	CHECK_EQUAL(hm2_sserial_start(box.port, 0x100, HM2_SSERIAL_NORMAL, &box.error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_sserial_start(box.port, 1, 7, &box.error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_sserial_start(box.port, 2, HM2_SSERIAL_SETUP, &box.error), HM2_ERR_BUSY);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_MODE_CONFLICT);
	CHECK_EQUAL(hm2_sserial_stop(box.port, 0x100, &box.error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_sserial_doit(box.port, 0x100, &box.error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_sserial_read_local(box.port, 0x1000, &byte, 1, &box.error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_sserial_read_local(box.port, 0xFFF, &byte, 2, &box.error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_sserial_read_remote(box.port, 0, 0, 0, 3, &value, &box.error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_sserial_read_remote(box.port, 8, 0, 0, 1, &value, &box.error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_sserial_read_remote(box.port, 0, 0, 0xFFFF, 2, &value, &box.error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_sserial_read_remote(box.port, 0, 0, 0, 1, &value, &box.error), HM2_ERR_BUSY);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_NOT_STARTED);
	CHECK_EQUAL(hm2_sserial_set_bits(box.port, 0, 97, 0, &box.error), HM2_ERR_RANGE);
	CHECK_EQUAL(box.count, 0);
	mailbox_free(&box);
}

static void test_a_doit_names_the_channels_that_were_asked_for(void)
{
	static const uint32_t expected[] = {0x1002, 0x1004, 0x1007};
	start(7);
	CHECK_EQUAL(hm2_sserial_doit(box.port, 2, &box.error), 0);
	CHECK_EQUAL(hm2_sserial_doit(box.port, 4, &box.error), 0);
	CHECK_EQUAL(hm2_sserial_doit(box.port, 0x0F, &box.error), 8); /* one that does not run has failed */
	check_commands(expected, 3);
	mailbox_free(&box);
}

/* What a channel was sent in its last life must not go out with the first exchange of the next. */
static void test_interface_data_is_zeroed_before_a_start(void)
{
	mailbox_open(&box);
	box.zeroed = 0;
	CHECK_EQUAL(hm2_sserial_start(box.port, 2, HM2_SSERIAL_NORMAL, &box.error), 0);
	for (int reg = 1; reg <= 3; reg++) {
		CHECK(box.zeroed >> (8 * reg + 1) & 1);
		CHECK(!(box.zeroed >> (8 * reg) & 1)); /* channel 0 was not named */
	}
	mailbox_free(&box);
}

/* Outputs must not stay on for what one exchange met; a bus that is silent has no use for more. */
static void test_zeroes_are_sent_again_where_that_may_help(void)
{
	static const struct {
		int fails, channel_fails;
		size_t count;
		uint32_t commands[4];
	} cases[] = {{0, 0, 2, {0x1001, 0x0801}}, {HM2_ERR_PROTOCOL, 0, 2, {0x1001, 0x0801}},
	             {HM2_ERR_TIMEOUT, 0, 1, {0x0801}}, {0, 1, 4, {0x1001, 0x1001, 0x1001, 0x0801}}};
	for (size_t i = 0; i < sizeof cases / sizeof *cases; i++) {
		start(1);
		box.fail_status = cases[i].fails;
		box.fail_writes = cases[i].fails != 0;
		box.words[DATA / 4] = (uint32_t)cases[i].channel_fails;
		CHECK_EQUAL(hm2_sserial_stop(box.port, 1, &box.error), HM2_OK);
		check_commands(cases[i].commands, cases[i].count);
		mailbox_free(&box);
	}
}

/* Who stops one motor must learn that the others have stopped, too. */
static void test_a_stop_whose_zeroes_hang_tells_that_others_were_stopped(void)
{
	static const uint32_t expected[] = {0x1001, 0x08FF, 0x0800, 0x0801};
	start(3);
	box.completes = not_a_doit;
	CHECK_EQUAL(hm2_sserial_stop(box.port, 1, &box.error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_UNJAMMED);
	CHECK_EQUAL(box.error.received, 0x1001);
	check_commands(expected, 4);
	CHECK_EQUAL(hm2_sserial_started(box.port), 0);
	mailbox_free(&box);
	start(1);
	box.completes = not_a_doit;
	CHECK_EQUAL(hm2_sserial_stop(box.port, 1, &box.error), HM2_OK);
	mailbox_free(&box);
}

/* The image still holds what came before: no fault of now. */
static void test_a_failed_transfer_brings_no_fault_word(void)
{
	hm2_sserial_event event;
	uint64_t lost = 0;
	start(1);
	hm2_sserial_watch(box.port, 0, 1, 0xFFFF0000);
	hm2_sserial_get_image(box.port)->inputs[0][1] = 0x00040000;
	box.words[DATA / 4] = 1;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 1, &box.error), 1 | HM2_SSERIAL_NEWS);
	CHECK_EQUAL(hm2_sserial_take_events(box.port, &event, 1, &lost), 1);
	CHECK_EQUAL(event.failed, 1);
	CHECK_EQUAL(event.word_rising, 0);
	mailbox_free(&box);
}

static void test_no_input_is_one_of_before_the_start(void)
{
	start(3);
	box.words[USER0 / 4] = box.words[USER0 / 4 + 1] = 0x11;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 3, &box.error), 0);
	CHECK_EQUAL(hm2_sserial_stop(box.port, 1, &box.error), HM2_OK);
	CHECK_EQUAL(hm2_sserial_start(box.port, 1, HM2_SSERIAL_NORMAL, &box.error), 0);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->inputs[0][0], 0);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->inputs[1][0], 0x11);
	mailbox_free(&box);
}

/* A list joins registers only where their words are neighbours, too. */
static void test_registers_without_gaps_keep_their_places(void)
{
	const hm2_sserial_config config = {BASE, 8, 0x40, 0, 2, 3};
	mailbox_open(&box);
	hm2_sserial_free(box.port);
	CHECK_EQUAL(hm2_sserial_open(box.board, &config, &box.port, NULL), HM2_OK);
	CHECK_EQUAL(hm2_sserial_start(box.port, 3, HM2_SSERIAL_NORMAL, &box.error), 0);
	hm2_sserial_image *image = hm2_sserial_get_image(box.port);
	for (uint32_t channel = 0; channel < 2; channel++) {
		CHECK_EQUAL(hm2_sserial_set_bits(box.port, channel, 96, 96, &box.error), HM2_OK);
		for (uint32_t row = 0; row < 3; row++)
			image->outputs[channel][row] = 0x100 * (channel + 1) + row;
	}
	CHECK_EQUAL(hm2_sserial_doit(box.port, 3, &box.error), 0);
	for (uint32_t row = 0; row < 3; row++) {
		CHECK_EQUAL(box.words[(BASE + 24 + 8 * row) / 4], 0x100 + row);
		CHECK_EQUAL(box.words[(BASE + 28 + 8 * row) / 4], 0x200 + row);
	}
	CHECK(memcmp(image->inputs, image->outputs, sizeof image->inputs) == 0); /* this mailbox is read as it was written */
	mailbox_free(&box);
}

int main(void)
{
	test_registers_without_gaps_keep_their_places();
	test_zeroes_are_sent_again_where_that_may_help();
	test_a_stop_whose_zeroes_hang_tells_that_others_were_stopped();
	test_a_failed_transfer_brings_no_fault_word();
	test_no_input_is_one_of_before_the_start();
	test_a_doit_names_the_channels_that_were_asked_for();
	test_interface_data_is_zeroed_before_a_start();
	test_a_hung_doit_is_aborted_and_everything_stopped();
	test_where_stopping_does_not_help_the_processor_is_reset();
	test_a_dead_processor_is_said_to_be_dead();
	test_a_command_lost_behind_a_reset_is_written_again();
	test_a_revision_of_aa_is_not_believed();
	test_a_start_that_hangs_is_ended_for_those_that_are_not_ready();
	test_a_bus_that_fails_in_a_doit_leaves_the_port_usable();
	test_inputs_of_a_failed_transfer_are_not_taken();
	test_a_channel_that_failed_is_stopped_before_it_is_started_again();
	test_errors_of_a_start_that_worked_are_reported_once();
	test_faults_that_nobody_takes_are_counted();
	test_the_ignored_write_is_no_command();
	test_arguments_outside_their_range();
	return CHECK_RESULT();
}
