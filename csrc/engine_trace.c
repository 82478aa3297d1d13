/* Where a cycle's time goes: stamps, histograms, the slowest cycles, and the record of each. */
#include "engine.h"

#include <stdlib.h>
#include <string.h>

int engine_trace_new(struct hm2_engine *engine)
{
	shared_words *shared = &engine->trace.shared;
	shared->count = 1 + HM2_ENGINE_SLOWEST * HEADER_WORDS;
	shared->words = calloc(shared->count, sizeof *shared->words);
	memset(engine->image.slots, 0xFF, sizeof engine->image.slots);
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

static void capture_word(struct hm2_engine *engine, uint32_t address, int write, uint32_t word)
{
	struct engine_image *image = &engine->image;
	uint16_t *slot = &image->slots[write][address / 4];
	const uint32_t count = atomic_load_explicit(&image->count, memory_order_relaxed);
	if (*slot == IMAGE_NONE) {
		if (count == image->capacity)
			return;
		image->address[count] = address | (uint32_t)write;
		*slot = (uint16_t)count;
		atomic_store_explicit(&image->count, count + 1, memory_order_release);
	}
	image->words[*slot] = word;
	engine->record.fresh[*slot / 32] |= 1u << *slot % 32;
}

/* After an exchange that came back, before its words are taken in. */
void engine_capture(struct hm2_engine *engine)
{
	const struct hm2_cycle *cycle = engine->cycle;
	for (size_t i = 0; engine->image.ring && i < cycle->transfers; i++) {
		const hm2_transfer *transfer = &cycle->transfer[i];
		const uint32_t step = transfer->flags & HM2_TRANSFER_SAME_ADDRESS ? 0 : 4;
		for (uint32_t k = 0; k < transfer->count; k++)
			capture_word(engine, transfer->address + k * step,
			             (transfer->flags & HM2_TRANSFER_WRITE) != 0, transfer->words[k]);
	}
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

static size_t image_size(uint32_t words)
{
	return (words + 1) / 2 * 8;
}

uint32_t hm2_engine_record_size(const struct hm2_engine *engine, uint32_t image_words)
{
	return (uint32_t)(sizeof(hm2_record) + image_size(image_words) +
	                  (engine->input_count + engine->output_count) * sizeof(double));
}

static void push_record(struct hm2_engine *engine)
{
	struct engine_image *image = &engine->image;
	uint8_t *place = hm2_record_ring_reserve(image->ring);
	if (!place)
		return;
	engine->record.image_words = atomic_load_explicit(&image->count, memory_order_relaxed);
	memcpy(place, &engine->record, sizeof engine->record);
	place += sizeof engine->record;
	memcpy(place, image->words, image->capacity * sizeof image->words[0]);
	place += image_size(image->capacity);
	memcpy(place, engine->input_values, engine->input_count * sizeof(double));
	place += engine->input_count * sizeof(double);
	memcpy(place, engine->output_values, engine->output_count * sizeof(double));
	hm2_record_ring_commit(image->ring);
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
	if (engine->image.ring)
		push_record(engine);
}

void engine_clear_trace(struct hm2_engine *engine)
{
	struct engine_trace *trace = &engine->trace;
	const uint64_t none = 0;
	for (int i = 0; i <= HM2_STAGES; i++)
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

void hm2_engine_set_record_ring(struct hm2_engine *engine, struct hm2_record_ring *ring, uint32_t image_words)
{
	engine->image.ring = ring;
	engine->image.capacity = image_words < HM2_RECORD_WORDS ? image_words : HM2_RECORD_WORDS;
}

size_t hm2_engine_layout(const struct hm2_engine *engine, uint32_t *addresses, size_t capacity)
{
	const size_t count = atomic_load_explicit(&engine->image.count, memory_order_acquire);
	memcpy(addresses, engine->image.address, (count < capacity ? count : capacity) * sizeof *addresses);
	return count;
}

void hm2_engine_get_histogram(const struct hm2_engine *engine, int stage, hm2_histogram *histogram)
{
	if (stage >= 0 && stage <= HM2_STAGES)
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
