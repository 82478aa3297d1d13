/* Which operations a module of the card has, by its GTAG. */
#include "card_modules.h"

#define TYPE_ROW(gtag, type) {gtag, &type},
static const struct {
	uint8_t gtag;
	const struct card_module_type *type;
} types[] = {CARD_MODULE_TYPES(TYPE_ROW)};

const struct card_module_type *card_module_type(uint8_t gtag)
{
	for (size_t i = 0; i < sizeof types / sizeof *types; i++)
		if (types[i].gtag == gtag)
			return types[i].type;
	return NULL;
}
