/* IOPort: output latches, direction, alternate source, open drain, invert, and the pads
 * (fact sheet registers.md 2.1, card observed 2). */
#include <stdlib.h>
#include <string.h>

#include "card_modules.h"

static void *ioport_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	(void)descriptor;
	struct ioport *port = calloc(1, sizeof *port);
	if (port == NULL)
		return NULL;
	port->card = card;
	port->ports = card->ports;
	port->mask = card->port_width == 32 ? UINT32_MAX : (UINT32_C(1) << card->port_width) - 1;
	port->released = -1;
	return port;
}

static void ioport_destroy(void *self)
{
	free(self);
}

int card_pin_of(const struct hm2_emulator *card, int tag, int unit, int number)
{
	for (int i = 0; i < card->pin_count; i++) {
		const struct card_pin *pin = &card->pins[i];
		int same_unit = pin->unit == unit || (pin->unit & CARD_SHARED_UNIT);
		if (pin->tag == tag && pin->number == number && same_unit)
			return i;
	}
	return -1;
}

static int module_output(struct ioport *port, int pin)
{
	const struct card_pin *p = &port->card->pins[pin];
	if (!(p->number & 0x80))
		return 0; /* an input's alternate source is constant 0 */
	struct card_module *module = card_find(port->card, p->tag);
	if (module == NULL || module->type->output == NULL)
		return 0;
	if (module->type->advance)
		module->type->advance(module->self, port->card->clock);
	return module->type->output(module->self, p->unit, p->number);
}

int ioport_driver(struct ioport *port, int pin)
{
	int p = pin / port->card->port_width;
	int b = pin % port->card->port_width;
	int open_drain = (port->open_drain[p] >> b) & 1;
	if (!open_drain && !((port->ddr[p] >> b) & 1))
		return HM2_LEVEL_FLOATING;
	int data = (port->alternate[p] >> b) & 1 ? module_output(port, pin) : (int)(port->latch[p] >> b) & 1;
	data ^= (int)(port->invert[p] >> b) & 1;
	if (open_drain && data)
		return HM2_LEVEL_FLOATING;
	return data;
}

int ioport_outside(const struct ioport *port, int pin, int *level)
{
	int p = pin / port->card->port_width;
	int b = pin % port->card->port_width;
	*level = (int)(port->outside_level[p] >> b) & 1;
	return (int)(port->outside[p] >> b) & 1;
}

/* What drives the pad from outside: by hand, else what is wired to its module's inputs. */
static int outside_level(struct ioport *port, int pin, int *level)
{
	const struct card_pin *p = &port->card->pins[pin];
	if (ioport_outside(port, pin, level))
		return 1;
	if (p->tag == 0 || (p->number & 0x80))
		return 0;
	struct card_module *module = card_find(port->card, p->tag);
	return module != NULL && module->type->outside != NULL &&
	       module->type->outside(module->self, p->unit & 0x7F, p->number, level);
}

int ioport_level(struct ioport *port, int pin)
{
	int outside;
	int driver = ioport_driver(port, pin);
	if (!outside_level(port, pin, &outside))
		return driver;
	return driver == HM2_LEVEL_FLOATING || driver == outside ? outside : HM2_LEVEL_CONTENTION;
}

int ioport_reads_high(struct ioport *port, int pin)
{
	int outside;
	if (outside_level(port, pin, &outside))
		return outside;
	return ioport_driver(port, pin) != HM2_LEVEL_LOW;
}

/* Pins that a module may move: through its output, or through what hangs on its input. */
static void find_moving(struct ioport *port)
{
	for (int pin = 0; pin < port->card->pin_count; pin++) {
		const struct card_pin *p = &port->card->pins[pin];
		const struct card_module *module = p->tag ? card_find(port->card, p->tag) : NULL;
		uint32_t bit = UINT32_C(1) << (pin % port->card->port_width);
		if (module != NULL && p->number & 0x80 && module->type->output)
			port->moving_outputs[pin / port->card->port_width] |= bit;
		if (module != NULL && !(p->number & 0x80) && module->type->outside)
			port->moving_inputs[pin / port->card->port_width] |= bit;
	}
	port->moving_found = 1;
}

/* As ioport_reads_high, pin by pin only where a module has a say. */
static uint32_t read_pads(struct ioport *port, int p)
{
	if (!port->moving_found)
		find_moving(port);
	uint32_t outside = port->outside[p];
	uint32_t driven = port->ddr[p] | port->open_drain[p];
	uint32_t data = (port->latch[p] & ~port->alternate[p]) ^ port->invert[p];
	uint32_t value = (outside & port->outside_level[p]) | (~outside & (~driven | data));
	uint32_t left = ~outside & (port->moving_inputs[p] | (port->moving_outputs[p] & port->alternate[p] & driven));
	for (value &= port->mask & ~left; left; left &= left - 1) {
		int b = __builtin_ctz(left);
		value |= (uint32_t)ioport_reads_high(port, p * port->card->port_width + b) << b;
	}
	return value;
}

int ioport_follows(const struct ioport *port, int pin)
{
	int level;
	int p = pin / port->card->port_width;
	uint32_t bit = UINT32_C(1) << (pin % port->card->port_width);
	if (ioport_outside(port, pin, &level) || !(port->alternate[p] & bit) ||
	    !((port->ddr[p] | port->open_drain[p]) & bit))
		return 0;
	return port->invert[p] & bit ? -1 : 1;
}

int ioport_is_switched(const struct ioport *port, int pin, int output)
{
	int p = pin / port->card->port_width;
	uint32_t bit = UINT32_C(1) << (pin % port->card->port_width);
	int driven = ((port->ddr[p] | port->open_drain[p]) & bit) != 0;
	if (!(port->alternate[p] & bit))
		return 0;
	return output ? driven && !(port->invert[p] & bit) : !driven;
}

void ioport_release(struct ioport *port)
{
	for (int p = 0; p < port->ports; p++)
		port->ddr[p] = port->open_drain[p] = 0;
	port->released = port->card->clock;
	card_pins_changed(port->card);
}

static void ioport_power_up(void *self)
{
	struct ioport *port = self;
	uint32_t *const registers[] = {port->latch, port->ddr, port->alternate, port->open_drain, port->invert};
	for (size_t i = 0; i < sizeof registers / sizeof *registers; i++)
		memset(registers[i], 0, sizeof port->latch);
	port->released = -1;
}

/* Only address bits 4..2 are decoded: the ports repeat every 32 bytes. */
static int port_index(const struct ioport *port, uint32_t offset)
{
	int p = (int)(offset >> 2) & 7;
	return p < port->ports ? p : -1;
}

static uint32_t ioport_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	struct ioport *port = self;
	int p = port_index(port, offset);
	if (p < 0 || reg > HM2_IOPORT_DDR)
		return 0;
	*value = reg == HM2_IOPORT_DATA ? read_pads(port, p) : port->ddr[p];
	return CARD_ALL_DRIVEN;
}

static int ioport_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct ioport *port = self;
	uint32_t *const registers[] = {port->latch, port->ddr, port->alternate, port->open_drain, port->invert};
	int p = port_index(port, offset);
	if (p < 0 || reg > HM2_IOPORT_OUTPUT_INVERT)
		return 0;
	/* The clear of a bite wins over a write in the same clock. */
	if ((reg == HM2_IOPORT_DDR || reg == HM2_IOPORT_OPEN_DRAIN) && port->released == port->card->clock)
		return 1;
	registers[reg][p] = value & port->mask;
	card_pins_changed(port->card);
	return 1;
}

const struct card_module_type ioport_type = {
	.create = ioport_create,
	.destroy = ioport_destroy,
	.read = ioport_read,
	.write = ioport_write,
	.power_up = ioport_power_up,
};
