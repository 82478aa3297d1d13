/* The engine in virtual time, cycle by cycle, on a mailbox that does as told: what turns outputs off and what does not,
 * ports given up, taken back and lent, late cycles, lost events. */
#include <math.h>
#include <string.h>
#include <unistd.h>

#include "check.h"
#include "engine_words.h"
#include "hm2.h"
#include "engine.h"
#include "mailbox.h"

enum { PERIOD_NS = 1000000 };

struct rig {
	struct mailbox mailbox;
	struct hm2_cycle *cycle;
	struct hm2_engine *engine;
	struct engine_words words;
};

static struct rig rig;

static hm2_engine_config calm(void)
{
	hm2_engine_config config;
	hm2_engine_defaults(&config);
	config.virtual_time = 1;
	config.dead_man_ns = 0;
	return config;
}

static void build(const hm2_engine_config *config)
{
	hm2_cyclic part;
	memset(&rig, 0, sizeof rig);
	mailbox_open(&rig.mailbox);
	engine_words_cycle(&rig.words, rig.mailbox.board, &rig.cycle);
	hm2_sserial_part(rig.mailbox.port, &part);
	CHECK_EQUAL(hm2_cycle_add(rig.cycle, &part, NULL), HM2_OK);
	engine_words_engine(&rig.words, rig.mailbox.board, rig.cycle, config, &rig.engine);
}

static void tear_down(void)
{
	hm2_engine_free(rig.engine);
	CHECK_EQUAL(rig.mailbox.words[OUT / 4], 0); /* whatever happened */
	hm2_cycle_free(rig.cycle);
	mailbox_free(&rig.mailbox);
}

static hm2_engine_status step(int cycles)
{
	return engine_steps(rig.engine, cycles);
}

static void start(void)
{
	const double value = 7.0;
	CHECK_EQUAL(hm2_engine_start(rig.engine, NULL, NULL), HM2_OK);
	CHECK_EQUAL(step(1).off, HM2_OFF_IDLE);
	hm2_engine_write(rig.engine, &value);
	CHECK_EQUAL(step(2).off, 0);
	CHECK_EQUAL(rig.mailbox.words[OUT / 4], 7);
}

/* The last event of this kind; {0}: none. Takes them all. */
static hm2_engine_event last_event(int kind)
{
	hm2_engine_event event, found = {0};
	while (hm2_engine_take_events(rig.engine, &event, 1))
		if (event.kind == kind)
			found = event;
	return found;
}

static void test_steps_are_for_an_engine_that_was_started(void)
{
	const hm2_engine_config config = calm();
	build(&config);
	CHECK_EQUAL(hm2_engine_step(rig.engine, NULL), HM2_ERR_BUSY);
	start();
	CHECK_EQUAL(hm2_engine_start(rig.engine, NULL, NULL), HM2_ERR_BUSY);
	CHECK_EQUAL(hm2_engine_wait(rig.engine, 2, 0), 1);     /* cycle 2 is over */
	CHECK_EQUAL(hm2_engine_wait(rig.engine, 1000, 50), 0); /* nobody would wake us */
	hm2_engine_stop(rig.engine);
	CHECK_EQUAL(hm2_engine_step(rig.engine, NULL), HM2_ERR_BUSY);
	tear_down();
	hm2_engine_free(NULL);
}

static void test_without_limits_nothing_but_its_user_turns_outputs_off(void)
{
	hm2_engine_config config = calm();
	config.stale_limit = 0;
	build(&config);
	start();
	rig.mailbox.fail_next = 500;
	const hm2_engine_status status = step(500);
	CHECK_EQUAL(status.off, 0);
	CHECK_EQUAL(status.stale, 500);
	CHECK_EQUAL(status.status, HM2_ERR_IO);
	CHECK_EQUAL(step(1).stale, 0);
	CHECK_EQUAL(last_event(HM2_EVENT_RECOVERED).value, 500);
	hm2_engine_disable(rig.engine);
	CHECK_EQUAL(step(1).off, HM2_OFF_USER);
	tear_down();
}

/* The write of a read-modify-write cycle is judged as its read is; the readings of the cycle were good. */
static void test_a_write_that_fails_counts_as_a_failed_exchange(void)
{
	hm2_engine_config config = calm();
	config.style = HM2_ENGINE_READ_MODIFY_WRITE;
	config.stale_limit = 2;
	build(&config);
	start();
	for (int i = 0; i < 2; i++) {
		rig.mailbox.fail_writes = 1;
		CHECK_EQUAL(step(1).stale, i + 1);
	}
	CHECK_EQUAL(step(1).off, HM2_OFF_STALE); /* before anything more goes out */
	CHECK_EQUAL(step(0).stale, 0);
	CHECK_EQUAL(rig.mailbox.words[OUT / 4], 0);
	rig.mailbox.fail_next = 1; /* the read: its write still goes out, and is not counted as well */
	CHECK_EQUAL(step(1).failures, 3);
	CHECK_EQUAL(step(0).stale, 1); /* writes that get through do not make readings fresh */
	CHECK_EQUAL(step(1).stale, 0);
	tear_down();
}

static void test_events_without_room_are_counted(void)
{
	hm2_engine_config config = calm();
	config.stale_limit = 0;
	build(&config);
	start();
	for (int i = 0; i < HM2_ENGINE_EVENTS; i++) { /* two events each: failed, recovered */
		rig.mailbox.fail_next = 1;
		(void)step(2);
	}
	hm2_engine_event event;
	const hm2_engine_status status = step(0);
	CHECK_EQUAL(status.events_lost, 2 * HM2_ENGINE_EVENTS + 1 - HM2_ENGINE_EVENTS); /* and one that outputs are on */
	CHECK_EQUAL(hm2_engine_take_events(rig.engine, &event, 1), 1);
	CHECK_EQUAL(event.kind, HM2_EVENT_ON); /* the oldest are kept */
	tear_down();
}

static void test_what_is_too_late_to_be_made_up_for_is_left_out(void)
{
	hm2_engine_config config = calm();
	config.overrun = HM2_OVERRUN_CATCH_UP;
	build(&config);
	start();
	rig.mailbox.slow_ns = 10 * PERIOD_NS; /* ten periods have passed when it is over */
	CHECK_EQUAL(step(11).skipped, 0);
	rig.mailbox.slow_ns = 11 * PERIOD_NS;
	(void)step(1); /* what is known when a cycle is over is shown by the next */
	CHECK_EQUAL(last_event(HM2_EVENT_OVERRUN).value, 11);
	CHECK_EQUAL(step(1).skipped, 11);
	CHECK_EQUAL(step(5).skipped, 11);
	tear_down();
}

static void test_as_many_overruns_in_a_row_as_are_allowed(void)
{
	hm2_engine_config config = calm();
	config.overrun_limit = 2;
	build(&config);
	start();
	rig.mailbox.slow_ns = 2 * PERIOD_NS;
	CHECK_EQUAL(step(1).off, 0);
	CHECK_EQUAL(step(1).off, 0); /* a good one in between: from the beginning */
	for (int i = 0; i < 2; i++) {
		rig.mailbox.slow_ns = 2 * PERIOD_NS;
		CHECK_EQUAL(step(1).off, 0);
	}
	CHECK_EQUAL(step(1).off, HM2_OFF_OVERRUN);
	CHECK_EQUAL(step(0).overruns, 3);
	tear_down();
}

/* ---- at any moment of a cycle ---- */

enum { MOMENTS = 40 };

static int looks_left;
static void (*act)(void);

static void at_the_moment(void)
{
	if (looks_left-- == 0)
		act();
}

static void write_and_enable(void)
{
	const double value = 9.0;
	hm2_engine_write(rig.engine, &value);
	hm2_engine_enable(rig.engine);
}

static void disable_and_write(void)
{
	const double value = 9.0;
	hm2_engine_disable(rig.engine);
	hm2_engine_write(rig.engine, &value);
}

/* What is put out from the moment on is one of both, in the end `last`. */
static void check_out(int32_t style, int moment, void (*what)(void), uint32_t first, uint32_t last)
{
	hm2_engine_config config = calm();
	config.style = style;
	build(&config);
	start();
	if (first != 7) {
		hm2_engine_disable(rig.engine);
		(void)step(2);
	}
	act = what;
	looks_left = moment;
	rig.mailbox.looked = at_the_moment;
	for (int i = 0; i < 8; i++) {
		(void)step(1);
		CHECK(rig.mailbox.words[OUT / 4] == first || rig.mailbox.words[OUT / 4] == last);
	}
	CHECK(looks_left < 0);
	rig.mailbox.looked = NULL;
	CHECK_EQUAL(rig.mailbox.words[OUT / 4], last);
	tear_down();
}

static void test_outputs_written_before_enabling_come_with_it_and_none_written_behind_disabling(void)
{
	for (int moment = 0; moment < MOMENTS; moment++) {
		const int32_t style = moment % 2 ? HM2_ENGINE_PIPELINED : HM2_ENGINE_READ_MODIFY_WRITE;
		check_out(style, moment / 2, write_and_enable, 0, 9);
		check_out(style, moment / 2, disable_and_write, 7, 0);
	}
}

static void test_of_enabling_and_disabling_in_one_cycle_the_last_counts(void)
{
	const hm2_engine_config config = calm();
	build(&config);
	start();
	hm2_engine_disable(rig.engine);
	hm2_engine_enable(rig.engine);
	(void)last_event(HM2_EVENT_ON);
	CHECK_EQUAL(step(1).off, 0);
	CHECK_EQUAL(last_event(HM2_EVENT_ON).kind, HM2_EVENT_ON); /* they were off: controllers begin anew */
	hm2_engine_enable(rig.engine);
	hm2_engine_disable(rig.engine);
	CHECK_EQUAL(step(3).off, HM2_OFF_USER);
	tear_down();
}

/* ---- ports ---- */

static void start_port(void)
{
	CHECK_EQUAL(hm2_sserial_start(rig.mailbox.port, 0x03, HM2_SSERIAL_NORMAL, NULL), 0);
	hm2_sserial_set_cyclic(rig.mailbox.port, 0x03);
	CHECK_EQUAL(hm2_engine_add_port(rig.engine, rig.mailbox.port, NULL), HM2_OK);
	start();
}

static int never(struct mailbox *mailbox, uint32_t command)
{
	(void)mailbox;
	(void)command;
	return 0;
}

static void test_a_hung_doit_gives_its_port_up_and_the_others_run_on(void)
{
	const hm2_engine_config config = calm();
	build(&config);
	start_port();
	const uint64_t cycles = step(3).cycles;
	CHECK_EQUAL(hm2_sserial_stop(rig.mailbox.port, 0, NULL), HM2_ERR_BUSY); /* the engine's */
	rig.mailbox.completes = never;
	hm2_engine_status status = step(5);
	CHECK_EQUAL(status.port_state[0], HM2_PORT_GIVEN_UP);
	CHECK_EQUAL(status.off & HM2_OFF_PORT, HM2_OFF_PORT);
	CHECK_EQUAL(status.cycles, cycles + 5);
	CHECK_EQUAL(last_event(HM2_EVENT_PORT_GIVEN_UP).value, -1);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(1).off & HM2_OFF_PORT, HM2_OFF_PORT); /* what still holds turns outputs off again */
	rig.mailbox.completes = always;
	CHECK(hm2_sserial_reset(rig.mailbox.port, NULL) != HM2_ERR_BUSY); /* its user's to start anew */
	CHECK_EQUAL(hm2_sserial_start(rig.mailbox.port, 0x03, HM2_SSERIAL_NORMAL, NULL), 0);
	hm2_engine_port_back(rig.engine, 0);
	hm2_engine_port_back(rig.engine, 1); /* no such port */
	CHECK_EQUAL(step(1).port_state[0], HM2_PORT_RUNNING);
	CHECK_EQUAL(last_event(HM2_EVENT_PORT_BACK).index, 0);
	CHECK_EQUAL(step(1).off & HM2_OFF_PORT, HM2_OFF_PORT); /* back, and outputs stay off until enabled */
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(1).off, 0);
	tear_down();
}

static void test_failed_transfers_fill_the_bucket_that_good_ones_empty(void)
{
	hm2_engine_config config = calm();
	config.fault_increment = 10;
	config.fault_decrement = 4;
	config.fault_limit = 20;
	build(&config);
	start_port();
	CHECK_EQUAL(step(3).port_level[0], 0); /* never below */
	rig.mailbox.words[DATA / 4] = 0x02;
	CHECK_EQUAL(step(1).port_level[0], 10);
	rig.mailbox.words[DATA / 4] = 0;
	CHECK_EQUAL(step(1).port_level[0], 6);
	rig.mailbox.words[DATA / 4] = 0x02;
	CHECK_EQUAL(step(1).port_level[0], 16);
	CHECK_EQUAL(step(0).off, 0);
	CHECK_EQUAL(step(1).off, HM2_OFF_PORT);
	CHECK_EQUAL(last_event(HM2_EVENT_PORT_GIVEN_UP).value, 26);
	hm2_sserial_counters before, after;
	hm2_sserial_get_counters(rig.mailbox.port, &before);
	CHECK_EQUAL(step(3).port_state[0], HM2_PORT_RUNNING); /* the zeroes go out first: the remote may hear */
	CHECK_EQUAL(step(1).port_state[0], HM2_PORT_GIVEN_UP);
	hm2_sserial_get_counters(rig.mailbox.port, &after);
	CHECK(after.doits - before.doits >= 3);
	(void)step(5);
	hm2_sserial_get_counters(rig.mailbox.port, &before);
	CHECK_EQUAL(before.doits, after.doits);
	tear_down();
}

/* Its zeroes cannot go out any more: its user gets it sooner. */
static void test_a_doit_that_hangs_while_its_port_is_left_ends_that(void)
{
	hm2_engine_config config = calm();
	config.fault_increment = config.fault_limit = 10;
	config.period_ns = 3000000; /* longer than a DOIT is waited for */
	build(&config);
	start_port();
	rig.mailbox.words[DATA / 4] = 0x02;
	CHECK_EQUAL(step(1).off, HM2_OFF_PORT);
	rig.mailbox.completes = never;
	CHECK_EQUAL(step(2).port_state[0], HM2_PORT_RUNNING);
	CHECK_EQUAL(step(1).port_state[0], HM2_PORT_GIVEN_UP);
	rig.mailbox.completes = always;
	rig.mailbox.words[DATA / 4] = 0;
	CHECK_EQUAL(hm2_sserial_stop(rig.mailbox.port, 0, NULL), HM2_OK);
	tear_down();
}

/* Exchanges succeed, and none of them brings a result that could be taken. */
static void test_results_that_stay_hidden_turn_outputs_off_as_lost_exchanges_do(void)
{
	hm2_engine_config config = calm();
	config.stale_limit = 3;
	build(&config);
	start_port();
	rig.mailbox.words[DATA / 4] = 0xFF; /* the answer to no DOIT on two channels */
	CHECK_EQUAL(step(2).port_stale[0], 2);
	CHECK_EQUAL(step(0).off, 0);
	CHECK_EQUAL(step(1).off, HM2_OFF_STALE);
	CHECK_EQUAL(step(0).stale, 0);
	CHECK_EQUAL(step(0).port_level[0], 0);
	rig.mailbox.words[DATA / 4] = 0;
	CHECK_EQUAL(step(2).port_stale[0], 0);
	CHECK_EQUAL(step(0).off, HM2_OFF_STALE); /* until enabled */
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(1).off, 0);
	tear_down();
}

/* Neither an exchange that brought no result nor one that failed is as good as a result. */
static void test_hidden_results_between_failed_exchanges_count_with_them(void)
{
	hm2_engine_config config = calm();
	config.stale_limit = 5;
	build(&config);
	start_port();
	rig.mailbox.words[DATA / 4] = 0xFF;
	rig.mailbox.fail_next = 4;
	CHECK_EQUAL(step(4).stale, 4);
	CHECK_EQUAL(step(0).off, 0);
	CHECK_EQUAL(step(1).stale, 0);
	CHECK_EQUAL(step(0).port_stale[0], 5);
	CHECK_EQUAL(step(0).off, HM2_OFF_STALE);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(1).off, HM2_OFF_STALE); /* exchanges are good again, and the port's inputs those of before */
	rig.mailbox.words[DATA / 4] = 0;
	CHECK_EQUAL(step(2).port_stale[0], 0);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(1).off, 0);
	tear_down();
}

/* The bucket has a limit of its own for those, or none. */
static void test_a_result_of_failed_transfers_alone_makes_no_inputs_fresh(void)
{
	hm2_engine_config config = calm();
	config.stale_limit = 3;
	config.fault_limit = 0;
	build(&config);
	start_port();
	rig.mailbox.words[DATA / 4] = 0xFF;
	CHECK_EQUAL(step(2).port_stale[0], 2);
	rig.mailbox.words[DATA / 4] = 0x03;
	CHECK_EQUAL(step(10).port_stale[0], 2);
	CHECK_EQUAL(step(0).off, 0);
	rig.mailbox.words[DATA / 4] = 0xFF;
	CHECK_EQUAL(step(1).off, HM2_OFF_STALE);
	rig.mailbox.words[DATA / 4] = 0x02; /* the other one was good */
	CHECK_EQUAL(step(2).port_stale[0], 0);
	tear_down();
}

/* Neither those of the last run nor those from before the port was given up. */
static void test_hidden_results_of_before_do_not_count(void)
{
	hm2_engine_config config = calm();
	config.stale_limit = 5;
	build(&config);
	start_port();
	rig.mailbox.words[DATA / 4] = 0xFF;
	CHECK_EQUAL(step(4).port_stale[0], 4);
	hm2_engine_stop(rig.engine);
	CHECK_EQUAL(hm2_engine_start(rig.engine, NULL, NULL), HM2_OK);
	CHECK_EQUAL(step(1).port_stale[0], 1);
	CHECK_EQUAL(step(3).port_stale[0], 4);
	rig.mailbox.completes = never;
	CHECK_EQUAL(step(5).port_state[0], HM2_PORT_GIVEN_UP);
	rig.mailbox.completes = always;
	rig.mailbox.words[DATA / 4] = 0;
	(void)hm2_sserial_reset(rig.mailbox.port, NULL);
	CHECK_EQUAL(hm2_sserial_start(rig.mailbox.port, 0x03, HM2_SSERIAL_NORMAL, NULL), 0);
	hm2_engine_port_back(rig.engine, 0);
	CHECK_EQUAL(step(1).port_stale[0], 0);
	tear_down();
}

static void test_without_a_limit_a_port_is_never_given_up(void)
{
	hm2_engine_config config = calm();
	config.fault_limit = 0;
	build(&config);
	start_port();
	rig.mailbox.words[DATA / 4] = 0x02;
	CHECK_EQUAL(step(100).port_state[0], HM2_PORT_RUNNING);
	CHECK(step(0).port_level[0] >= 900);
	tear_down();
}

/* A remote's own fault turns outputs off at once; a lost reply, seen in CS too, is the bucket's business. */
static void test_only_a_fault_of_the_remote_itself_turns_outputs_off(void)
{
	const hm2_engine_config config = calm();
	build(&config);
	start_port();
	rig.mailbox.words[CS / 4 + 1] = 0x00002000; /* a communication error */
	CHECK_EQUAL(step(2).off, 0);
	CHECK_EQUAL(last_event(HM2_EVENT_PORT_FAULT).index, 1);
	rig.mailbox.words[CS / 4 + 1] = 0x04002000;
	CHECK_EQUAL(step(2).off, HM2_OFF_FAULT);
	CHECK_EQUAL(last_event(HM2_EVENT_PORT_FAULT).words[1], 0x04000000);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(2).off, 0); /* not new */
	hm2_sserial_watch(rig.mailbox.port, 0, 1, 0xC0);
	rig.mailbox.words[(USER0 + 0x100) / 4] = 0x80; /* the watched word of an 8I20 */
	CHECK_EQUAL(step(2).off, HM2_OFF_FAULT);
	CHECK_EQUAL(last_event(HM2_EVENT_PORT_FAULT).words[3], 0x80);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(2).off, 0);
	tear_down();
}

/* It takes no outputs until it is started anew, so enabling would be a promise that nobody keeps. */
static void test_a_remote_whose_watchdog_has_bitten_keeps_outputs_off(void)
{
	const hm2_engine_config config = calm();
	build(&config);
	start_port();
	rig.mailbox.words[CS / 4 + 1] = 0x01002000;
	CHECK_EQUAL(step(2).off, HM2_OFF_FAULT);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(2).off, HM2_OFF_FAULT);
	rig.mailbox.words[CS / 4 + 1] = 0;
	CHECK_EQUAL(step(2).off, HM2_OFF_FAULT);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(2).off, 0);
	hm2_sserial_watch(rig.mailbox.port, 0, 1, 0xC0);
	rig.mailbox.words[(USER0 + 0x100) / 4] = 0x40; /* the lowest bit of an 8I20's word */
	CHECK_EQUAL(step(2).off, HM2_OFF_FAULT);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(2).off, HM2_OFF_FAULT);
	rig.mailbox.words[CS / 4 + 2] = 0x01002000; /* no channel of the cycle */
	rig.mailbox.words[(USER0 + 0x100) / 4] = 0;
	step(2);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(2).off, 0);
	tear_down();
}

static void test_a_port_is_lent_when_its_doit_is_over(void)
{
	uint8_t byte;
	const hm2_engine_config config = calm();
	build(&config);
	start_port();
	CHECK_EQUAL(hm2_engine_lend_port(rig.engine, 1, 1), 0); /* no such port */
	CHECK_EQUAL(hm2_engine_lend_port(rig.engine, 0, 1), 0); /* asked */
	CHECK_EQUAL(hm2_engine_lend_port(rig.engine, 0, 0), 0); /* and taken back before it was heard */
	(void)step(3);
	CHECK_EQUAL(hm2_sserial_read_local(rig.mailbox.port, 0, &byte, 1, NULL), HM2_ERR_BUSY);
	CHECK_EQUAL(hm2_engine_lend_port(rig.engine, 0, 1), 0);
	(void)step(1);
	CHECK_EQUAL(hm2_engine_lend_port(rig.engine, 0, 0), 0); /* taken back while held: it goes on */
	(void)step(2);
	hm2_sserial_counters before, after;
	hm2_sserial_get_counters(rig.mailbox.port, &before);
	(void)step(5);
	hm2_sserial_get_counters(rig.mailbox.port, &after);
	CHECK_EQUAL(after.doits - before.doits, 5);
	CHECK_EQUAL(hm2_engine_lend_port(rig.engine, 0, 1), 0);
	(void)step(3);
	CHECK_EQUAL(hm2_engine_lend_port(rig.engine, 0, 1), 1);
	CHECK_EQUAL(step(2).port_state[0], HM2_PORT_RUNNING);
	CHECK_EQUAL(step(0).off, 0); /* lent is not given up */
	CHECK_EQUAL(hm2_sserial_read_local(rig.mailbox.port, 0, &byte, 1, NULL), HM2_OK);
	hm2_engine_port_back(rig.engine, 0);
	(void)step(2);
	CHECK_EQUAL(hm2_sserial_read_local(rig.mailbox.port, 0, &byte, 1, NULL), HM2_ERR_BUSY);
	tear_down();
}

static void check_that_doits_go_on(void)
{
	hm2_sserial_counters before, after;
	hm2_sserial_get_counters(rig.mailbox.port, &before);
	CHECK_EQUAL(step(20).off, 0);
	CHECK_EQUAL(step(0).port_stale[0], 0);
	hm2_sserial_get_counters(rig.mailbox.port, &after);
	CHECK(after.doits - before.doits >= 18);
}

static void lend_port(void)
{
	CHECK_EQUAL(hm2_engine_lend_port(rig.engine, 0, 1), 0);
	(void)step(3);
	CHECK_EQUAL(hm2_engine_lend_port(rig.engine, 0, 1), 1);
}

/* Whether a command that was lost on its way is over is to be seen. It was not: inputs stood still, and outputs on. */
static void test_a_port_with_a_command_in_doubt_is_not_left_alone_for_ever(void)
{
	uint8_t byte;
	const hm2_engine_config config = calm();
	build(&config);
	CHECK_EQUAL(hm2_sserial_start(rig.mailbox.port, 0x03, HM2_SSERIAL_NORMAL, NULL), 0);
	rig.mailbox.fail_next = 1;
	CHECK_EQUAL(hm2_sserial_doit(rig.mailbox.port, 0x03, NULL), HM2_ERR_IO); /* before the engine is started */
	start_port();
	check_that_doits_go_on();
	lend_port();
	rig.mailbox.fail_next = 1;
	CHECK_EQUAL(hm2_sserial_read_local(rig.mailbox.port, 0, &byte, 1, NULL), HM2_ERR_IO);
	hm2_engine_port_back(rig.engine, 0);
	check_that_doits_go_on();
	tear_down();
}

static int but_no_reading(struct mailbox *mailbox, uint32_t command)
{
	(void)mailbox;
	return command >> 12 != 0x2;
}

/* Its inputs would stand still, and nothing would say so. */
static void test_a_lent_port_that_comes_back_without_its_channels_is_given_up(void)
{
	uint8_t byte;
	for (int hangs = 0; hangs < 2; hangs++) {
		const hm2_engine_config config = calm();
		build(&config);
		start_port();
		lend_port();
		if (hangs) { /* all is stopped for it */
			rig.mailbox.completes = but_no_reading;
			CHECK_EQUAL(hm2_sserial_read_local(rig.mailbox.port, 0, &byte, 1, NULL), HM2_ERR_TIMEOUT);
			CHECK_EQUAL(hm2_sserial_started(rig.mailbox.port), 0);
		} else {
			CHECK_EQUAL(hm2_sserial_stop(rig.mailbox.port, 0x02, NULL), HM2_OK);
		}
		hm2_engine_port_back(rig.engine, 0);
		CHECK_EQUAL(step(1).off, HM2_OFF_PORT);
		CHECK_EQUAL(last_event(HM2_EVENT_PORT_GIVEN_UP).value, -2);
		CHECK_EQUAL(step(3).port_state[0], HM2_PORT_RUNNING); /* the zeroes go out to what still runs */
		CHECK_EQUAL(step(1).port_state[0], HM2_PORT_GIVEN_UP);
		tear_down();
	}
}

static void test_what_is_enabled_before_a_start_stays_off(void)
{
	const hm2_engine_config config = calm();
	build(&config);
	for (int i = 0; i < 2; i++) {
		hm2_engine_enable(rig.engine);
		CHECK_EQUAL(hm2_engine_start(rig.engine, NULL, NULL), HM2_OK);
		CHECK_EQUAL(step(3).off, HM2_OFF_IDLE);
		hm2_engine_stop(rig.engine);
	}
	tear_down();
}

/* Nor does what was written for the last run go out in this one. */
static void test_enabling_waits_for_outputs_of_this_run(void)
{
	const double value = 8.0;
	const hm2_engine_config config = calm();
	build(&config);
	start();
	hm2_engine_stop(rig.engine);
	CHECK_EQUAL(hm2_engine_start(rig.engine, NULL, NULL), HM2_OK);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(3).off, HM2_OFF_IDLE);
	CHECK_EQUAL(rig.mailbox.words[OUT / 4], 0);
	hm2_engine_disable(rig.engine);
	(void)step(1);
	hm2_engine_write(rig.engine, &value);
	CHECK_EQUAL(step(3).off, HM2_OFF_IDLE | HM2_OFF_USER);
	hm2_engine_enable(rig.engine);
	CHECK_EQUAL(step(2).off, 0);
	CHECK_EQUAL(rig.mailbox.words[OUT / 4], 8);
	tear_down();
}

/* In a forked child: nothing is the child's to stop. */
static void test_an_abandoned_engine_stops_nothing(void)
{
	const hm2_engine_config config = calm();
	build(&config);
	start();
	shared_words_begin(&rig.engine->shared); /* the fork came in the middle of a write */
	shared_words_begin(&rig.engine->trace.shared);
	hm2_engine_abandon(rig.engine);
	hm2_engine_status status;
	hm2_record slowest;
	alarm(20); /* ends one that waits for the writer for ever */
	hm2_engine_read(rig.engine, &status, NULL, NULL);
	CHECK_EQUAL(status.running, 0);
	CHECK_EQUAL(hm2_engine_slowest(rig.engine, &slowest, 1), 1);
	alarm(0);
	hm2_engine_stop(rig.engine);
	CHECK_EQUAL(rig.mailbox.words[OUT / 4], 7);
	CHECK_EQUAL(hm2_engine_step(rig.engine, NULL), HM2_ERR_BUSY);
	rig.mailbox.words[OUT / 4] = 0;
	tear_down();
}

int main(void)
{
	test_steps_are_for_an_engine_that_was_started();
	test_without_limits_nothing_but_its_user_turns_outputs_off();
	test_a_write_that_fails_counts_as_a_failed_exchange();
	test_events_without_room_are_counted();
	test_what_is_too_late_to_be_made_up_for_is_left_out();
	test_as_many_overruns_in_a_row_as_are_allowed();
	test_outputs_written_before_enabling_come_with_it_and_none_written_behind_disabling();
	test_of_enabling_and_disabling_in_one_cycle_the_last_counts();
	test_a_hung_doit_gives_its_port_up_and_the_others_run_on();
	test_failed_transfers_fill_the_bucket_that_good_ones_empty();
	test_a_doit_that_hangs_while_its_port_is_left_ends_that();
	test_results_that_stay_hidden_turn_outputs_off_as_lost_exchanges_do();
	test_hidden_results_between_failed_exchanges_count_with_them();
	test_a_result_of_failed_transfers_alone_makes_no_inputs_fresh();
	test_hidden_results_of_before_do_not_count();
	test_without_a_limit_a_port_is_never_given_up();
	test_only_a_fault_of_the_remote_itself_turns_outputs_off();
	test_a_remote_whose_watchdog_has_bitten_keeps_outputs_off();
	test_a_port_is_lent_when_its_doit_is_over();
	test_a_port_with_a_command_in_doubt_is_not_left_alone_for_ever();
	test_a_lent_port_that_comes_back_without_its_channels_is_given_up();
	test_what_is_enabled_before_a_start_stays_off();
	test_enabling_waits_for_outputs_of_this_run();
	test_an_abandoned_engine_stops_nothing();
	return CHECK_RESULT();
}
