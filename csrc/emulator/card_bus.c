/* The emulated card as a transport of the driver. */
#include "card.h"

static int bus_begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	CARD_HOLD(self);
	card_touch(self);
	for (size_t i = 0; i < count; i++) {
		const hm2_transfer *t = &transfers[i];
		int same = (t->flags & HM2_TRANSFER_SAME_ADDRESS) != 0;
		size_t times = same ? t->count : 1;
		size_t words = same ? 1 : t->count;
		for (size_t k = 0; k < times; k++) {
			int status = t->flags & HM2_TRANSFER_WRITE
			                     ? card_write_words(self, t->address, t->words + k, words, error)
			                     : card_read_words(self, t->address, t->words + k, words, error);
			if (status != HM2_OK)
				return status;
		}
	}
	return HM2_OK;
}

static int bus_finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	(void)self;
	(void)deadline_ns;
	(void)error;
	return HM2_OK;
}

static int64_t bus_now_ns(void *self)
{
	return card_time_ps(self) / 1000;
}

static void bus_pause_ns(void *self, int64_t ns)
{
	struct hm2_emulator *card = self;
	if (ns <= 0)
		return;
	if (card->options.clock == HM2_CLOCK_REAL)
		card_sleep_ns(ns);
	else
		hm2_emulator_advance_ps(card, ns * 1000);
}

static void bus_close(void *self)
{
	(void)self; /* the card belongs to whoever made it */
}

int hm2_emulator_bus(hm2_emulator *card, hm2_bus *out)
{
	out->self = card;
	out->begin = bus_begin;
	out->finish = bus_finish;
	out->now_ns = bus_now_ns;
	out->pause_ns = bus_pause_ns;
	out->close = bus_close;
	out->disturbances = NULL;
	return HM2_OK;
}
