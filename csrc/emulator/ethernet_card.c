/* An emulated card behind the LBP16 engine. */
#include "card_modules.h"
#include "dpll.h"
#include "ethernet.h"

/* A packet is one moment: nobody else comes between, and the clock is looked at once, when it begins. */
static void card_enter(void *self)
{
	card_lock(self);
	card_touch(self);
}

static void card_leave(void *self)
{
	pthread_mutex_unlock(&((struct hm2_emulator *)self)->lock);
}

/* Addresses are aligned and in range. A strict card stops at a word that nothing decodes; no packet does. */
static void card_read(void *self, uint32_t address, uint32_t *words, size_t count)
{
	hm2_error error;

	for (size_t i = 0; i < count; i = (error.address - address) / 4 + 1)
		if (card_read_words(self, address + 4 * (uint32_t)i, words + i, count - i, &error) == HM2_OK)
			return;
}

static void card_write(void *self, uint32_t address, const uint32_t *words, size_t count)
{
	hm2_error error;

	for (size_t i = 0; i < count; i = (error.address - address) / 4 + 1)
		if (card_write_words(self, address + 4 * (uint32_t)i, words + i, count - i, &error) == HM2_OK)
			return;
}

static void card_pause_us(void *self, int64_t us)
{
	hm2_bus bus;

	hm2_emulator_bus(self, &bus);
	bus.pause_ns(bus.self, us * 1000);
	card_touch(self);
}

static int64_t card_now_us(void *self)
{
	return hm2_emulator_now_ps(self) / 1000000;
}

/* A moment in which the card is held: whoever else wants it comes between two of them. */
static int64_t last_edge(struct hm2_emulator *card, int line, int64_t *now_ps)
{
	CARD_HOLD(card);
	hm2_emulator_sync(card);
	*now_ps = card->now_ps;
	return dpll_last_event(card, line, card->clock);
}

/* A real clock runs by itself; sleeping would miss the edge by more than the wait is good for. */
static int64_t card_wait_edge(void *self, int line, uint32_t timeout_us)
{
	struct hm2_emulator *card = self;
	int64_t start_ps, now_ps, waited_us = 0;
	const int64_t before = last_edge(card, line, &start_ps);

	while (waited_us < timeout_us) {
		if (card->options.clock == HM2_CLOCK_VIRTUAL)
			hm2_emulator_advance_ps(card, 1000000);
		if (last_edge(card, line, &now_ps) != before)
			return (now_ps - start_ps) / 1000000;
		waited_us = (now_ps - start_ps) / 1000000;
	}
	return -1;
}

static void card_reload(void *self)
{
	card_power_up(self);
}

void hm2_ethernet_emulator(struct hm2_emulator *card, hm2_ethernet_card *out)
{
	*out = (hm2_ethernet_card){
		.self = card,
		.read = card_read,
		.write = card_write,
		.enter = card_enter,
		.leave = card_leave,
		.reload = card_reload,
		.wait_edge = card_wait_edge,
		.pause_us = card_pause_us,
		.now_us = card->options.clock == HM2_CLOCK_VIRTUAL ? card_now_us : NULL,
	};
}
