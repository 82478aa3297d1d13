/* What the cycle engine needs to know of a cycle. Private to csrc/cycle.c and csrc/engine*.c. */
#ifndef HM2_CYCLE_H
#define HM2_CYCLE_H

#include "hm2.h"

struct cycle_lister {
	void *self;
	size_t (*list)(void *self, hm2_transfer *transfers, size_t capacity);
};

struct hm2_cycle {
	struct hm2_board *board;
	size_t parts;
	size_t readers, writers, processors; /* those parts that do this */
	struct cycle_lister reader[HM2_CYCLE_PARTS], writer[HM2_CYCLE_PARTS];
	struct cycle_processor {
		void *self;
		void (*process)(void *self, int64_t now_ns);
	} processor[HM2_CYCLE_PARTS];
	size_t transfers;
	hm2_transfer transfer[HM2_CYCLE_TRANSFERS];
	hm2_cycle_counters counters;
	int processes; /* the outstanding exchange has reads to take in */
};

/* The steps of an exchange: begin, await its answer, take in what it read. */
int cycle_begin(struct hm2_cycle *cycle, int reads, int writes, hm2_error *error);
int cycle_await(struct hm2_cycle *cycle, int64_t deadline_ns, hm2_error *error);
void cycle_process(struct hm2_cycle *cycle);

/* What hm2_cyclic_words_part lists. */
size_t cyclic_words_list(void *self, hm2_transfer *transfers, size_t capacity);

#endif
