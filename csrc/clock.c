/* The clock of every bus that works in real time. */
#include "clock.h"

#include <errno.h>
#include <time.h>

#define NS_PER_S 1000000000LL

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
	const struct timespec until = {.tv_sec = (time_t)(end / NS_PER_S), .tv_nsec = (long)(end % NS_PER_S)};
	/* absolute, so that a signal does not lengthen the pause */
	while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL) == EINTR)
		;
}
