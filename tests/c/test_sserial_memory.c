/* Memory of a remote through an SSERIAL port: asked for only where it can be, and what is told when it fails. */
#include "mailbox.h"
#include "registers.h"

static struct mailbox box;

/* The registers keep, above the bytes of an answer, what an earlier and longer one left there. */
static void test_a_remotes_value_is_as_wide_as_was_asked_for(void)
{
	static const uint64_t expected[][2] = {
		{1, 0x44}, {2, 0x3344}, {4, 0x11223344}, {8, 0x5566778811223344}};
	mailbox_open(&box);
	CHECK_EQUAL(hm2_sserial_start(box.port, 1, HM2_SSERIAL_SETUP, &box.error), 0);
	box.words[USER0 / 4] = 0x11223344;
	box.words[(USER0 + 0x100) / 4] = 0x55667788;
	for (size_t i = 0; i < sizeof expected / sizeof *expected; i++) {
		uint64_t value = 0;
		const uint32_t size = (uint32_t)expected[i][0];
		CHECK_EQUAL(hm2_sserial_read_remote(box.port, 0, 0, 0x100, size, &value, &box.error), HM2_OK);
		CHECK(value == expected[i][1]);
	}
	mailbox_free(&box);
}

static size_t doits;

static int not_the_third_doit(struct mailbox *mailbox, uint32_t command)
{
	(void)mailbox;
	return (command & 0xFF00) != 0x1000 || ++doits != 3;
}

static void test_a_port_stopped_while_the_space_is_put_back_says_so(void)
{
	uint64_t value = 0;
	mailbox_open(&box);
	CHECK_EQUAL(hm2_sserial_start(box.port, 1, HM2_SSERIAL_SETUP, &box.error), 0);
	doits = 0;
	box.completes = not_the_third_doit;
	CHECK_EQUAL(hm2_sserial_read_remote(box.port, 0, HM2_LBP_SPACE_EEPROM, 0x10, 1, &value, &box.error),
	            HM2_ERR_TIMEOUT);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_UNJAMMED);
	CHECK_EQUAL(hm2_sserial_started(box.port), 0);
	mailbox_free(&box);
}

/* In normal mode a DOIT moves process data: the outputs of a machine that runs would be a memory access. */
static void test_a_remotes_memory_is_not_touched_while_process_data_moves(void)
{
	uint64_t value = 0x77;
	mailbox_open(&box);
	CHECK_EQUAL(hm2_sserial_start(box.port, 1, HM2_SSERIAL_NORMAL, &box.error), 0);
	box.count = 0;
	for (uint32_t channel = 0; channel < 2; channel++) {
		CHECK_EQUAL(hm2_sserial_access(box.port, channel, 0x64, 0x100, &value, &box.error), HM2_ERR_BUSY);
		CHECK_EQUAL(box.error.detail, HM2_SSERIAL_NOT_STARTED);
		CHECK_EQUAL(box.error.index, channel);
		CHECK_EQUAL(hm2_sserial_write_remote(box.port, channel, 0, 0x100, 1, 7, &box.error), HM2_ERR_BUSY);
		CHECK_EQUAL(box.error.detail, HM2_SSERIAL_NOT_STARTED);
		CHECK_EQUAL(box.error.index, channel);
	}
	CHECK_EQUAL(box.count, 0);
	CHECK_EQUAL(box.words[USER0 / 4], 0);
	mailbox_free(&box);
}

/* What the channel says of it is evidence: if that cannot be read, the bus is the trouble, not the remote. */
static void test_a_bus_that_fails_behind_a_silent_remote_is_told_as_that(void)
{
	uint64_t value = 0;
	mailbox_open(&box);
	CHECK_EQUAL(hm2_sserial_start(box.port, 1, HM2_SSERIAL_SETUP, &box.error), 0);
	box.words[DATA / 4] = 1; /* the DOIT's answer: channel 0 has failed */
	box.exchanges = 0;
	CHECK_EQUAL(hm2_sserial_access(box.port, 0, 0x44, 0x100, &value, &box.error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_REMOTE_SILENT);
	box.fail_at = box.exchanges; /* the last one, which looked at the channel */
	box.exchanges = 0;
	CHECK_EQUAL(hm2_sserial_access(box.port, 0, 0x44, 0x100, &value, &box.error), HM2_ERR_IO);
	mailbox_free(&box);
}

static void test_a_remote_that_was_not_started_is_not_asked(void)
{
	uint64_t value = 0x77;
	mailbox_open(&box);
	CHECK_EQUAL(hm2_sserial_start(box.port, 1, HM2_SSERIAL_SETUP, &box.error), 0);
	box.count = 0;
	CHECK_EQUAL(hm2_sserial_read_remote(box.port, 1, HM2_LBP_SPACE_EEPROM, 0x100, 1, &value, &box.error), HM2_ERR_BUSY);
	CHECK_EQUAL(box.error.detail, HM2_SSERIAL_NOT_STARTED);
	CHECK_EQUAL(box.error.index, 1);
	CHECK_EQUAL(hm2_sserial_access(box.port, 1, 0x44, 0x100, &value, &box.error), HM2_ERR_BUSY);
	CHECK_EQUAL(box.error.index, 1);
	CHECK_EQUAL(value, 0x77);
	CHECK_EQUAL(box.count, 0);
	CHECK_EQUAL(hm2_sserial_start(box.port, 2, HM2_SSERIAL_SETUP, &box.error), 0);
	box.count = 0;
	CHECK_EQUAL(hm2_sserial_read_remote(box.port, 1, HM2_LBP_SPACE_RAM, 0x100, 1, &value, &box.error), HM2_OK);
	CHECK_EQUAL(box.count, 2); /* where it was left before is not known: RAM is selected, once */
	CHECK_EQUAL(hm2_sserial_read_remote(box.port, 1, HM2_LBP_SPACE_RAM, 0x100, 1, &value, &box.error), HM2_OK);
	CHECK_EQUAL(box.count, 3);
	mailbox_free(&box);
}

int main(void)
{
	test_a_remotes_value_is_as_wide_as_was_asked_for();
	test_a_port_stopped_while_the_space_is_put_back_says_so();
	test_a_remotes_memory_is_not_touched_while_process_data_moves();
	test_a_bus_that_fails_behind_a_silent_remote_is_told_as_that();
	test_a_remote_that_was_not_started_is_not_asked();
	return CHECK_RESULT();
}
