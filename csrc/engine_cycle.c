/* One cycle of the engine, and when the next is due. */
#include "engine.h"

#define CATCH_UP_PERIODS 10

static int exchange(struct hm2_engine *engine, int reads, int writes, int begun, int replied)
{
	struct hm2_cycle *cycle = engine->cycle;
	hm2_error error;
	int status = cycle_begin(cycle, reads, writes, &error);
	if (begun >= 0)
		engine_stamp(engine, begun);
	if (status == HM2_OK) {
		engine_plan_capture(engine, reads);
		status = cycle_await(cycle, hm2_board_now_ns(engine->board) + engine->config.reply_ns, &error);
	}
	engine_stamp(engine, replied);
	if (status == HM2_OK)
		engine_capture(engine, reads);
	return status;
}

/* Controllers see only what was read in this cycle: after a failed exchange outputs stay as they are, until the
 * policy turns them off. */
static void compute(struct hm2_engine *engine, int status)
{
	engine_take_settings(engine);
	engine_judge_outputs(engine);
	if (status == HM2_OK || engine->status.off) {
		engine_control(engine);
		engine->elapsed_periods = 0;
	}
	engine_stamp(engine, HM2_STAGE_CONTROL);
	engine_scatter(engine);
	engine_stamp(engine, HM2_STAGE_PACK);
}

/* What can be done before it is time. */
void engine_prepare(struct hm2_engine *engine, int64_t due_ns)
{
	engine->record = (hm2_record){.cycle = engine->status.cycles, .start_ns = due_ns};
	if (engine->overruns_in_a_row)
		engine->record.flags = HM2_ENGINE_OVERRAN;
	engine_warm_record(engine);
}

static int are_left_out(const struct hm2_engine *engine, int64_t periods)
{
	return engine->config.overrun == HM2_OVERRUN_SKIP || periods > CATCH_UP_PERIODS;
}

/* Those that passed before a late cycle began lie between its readings and the last ones: told only to the next cycle they
 * would make what is taken from differences several times too high in this one. */
static void count_late_periods(struct hm2_engine *engine)
{
	const int64_t late = engine->record.stage_ns[HM2_STAGE_WAKE] / engine->config.period_ns;
	engine->late_periods = are_left_out(engine, late) ? late : 0;
	engine->elapsed_periods += engine->late_periods;
}

/* Now, as engine_prepare was told. */
void engine_cycle(struct hm2_engine *engine)
{
	const int modify = engine->config.style == HM2_ENGINE_READ_MODIFY_WRITE;
	engine_stamp(engine, HM2_STAGE_WAKE);
	count_late_periods(engine);
	const int status = exchange(engine, 1, !modify, HM2_STAGE_REQUEST, HM2_STAGE_REPLY);
	if (status == HM2_OK) {
		cycle_process(engine->cycle);
		engine_judge_ports(engine);
	} else {
		engine_miss_ports(engine);
	}
	if (status != HM2_OK || !modify)
		engine_judge_exchange(engine, status);
	engine_gather(engine);
	engine_stamp(engine, HM2_STAGE_UNPACK);
	compute(engine, status);
	if (modify) {
		const int written = exchange(engine, 0, 1, -1, HM2_STAGE_WRITE);
		if (written == HM2_OK)
			cycle_process(engine->cycle);
		if (status == HM2_OK)
			engine_judge_exchange(engine, written);
	} else {
		engine->record.stage_ns[HM2_STAGE_WRITE] = engine->record.stage_ns[HM2_STAGE_PACK];
	}
	engine->status.cycles++;
	engine->status.start_ns = engine->record.start_ns;
	engine_trace_cycle(engine);
	engine_publish(engine);
	engine_trace_rest(engine);
}

void engine_schedule(struct hm2_engine *engine)
{
	const int64_t period = engine->config.period_ns;
	const int64_t late = engine_now_ns(engine) - (engine->due_ns + period);
	const int64_t missed = late >= 0 ? late / period + 1 : 0;
	int64_t periods = 1;
	engine_judge_time(engine, missed);
	if (missed && are_left_out(engine, missed)) {
		engine->status.skipped += (uint64_t)missed;
		periods += missed;
	}
	engine->elapsed_periods += periods - engine->late_periods;
	engine->due_ns += periods * period;
}
