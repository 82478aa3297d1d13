/* The engine on a bus that is a few words of memory: order of a cycle, failures, overruns, and threads all around. */
/* also under the thread sanitizer */
#include <pthread.h>
#include <stdatomic.h>
#include <string.h>
#include <time.h>

#include "check.h"
#include "engine_words.h"
#include "hm2.h"

#define PERIOD_NS 200000

struct card {
	_Atomic uint32_t input, output;
	_Atomic int fail;       /* so many more exchanges */
	_Atomic int64_t slow_ns; /* the next exchange takes so long */
	_Atomic uint64_t exchanges;
	int failing;
};

static int64_t clock_ns(void *self)
{
	struct timespec now;
	(void)self;
	clock_gettime(CLOCK_MONOTONIC, &now);
	return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static void pause_ns(void *self, int64_t ns)
{
	const struct timespec time = {0, ns};
	(void)self;
	nanosleep(&time, NULL);
}

static int begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	struct card *card = self;
	(void)error;
	card->failing = card->fail > 0;
	if (card->failing)
		card->fail--;
	card->exchanges++;
	const int64_t slow_ns = atomic_exchange(&card->slow_ns, 0);
	if (slow_ns)
		pause_ns(card, slow_ns);
	for (size_t i = 0; i < count && !card->failing; i++) {
		if (transfers[i].flags & HM2_TRANSFER_WRITE)
			card->output = transfers[i].words[0];
		else
			transfers[i].words[0] = card->input++;
	}
	return HM2_OK;
}

static int finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	(void)deadline_ns;
	if (!((struct card *)self)->failing)
		return HM2_OK;
	if (error)
		memset(error, 0, sizeof *error);
	return HM2_ERR_TIMEOUT;
}

static void close_bus(void *self)
{
	(void)self;
}

struct rig {
	struct card card;
	struct hm2_board *board;
	struct hm2_cycle *cycle;
	struct hm2_engine *engine;
	struct hm2_record_ring *ring;
	struct engine_words words;
	_Atomic int over;
};

static void build(struct rig *rig, const hm2_engine_config *config)
{
	memset(rig, 0, sizeof *rig);
	const hm2_bus bus = {&rig->card, begin, finish, clock_ns, pause_ns, close_bus, NULL};
	CHECK(hm2_board_open(&bus, &rig->board, NULL) == HM2_OK);
	engine_words_cycle(&rig->words, rig->board, &rig->cycle);
	engine_words_engine(&rig->words, rig->board, rig->cycle, config, &rig->engine);
	rig->ring = engine_words_ring(rig->engine, 1024);
}

static void tear_down(struct rig *rig)
{
	hm2_engine_free(rig->engine);
	CHECK(rig->card.output == 0);
	hm2_record_ring_free(rig->ring);
	hm2_cycle_free(rig->cycle);
	hm2_board_free(rig->board);
}

static hm2_engine_config quick(void)
{
	hm2_engine_config config;
	hm2_engine_defaults(&config);
	config.period_ns = PERIOD_NS;
	config.early_ns = 0;
	config.dead_man_ns = 0;
	return config;
}

static hm2_engine_status after(struct rig *rig, uint64_t cycles)
{
	hm2_engine_status status;
	hm2_engine_read(rig->engine, &status, NULL, NULL);
	CHECK(hm2_engine_wait(rig->engine, status.cycles + cycles, 20000000000LL) == 1);
	hm2_engine_read(rig->engine, &status, NULL, NULL);
	return status;
}

static int seen(struct rig *rig, int kind)
{
	hm2_engine_event events[64];
	int found = 0;
	for (size_t count; (count = hm2_engine_take_events(rig->engine, events, 64)) != 0;)
		for (size_t i = 0; i < count; i++)
			found += events[i].kind == kind;
	return found;
}

static void test_failed_exchanges_in_a_row_turn_outputs_off_and_good_ones_do_not_turn_them_on(void)
{
	struct rig rig;
	hm2_engine_config config = quick();
	const double value = 7.0;
	config.stale_limit = 3;
	build(&rig, &config);
	CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_OK);
	hm2_engine_write(rig.engine, &value);
	CHECK(after(&rig, 4).off == 0);
	CHECK(rig.card.output == 7);
	rig.card.fail = 2;
	CHECK(after(&rig, 6).off == 0);
	rig.card.fail = 3;
	const hm2_engine_status status = after(&rig, 8);
	CHECK(status.off == HM2_OFF_STALE);
	CHECK(status.failures == 5);
	CHECK(status.stale == 0);
	CHECK(rig.card.output == 0);
	CHECK(seen(&rig, HM2_EVENT_FAILED) == 2);
	hm2_engine_write(rig.engine, &value);
	CHECK(after(&rig, 3).off == HM2_OFF_STALE);
	hm2_engine_enable(rig.engine);
	CHECK(after(&rig, 4).off == 0);
	CHECK(rig.card.output == 7);
	tear_down(&rig);
}

static void test_an_overrun_skips_the_periods_that_have_passed(void)
{
	struct rig rig;
	const hm2_engine_config config = quick();
	build(&rig, &config);
	CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_OK);
	rig.card.slow_ns = 5 * PERIOD_NS;
	const hm2_engine_status status = after(&rig, 20);
	CHECK(status.overruns >= 1);
	CHECK(status.skipped >= 5);
	CHECK(seen(&rig, HM2_EVENT_OVERRUN) >= 1);
	tear_down(&rig);
}

static void test_overruns_in_a_row_turn_outputs_off_where_wanted(void)
{
	struct rig rig;
	hm2_engine_config config = quick();
	const double value = 7.0;
	config.overrun_limit = 1;
	build(&rig, &config);
	CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_OK);
	hm2_engine_write(rig.engine, &value);
	rig.card.slow_ns = 3 * PERIOD_NS;
	CHECK(after(&rig, 10).off & HM2_OFF_OVERRUN);
	tear_down(&rig);
}

static void test_catching_up_leaves_no_period_out(void)
{
	struct rig rig;
	hm2_engine_config config = quick();
	config.period_ns = 5000000;
	config.overrun = HM2_OVERRUN_CATCH_UP;
	build(&rig, &config);
	CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_OK);
	rig.card.slow_ns = 12000000;
	const hm2_engine_status status = after(&rig, 8);
	CHECK(status.overruns >= 2);
	CHECK(status.skipped == 0);
	tear_down(&rig);
}

static void test_a_silent_writer_is_a_dead_one(void)
{
	struct rig rig;
	hm2_engine_config config = quick();
	const double value = 7.0;
	config.dead_man_ns = 20000000;
	build(&rig, &config);
	CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_OK);
	hm2_engine_write(rig.engine, &value);
	CHECK(after(&rig, 300).off == HM2_OFF_DEAD_MAN);
	CHECK(rig.card.output == 0);
	tear_down(&rig);
}

/* ---- everybody at once, for the thread sanitizer ---- */

static void *writer(void *argument)
{
	struct rig *rig = argument;
	for (double value = 1.0; !rig->over; value += 1.0) {
		hm2_engine_write(rig->engine, &value);
		hm2_engine_enable(rig->engine);
		pause_ns(NULL, 50000);
	}
	return NULL;
}

static void *reader(void *argument)
{
	struct rig *rig = argument;
	static hm2_histogram histogram;
	uint64_t last = 0;
	while (!rig->over) {
		hm2_engine_status status;
		double in, out;
		hm2_record slowest[HM2_ENGINE_SLOWEST];
		hm2_engine_read(rig->engine, &status, &in, &out);
		CHECK(status.cycles >= last);
		last = status.cycles;
		hm2_engine_get_histogram(rig->engine, HM2_STAGES, &histogram);
		hm2_engine_slowest(rig->engine, slowest, HM2_ENGINE_SLOWEST);
		(void)hm2_engine_wait(rig->engine, status.cycles, 1000000);
	}
	return NULL;
}

static void *drain(void *argument)
{
	struct rig *rig = argument;
	static uint8_t records[64 * 512];
	uint32_t layout[8];
	while (!rig->over) {
		(void)seen(rig, 0);
		(void)hm2_record_ring_pop_many(rig->ring, records, 64);
		CHECK(hm2_engine_layout(rig->engine, layout, 8) <= 2);
		pause_ns(NULL, 100000);
	}
	return NULL;
}

static void *looker(void *argument)
{
	struct rig *rig = argument;
	uint32_t word;
	while (!rig->over) {
		hm2_board_counters counters;
		(void)hm2_read(rig->board, 0x2000, &word, 1, NULL);
		hm2_board_get_counters(rig->board, &counters);
		rig->card.fail = counters.exchanges % 7 == 0;
		pause_ns(NULL, 300000);
	}
	return NULL;
}

static void test_readers_writers_and_lookers_at_once(void)
{
	struct rig rig;
	const hm2_engine_config config = quick();
	void *(*const work[])(void *) = {writer, reader, drain, looker};
	pthread_t threads[4];
	build(&rig, &config);
	for (int round = 0; round < 3; round++) {
		CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_OK);
		rig.over = 0;
		for (int i = 0; i < 4; i++)
			CHECK(pthread_create(&threads[i], NULL, work[i], &rig) == 0);
		(void)after(&rig, 150);
		hm2_engine_reset_trace(rig.engine);
		(void)after(&rig, 50);
		rig.over = 1;
		for (int i = 0; i < 4; i++)
			CHECK(pthread_join(threads[i], NULL) == 0);
		rig.card.fail = 0;
		hm2_engine_stop(rig.engine);
		CHECK(rig.card.output == 0);
	}
	tear_down(&rig);
}

static void test_start_and_stop_in_quick_succession(void)
{
	struct rig rig;
	const hm2_engine_config config = quick();
	build(&rig, &config);
	for (int i = 0; i < 50; i++) {
		CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_OK);
		CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_ERR_BUSY);
		hm2_engine_stop(rig.engine);
		hm2_engine_stop(rig.engine);
	}
	tear_down(&rig);
}

/* Its thread sleeps for an hour, in pieces. */
static void test_an_engine_that_sleeps_long_is_stopped_at_once(void)
{
	struct rig rig;
	hm2_engine_config config = quick();
	config.period_ns = INT64_C(3600) * 1000000000;
	build(&rig, &config);
	CHECK(hm2_engine_step(rig.engine, NULL) == HM2_ERR_BUSY);
	CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_OK);
	pause_ns(&rig.card, 20000000); /* it is asleep by now */
	CHECK(hm2_engine_step(rig.engine, NULL) == HM2_ERR_BUSY); /* its thread's */
	hm2_engine_stop(rig.engine);
	hm2_engine_read(rig.engine, NULL, NULL, NULL); /* nothing is asked for */
	tear_down(&rig);
}

/* As a program ends: the engine is stopped and the board closed while the recorder still empties the ring, and
 * whoever shows values still reads the last of them. */
static void test_stop_and_close_while_others_read_and_record(void)
{
	struct rig rig;
	const hm2_engine_config config = quick();
	void *(*const work[])(void *) = {reader, drain};
	pthread_t threads[2];
	uint32_t word;
	build(&rig, &config);
	for (int round = 0; round < 20; round++) {
		CHECK(hm2_engine_start(rig.engine, NULL, NULL) == HM2_OK);
		rig.over = 0;
		for (int i = 0; i < 2; i++)
			CHECK(pthread_create(&threads[i], NULL, work[i], &rig) == 0);
		(void)after(&rig, 20);
		hm2_engine_stop(rig.engine);
		CHECK(rig.card.output == 0);
		if (round == 19) {
			hm2_board_close(rig.board);
			CHECK(hm2_read(rig.board, 0x2000, &word, 1, NULL) == HM2_ERR_CLOSED);
		}
		rig.over = 1;
		for (int i = 0; i < 2; i++)
			CHECK(pthread_join(threads[i], NULL) == 0);
	}
	tear_down(&rig);
}

int main(void)
{
	test_failed_exchanges_in_a_row_turn_outputs_off_and_good_ones_do_not_turn_them_on();
	test_an_overrun_skips_the_periods_that_have_passed();
	test_overruns_in_a_row_turn_outputs_off_where_wanted();
	test_catching_up_leaves_no_period_out();
	test_a_silent_writer_is_a_dead_one();
	test_readers_writers_and_lookers_at_once();
	test_start_and_stop_in_quick_succession();
	test_an_engine_that_sleeps_long_is_stopped_at_once();
	test_stop_and_close_while_others_read_and_record();
	return check_failures != 0;
}
