/* An emulated card behind shared memory, for a driver that maps a file as it would a PCI BAR.
 *
 * Loads and stores of another process cannot be intercepted, so this looks: a word that is not what was
 * shown last has been written by the driver. */
#include "card.h"

#include <endian.h>
#include <stdatomic.h>

#define SPACE_BYTES 0x10000u

static _Atomic uint32_t *word_at(void *shared, uint32_t address)
{
	return (_Atomic uint32_t *)shared + address / 4;
}

/* Whether any word was written. Backwards, because a driver writes a command after its data: whoever sees
 * the command then finds the data there, too. */
static int look(void *shared, const hm2_mirror_word *words, size_t count, uint32_t *seen)
{
	int written = 0;
	for (size_t i = count; i-- > 0;) {
		seen[i] = le32toh(atomic_load(word_at(shared, words[i].address)));
		written |= seen[i] != words[i].shown;
	}
	return written;
}

static int take(hm2_emulator *card, hm2_mirror_word *words, size_t count, const uint32_t *seen, hm2_error *error)
{
	for (size_t i = 0; i < count; i++) {
		if (seen[i] == words[i].shown)
			continue;
		words[i].shown = seen[i];
		const int status = hm2_emulator_write(card, words[i].address, &seen[i], 1, error);
		if (status != HM2_OK)
			return status;
	}
	return HM2_OK;
}

/* A word the driver has written meanwhile is left alone: the next look finds it. */
static int show(hm2_emulator *card, void *shared, hm2_mirror_word *words, size_t count, hm2_error *error)
{
	for (size_t i = 0; i < count; i++) {
		uint32_t value = HM2_EMULATOR_UNDRIVEN;
		if (words[i].readable) {
			const int status = hm2_emulator_read(card, words[i].address, &value, 1, error);
			if (status != HM2_OK)
				return status;
		}
		uint32_t expected = htole32(words[i].shown);
		if (value != words[i].shown &&
		    atomic_compare_exchange_strong(word_at(shared, words[i].address), &expected, htole32(value)))
			words[i].shown = value;
	}
	return HM2_OK;
}

int hm2_emulator_mirror(hm2_emulator *card, void *shared, hm2_mirror_word *words, uint32_t *seen, size_t count,
                        hm2_error *error)
{
	for (size_t i = 0; i < count; i++)
		if (words[i].address % 4 || words[i].address >= SPACE_BYTES)
			return HM2_ERR_RANGE;
	if (look(shared, words, count, seen)) {
		const int status = take(card, words, count, seen, error);
		if (status != HM2_OK)
			return status;
	}
	return show(card, shared, words, count, error);
}
