/* The card's time: picoseconds, and rising edges of ClockLow that lie in the middle of a period, so
 * that stimulus at whole periods never falls on an edge. */
#include <time.h>

#include "card_modules.h"

int64_t card_edge_ps(const struct hm2_emulator *card, int64_t clock)
{
	return clock * card->period_ps - card->period_ps / 2;
}

int64_t card_clock_at(const struct hm2_emulator *card, int64_t ps)
{
	return (ps + card->period_ps / 2) / card->period_ps;
}

static void advance_modules(struct hm2_emulator *card, int64_t clock)
{
	for (int i = 0; i < card->module_count; i++)
		if (card->modules[i].type->advance)
			card->modules[i].type->advance(card->modules[i].self, clock);
}

static struct card_module *next_event(struct hm2_emulator *card, int64_t *clock)
{
	struct card_module *first = NULL;
	*clock = CARD_NEVER;
	for (int i = 0; i < card->module_count; i++) {
		struct card_module *module = &card->modules[i];
		int64_t at = module->type->next_event ? module->type->next_event(module->self) : CARD_NEVER;
		if (at < *clock) {
			*clock = at;
			first = module;
		}
	}
	return first;
}

void card_advance_to(struct hm2_emulator *card, int64_t ps)
{
	int64_t target = card_clock_at(card, ps);
	int64_t at;
	struct card_module *module;
	while ((module = next_event(card, &at)) != NULL && at <= target) {
		advance_modules(card, at);
		card->clock = at;
		card->now_ps = card_edge_ps(card, at);
		module->type->fire(module->self);
	}
	card->clock = target;
	card->now_ps = ps;
	card->epoch++;
}

static int64_t monotonic_ns(void)
{
	struct timespec now;
	clock_gettime(CLOCK_MONOTONIC, &now);
	return (int64_t)now.tv_sec * 1000000000 + now.tv_nsec;
}

pthread_mutex_t *card_lock(const struct hm2_emulator *card)
{
	pthread_mutex_t *lock = &((struct hm2_emulator *)(uintptr_t)card)->lock;
	pthread_mutex_lock(lock);
	return lock;
}

void card_unlock(pthread_mutex_t **lock)
{
	pthread_mutex_unlock(*lock);
}

static int64_t time_ps(struct hm2_emulator *card)
{
	if (card->options.clock != HM2_CLOCK_REAL)
		return card->now_ps;
	int64_t now = monotonic_ns();
	if (card->real_origin_ns == 0)
		card->real_origin_ns = now;
	int64_t ps = (now - card->real_origin_ns) * 1000;
	return ps > card->now_ps ? ps : card->now_ps;
}

int64_t card_time_ps(struct hm2_emulator *card)
{
	CARD_HOLD(card);
	return time_ps(card);
}

void card_touch(struct hm2_emulator *card)
{
	CARD_HOLD(card);
	int64_t ps = time_ps(card);
	card->epoch++;
	if (ps > card->now_ps)
		card_advance_to(card, ps);
}

/* A sleep overshoots by the kernel's timer slack, so the last part is waited for awake: a driver's pause
 * of a few microseconds on a real clock is one. */
void card_sleep_ns(int64_t ns)
{
	const int64_t slack = 60000;
	const int64_t end = monotonic_ns() + ns;
	struct timespec time = {.tv_sec = (ns - slack) / 1000000000, .tv_nsec = (ns - slack) % 1000000000};
	while (ns > slack && nanosleep(&time, &time) != 0)
		;
	while (monotonic_ns() < end)
		;
}

void card_settle(struct hm2_emulator *card)
{
	advance_modules(card, card->clock);
	card->settled_ps = card->now_ps;
}

void card_pins_changed(struct hm2_emulator *card)
{
	for (int i = 0; i < card->module_count; i++)
		if (card->modules[i].type->pins_changed)
			card->modules[i].type->pins_changed(card->modules[i].self);
}

int64_t hm2_emulator_now_ps(const hm2_emulator *card)
{
	CARD_HOLD(card);
	return card->now_ps;
}

int64_t hm2_emulator_clocks(const hm2_emulator *card)
{
	CARD_HOLD(card);
	return card->clock;
}

void hm2_emulator_advance_ps(hm2_emulator *card, int64_t ps)
{
	CARD_HOLD(card);
	if (ps > 0 && card->options.clock == HM2_CLOCK_VIRTUAL)
		card_advance_to(card, card->now_ps + ps);
	hm2_emulator_sync(card);
}

void hm2_emulator_advance_clocks(hm2_emulator *card, int64_t clocks)
{
	hm2_emulator_advance_ps(card, clocks * card->period_ps);
}

void hm2_emulator_sync(hm2_emulator *card)
{
	CARD_HOLD(card);
	card_touch(card);
	card_settle(card);
}
