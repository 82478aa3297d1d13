/* One record per cycle from the cycle's thread to a writer: a ring of fixed slots that never makes anybody wait. */
#include "error.h"

#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#define CACHE_LINE 64
#define SLOTS_MAX (1u << 24)

/* The two sides write to cache lines of their own. Positions count records since the beginning; a slot is
 * position modulo slots. */
struct hm2_record_ring {
	uint32_t slots, record_size;
	uint8_t *memory;
	_Alignas(CACHE_LINE) _Atomic uint64_t pushed;
	uint64_t known_popped; /* the pusher's idea of popped: looked up only when the ring seems full */
	_Atomic uint64_t dropped;
	_Alignas(CACHE_LINE) _Atomic uint64_t popped;
};

static int refuse(hm2_error *error, uint32_t limit, uint32_t value)
{
	hm2_error_set(error, HM2_ERR_RANGE, "record ring");
	if (error) {
		error->expected = limit;
		error->received = value;
	}
	return HM2_ERR_RANGE;
}

int hm2_record_ring_new(uint32_t slots, uint32_t record_size, struct hm2_record_ring **ring, hm2_error *error)
{
	if (slots < 2 || slots > SLOTS_MAX || (slots & (slots - 1)))
		return refuse(error, SLOTS_MAX, slots);
	if (record_size < 8 || record_size % 8)
		return refuse(error, 8, record_size);
	const size_t size = (size_t)slots * record_size;
	const size_t whole = (sizeof(struct hm2_record_ring) + CACHE_LINE - 1) / CACHE_LINE * CACHE_LINE;
	struct hm2_record_ring *made = aligned_alloc(CACHE_LINE, whole);
	uint8_t *memory = aligned_alloc(CACHE_LINE, (size + CACHE_LINE - 1) / CACHE_LINE * CACHE_LINE);
	if (!made || !memory) {
		free(made);
		free(memory);
		return hm2_error_set(error, HM2_ERR_NO_MEMORY, "record ring");
	}
	memset(made, 0, sizeof *made);
	memset(memory, 0, size); /* not only for order: pages that are there cost the cycle nothing */
	made->slots = slots;
	made->record_size = record_size;
	made->memory = memory;
	*ring = made;
	return HM2_OK;
}

void hm2_record_ring_free(struct hm2_record_ring *ring)
{
	if (ring)
		free(ring->memory);
	free(ring);
}

static uint8_t *slot(const struct hm2_record_ring *ring, uint64_t position)
{
	return ring->memory + (size_t)(position & (ring->slots - 1)) * ring->record_size;
}

void *hm2_record_ring_reserve(struct hm2_record_ring *ring)
{
	const uint64_t position = atomic_load_explicit(&ring->pushed, memory_order_relaxed);
	if (position - ring->known_popped >= ring->slots)
		ring->known_popped = atomic_load_explicit(&ring->popped, memory_order_acquire);
	if (position - ring->known_popped >= ring->slots) {
		const uint64_t dropped = atomic_load_explicit(&ring->dropped, memory_order_relaxed);
		atomic_store_explicit(&ring->dropped, dropped + 1, memory_order_relaxed);
		return NULL;
	}
	return slot(ring, position);
}

const void *hm2_record_ring_next(const struct hm2_record_ring *ring)
{
	return slot(ring, atomic_load_explicit(&ring->pushed, memory_order_relaxed));
}

void hm2_record_ring_commit(struct hm2_record_ring *ring)
{
	const uint64_t position = atomic_load_explicit(&ring->pushed, memory_order_relaxed);
	atomic_store_explicit(&ring->pushed, position + 1, memory_order_release);
}

int hm2_record_ring_push(struct hm2_record_ring *ring, const void *record)
{
	void *place = hm2_record_ring_reserve(ring);
	if (!place)
		return 0;
	memcpy(place, record, ring->record_size);
	hm2_record_ring_commit(ring);
	return 1;
}

size_t hm2_record_ring_pop_many(struct hm2_record_ring *ring, void *buffer, size_t most)
{
	const uint64_t first = atomic_load_explicit(&ring->popped, memory_order_relaxed);
	const uint64_t end = atomic_load_explicit(&ring->pushed, memory_order_acquire);
	const size_t waiting = (size_t)(end - first);
	const size_t count = waiting < most ? waiting : most;
	const size_t from = (size_t)(first & (ring->slots - 1));
	const size_t straight = count < ring->slots - from ? count : ring->slots - from;
	memcpy(buffer, slot(ring, first), straight * ring->record_size);
	memcpy((uint8_t *)buffer + straight * ring->record_size, ring->memory, (count - straight) * ring->record_size);
	atomic_store_explicit(&ring->popped, first + count, memory_order_release);
	return count;
}

void hm2_record_ring_get_counters(const struct hm2_record_ring *ring, hm2_record_ring_counters *counters)
{
	counters->popped = atomic_load_explicit(&ring->popped, memory_order_acquire);
	counters->dropped = atomic_load_explicit(&ring->dropped, memory_order_relaxed);
	counters->pushed = atomic_load_explicit(&ring->pushed, memory_order_acquire);
	counters->slots = ring->slots;
	counters->record_size = ring->record_size;
}
