/* Watchdog: a down counter whose passage through zero lets go of every pin (fact sheet registers.md
 * 2.2, card observed 3).
 *
 * The counter runs while its top bit is 0. Its top bit is looked at one clock late and compared with
 * that of the clock before; a 0 to 1 step is the bite: status is set with the comparison, the ports
 * are cleared one clock behind it. */
#include <stdlib.h>

#include "card_modules.h"

#define STOPPED HM2_WATCHDOG_TIMER_STOPPED_MASK
#define BITE_TO_RELEASE 1

struct watchdog {
	struct hm2_emulator *card;
	int64_t clock;
	uint32_t counter; /* after edge `clock` */
	uint32_t reload;
	uint32_t status;
	int64_t bite;    /* clock whose edge sets status, CARD_NEVER: none on its way */
	int64_t release; /* clock whose edge clears the ports */
	int64_t bitten;  /* the last clock that set status */
};

static void watchdog_power_up(void *self)
{
	struct watchdog *dog = self;
	dog->counter = STOPPED;
	dog->reload = 0;
	dog->status = 1; /* the top bit starts at 1, its copy at 0: the first clock counts as a bite */
	dog->bite = dog->release = CARD_NEVER;
	dog->bitten = -1;
}

static void *watchdog_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	(void)descriptor;
	struct watchdog *dog = calloc(1, sizeof *dog);
	if (dog == NULL)
		return NULL;
	dog->card = card;
	watchdog_power_up(dog);
	return dog;
}

static void watchdog_destroy(void *self)
{
	free(self);
}

static int running(const struct watchdog *dog)
{
	return !(dog->counter & STOPPED);
}

static void watchdog_advance(void *self, int64_t clock)
{
	struct watchdog *dog = self;
	if (clock <= dog->clock)
		return;
	if (running(dog))
		dog->counter = clock - dog->clock > dog->counter ? UINT32_MAX
		                                                  : dog->counter - (uint32_t)(clock - dog->clock);
	dog->clock = clock;
	if (clock >= dog->bite) {
		dog->status = 1;
		dog->bitten = dog->bite;
		dog->release = dog->bite + BITE_TO_RELEASE;
		dog->bite = CARD_NEVER;
	}
}

static int64_t watchdog_next_event(void *self)
{
	struct watchdog *dog = self;
	if (dog->release != CARD_NEVER)
		return dog->release;
	return dog->bite == CARD_NEVER ? CARD_NEVER : dog->bite + BITE_TO_RELEASE;
}

static void watchdog_fire(void *self)
{
	struct watchdog *dog = self;
	dog->release = CARD_NEVER;
	ioport_release(dog->card->ioport);
}

/* A new counter value at this edge. Up to the edge of its passage the counter was running. */
static void load(struct watchdog *dog, uint32_t value)
{
	int was_running = running(dog) || dog->bite == dog->clock + 1;
	dog->counter = value;
	if (running(dog))
		dog->bite = dog->clock + (int64_t)value + 2;
	else
		dog->bite = was_running ? dog->clock + 1 : CARD_NEVER;
}

static uint32_t watchdog_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct watchdog *dog = self;
	(void)offset;
	if (reg == HM2_WATCHDOG_RESET)
		return 0;
	*value = reg == HM2_WATCHDOG_TIMER ? dog->counter : dog->status;
	return CARD_ALL_DRIVEN;
}

static int watchdog_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct watchdog *dog = self;
	(void)offset;
	if (reg == HM2_WATCHDOG_TIMER) {
		dog->reload = value;
		load(dog, value);
	} else if (reg == HM2_WATCHDOG_RESET) {
		if (value >> 24 == HM2_WATCHDOG_KEY_RESET >> 24)
			load(dog, dog->reload);
	} else if (dog->bitten != dog->clock) { /* a bite in the same clock wins */
		dog->status = value & 1;
	}
	return 1;
}

const struct card_module_type watchdog_type = {
	.create = watchdog_create,
	.destroy = watchdog_destroy,
	.read = watchdog_read,
	.write = watchdog_write,
	.advance = watchdog_advance,
	.next_event = watchdog_next_event,
	.fire = watchdog_fire,
	.power_up = watchdog_power_up,
};
