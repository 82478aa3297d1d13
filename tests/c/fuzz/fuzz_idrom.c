/* Any words as a card: what is accepted is bounded, inside the register file, and inside the buffers asked for. */
#include <stdlib.h>
#include <string.h>

#include "hm2.h"

#define SPACE_WORDS (HM2_ADDRESS_SPACE / 4)

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length);

static void require(int condition)
{
	if (!condition)
		abort();
}

/* A copy of exactly these words, so that the sanitizer sees one word too many. */
static uint32_t *words_at(const uint32_t *space, uint32_t address, size_t count)
{
	uint32_t *copy = malloc(count * sizeof *copy);
	require(copy != NULL && address % 4 == 0 && address / 4 + count <= SPACE_WORDS);
	memcpy(copy, space + address / 4, count * sizeof *copy);
	return copy;
}

static int parse_header(const uint32_t *space, int known, hm2_idrom *idrom, hm2_error *error)
{
	uint32_t *id = words_at(space, HM2_ID_ADDRESS, HM2_ID_WORDS);
	int status = hm2_idrom_parse_id(id, idrom, error);
	free(id);
	if (status != HM2_OK)
		return status;
	uint32_t *header = words_at(space, idrom->offset, HM2_IDROM_HEADER_WORDS);
	status = hm2_idrom_parse_header(header, known ? 17 : HM2_IDROM_NONE, known ? 2 : HM2_IDROM_NONE, idrom, error);
	free(header);
	return status;
}

static hm2_pin_descriptor *parse_pins(const uint32_t *space, const hm2_idrom *idrom, hm2_error *error)
{
	if (hm2_idrom_check_pin_offset(idrom, error) != HM2_OK)
		return NULL;
	require(idrom->io_width >= 1 && idrom->io_width <= HM2_IDROM_PINS_MAX);
	uint32_t *words = words_at(space, idrom->offset + idrom->pin_offset, idrom->io_width);
	hm2_pin_descriptor *pins = malloc(idrom->io_width * sizeof *pins);
	require(pins != NULL);
	const int status = hm2_idrom_parse_pins(idrom, words, idrom->io_width, pins, idrom->io_width, error);
	free(words);
	if (status == HM2_OK)
		return pins;
	free(pins);
	return NULL;
}

static hm2_module_descriptor *parse_modules(const uint32_t *space, const hm2_idrom *idrom, size_t *count,
                                            hm2_error *error)
{
	size_t size = 0;
	if (hm2_idrom_check_module_offset(idrom, &size, error) != HM2_OK)
		return NULL;
	uint32_t *words = words_at(space, idrom->offset + idrom->module_offset, size);
	hm2_module_descriptor *modules = malloc(HM2_IDROM_MODULES_MAX * sizeof *modules);
	require(modules != NULL);
	const int status = hm2_idrom_parse_modules(idrom, words, size, modules, HM2_IDROM_MODULES_MAX, count, error);
	free(words);
	if (status == HM2_OK)
		return modules;
	free(modules);
	return NULL;
}

static void check(const hm2_idrom *idrom, const hm2_module_descriptor *modules, size_t count,
                  const hm2_pin_descriptor *pins, hm2_error *error)
{
	size_t first = 0;
	for (size_t i = 0; i < count; i++) {
		require(modules[i].gtag != 0 && modules[i].clock >= 1000000);
		require(modules[i].registers == 0 || modules[i].base % 4 == 0);
		hm2_idrom_check_form(modules, i, error);
	}
	hm2_idrom_check_modules(idrom, modules, count, error);
	while (hm2_idrom_check_pins(idrom, modules, count, pins, idrom->io_width, first, error) != HM2_OK) {
		require(error->index >= (int32_t)first && (size_t)error->index < idrom->io_width);
		first = (size_t)error->index + 1;
	}
}

/* The first four words are the ID block, the rest lies where the ID block says, one byte chooses the board. */
int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
	static uint32_t space[SPACE_WORDS];
	hm2_idrom idrom;
	hm2_error error;
	size_t count = 0;
	if (length < 17)
		return 0;
	memset(space, 0, sizeof space);
	memcpy(space + HM2_ID_ADDRESS / 4, bytes, 16);
	const uint32_t offset = space[HM2_ID_ADDRESS / 4 + 3] & 0xFFFC;
	const size_t room = HM2_ADDRESS_SPACE - offset;
	memcpy((uint8_t *)space + offset, bytes + 16, length - 17 < room ? length - 17 : room);
	if (parse_header(space, bytes[length - 1] & 1, &idrom, &error) != HM2_OK)
		return 0;
	hm2_pin_descriptor *pins = parse_pins(space, &idrom, &error);
	hm2_module_descriptor *modules = pins ? parse_modules(space, &idrom, &count, &error) : NULL;
	if (modules)
		check(&idrom, modules, count, pins, &error);
	free(modules);
	free(pins);
	return 0;
}
