/* The register file: which module answers at which address, and the pins as the outside sees them. */
#include "card.h"

#include <stdlib.h>
#include <string.h>

#include "card_modules.h"
#include "inheriting_mutex.h"

struct card_module *card_find(struct hm2_emulator *card, uint8_t gtag)
{
	for (int i = 0; i < card->module_count; i++)
		if (card->modules[i].descriptor.gtag == gtag)
			return &card->modules[i];
	return NULL;
}

/* Where the first module of a kind lies; -1: there is none. */
static int32_t base_of(const struct hm2_emulator *card, uint8_t gtag)
{
	uint32_t at = card_idrom_field(card, HM2_IDROM_MODULE_OFFSET) / 4;
	for (; at + 3 <= CARD_IDROM_WORDS && (card->idrom[at] & 0xFF) != 0; at += 3)
		if ((card->idrom[at] & 0xFF) == gtag)
			return (int32_t)(card->idrom[at + 1] & 0xFFFF);
	return -1;
}

int card_has(const struct hm2_emulator *card, uint8_t gtag)
{
	return base_of(card, gtag) >= 0;
}

/* The registers for it came with generation B, which is told by what it has moved (registers.md 0). */
int card_samples_by_timer(const struct hm2_emulator *card)
{
	static const struct {
		uint8_t gtag;
		int32_t base;
	} generation_a[] = {{HM2_GTAG_MUXED_ENCODER, 0x3500}, {HM2_GTAG_RESOLVER, 0x3A00}, {HM2_GTAG_PWMGEN, 0x4000},
	                    {HM2_GTAG_TP_PWM, 0x4500},        {HM2_GTAG_BSPI, 0x5400},     {HM2_GTAG_SSERIAL, 0x5A00},
	                    {HM2_GTAG_UART_TX, 0x6000},       {HM2_GTAG_SSI, 0x6800}};
	for (size_t i = 0; i < sizeof generation_a / sizeof *generation_a; i++)
		if (base_of(card, generation_a[i].gtag) == generation_a[i].base)
			return 0;
	return card_has(card, HM2_GTAG_DPLL);
}

static int fail(hm2_error *error, int status, uint32_t address, const char *where)
{
	if (!error)
		return status;
	memset(error, 0, sizeof *error);
	error->status = status;
	error->address = address;
	error->index = -1;
	strncpy(error->where, where, sizeof error->where - 1);
	return status;
}

static void read_descriptor(const struct hm2_emulator *card, const uint32_t *words, struct card_descriptor *out)
{
	out->gtag = (uint8_t)words[0];
	out->version = (uint8_t)(words[0] >> 8);
	out->clock_tag = (uint8_t)(words[0] >> 16);
	out->instances = (uint8_t)(words[0] >> 24);
	out->base = (uint16_t)words[1];
	out->registers = (uint8_t)(words[1] >> 16);
	out->instance_stride = card_idrom_field(
		card, words[1] >> 28 ? HM2_IDROM_INSTANCE_STRIDE_1 : HM2_IDROM_INSTANCE_STRIDE_0);
	out->multiple = words[2];
}

static void claim_page(struct hm2_emulator *card, int index, int reg)
{
	uint32_t page = (uint32_t)(card->modules[index].descriptor.base >> 8) + (uint32_t)reg;
	if (page > 0xFF || card->pages[page].module)
		return;
	card->pages[page].module = (uint8_t)(index + 1);
	card->pages[page].reg = (uint8_t)reg;
}

/* Optional registers lie behind those a descriptor counts, where no other module has its own. */
static void claim_pages(struct hm2_emulator *card)
{
	for (int i = 0; i < card->module_count; i++)
		for (int r = 0; r < card->modules[i].descriptor.registers; r++)
			claim_page(card, i, r);
	for (int i = 0; i < card->module_count; i++)
		for (int r = 0; r < card->modules[i].type->extra_registers; r++)
			claim_page(card, i, card->modules[i].descriptor.registers + r);
}

static int add_module(struct hm2_emulator *card, const uint32_t *words)
{
	struct card_descriptor descriptor;
	read_descriptor(card, words, &descriptor);
	const struct card_module_type *type = card_module_type(descriptor.gtag);
	if (type == NULL || card->module_count == CARD_MAX_MODULES)
		return HM2_OK;
	struct card_module *module = &card->modules[card->module_count];
	module->type = type;
	module->descriptor = descriptor;
	module->self = type->create(card, &descriptor);
	if (module->self == NULL)
		return HM2_ERR_NO_MEMORY;
	card->module_count++;
	return HM2_OK;
}

int card_add_part(struct hm2_emulator *card, const struct card_module_type *type, void *self)
{
	if (card->module_count == CARD_MAX_MODULES)
		return HM2_ERR_RANGE;
	struct card_module *module = &card->modules[card->module_count++];
	memset(&module->descriptor, 0, sizeof module->descriptor);
	module->type = type;
	module->self = self;
	return HM2_OK;
}

static int add_modules(struct hm2_emulator *card, hm2_error *error)
{
	/* as a descriptor would name them: one instance at 0x0900 with three registers */
	static const uint32_t interrupt[3] = {0x01010000 | HM2_GTAG_IRQ, 0x00030900, 0};
	uint32_t offset = card_idrom_field(card, HM2_IDROM_MODULE_OFFSET);
	for (uint32_t at = offset / 4; at + 3 <= CARD_IDROM_WORDS; at += 3) {
		if ((card->idrom[at] & 0xFF) == 0)
			break;
		int status = add_module(card, &card->idrom[at]);
		if (status != HM2_OK)
			return fail(error, status, 0x400 + 4 * at, "emulated module");
	}
	if (card->options.interrupt && card_find(card, HM2_GTAG_IRQ) == NULL && add_module(card, interrupt) != HM2_OK)
		return fail(error, HM2_ERR_NO_MEMORY, interrupt[1] & 0xFFFF, "emulated module");
	struct card_module *ioport = card_find(card, HM2_GTAG_IOPORT);
	if (ioport == NULL)
		return fail(error, HM2_ERR_FORMAT, 0x400 + offset, "no ioport module");
	card->ioport = ioport->self;
	claim_pages(card);
	return HM2_OK;
}

int hm2_emulator_new(const uint32_t *idrom, size_t words, const hm2_emulator_options *options,
                     hm2_emulator **out, hm2_error *error)
{
	hm2_emulator *card = calloc(1, sizeof *card);
	*out = NULL;
	if (card == NULL)
		return fail(error, HM2_ERR_NO_MEMORY, 0, "emulated card");
	inheriting_mutex_init(&card->lock);
	card->options = *options;
	card->mux_delay_ps = CARD_MUX_DELAY_PS;
	if (card->options.sserial_clock_hz == 0)
		card->options.sserial_clock_hz = 100000000;
	int status = card_identity_load(card, idrom, words, error);
	if (status == HM2_OK)
		status = add_modules(card, error);
	if (status != HM2_OK) {
		hm2_emulator_free(card);
		return status;
	}
	card_pins_changed(card);
	card_touch(card);
	*out = card;
	return HM2_OK;
}

void hm2_emulator_free(hm2_emulator *card)
{
	if (card == NULL)
		return;
	for (int i = 0; i < card->module_count; i++)
		card->modules[i].type->destroy(card->modules[i].self);
	pthread_mutex_destroy(&card->lock);
	free(card);
}

/* A module that has no such operation keeps its registers: what they are at a power-up no source says. */
void card_power_up(struct hm2_emulator *card)
{
	CARD_HOLD(card);
	hm2_emulator_sync(card);
	card_identity_power_up(card);
	for (int i = 0; i < card->module_count; i++)
		if (card->modules[i].type->power_up)
			card->modules[i].type->power_up(card->modules[i].self);
	card->epoch++;
	card_pins_changed(card);
}

static uint32_t read_word(struct hm2_emulator *card, uint32_t address, uint32_t *value)
{
	struct card_page page = card->pages[address >> 8];
	*value = 0;
	if (page.module == 0)
		return card_identity_read(card, address, value);
	struct card_module *module = &card->modules[page.module - 1];
	if (module->advanced != card->epoch && module->type->advance)
		module->type->advance(module->self, card->clock);
	module->advanced = card->epoch;
	return module->type->read(module->self, page.reg, address & 0xFC, value);
}

static int write_word(struct hm2_emulator *card, uint32_t address, uint32_t value)
{
	struct card_page page = card->pages[address >> 8];
	if (page.module == 0)
		return card_identity_write(card, address, value);
	struct card_module *module = &card->modules[page.module - 1];
	if (card->settled_ps != card->now_ps)
		card_settle(card); /* what the write changes others may have seen until now */
	else if (module->type->advance)
		module->type->advance(module->self, card->clock); /* after the last write to it */
	card->epoch++;
	return module->type->write(module->self, page.reg, address & 0xFC, value);
}

static int check_range(uint32_t address, size_t count, hm2_error *error)
{
	if (address % 4 != 0)
		return fail(error, HM2_ERR_ALIGN, address, "emulated card");
	if (address > 0xFFFC || count > (0x10000 - address) / 4)
		return fail(error, HM2_ERR_RANGE, address, "emulated card");
	return HM2_OK;
}

int card_read_words(struct hm2_emulator *card, uint32_t address, uint32_t *words, size_t count, hm2_error *error)
{
	int status = check_range(address, count, error);
	if (status != HM2_OK)
		return status;
	for (size_t i = 0; i < count; i++) {
		if (read_word(card, address + 4 * (uint32_t)i, &words[i]) != 0)
			continue;
		words[i] = HM2_EMULATOR_UNDRIVEN;
		if (card->options.strict)
			return fail(error, HM2_ERR_PROTOCOL, address + 4 * (uint32_t)i, "undecoded read");
	}
	return HM2_OK;
}

int card_write_words(struct hm2_emulator *card, uint32_t address, const uint32_t *words, size_t count,
                     hm2_error *error)
{
	int status = check_range(address, count, error);
	if (status != HM2_OK)
		return status;
	for (size_t i = 0; i < count; i++) {
		if (!write_word(card, address + 4 * (uint32_t)i, words[i]) && card->options.strict)
			return fail(error, HM2_ERR_PROTOCOL, address + 4 * (uint32_t)i, "undecoded write");
	}
	return HM2_OK;
}

int hm2_emulator_read(hm2_emulator *card, uint32_t address, uint32_t *words, size_t count, hm2_error *error)
{
	CARD_HOLD(card);
	card_touch(card);
	return card_read_words(card, address, words, count, error);
}

int hm2_emulator_write(hm2_emulator *card, uint32_t address, const uint32_t *words, size_t count,
                       hm2_error *error)
{
	CARD_HOLD(card);
	card_touch(card);
	return card_write_words(card, address, words, count, error);
}

/* A card has one kind of SSERIAL or the other. */
static const struct card_module *sserial_module(const hm2_emulator *card)
{
	for (int i = 0; i < card->module_count; i++) {
		uint8_t gtag = card->modules[i].descriptor.gtag;
		if (gtag == HM2_GTAG_SSERIAL || gtag == HM2_GTAG_SSERIAL_B)
			return &card->modules[i];
	}
	return NULL;
}

int hm2_emulator_attach(hm2_emulator *card, int instance, int channel, struct hm2_remote *remote, int through_pins)
{
	CARD_HOLD(card);
	const struct card_module *module = sserial_module(card);
	if (module == NULL)
		return HM2_ERR_RANGE;
	hm2_emulator_sync(card);
	return sserial_attach(module, instance, channel, remote, through_pins);
}

int hm2_emulator_peek_remote(hm2_emulator *card, struct hm2_remote *remote, int space, uint32_t address,
                             uint8_t *bytes, size_t length)
{
	CARD_HOLD(card);
	return hm2_remote_peek(remote, space, address, bytes, length);
}

int hm2_emulator_poke_remote(hm2_emulator *card, struct hm2_remote *remote, int space, uint32_t address,
                             const uint8_t *bytes, size_t length)
{
	CARD_HOLD(card);
	return hm2_remote_poke(remote, space, address, bytes, length);
}

size_t hm2_emulator_line_records(hm2_emulator *card, int instance, hm2_line_record *records, size_t capacity)
{
	CARD_HOLD(card);
	const struct card_module *module = sserial_module(card);
	return module == NULL ? 0 : sserial_line_records(module, instance, records, capacity);
}

int hm2_emulator_sserial_channels(const hm2_emulator *card, int instance)
{
	const struct card_module *module = sserial_module(card);
	return module == NULL ? 0 : sserial_channels(module, instance);
}

int hm2_emulator_interrupt(hm2_emulator *card)
{
	CARD_HOLD(card);
	struct card_module *module = card_find(card, HM2_GTAG_IRQ);
	hm2_emulator_sync(card);
	return module != NULL && irq_asserted(module);
}
