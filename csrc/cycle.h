/* What the cycle engine needs to know of a cycle. Private to csrc/cycle.c and csrc/engine*.c. */
#ifndef HM2_CYCLE_H
#define HM2_CYCLE_H

#include "hm2.h"

struct hm2_cycle {
	struct hm2_board *board;
	size_t parts;
	hm2_cyclic part[HM2_CYCLE_PARTS];
	size_t transfers;
	hm2_transfer transfer[HM2_CYCLE_TRANSFERS];
	hm2_cycle_counters counters;
	int processes; /* the outstanding exchange has reads to take in */
};

/* The steps of an exchange: begin, await its answer, take in what it read. */
int cycle_begin(struct hm2_cycle *cycle, int reads, int writes, hm2_error *error);
int cycle_await(struct hm2_cycle *cycle, int64_t deadline_ns, hm2_error *error);
void cycle_process(struct hm2_cycle *cycle);

#endif
