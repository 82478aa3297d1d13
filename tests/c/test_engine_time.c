/* Late cycles and missing readings on a clock of the tests, which moves by what an exchange takes: every cycle is due at a
 * known time, and nothing depends on the machine. What turns outputs off otherwise is test_engine_policy.c. */
#include <math.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#include "check.h"
#include "engine_words.h"
#include "hm2.h"

#define PERIOD_NS 1000000
#define REPLY_NS 800000

/* ---- a card that is two words of memory and a clock that moves when it is told ---- */

struct card {
	int64_t now_ns, takes_ns; /* the next exchange takes so long */
	uint32_t input, output;
	int good; /* exchanges before some fail */
	int fail; /* so many */
	int failing;
};

static int64_t clock_ns(void *self)
{
	return ((struct card *)self)->now_ns;
}

static void pause_ns(void *self, int64_t ns)
{
	if (ns > 0)
		((struct card *)self)->now_ns += ns;
}

static int begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	struct card *card = self;
	(void)error;
	card->failing = !card->good && card->fail;
	card->good -= card->good > 0;
	card->fail -= card->failing;
	card->now_ns += card->takes_ns;
	card->takes_ns = 0;
	for (size_t i = 0; i < count && !card->failing; i++) {
		if (transfers[i].flags & HM2_TRANSFER_WRITE)
			card->output = transfers[i].words[0];
		else
			transfers[i].words[0] = card->input;
	}
	return HM2_OK;
}

static int finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	struct card *card = self;
	if (!card->failing)
		return HM2_OK;
	if (card->now_ns < deadline_ns)
		card->now_ns = deadline_ns;
	if (error)
		memset(error, 0, sizeof *error);
	return HM2_ERR_TIMEOUT;
}

static void close_bus(void *self)
{
	(void)self;
}

/* ---- an engine on it, and what its controller saw ---- */

struct rig {
	struct card card;
	struct hm2_board *board;
	struct hm2_cycle *cycle;
	struct hm2_engine *engine;
	struct hm2_record_ring *ring;
	struct engine_words words;
	int calls, enabled;
	double seconds, input;
};

static void look(void *context, const double *inputs, double *outputs, double seconds, int32_t enabled)
{
	struct rig *rig = context;
	(void)outputs;
	rig->calls++;
	rig->enabled = enabled;
	rig->seconds = seconds;
	rig->input = inputs[0];
}

static hm2_engine_config stepped(void)
{
	hm2_engine_config config;
	hm2_engine_defaults(&config);
	config.period_ns = PERIOD_NS;
	config.reply_ns = REPLY_NS;
	config.virtual_time = 1;
	config.dead_man_ns = 0;
	config.stale_limit = 0;
	return config;
}

static void build(struct rig *rig, const hm2_engine_config *config)
{
	memset(rig, 0, sizeof *rig);
	rig->card.now_ns = 1000000000;
	const hm2_bus bus = {&rig->card, begin, finish, clock_ns, pause_ns, close_bus, NULL};
	CHECK(hm2_board_open(&bus, &rig->board, NULL) == HM2_OK);
	engine_words_cycle(&rig->words, rig->board, &rig->cycle);
	engine_words_engine(&rig->words, rig->board, rig->cycle, config, &rig->engine);
	CHECK(hm2_engine_add_control(rig->engine, look, rig, NULL) == HM2_OK);
	rig->ring = engine_words_ring(rig->engine, 64);
}

static void tear_down(struct rig *rig)
{
	rig->card.fail = 0;
	hm2_engine_free(rig->engine);
	CHECK_EQUAL(rig->card.output, 0);
	hm2_record_ring_free(rig->ring);
	hm2_cycle_free(rig->cycle);
	hm2_board_free(rig->board);
}

static void start(struct rig *rig, const hm2_engine_config *config)
{
	build(rig, config);
	CHECK(hm2_engine_start(rig->engine, NULL, NULL) == HM2_OK);
}

static hm2_engine_status step(struct rig *rig, int cycles)
{
	return engine_steps(rig->engine, cycles);
}

static hm2_engine_status write_and_step(struct rig *rig, double value, int cycles)
{
	hm2_engine_write(rig->engine, &value);
	return step(rig, cycles);
}

/* How many events of a kind there were, and the value of the last. */
static int events(struct rig *rig, int kind, int64_t *value)
{
	hm2_engine_event found[64];
	int count = 0;
	for (size_t n; (n = hm2_engine_take_events(rig->engine, found, 64)) != 0;)
		for (size_t i = 0; i < n; i++)
			if (found[i].kind == kind) {
				count++;
				if (value)
					*value = found[i].value;
			}
	return count;
}

/* ---- time ---- */

/* The time of a cycle that takes 3.5 periods ends in the fourth after it: the one due then is the fifth. */
static void test_skipping_goes_on_at_the_next_time_that_was_planned(void)
{
	struct rig rig;
	const hm2_engine_config config = stepped();
	int64_t missed = 0;
	start(&rig, &config);
	const int64_t due_ns = step(&rig, 3).start_ns;
	rig.card.takes_ns = 7 * PERIOD_NS / 2;
	CHECK_EQUAL(step(&rig, 1).start_ns, due_ns + PERIOD_NS);
	const hm2_engine_status status = step(&rig, 1);
	CHECK_EQUAL(status.start_ns, due_ns + 5 * PERIOD_NS);
	CHECK_EQUAL(status.overruns, 1);
	CHECK_EQUAL(status.skipped, 3);
	CHECK_EQUAL(events(&rig, HM2_EVENT_OVERRUN, &missed), 1);
	CHECK_EQUAL(missed, 3);
	CHECK(fabs(rig.seconds - 4e-3) < 1e-12); /* controllers integrate over what was left out */
	(void)step(&rig, 1);
	CHECK(fabs(rig.seconds - 1e-3) < 1e-12);
	tear_down(&rig);
}

static void test_a_cycle_that_ends_when_the_next_is_due_has_missed_it(void)
{
	struct rig rig;
	const hm2_engine_config config = stepped();
	start(&rig, &config);
	rig.card.takes_ns = PERIOD_NS - 1;
	CHECK_EQUAL(step(&rig, 1).overruns, 0);
	rig.card.takes_ns = PERIOD_NS;
	(void)step(&rig, 1);
	CHECK_EQUAL(step(&rig, 1).overruns, 1);
	tear_down(&rig);
}

static void test_catching_up_runs_every_period_one_right_after_the_other(void)
{
	struct rig rig;
	hm2_engine_config config = stepped();
	config.overrun = HM2_OVERRUN_CATCH_UP;
	start(&rig, &config);
	const int64_t due_ns = step(&rig, 1).start_ns;
	rig.card.takes_ns = 7 * PERIOD_NS / 2;
	const int64_t began_ns = due_ns + PERIOD_NS;
	(void)step(&rig, 1);
	for (int i = 1; i <= 4; i++) {
		const hm2_engine_status status = step(&rig, 1);
		CHECK_EQUAL(status.start_ns, began_ns + i * PERIOD_NS);
		CHECK_EQUAL(status.skipped, 0);
		CHECK(fabs(rig.seconds - 1e-3) < 1e-12);
		CHECK_EQUAL(rig.card.now_ns, began_ns + (i < 4 ? 7 * PERIOD_NS / 2 : 4 * PERIOD_NS));
	}
	CHECK_EQUAL(step(&rig, 3).overruns, 3); /* the slow one and those that ended late because of it */
	CHECK_EQUAL(events(&rig, HM2_EVENT_OVERRUN, NULL), 1);
	tear_down(&rig);
}

static void test_more_than_ten_periods_are_not_caught_up_with(void)
{
	struct rig rig;
	hm2_engine_config config = stepped();
	config.overrun = HM2_OVERRUN_CATCH_UP;
	start(&rig, &config);
	const int64_t due_ns = step(&rig, 1).start_ns;
	rig.card.takes_ns = 21 * PERIOD_NS / 2; /* ten missed: made up for */
	(void)step(&rig, 1);
	CHECK_EQUAL(step(&rig, 12).skipped, 0);
	rig.card.takes_ns = 23 * PERIOD_NS / 2; /* eleven: left out */
	(void)step(&rig, 1);
	const hm2_engine_status status = step(&rig, 1);
	CHECK_EQUAL(status.skipped, 11);
	CHECK_EQUAL((status.start_ns - due_ns) % PERIOD_NS, 0);
	tear_down(&rig);
}

static void test_only_overruns_in_a_row_turn_outputs_off(void)
{
	struct rig rig;
	hm2_engine_config config = stepped();
	config.overrun_limit = 3;
	start(&rig, &config);
	CHECK_EQUAL(write_and_step(&rig, 7, 2).off, 0);
	for (int round = 0; round < 4; round++) {
		for (int slow = 0; slow < 2; slow++) {
			rig.card.takes_ns = 3 * PERIOD_NS / 2;
			(void)step(&rig, 1);
		}
		CHECK_EQUAL(step(&rig, 2).off, 0);
	}
	for (int slow = 0; slow < 3; slow++) {
		rig.card.takes_ns = 3 * PERIOD_NS / 2;
		(void)step(&rig, 1);
	}
	CHECK_EQUAL(step(&rig, 2).off, HM2_OFF_OVERRUN);
	CHECK_EQUAL(rig.card.output, 0);
	CHECK_EQUAL(write_and_step(&rig, 7, 5).off, HM2_OFF_OVERRUN);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(&rig, 2).off, 0);
	CHECK_EQUAL(rig.card.output, 7);
	tear_down(&rig);
}

static void test_the_dead_man_counts_time_not_cycles(void)
{
	struct rig rig;
	hm2_engine_config config = stepped();
	config.dead_man_ns = 10 * PERIOD_NS;
	start(&rig, &config);
	CHECK_EQUAL(write_and_step(&rig, 7, 11).off, 0); /* taken over by the first: ten periods old, not older */
	CHECK_EQUAL(step(&rig, 1).off, HM2_OFF_DEAD_MAN);
	(void)step(&rig, 1);
	CHECK_EQUAL(rig.card.output, 0);
	CHECK_EQUAL(write_and_step(&rig, 7, 2).off, HM2_OFF_DEAD_MAN);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(write_and_step(&rig, 7, 2).off, 0);
	rig.card.takes_ns = 11 * PERIOD_NS; /* one cycle is enough */
	(void)step(&rig, 1);
	CHECK_EQUAL(step(&rig, 1).off, HM2_OFF_DEAD_MAN);
	tear_down(&rig);
}

/* ---- readings that did not come ---- */

static void test_without_readings_controllers_rest_and_outputs_stay(void)
{
	struct rig rig;
	const hm2_engine_config config = stepped(); /* no limit */
	double value = 9;
	start(&rig, &config);
	rig.card.input = 5;
	(void)write_and_step(&rig, 7, 2);
	const int calls = rig.calls;
	rig.card.fail = 3;
	rig.card.input = 6;
	hm2_engine_write(rig.engine, &value);
	hm2_engine_status status = step(&rig, 3);
	CHECK_EQUAL(rig.calls, calls);
	CHECK_EQUAL(rig.words.out, 7);
	CHECK_EQUAL(status.stale, 3);
	CHECK_EQUAL(status.failures, 3);
	CHECK_EQUAL(status.status, HM2_ERR_TIMEOUT);
	CHECK_EQUAL(status.off, 0);
	status = step(&rig, 2);
	CHECK_EQUAL(rig.calls, calls + 2);
	CHECK_EQUAL((int)rig.input, 6);
	CHECK_EQUAL(rig.card.output, 9);
	CHECK_EQUAL(status.stale, 0);
	tear_down(&rig);
}

static void test_the_time_of_failed_cycles_reaches_the_controller(void)
{
	struct rig rig;
	const hm2_engine_config config = stepped();
	start(&rig, &config);
	(void)write_and_step(&rig, 7, 2);
	rig.card.fail = 3;
	(void)step(&rig, 4);
	CHECK(fabs(rig.seconds - 4e-3) < 1e-12);
	tear_down(&rig);
}

static void test_stale_readings_turn_outputs_off_at_their_limit_in_both_styles(void)
{
	for (int style = 0; style < 2; style++) {
		struct rig rig;
		hm2_engine_config config = stepped();
		int64_t value = 0;
		config.style = style ? HM2_ENGINE_READ_MODIFY_WRITE : HM2_ENGINE_PIPELINED;
		config.stale_limit = 3;
		start(&rig, &config);
		CHECK_EQUAL(write_and_step(&rig, 7, 3).off, 0);
		rig.card.fail = style ? 4 : 2; /* a cycle makes as many exchanges */
		CHECK_EQUAL(step(&rig, 2).off, 0);
		CHECK_EQUAL(step(&rig, 1).stale, 0);
		rig.card.fail = style ? 6 : 3;
		const hm2_engine_status status = step(&rig, 3);
		CHECK_EQUAL(status.off, HM2_OFF_STALE);
		CHECK_EQUAL(status.stale, 3);
		CHECK_EQUAL(status.failures, 5); /* cycles, whichever of their exchanges it was */
		(void)step(&rig, 2);
		CHECK_EQUAL(rig.card.output, 0);
		CHECK_EQUAL(write_and_step(&rig, 7, 4).off, HM2_OFF_STALE);
		CHECK_EQUAL(events(&rig, HM2_EVENT_RECOVERED, &value), 2);
		CHECK_EQUAL(value, 3);
		hm2_engine_enable(rig.engine);
		CHECK_EQUAL(step(&rig, 2).off, 0);
		CHECK_EQUAL(rig.card.output, 7);
		tear_down(&rig);
	}
}

static void test_a_write_that_fails_is_a_failed_cycle(void)
{
	struct rig rig;
	hm2_engine_config config = stepped();
	config.style = HM2_ENGINE_READ_MODIFY_WRITE;
	config.stale_limit = 2;
	start(&rig, &config);
	(void)write_and_step(&rig, 7, 2);
	for (int i = 1; i <= 2; i++) {
		rig.card.good = rig.card.fail = 1; /* the first exchange reads, the second writes */
		const hm2_engine_status status = write_and_step(&rig, 7 + i, 1);
		CHECK_EQUAL(status.status, HM2_ERR_TIMEOUT);
		CHECK_EQUAL(status.stale, i);
		CHECK_EQUAL(rig.card.output, 7);
	}
	CHECK_EQUAL(step(&rig, 1).off, HM2_OFF_STALE); /* before anything more goes out */
	CHECK_EQUAL(rig.card.output, 0);
	tear_down(&rig);
}

static void test_enabling_while_nothing_comes_turns_nothing_on(void)
{
	struct rig rig;
	hm2_engine_config config = stepped();
	config.stale_limit = 2;
	start(&rig, &config);
	(void)write_and_step(&rig, 7, 2);
	rig.card.fail = 10;
	CHECK_EQUAL(step(&rig, 3).off, HM2_OFF_STALE);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(write_and_step(&rig, 7, 1).off, HM2_OFF_STALE);
	CHECK_EQUAL(step(&rig, 2).off, HM2_OFF_STALE);
	CHECK_EQUAL(rig.words.out, 0);
	rig.card.fail = 0;
	CHECK_EQUAL(step(&rig, 3).off, HM2_OFF_STALE);
	tear_down(&rig);
}

/* ---- the beginning ---- */

static int64_t lock_takes_ns;

static int64_t machine_ns(void)
{
	struct timespec now;
	clock_gettime(CLOCK_MONOTONIC, &now);
	return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

/* In the place of the system's: locking much memory takes many periods. */
int mlockall(int flags)
{
	const struct timespec time = {0, (long)lock_takes_ns};
	(void)flags;
	nanosleep(&time, NULL);
	return 0;
}

static void test_the_first_cycle_is_due_after_what_starting_took(void)
{
	struct rig rig;
	hm2_engine_config config = stepped();
	uint8_t record[256];
	hm2_record first;
	hm2_engine_status status;
	config.virtual_time = 0;
	config.lock_memory = 1;
	lock_takes_ns = 50 * PERIOD_NS;
	build(&rig, &config);
	CHECK(hm2_engine_record_size(rig.engine, 8) <= sizeof record);
	for (int round = 0; round < 2; round++) {
		const int64_t began_ns = machine_ns();
		CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_OK);
		hm2_engine_read(rig.engine, &status, NULL, NULL);
		CHECK(hm2_engine_wait(rig.engine, status.cycles, 10000000000LL) == 1);
		hm2_engine_stop(rig.engine);
		CHECK(hm2_record_ring_pop_many(rig.ring, record, 1) == 1);
		memcpy(&first, record, sizeof first);
		CHECK(first.start_ns >= began_ns + lock_takes_ns + PERIOD_NS);
		CHECK(!(first.flags & HM2_ENGINE_OVERRAN));
		while (hm2_record_ring_pop_many(rig.ring, record, 1))
			;
	}
	tear_down(&rig);
}

/* An overrun of the last run is not one of the next. */
static void test_a_run_begins_without_the_overruns_of_the_last(void)
{
	struct rig rig;
	hm2_engine_config config = stepped();
	uint8_t record[256];
	hm2_record first;
	config.overrun_limit = 2;
	start(&rig, &config);
	(void)write_and_step(&rig, 7, 1);
	rig.card.takes_ns = 3 * PERIOD_NS;
	(void)step(&rig, 1);
	hm2_engine_stop(rig.engine);
	while (hm2_record_ring_pop_many(rig.ring, record, 1))
		;
	rig.card.now_ns += 100 * PERIOD_NS;
	CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_OK);
	const int64_t started_ns = rig.card.now_ns;
	rig.card.takes_ns = 3 * PERIOD_NS / 2;
	CHECK_EQUAL(write_and_step(&rig, 7, 1).start_ns, started_ns + PERIOD_NS);
	CHECK(fabs(rig.seconds - 1e-3) < 1e-12);
	CHECK_EQUAL(step(&rig, 2).off, 0);
	CHECK(hm2_record_ring_pop_many(rig.ring, record, 1) == 1);
	memcpy(&first, record, sizeof first);
	CHECK(!(first.flags & HM2_ENGINE_OVERRAN));
	tear_down(&rig);
}

int main(void)
{
	test_skipping_goes_on_at_the_next_time_that_was_planned();
	test_a_cycle_that_ends_when_the_next_is_due_has_missed_it();
	test_catching_up_runs_every_period_one_right_after_the_other();
	test_more_than_ten_periods_are_not_caught_up_with();
	test_only_overruns_in_a_row_turn_outputs_off();
	test_the_dead_man_counts_time_not_cycles();
	test_without_readings_controllers_rest_and_outputs_stay();
	test_the_time_of_failed_cycles_reaches_the_controller();
	test_stale_readings_turn_outputs_off_at_their_limit_in_both_styles();
	test_a_write_that_fails_is_a_failed_cycle();
	test_enabling_while_nothing_comes_turns_nothing_on();
	test_the_first_cycle_is_due_after_what_starting_took();
	test_a_run_begins_without_the_overruns_of_the_last();
	return CHECK_RESULT();
}
