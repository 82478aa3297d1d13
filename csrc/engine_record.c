/* The record of each cycle: raw words into the image as exchanges come back, all of it into the ring at the end. */
#include "engine.h"

#include <string.h>

#define CACHE_LINE 64

void engine_record_new(struct engine_image *image)
{
	memset(image->slots, 0xFF, sizeof image->slots);
}

/* The image's word for a register, a new one if there is room; if not, each register is counted once. */
static uint16_t slot_of(struct engine_image *image, uint32_t address, int write)
{
	uint16_t *slot = &image->slots[write][address / 4];
	const uint32_t count = atomic_load_explicit(&image->count, memory_order_relaxed);
	if (*slot == IMAGE_NONE && count == image->capacity) {
		*slot = IMAGE_LEFT_OUT;
		atomic_fetch_add_explicit(&image->left_out, 1, memory_order_relaxed);
	} else if (*slot == IMAGE_NONE) {
		image->address[count] = address | (uint32_t)write;
		*slot = (uint16_t)count;
		atomic_store_explicit(&image->count, count + 1, memory_order_release);
	}
	return *slot;
}

/* Neighbours move together. Words that are read over and over may be more than there are moves: not fresh, then. */
static void add_move(struct engine_plan *plan, const uint32_t *from, uint16_t slot)
{
	struct engine_move *last = plan->moves ? &plan->move[plan->moves - 1] : NULL;
	if (last && last->from + last->count == from && last->slot + last->count == slot)
		last->count++;
	else if (plan->moves < HM2_RECORD_WORDS)
		plan->move[plan->moves++] = (struct engine_move){from, slot, 1};
	else
		return;
	plan->fresh[slot / 32] |= 1u << slot % 32;
}

static void plan_transfer(struct engine_image *image, struct engine_plan *plan, const hm2_transfer *transfer)
{
	const int write = (transfer->flags & HM2_TRANSFER_WRITE) != 0;
	const int same = (transfer->flags & HM2_TRANSFER_SAME_ADDRESS) != 0; /* the last word stays */
	for (uint32_t k = same ? transfer->count - 1u : 0; k < transfer->count; k++) { /* never of no words: see board.c */
		const uint16_t slot = slot_of(image, transfer->address + (same ? 0 : 4 * k), write);
		if (slot != IMAGE_LEFT_OUT)
			add_move(plan, &transfer->words[k], slot);
	}
}

/* While the answer to an exchange is on its way. A cycle's exchanges are like the last one's, so where words go is looked
 * up only when they are not. */
void engine_plan_capture(struct hm2_engine *engine, int reads)
{
	struct engine_image *image = &engine->image;
	struct engine_plan *plan = &image->plans[reads != 0];
	const struct hm2_cycle *cycle = engine->cycle;
	const size_t size = cycle->transfers * sizeof plan->transfer[0];
	if (!image->ring ||
	    (plan->transfers == cycle->transfers && !memcmp(plan->transfer, cycle->transfer, size)))
		return;
	memset(plan->fresh, 0, sizeof plan->fresh);
	memcpy(plan->transfer, cycle->transfer, size);
	plan->transfers = cycle->transfers;
	plan->moves = 0;
	for (size_t i = 0; i < plan->transfers; i++)
		plan_transfer(image, plan, &plan->transfer[i]);
}

/* When it is there, before its words are taken in. */
void engine_capture(struct hm2_engine *engine, int reads)
{
	struct engine_image *image = &engine->image;
	const struct engine_plan *plan = &image->plans[reads != 0];
	if (!image->ring)
		return;
	for (size_t i = 0; i < plan->moves; i++) {
		const struct engine_move move = plan->move[i];
		for (uint32_t k = 0; k < move.count; k++)
			image->words[move.slot + k] = move.from[k];
	}
	for (size_t k = 0; k < sizeof plan->fresh / sizeof plan->fresh[0]; k++)
		engine->record.fresh[k] |= plan->fresh[k];
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

/* Words behind those in use stay the zeros that the ring began with. */
void engine_push_record(struct hm2_engine *engine)
{
	struct engine_image *image = &engine->image;
	if (!image->ring)
		return;
	uint8_t *at = hm2_record_ring_reserve(image->ring);
	if (!at)
		return;
	engine->record.image_words = atomic_load_explicit(&image->count, memory_order_relaxed);
	memcpy(at, &engine->record, sizeof engine->record);
	at += sizeof engine->record;
	memcpy(at, image->words, engine->record.image_words * sizeof image->words[0]);
	at += image_size(image->capacity);
	memcpy(at, engine->input_values, engine->input_count * sizeof(double));
	at += engine->input_count * sizeof(double);
	memcpy(at, engine->output_values, engine->output_count * sizeof(double));
	hm2_record_ring_commit(image->ring);
}

static void warm(const void *memory, size_t size)
{
	for (size_t at = 0; at < size; at += CACHE_LINE)
		__builtin_prefetch((const uint8_t *)memory + at, 1);
}

/* While waiting awake. The next record's memory was last at the reader's processor, the rest was used a period ago:
 * fetching all that takes longer than filling it. */
void engine_warm_record(const struct hm2_engine *engine)
{
	const struct engine_image *image = &engine->image;
	if (!image->ring)
		return;
	warm(hm2_record_ring_next(image->ring), hm2_engine_record_size(engine, image->capacity));
	warm(image->words, atomic_load_explicit(&image->count, memory_order_relaxed) * sizeof image->words[0]);
	for (size_t i = 0; i < 2; i++) {
		const struct engine_plan *plan = &image->plans[i];
		warm(plan->transfer, plan->transfers * sizeof plan->transfer[0]);
		warm(plan->move, plan->moves * sizeof plan->move[0]);
		warm(plan->fresh, sizeof plan->fresh);
	}
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

uint32_t hm2_engine_left_out(const struct hm2_engine *engine)
{
	return atomic_load_explicit(&engine->image.left_out, memory_order_relaxed);
}
