/* Where a cycle's time goes: stamps, histograms, the slowest cycles. */
#include "engine.h"

#include <stdlib.h>
#include <string.h>

int engine_trace_new(struct hm2_engine *engine)
{
	shared_words *shared = &engine->trace.shared;
	shared->count = 1 + HM2_ENGINE_SLOWEST * HEADER_WORDS;
	shared->words = calloc(shared->count, sizeof *shared->words);
	return shared->words != NULL;
}

void engine_trace_free(struct hm2_engine *engine)
{
	free(engine->trace.shared.words);
}

void engine_stamp(struct hm2_engine *engine, int stage)
{
	const int64_t passed = engine_now_ns(engine) - engine->record.start_ns;
	engine->record.stage_ns[stage] = passed < 0 ? 0 : passed > UINT32_MAX ? UINT32_MAX : (uint32_t)passed;
}

static void note_slowest(struct hm2_engine *engine, uint32_t took_ns)
{
	struct engine_trace *trace = &engine->trace;
	uint32_t at = trace->slowest_count;
	uint64_t words[HEADER_WORDS];
	if (at < HM2_ENGINE_SLOWEST) {
		trace->slowest_count++;
	} else {
		at = 0;
		for (uint32_t i = 1; i < HM2_ENGINE_SLOWEST; i++)
			if (trace->slowest[i].stage_ns[HM2_STAGE_WRITE] < trace->slowest[at].stage_ns[HM2_STAGE_WRITE])
				at = i;
		if (took_ns <= trace->slowest[at].stage_ns[HM2_STAGE_WRITE])
			return;
	}
	const uint64_t count = trace->slowest_count;
	trace->slowest[at] = engine->record;
	memcpy(words, &engine->record, sizeof words);
	shared_words_begin(&trace->shared);
	shared_words_put(&trace->shared, 0, &count, 1);
	shared_words_put(&trace->shared, 1 + at * HEADER_WORDS, words, HEADER_WORDS);
	shared_words_end(&trace->shared);
}

void engine_trace_cycle(struct hm2_engine *engine)
{
	hm2_record *record = &engine->record;
	const uint32_t *stages = record->stage_ns;
	record->outputs = engine->status.outputs;
	record->status = engine->status.status;
	record->flags |= engine->status.off;
	hm2_histogram_record(&engine->trace.stages[0], stages[0]);
	for (int i = 1; i < HM2_STAGES; i++)
		hm2_histogram_record(&engine->trace.stages[i], (int64_t)stages[i] - stages[i - 1]);
	hm2_histogram_record(&engine->trace.stages[HM2_STAGES], stages[HM2_STAGES - 1]);
	note_slowest(engine, stages[HM2_STAGES - 1]);
	engine_push_record(engine);
}

/* What followed the cycle counts for the next one's schedule only. */
void engine_trace_rest(struct hm2_engine *engine)
{
	const int64_t ended_ns = engine->record.start_ns + engine->record.stage_ns[HM2_STAGE_WRITE];
	hm2_histogram_record(&engine->trace.stages[HM2_STAGES + 1], engine_now_ns(engine) - ended_ns);
}

void engine_clear_trace(struct hm2_engine *engine)
{
	struct engine_trace *trace = &engine->trace;
	const uint64_t none = 0;
	for (int i = 0; i <= HM2_STAGES + 1; i++)
		hm2_histogram_reset(&trace->stages[i]);
	trace->slowest_count = 0;
	shared_words_begin(&trace->shared);
	shared_words_put(&trace->shared, 0, &none, 1);
	shared_words_end(&trace->shared);
}

void hm2_engine_reset_trace(struct hm2_engine *engine)
{
	if (atomic_load(&engine->running))
		atomic_fetch_or(&engine->requests, ENGINE_REQUEST_RESET_TRACE);
	else
		engine_clear_trace(engine);
}

void hm2_engine_get_histogram(const struct hm2_engine *engine, int stage, hm2_histogram *histogram)
{
	if (stage >= 0 && stage <= HM2_STAGES + 1)
		hm2_histogram_copy(histogram, &engine->trace.stages[stage]);
}

size_t hm2_engine_slowest(const struct hm2_engine *engine, hm2_record *records, size_t capacity)
{
	uint64_t words[1 + HM2_ENGINE_SLOWEST * HEADER_WORDS];
	while (!shared_words_try(&engine->trace.shared, 0, words, engine->trace.shared.count))
		sched_yield();
	const size_t count = words[0] < capacity ? words[0] : capacity;
	memcpy(records, &words[1], count * sizeof *records);
	return count;
}
