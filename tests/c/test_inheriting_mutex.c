/* A real-time thread that waits for a card lends its priority to whoever holds the card: without, the holder would
 * stay behind every thread between the two. Ends with 77 where threads may not be real-time. */
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <time.h>

#include "check.h"
#include "clock.h"
#include "emulator/card.h"
#include "emulator/ethernet.h"
#include "hm2.h"

enum { SKIPPED = 77, BETWEEN = 10, WAITING = 20, PATIENCE_MS = 300 /* the system helps the starved out after a second */ };

static pthread_mutex_t *mutex;
static atomic_int held, crowded, taken, gave_up;

static void *hold(void *argument)
{
	(void)argument;
	pthread_mutex_lock(mutex);
	held = 1;
	while (!crowded)
		;
	pthread_mutex_unlock(mutex);
	return NULL;
}

/* On the holder's processor, above it, and never done before the lock has been taken. */
static void *crowd(void *argument)
{
	const int64_t start_ns = hm2_clock_now_ns();

	(void)argument;
	crowded = 1;
	while (!taken && !gave_up)
		gave_up = hm2_clock_now_ns() - start_ns > PATIENCE_MS * INT64_C(1000000);
	return NULL;
}

static pthread_t started(void *(*run)(void *), int policy, int priority)
{
	const struct sched_param parameter = {.sched_priority = priority};
	pthread_attr_t attributes;
	pthread_t thread;
	cpu_set_t allowed, first;

	sched_getaffinity(0, sizeof allowed, &allowed);
	CPU_ZERO(&first);
	for (size_t cpu = 0; CPU_COUNT(&first) == 0; cpu++) {
		if (CPU_ISSET(cpu, &allowed))
			CPU_SET(cpu, &first);
	}
	pthread_attr_init(&attributes);
	pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
	pthread_attr_setschedpolicy(&attributes, policy);
	pthread_attr_setschedparam(&attributes, &parameter);
	pthread_attr_setaffinity_np(&attributes, sizeof first, &first);
	CHECK_EQUAL(pthread_create(&thread, &attributes, run, NULL), 0);
	pthread_attr_destroy(&attributes);
	return thread;
}

static void until(const atomic_int *flag)
{
	const struct timespec moment = {.tv_nsec = 1000000};

	while (!*flag)
		nanosleep(&moment, NULL);
}

static void lends_priority(pthread_mutex_t *which)
{
	pthread_t holder, between;

	mutex = which;
	held = crowded = taken = gave_up = 0;
	holder = started(hold, SCHED_OTHER, 0);
	until(&held);
	between = started(crowd, SCHED_FIFO, BETWEEN);
	until(&crowded);
	pthread_mutex_lock(mutex);
	taken = 1;
	pthread_mutex_unlock(mutex);
	pthread_join(between, NULL);
	pthread_join(holder, NULL);
	CHECK(!gave_up);
}

static void test_a_card(void)
{
	uint32_t idrom[44] = {3, 64, 80, 0x4153454D, 0x54534554, 9, 24, 1, 24, 24, 33333333, 200000000, 4, 64, 256, 256,
	                      0x01010003, 0x00051000, 0x1F};
	const hm2_emulator_options options = {.clock = HM2_CLOCK_VIRTUAL};
	hm2_emulator *card;
	hm2_error error;

	for (int pin = 0; pin < 24; pin++)
		idrom[20 + pin] = (uint32_t)HM2_GTAG_IOPORT << 24;
	CHECK_EQUAL(hm2_emulator_new(idrom, sizeof idrom / sizeof *idrom, &options, &card, &error), HM2_OK);
	if (card)
		lends_priority(&card->lock);
	hm2_emulator_free(card);
}

static void test_an_ethernet_engine(void)
{
	const hm2_ethernet_config config = {.name = "7I92", .flash_id = 0x13, .lbp_version = 3, .firmware_version = 15};
	struct hm2_ethernet *ethernet = hm2_ethernet_new(&config, NULL);

	CHECK(ethernet != NULL);
	if (ethernet)
		lends_priority(&ethernet->mutex);
	hm2_ethernet_free(ethernet);
}

int main(void)
{
	const struct sched_param parameter = {.sched_priority = WAITING};

	if (sched_setscheduler(0, SCHED_FIFO, &parameter)) {
		perror("priority inheritance NOT SHOWN, no real-time thread");
		return SKIPPED;
	}
	test_a_card();
	test_an_ethernet_engine();
	return CHECK_RESULT();
}
