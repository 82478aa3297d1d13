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

/* Backwards again: a command that is found done was done before its data are read. */
static int sample(hm2_emulator *card, const hm2_mirror_word *words, size_t count, uint32_t *values, hm2_error *error)
{
	for (size_t i = count; i-- > 0;) {
		values[i] = HM2_EMULATOR_UNDRIVEN;
		if (!words[i].readable)
			continue;
		const int status = hm2_emulator_read(card, words[i].address, &values[i], 1, error);
		if (status != HM2_OK)
			return status;
	}
	return HM2_OK;
}

/* Forwards: who sees a command done finds its data. A word the driver has written meanwhile is left alone,
 * the next look finds it. */
static void show(void *shared, hm2_mirror_word *words, size_t count, const uint32_t *values)
{
	for (size_t i = 0; i < count; i++) {
		uint32_t expected = htole32(words[i].shown);
		if (values[i] != words[i].shown &&
		    atomic_compare_exchange_strong(word_at(shared, words[i].address), &expected, htole32(values[i])))
			words[i].shown = values[i];
	}
}

int hm2_emulator_mirror(hm2_emulator *card, void *shared, hm2_mirror_word *words, uint32_t *seen, size_t count,
                        hm2_error *error)
{
	for (size_t i = 0; i < count; i++)
		if (words[i].address % 4 || words[i].address >= SPACE_BYTES)
			return HM2_ERR_RANGE;
	int status = HM2_OK;
	if (look(shared, words, count, seen))
		status = take(card, words, count, seen, error);
	if (status == HM2_OK)
		status = sample(card, words, count, seen, error);
	if (status == HM2_OK)
		show(shared, words, count, seen);
	return status;
}

int hm2_emulator_mirror_looks(hm2_emulator *card, void *shared, hm2_mirror_word *words, uint32_t *seen,
                              size_t count, int looks, int64_t pause_ns, hm2_error *error)
{
	for (int i = 0; i < looks; i++) {
		const int status = hm2_emulator_mirror(card, shared, words, seen, count, error);
		if (status != HM2_OK)
			return status;
		card_sleep_ns(pause_ns);
	}
	return HM2_OK;
}
