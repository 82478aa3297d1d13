/* An emulated card behind the LBP16 engine. */
#include "ethernet.h"

static uint32_t card_read(void *self, uint32_t address)
{
	uint32_t word = 0;
	hm2_error error;

	/* addresses are aligned and in range; a strict card's undecoded word reads as on any other card */
	hm2_emulator_read(self, address, &word, 1, &error);
	return word;
}

static void card_write(void *self, uint32_t address, uint32_t value)
{
	hm2_error error;

	hm2_emulator_write(self, address, &value, 1, &error);
}

void hm2_ethernet_emulator(struct hm2_emulator *card, hm2_ethernet_card *out)
{
	*out = (hm2_ethernet_card){.self = card, .read = card_read, .write = card_write};
}
