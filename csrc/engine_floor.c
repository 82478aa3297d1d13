/* The least that a periodic loop, an access and a record take on this machine, to measure the engine against. */
#include "clock.h"
#include "hm2.h"

#include <time.h>

void hm2_floor_wake(int64_t period_ns, int64_t early_ns, uint32_t cycles, hm2_histogram *lateness)
{
	int64_t due_ns = hm2_clock_now_ns() + period_ns;
	for (uint32_t i = 0; i < cycles; i++) {
		const int64_t wake_ns = due_ns - early_ns;
		const struct timespec until = {(time_t)(wake_ns / 1000000000), (long)(wake_ns % 1000000000)};
		clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
		int64_t now_ns = hm2_clock_now_ns();
		while (now_ns < due_ns)
			now_ns = hm2_clock_now_ns();
		hm2_histogram_record(lateness, now_ns - due_ns);
		for (due_ns += period_ns; due_ns <= now_ns; due_ns += period_ns)
			; /* periods that have passed are left out */
	}
}

int hm2_floor_exchanges(struct hm2_board *board, const hm2_transfer *transfers, size_t count, uint32_t exchanges,
                        uint64_t *ns, hm2_error *error)
{
	for (uint32_t i = 0; i < exchanges; i++) {
		const int64_t start_ns = hm2_clock_now_ns();
		const int status = hm2_exchange(board, transfers, count, error);
		if (status != HM2_OK)
			return status;
		ns[i] = (uint64_t)(hm2_clock_now_ns() - start_ns);
	}
	return HM2_OK;
}

uint64_t hm2_floor_pushes(struct hm2_record_ring *ring, const void *record, uint32_t pushes)
{
	const int64_t start_ns = hm2_clock_now_ns();
	for (uint32_t i = 0; i < pushes; i++)
		(void)hm2_record_ring_push(ring, record);
	return (uint64_t)(hm2_clock_now_ns() - start_ns);
}
