/* Which fault happens at which step. */
#ifndef HM2_EMULATOR_FAULT_H
#define HM2_EMULATOR_FAULT_H

#include "hm2.h"

struct fault_plan {
	const hm2_fault *faults; /* borrowed */
	size_t count;
	uint64_t steps; /* taken so far */
	uint64_t fired; /* steps at which a fault was due */
};

/* Takes a step. The fault that is due, its `act` called and its signal raised; NULL: none. */
const hm2_fault *fault_step(struct fault_plan *plan);
void fault_plan_set(struct fault_plan *plan, const hm2_fault *faults, size_t count);

#endif
