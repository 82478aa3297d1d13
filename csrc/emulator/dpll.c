#include "card_modules.h"

int64_t dpll_last_event(struct hm2_emulator *card, int timer, int64_t clock)
{
	(void)card;
	(void)timer;
	(void)clock;
	return -1;
}
