/* Which fault happens at which step. */
#include "fault.h"

#include <signal.h>

static int is_due(const hm2_fault *fault, uint64_t step)
{
	if (step < fault->step)
		return 0;
	return fault->repeat < 0 || step - fault->step <= (uint64_t)fault->repeat;
}

const hm2_fault *fault_step(struct fault_plan *plan)
{
	const hm2_fault *due = NULL;

	plan->steps++;
	for (size_t i = 0; i < plan->count && !due; i++)
		if (is_due(&plan->faults[i], plan->steps))
			due = &plan->faults[i];
	if (!due)
		return NULL;
	plan->fired++;
	if (due->act)
		due->act(due->self);
	if (due->kind == HM2_FAULT_SIGNAL)
		raise((int)due->value);
	return due;
}

void fault_plan_set(struct fault_plan *plan, const hm2_fault *faults, size_t count)
{
	*plan = (struct fault_plan){.faults = faults, .count = count};
}
