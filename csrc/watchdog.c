/* Watching the watchdog: reload it each cycle, and stop all writes when it has bitten. */
#include "hm2.h"
#include "registers.h"

static size_t watchdog_reads(void *self, hm2_transfer *transfers, size_t capacity)
{
	hm2_watchdog *watchdog = self;
	if (capacity) {
		const hm2_transfer status = {watchdog->status_address, 1, HM2_TRANSFER_READ, &watchdog->status};
		transfers[0] = status;
	}
	return 1;
}

static size_t watchdog_writes(void *self, hm2_transfer *transfers, size_t capacity)
{
	hm2_watchdog *watchdog = self;
	if (!watchdog->armed)
		return 0;
	if (capacity) {
		const hm2_transfer reload = {watchdog->reset_address, 1, HM2_TRANSFER_WRITE, &watchdog->reset};
		transfers[0] = reload;
	}
	return 1;
}

static void watchdog_process(void *self, int64_t now_ns)
{
	hm2_watchdog *watchdog = self;
	(void)now_ns;
	if (!(watchdog->status & HM2_WATCHDOG_STATUS_HAS_BITTEN_MASK) || !watchdog->armed)
		return;
	watchdog->has_bitten = 1;
	watchdog->armed = 0; /* a reload would start the counter again: a bite stays a bite */
	hm2_board_set_gate(watchdog->board, 1);
}

void hm2_watchdog_part(hm2_watchdog *watchdog, hm2_cyclic *part)
{
	watchdog->reset = HM2_WATCHDOG_KEY_RESET;
	part->self = watchdog;
	part->reads = watchdog_reads;
	part->writes = watchdog_writes;
	part->process = watchdog_process;
}
