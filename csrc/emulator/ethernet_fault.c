/* Loss, duplication, delay and reordering of datagrams, from a seeded generator. */
#include "ethernet_fault.h"

#include <string.h>

#define HOLD_US 50000 /* how long a reordered datagram waits for one to pass it */

void fault_seed(struct fault_line *line, uint64_t seed)
{
	line->state = seed;
}

void fault_init(struct fault_line *line, uint64_t seed)
{
	memset(line, 0, sizeof *line);
	for (int i = 0; i < FAULT_WAITING; i++)
		line->entries[i].due_us = INT64_MAX;
	fault_seed(line, seed);
}

/* splitmix64: any seed will do, zero too */
static uint64_t draw(struct fault_line *line)
{
	uint64_t z = line->state += 0x9E3779B97F4A7C15u;

	z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9u;
	z = (z ^ z >> 27) * 0x94D049BB133111EBu;
	return z ^ z >> 31;
}

static int chance(struct fault_line *line, uint32_t ppm)
{
	return draw(line) % 1000000 < ppm;
}

int fault_active(const struct fault_line *line)
{
	const hm2_ethernet_fault *fault = &line->fault;

	return line->waiting || fault->loss_ppm || fault->duplicate_ppm || fault->reorder_ppm || fault->delay_us ||
	       fault->jitter_us;
}

static void enqueue(struct fault_line *line, const fault_datagram *datagram, int64_t due_us, int held)
{
	for (int i = 0; i < FAULT_WAITING; i++) {
		struct fault_entry *entry = &line->entries[i];

		if (entry->due_us != INT64_MAX)
			continue;
		entry->due_us = due_us;
		entry->order = line->order++;
		entry->held = held;
		entry->datagram.peer = datagram->peer;
		entry->datagram.length = datagram->length;
		memcpy(entry->datagram.bytes, datagram->bytes, datagram->length);
		line->waiting++;
		line->held += held;
		return;
	}
	line->overflows++;
}

static int64_t delay(struct fault_line *line)
{
	const uint32_t jitter = line->fault.jitter_us;

	return line->fault.delay_us + (jitter ? (int64_t)(draw(line) % ((uint64_t)jitter + 1)) : 0);
}

void fault_put(struct fault_line *line, const fault_datagram *datagram, int64_t now_us)
{
	const hm2_ethernet_fault *fault = &line->fault;
	const int lost = chance(line, fault->loss_ppm);
	const int twice = chance(line, fault->duplicate_ppm);
	const int late = chance(line, fault->reorder_ppm);

	if (lost) {
		line->lost++;
		return;
	}
	if (late)
		line->reordered++;
	enqueue(line, datagram, now_us + (late ? HOLD_US : 0) + delay(line), late);
	if (twice) {
		line->duplicated++;
		enqueue(line, datagram, now_us + delay(line), 0);
	}
}

static int oldest(const struct fault_line *line)
{
	int best = -1;

	for (int i = 0; i < FAULT_WAITING; i++) {
		const struct fault_entry *entry = &line->entries[i];
		const struct fault_entry *other = best < 0 ? NULL : &line->entries[best];

		if (entry->due_us == INT64_MAX)
			continue;
		if (!other || entry->due_us < other->due_us ||
		    (entry->due_us == other->due_us && entry->order < other->order))
			best = i;
	}
	return best;
}

int64_t fault_due_us(const struct fault_line *line)
{
	const int next = line->waiting ? oldest(line) : -1;

	return next < 0 ? INT64_MAX : line->entries[next].due_us;
}

static void release_held(struct fault_line *line, int64_t now_us)
{
	for (int i = 0; i < FAULT_WAITING && line->held; i++) {
		struct fault_entry *entry = &line->entries[i];

		if (entry->due_us == INT64_MAX || !entry->held)
			continue;
		entry->due_us = now_us;
		entry->held = 0;
		line->held--;
	}
}

int fault_take(struct fault_line *line, int64_t now_us, fault_datagram *datagram)
{
	const int next = line->waiting ? oldest(line) : -1;
	struct fault_entry *entry;

	if (next < 0 || line->entries[next].due_us > now_us)
		return 0;
	entry = &line->entries[next];
	datagram->peer = entry->datagram.peer;
	datagram->length = entry->datagram.length;
	memcpy(datagram->bytes, entry->datagram.bytes, entry->datagram.length);
	entry->due_us = INT64_MAX;
	line->waiting--;
	line->held -= entry->held;
	release_held(line, now_us);
	return 1;
}
