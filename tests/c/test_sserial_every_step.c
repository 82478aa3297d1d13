/* Everything an SSERIAL port does, with one of its exchanges failing and with one of its commands hanging, each in turn:
 * it says so, and a port on a bus that works again is as good as new. */
#include "mailbox.h"

static struct mailbox box;
static int hang_at; /* the command of this number never completes by itself; 0: none */

/* Unjamming completes whatever hangs. */
static int one_hangs(struct mailbox *mailbox, uint32_t command)
{
	return command != 0x4000 && (int)mailbox->count != hang_at;
}

typedef int operation(hm2_error *error);

static int reset(hm2_error *error)
{
	return hm2_sserial_reset(box.port, error);
}

static int stop_all(hm2_error *error)
{
	return hm2_sserial_stop(box.port, 0, error);
}

static int stop_one(hm2_error *error)
{
	return hm2_sserial_stop(box.port, 2, error);
}

static int start_another(hm2_error *error)
{
	return hm2_sserial_start(box.port, 4, HM2_SSERIAL_NORMAL, error);
}

/* Channels that failed are stopped before they are started. */
static int start_again(hm2_error *error)
{
	box.words[DATA / 4] = 4;
	int status = hm2_sserial_start(box.port, 4, HM2_SSERIAL_NORMAL, error);
	box.words[DATA / 4] = 0;
	if (status < 0)
		return status;
	CHECK_EQUAL(status, 4);
	status = hm2_sserial_start(box.port, 4, HM2_SSERIAL_NORMAL, error);
	return status;
}

static int doit(hm2_error *error)
{
	return hm2_sserial_doit(box.port, 3, error);
}

static int two_cycles(hm2_error *error)
{
	uint32_t requested;
	int status = hm2_sserial_cycle(box.port, 3, &requested, error);
	CHECK_EQUAL(requested, 0);
	for (int i = 0; i < 3 && status == HM2_OK; i++) {
		box.now_ns += i * 400000; /* in one exchange where the last DOIT must be over */
		status = hm2_sserial_cycle(box.port, 3, &requested, error);
	}
	return status;
}

/* A DOIT on its way is waited for and its result taken before anything else. */
static int cycle_and_stop(hm2_error *error)
{
	uint32_t requested;
	const int status = hm2_sserial_cycle(box.port, 3, &requested, error);
	return status == HM2_OK ? hm2_sserial_stop(box.port, 0, error) : status;
}

static int read_local(hm2_error *error)
{
	uint8_t bytes[2];
	return hm2_sserial_read_local(box.port, 0x10, bytes, 2, error);
}

static int write_local(hm2_error *error)
{
	const uint8_t bytes[2] = {1, 2};
	return hm2_sserial_write_local(box.port, 0x10, bytes, 2, error);
}

static int ignored_write(hm2_error *error)
{
	return hm2_sserial_ignored_write(box.port, error);
}

static int read_eeprom(hm2_error *error)
{
	uint64_t value;
	return hm2_sserial_read_remote(box.port, 0, 1, 0x20, 4, &value, error);
}

static int write_ram(hm2_error *error)
{
	return hm2_sserial_write_remote(box.port, 0, 0, 0x20, 2, 0x1234, error);
}

static int read_toc(hm2_error *error)
{
	hm2_toc_record record;
	size_t count = 0;
	return hm2_sserial_read_toc(box.port, 0, 0x40, HM2_PTOC, NULL, 0, &record, 1, &count, error);
}

static const struct {
	const char *name;
	operation *run;
	int mode; /* in which channels 0 and 1 run */
	int best_effort; /* a failed exchange may have been made up for, or was not essential */
	int outlives_hang; /* stops anyway, repeats what may get lost, or does not wait for it */
} operations[] = {
	{"reset", reset, HM2_SSERIAL_NORMAL, 0, 1},
	{"stop all", stop_all, HM2_SSERIAL_NORMAL, 1, 1}, /* zeroes first, if they can be sent */
	{"stop one", stop_one, HM2_SSERIAL_NORMAL, 1, 1},
	{"start another", start_another, HM2_SSERIAL_NORMAL, 0, 0},
	{"start again", start_again, HM2_SSERIAL_NORMAL, 0, 0},
	{"doit", doit, HM2_SSERIAL_NORMAL, 0, 0},
	{"two cycles", two_cycles, HM2_SSERIAL_NORMAL, 0, 1},
	{"cycle and stop", cycle_and_stop, HM2_SSERIAL_NORMAL, 1, 1},
	{"read local", read_local, HM2_SSERIAL_NORMAL, 0, 0},
	{"write local", write_local, HM2_SSERIAL_NORMAL, 0, 0},
	{"ignored write", ignored_write, HM2_SSERIAL_NORMAL, 0, 0},
	{"read EEPROM", read_eeprom, HM2_SSERIAL_SETUP, 1, 1}, /* the space is put back once more */
	{"write RAM", write_ram, HM2_SSERIAL_SETUP, 0, 0},
	{"read table", read_toc, HM2_SSERIAL_SETUP, 0, 0},
};

enum { OPERATIONS = sizeof operations / sizeof operations[0] };

static void prepare(int mode)
{
	mailbox_open(&box);
	box.completes = one_hangs;
	hang_at = 0;
	CHECK_EQUAL(hm2_sserial_start(box.port, 3, mode, &box.error), 0);
	hm2_sserial_get_image(box.port)->outputs[0][0] = 0x1234;
	hm2_sserial_get_image(box.port)->outputs[1][0] = 0x5678;
	box.words[DATA / 4] = 0;
	box.count = 0;
	box.exchanges = 0;
}

/* Whatever has happened: it stops, with outputs zero, starts and transfers. */
static void check_usable(void)
{
	box.fail_at = 0;
	hang_at = 0;
	box.words[DATA / 4] = 0;
	if (hm2_sserial_stop(box.port, 0, &box.error) != HM2_OK) { /* a processor left in reset: dug out by this */
		CHECK_EQUAL(box.error.status, HM2_ERR_TIMEOUT);
		CHECK(box.error.detail != HM2_SSERIAL_DEAD);
		CHECK_EQUAL(hm2_sserial_stop(box.port, 0, &box.error), HM2_OK);
	}
	CHECK_EQUAL(hm2_sserial_started(box.port), 0);
	CHECK_EQUAL(hm2_sserial_mode(box.port), HM2_SSERIAL_STOPPED);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->outputs[0][0], 0);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->outputs[1][0], 0);
	CHECK_EQUAL(hm2_sserial_start(box.port, 3, HM2_SSERIAL_NORMAL, &box.error), 0);
	box.words[USER0 / 4] = 0xABCD;
	CHECK_EQUAL(hm2_sserial_doit(box.port, 3, &box.error), 0);
	CHECK_EQUAL(hm2_sserial_get_image(box.port)->inputs[0][0], 0xABCD);
}

static void test_each_exchange_fails_once(int which, hm2_error *error)
{
	for (int number = 1;; number++) {
		prepare(operations[which].mode);
		box.fail_at = number;
		const int status = operations[which].run(error);
		const int failed = box.exchanges >= number;
		if (failed && !(operations[which].best_effort && status == HM2_OK) && status != HM2_ERR_IO)
			fprintf(stderr, "%s: exchange %d fails: %d\n", operations[which].name, number, status);
		CHECK(failed || status == HM2_OK);
		CHECK(!failed || status == HM2_ERR_IO || (operations[which].best_effort && status == HM2_OK));
		check_usable();
		mailbox_free(&box);
		if (!failed)
			return;
	}
}

/* No channel runs on behind a command that hung: it was unjammed and everything stopped. */
static void test_each_command_hangs_once(int which, hm2_error *error)
{
	for (int number = 1;; number++) {
		prepare(operations[which].mode);
		hang_at = number;
		const int status = operations[which].run(error);
		const int hung = (int)box.count >= number;
		if (hung && status != HM2_ERR_TIMEOUT && !operations[which].outlives_hang)
			fprintf(stderr, "%s: command %d hangs: %d\n", operations[which].name, number, status);
		CHECK(!hung || status == HM2_ERR_TIMEOUT || operations[which].outlives_hang);
		if (status == HM2_ERR_TIMEOUT) {
			CHECK_EQUAL(hm2_sserial_started(box.port), 0);
			CHECK_EQUAL(hm2_sserial_get_image(box.port)->outputs[0][0], 0);
		}
		CHECK(hung || status == HM2_OK);
		check_usable();
		mailbox_free(&box);
		if (!hung)
			return;
	}
}

/* ---- who may use it ---- */

static void test_a_port_in_a_cycle_is_nobody_elses(void)
{
	uint64_t value = 0;
	for (int i = 0; i < OPERATIONS; i++) {
		prepare(operations[i].mode);
		hm2_sserial_set_use(box.port, HM2_SSERIAL_USE_CYCLE);
		const int writes = operations[i].run == ignored_write;
		CHECK_EQUAL(operations[i].run(&box.error), writes ? HM2_OK : HM2_ERR_BUSY); /* allowed at any time */
		if (!writes)
			CHECK_EQUAL(box.error.detail, HM2_SSERIAL_LENT);
		CHECK_EQUAL(box.count, 0);
		if (operations[i].mode == HM2_SSERIAL_SETUP)
			CHECK_EQUAL(hm2_sserial_access(box.port, 0, 0x40, 0, &value, &box.error), HM2_ERR_BUSY);
		hm2_sserial_set_use(box.port, HM2_SSERIAL_USE_ANY);
		CHECK_EQUAL(operations[i].run(&box.error), HM2_OK);
		mailbox_free(&box);
	}
}

int main(void)
{
	for (int i = 0; i < OPERATIONS; i++) {
		hm2_error error = {0};
		test_each_exchange_fails_once(i, &error);
		test_each_exchange_fails_once(i, NULL);
		test_each_command_hangs_once(i, &error);
		test_each_command_hangs_once(i, NULL);
	}
	test_a_port_in_a_cycle_is_nobody_elses();
	return CHECK_RESULT();
}
