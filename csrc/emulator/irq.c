/* Interrupt logic: a flag set by a DPLL output, a mask, and the pin (fact sheet registers.md 2.23, card
 * observed 1 and 8). PCI cards have it although no descriptor names it. */
#include <stdlib.h>

#include "card_modules.h"

enum { STATUS, CLEAR };

#define FLAG 1u
#define MASK 2u
#define STORED 0x1Fu

struct irq {
	struct hm2_emulator *card;
	uint32_t status;
};

static void *irq_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	(void)descriptor;
	struct irq *irq = calloc(1, sizeof *irq);
	if (irq != NULL)
		irq->card = card;
	return irq;
}

static void irq_destroy(void *self)
{
	free(self);
}

static uint32_t irq_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct irq *irq = self;
	(void)offset;
	if (reg != STATUS)
		return 0;
	*value = irq->status;
	return CARD_ALL_DRIVEN;
}

static int irq_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct irq *irq = self;
	(void)offset;
	if (reg == CLEAR)
		irq->status &= ~FLAG;
	else
		irq->status = value & STORED;
	return 1;
}

int irq_asserted(const struct card_module *module)
{
	const struct irq *irq = module->self;
	return (irq->status & (FLAG | MASK)) == (FLAG | MASK);
}

const struct card_module_type irq_type = {
	.gtag = GTAG_IRQ,
	.create = irq_create,
	.destroy = irq_destroy,
	.read = irq_read,
	.write = irq_write,
};
