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

static void card_read(void *self, uint32_t address, uint32_t *words, size_t count)
{
	hm2_error error;

	/* addresses are aligned and in range; a strict card's undecoded word reads as on any other card */
	card_read_words(self, address, words, count, &error);
}

static void card_write(void *self, uint32_t address, const uint32_t *words, size_t count)
{
	hm2_error error;

	card_write_words(self, address, words, count, &error);
}

static void card_pause_us(void *self, int64_t us)
{
	hm2_bus bus;

	hm2_emulator_bus(self, &bus);
	bus.pause_ns(bus.self, us * 1000);
	card_touch(self);
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

static void write_all(struct hm2_emulator *card, const struct card_module *module, uint32_t reg, uint32_t value)
{
	const struct card_descriptor *descriptor = &module->descriptor;

	for (uint32_t i = 0; i < descriptor->instances; i++)
		hm2_emulator_write(card, descriptor->base + 0x100 * reg + i * descriptor->instance_stride, &value, 1,
		                   &(hm2_error){0});
}

/* A newly configured FPGA: all that reaches the machine is off. Pins float, no function is connected to them,
 * the smart-serial links are stopped and the watchdog does not run. Registers that reach nothing without their
 * pins keep their values: no client can rely on them. */
static void card_reload(void *self)
{
	struct hm2_emulator *card = self;

	for (int i = 0; i < card->module_count; i++) {
		const struct card_module *module = &card->modules[i];

		if (module->descriptor.gtag == HM2_GTAG_IOPORT) {
			for (uint32_t reg = HM2_IOPORT_DDR; reg <= HM2_IOPORT_OUTPUT_INVERT; reg++)
				write_all(card, module, reg, 0);
			write_all(card, module, HM2_IOPORT_DATA, 0);
		} else if (module->descriptor.gtag == HM2_GTAG_SSERIAL || module->descriptor.gtag == HM2_GTAG_SSERIAL_B) {
			write_all(card, module, HM2_SSERIAL_COMMAND, HM2_SSLBP_COMMAND_STOP);
		} else if (module->descriptor.gtag == HM2_GTAG_WATCHDOG) {
			write_all(card, module, HM2_WATCHDOG_TIMER, HM2_WATCHDOG_TIMER_STOPPED_MASK);
			write_all(card, module, HM2_WATCHDOG_STATUS, 0);
		}
	}
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
	};
}
