/* The clock of every bus that works in real time. */
#include "clock.h"

#include <errno.h>
#include <time.h>

#define NS_PER_S 1000000000LL
#define SLACK_NS 60000LL /* a sleep overshoots by the kernel's timer slack, 50 us unless changed */

int64_t hm2_clock_now_ns(void)
{
	struct timespec now;
	clock_gettime(CLOCK_MONOTONIC, &now);
	return (int64_t)now.tv_sec * NS_PER_S + now.tv_nsec;
}

void hm2_clock_pause_ns(int64_t ns)
{
	if (ns <= 0)
		return;
	const int64_t end = hm2_clock_now_ns() + ns;
	const int64_t wake = end - SLACK_NS;
	const struct timespec until = {.tv_sec = (time_t)(wake / NS_PER_S), .tv_nsec = (long)(wake % NS_PER_S)};
	/* absolute, so that a signal does not lengthen the pause */
	while (ns > SLACK_NS && clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR)
		;
	while (hm2_clock_now_ns() < end)
		;
}
