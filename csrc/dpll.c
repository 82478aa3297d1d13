/* The DPLL's part of a cycle: its reference, and at the start the phase set instead of followed. */
#include "hm2.h"

static size_t dpll_reads(void *self, hm2_transfer *transfers, size_t capacity)
{
	hm2_dpll *dpll = self;
	if (capacity) {
		const hm2_transfer sync = {dpll->sync_address, 1, HM2_TRANSFER_READ, &dpll->sync};
		transfers[0] = sync;
	}
	return 1;
}

static size_t dpll_writes(void *self, hm2_transfer *transfers, size_t capacity)
{
	hm2_dpll *dpll = self;
	if (!dpll->settling)
		return 0;
	const int last = dpll->settling == 1;
	if (capacity) {
		const hm2_transfer phase = {dpll->phase_address, 1, HM2_TRANSFER_WRITE, &dpll->phase};
		const hm2_transfer clear = {dpll->control0_address, 1, HM2_TRANSFER_WRITE, &dpll->control0};
		transfers[0] = last ? clear : phase;
	}
	dpll->written = 1;
	return 1;
}

/* Only what came back counts: the last of these writes clears the error filtered meanwhile. */
static void dpll_process(void *self, int64_t now_ns)
{
	hm2_dpll *dpll = self;
	(void)now_ns;
	if (dpll->settling && dpll->written)
		dpll->settling--;
	dpll->written = 0;
}

void hm2_dpll_part(hm2_dpll *dpll, hm2_cyclic *part)
{
	part->self = dpll;
	part->reads = dpll_reads;
	part->writes = dpll_writes;
	part->process = dpll_process;
}
