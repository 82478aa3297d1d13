/* An independent witness of the machine: wakes up often, above every other real-time thread, on one processor, and
 * prints each time it was held up: when it should have run and when it did, in ns of CLOCK_MONOTONIC.
 *
 *     witness PROCESSOR
 *
 * It ends with SIGTERM. It knows nothing of cards, networks or LinuxCNC. */
#include <sched.h>
#include <signal.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <time.h>

#define PERIOD_NS 200000
#define STALL_NS 100000
#define PRIORITY 90
#define KEPT 500000 /* of STALL_NS each: 50 s of nothing but stalls */

static volatile sig_atomic_t stopping;
static int64_t stalls[KEPT][2]; /* printed at the end: a pipe that nobody reads yet takes but so many */

static void stop(int number)
{
	(void)number;
	stopping = 1;
}

static int64_t now_ns(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

static int become_real_time(int processor)
{
	const struct sched_param parameter = {.sched_priority = PRIORITY};
	cpu_set_t set;

	CPU_ZERO(&set);
	CPU_SET((size_t)processor, &set);
	return sched_setaffinity(0, sizeof set, &set) == 0 && sched_setscheduler(0, SCHED_FIFO, &parameter) == 0 &&
	       mlockall(MCL_CURRENT | MCL_FUTURE) == 0;
}

int main(int count, char **arguments)
{
	size_t kept = 0;
	int64_t due;

	if (count != 2 || !become_real_time(atoi(arguments[1]))) {
		perror("witness");
		return 1;
	}
	signal(SIGTERM, stop);
	puts("ready");
	fflush(stdout);
	for (due = now_ns() + PERIOD_NS; !stopping; due += PERIOD_NS) {
		const struct timespec time = {.tv_sec = due / 1000000000, .tv_nsec = due % 1000000000};
		int64_t now;

		clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, NULL);
		now = now_ns();
		if (now - due < STALL_NS)
			continue;
		if (kept < KEPT) {
			stalls[kept][0] = due;
			stalls[kept++][1] = now;
		}
		due = now;
	}
	for (size_t i = 0; i < kept; i++)
		printf("%lld %lld\n", (long long)stalls[i][0], (long long)stalls[i][1]);
	return 0;
}
