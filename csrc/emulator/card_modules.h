/* The modules of the emulated card, and what they ask of each other. */
#ifndef HM2_EMULATOR_CARD_MODULES_H
#define HM2_EMULATOR_CARD_MODULES_H

#include "card.h"

#define GTAG_IRQ 0x01
#define GTAG_WATCHDOG 0x02
#define GTAG_IOPORT 0x03
#define GTAG_SSERIAL 0xC1
#define GTAG_SSERIAL_B 0xC6

extern const struct card_module_type irq_type;
extern const struct card_module_type watchdog_type;
extern const struct card_module_type ioport_type;
extern const struct card_module_type sserial_type;

/* ioport.c */
struct ioport {
	struct hm2_emulator *card;
	int ports;
	uint32_t mask; /* the bits a port has */
	uint32_t latch[CARD_MAX_PORTS];
	uint32_t ddr[CARD_MAX_PORTS];
	uint32_t alternate[CARD_MAX_PORTS];
	uint32_t open_drain[CARD_MAX_PORTS];
	uint32_t invert[CARD_MAX_PORTS];
	uint32_t outside[CARD_MAX_PORTS];       /* driven from outside */
	uint32_t outside_level[CARD_MAX_PORTS];
	int64_t released; /* the clock of the last watchdog bite */
};
void ioport_release(struct ioport *port); /* the watchdog has bitten */
int ioport_level(struct ioport *port, int pin); /* HM2_LEVEL_* */
/* The card's own driver of a pin: HM2_LEVEL_LOW, _HIGH or _FLOATING. */
int ioport_driver(struct ioport *port, int pin);
/* Driven by its module's function: alternate source on, direction out, not inverted. */
int ioport_is_switched(const struct ioport *port, int pin, int output);

/* irq.c */
int irq_asserted(const struct card_module *module);

/* sserial.c */
int sserial_attach(struct card_module *module, int instance, int channel, struct hm2_remote *remote,
                   int through_pins);
int sserial_channels(const struct card_module *module, int instance);

#endif
