/* Interrupt logic: a flag set as a DPLL output falls, a mask, and the pin (fact sheet registers.md 2.23,
 * card observed 1 and 8). PCI cards have it although no descriptor names it.
 *
 * The selected source passes two registers: the flag comes two clocks behind the source's fall. A change
 * of the selection passes them too, so going from a high source to a low one sets the flag. */
#include <stdlib.h>

#include "card_modules.h"
#include "dpll.h"

#define FLAG HM2_IRQ_STATUS_FLAG_MASK
#define MASK HM2_IRQ_STATUS_MASK_BIT_MASK
#define SOURCE_LSB HM2_IRQ_STATUS_SOURCE_SELECT_LSB
#define STORED (FLAG | MASK | HM2_IRQ_STATUS_SOURCE_SELECT_MASK)
#define DELAY 2

struct irq {
	struct hm2_emulator *card;
	uint32_t status;
	int64_t clock;
	int64_t selected;   /* when the source was chosen: falls of it count from then on */
	int64_t selection_falls; /* clock of the flag a change of selection brings; CARD_NEVER */
	int64_t flagged;
};

static void *irq_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	(void)descriptor;
	struct irq *irq = calloc(1, sizeof *irq);
	if (irq == NULL)
		return NULL;
	irq->card = card;
	irq->selection_falls = CARD_NEVER;
	irq->flagged = -1;
	return irq;
}

static void irq_destroy(void *self)
{
	free(self);
}

static void irq_power_up(void *self)
{
	struct irq *irq = self;
	irq->status = 0;
	irq->selected = irq->card->clock;
	irq->selection_falls = CARD_NEVER;
	irq->flagged = -1;
}

static int source(const struct irq *irq)
{
	return (int)(irq->status >> SOURCE_LSB) & 7;
}

static void flag_between(struct irq *irq, int64_t at, int64_t clock)
{
	if (at > irq->clock && at <= clock) {
		irq->status |= FLAG;
		irq->flagged = at;
	}
}

static void irq_advance(void *self, int64_t clock)
{
	struct irq *irq = self;
	struct dpll *dpll = dpll_of(irq->card);
	if (clock <= irq->clock)
		return;
	if (dpll != NULL && source(irq) <= DPLL_TIMERS) {
		dpll_advance(dpll, clock);
		for (int i = 0; i < 2; i++) {
			int64_t fall = dpll->fall[source(irq)][i];
			if (fall > irq->selected)
				flag_between(irq, fall + DELAY, clock);
		}
	}
	flag_between(irq, irq->selection_falls, clock);
	irq->clock = clock;
}

static uint32_t irq_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct irq *irq = self;
	(void)offset;
	if (reg != HM2_IRQ_STATUS)
		return 0;
	*value = irq->status;
	return CARD_ALL_DRIVEN;
}

static int source_level(const struct irq *irq, int number, int64_t clock)
{
	struct dpll *dpll = dpll_of(irq->card);
	if (dpll == NULL || number > DPLL_TIMERS)
		return 0;
	dpll_advance(dpll, irq->card->clock);
	int level = dpll_level(dpll, number);
	return dpll->rise[number][0] > clock || dpll->fall[number][0] > clock ? !level : level;
}

static void write_status(struct irq *irq, uint32_t value)
{
	int64_t now = irq->card->clock;
	int old = source(irq);
	int chosen = (int)(value >> SOURCE_LSB) & 7;
	if (chosen != old) {
		int falls = source_level(irq, old, now - 1) && !source_level(irq, chosen, now);
		irq->selection_falls = falls ? now + DELAY : CARD_NEVER;
		irq->selected = now;
	}
	uint32_t kept = irq->flagged == now ? FLAG : 0; /* an event in the same clock wins */
	irq->status = (value & STORED) | kept;
}

static int irq_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct irq *irq = self;
	(void)offset;
	if (reg == HM2_IRQ_CLEAR)
		irq->status &= ~FLAG;
	else if (reg == HM2_IRQ_STATUS)
		write_status(irq, value);
	else
		return 0; /* the divider belongs to another variant */
	return 1;
}

int irq_asserted(const struct card_module *module)
{
	const struct irq *irq = module->self;
	return (irq->status & (FLAG | MASK)) == (FLAG | MASK);
}

const struct card_module_type irq_type = {
	.create = irq_create,
	.destroy = irq_destroy,
	.read = irq_read,
	.write = irq_write,
	.advance = irq_advance,
	.power_up = irq_power_up,
};
