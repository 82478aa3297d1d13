/* The modules of the emulated card, and what they ask of each other. */
#ifndef HM2_EMULATOR_CARD_MODULES_H
#define HM2_EMULATOR_CARD_MODULES_H

#include "card.h"

/* The modules the emulated card knows: GTAG and operations, which are the file of that name. */
#define CARD_MODULE_TYPES(row) \
	row(HM2_GTAG_IRQ, irq_type) \
	row(HM2_GTAG_WATCHDOG, watchdog_type) \
	row(HM2_GTAG_IOPORT, ioport_type) \
	row(HM2_GTAG_ENCODER, encoder_type) \
	row(HM2_GTAG_MUXED_ENCODER, muxed_encoder_type) \
	row(HM2_GTAG_MUXED_ENCODER_SELECT, muxed_select_type) \
	row(HM2_GTAG_STEPGEN, stepgen_type) \
	row(HM2_GTAG_PWMGEN, pwmgen_type) \
	row(HM2_GTAG_DPLL, dpll_type) \
	row(HM2_GTAG_SSR, ssr_type) \
	row(HM2_GTAG_OUTM, outm_type) \
	row(HM2_GTAG_SSERIAL, sserial_type) \
	row(HM2_GTAG_SSERIAL_B, sserial_type) \
	row(HM2_GTAG_RCPWM, rcpwm_type) \
	row(HM2_GTAG_TP_PWM, tp_pwm_type) \
	row(HM2_GTAG_INM, field_input_type) \
	row(HM2_GTAG_INMUX, field_input_type) \
	row(HM2_GTAG_ONESHOT, oneshot_type) \
	row(HM2_GTAG_PERIOD, period_type) \
	row(HM2_GTAG_RESOLVER, resolver_type) \
	row(HM2_GTAG_SSI, ssi_type) \
	row(HM2_GTAG_UART_TX, uart_tx_type) \
	row(HM2_GTAG_UART_RX, uart_rx_type) \
	row(HM2_GTAG_PKTUART_TX, pktuart_tx_type) \
	row(HM2_GTAG_PKTUART_RX, pktuart_rx_type) \
	row(HM2_GTAG_BSPI, bspi_type) \
	row(HM2_GTAG_DBSPI, bspi_type)

#define DECLARE_TYPE(gtag, type) extern const struct card_module_type type;
CARD_MODULE_TYPES(DECLARE_TYPE)
#undef DECLARE_TYPE

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
	uint32_t moving_inputs[CARD_MAX_PORTS]; /* pins whose level a module has a say in */
	uint32_t moving_outputs[CARD_MAX_PORTS];
	int moving_found;
	int64_t released; /* the clock of the last watchdog bite */
};
void ioport_release(struct ioport *port); /* the watchdog has bitten */
int ioport_level(struct ioport *port, int pin); /* HM2_LEVEL_* */
/* The card's own driver of a pin: HM2_LEVEL_LOW, _HIGH or _FLOATING. */
int ioport_driver(struct ioport *port, int pin);
/* Driven by hand from outside: 1 and its level. */
int ioport_outside(const struct ioport *port, int pin, int *level);
int ioport_reads_high(struct ioport *port, int pin);
/* +1 the pad follows the pin's module, -1 inverted, 0 it does not. */
int ioport_follows(const struct ioport *port, int pin);
/* Driven by its module's function: alternate source on, direction out, not inverted. */
int ioport_is_switched(const struct ioport *port, int pin, int output);

/* For what hangs on a module from outside, by whoever holds the card: the module's state, up to date; NULL: it has
 * no such instance. */
void *card_instances(struct hm2_emulator *card, uint8_t gtag, int unit);
/* The pin of a module's function, its own or shared by all units; -1: none. */
int card_pin_of(const struct hm2_emulator *card, int tag, int unit, int number);

/* irq.c */
int irq_asserted(const struct card_module *module);

/* dpll.c */
/* The clock of the last event of timer 1..4 (0: reference) up to `clock`; -1: none or no DPLL. */
int64_t dpll_last_event(struct hm2_emulator *card, int timer, int64_t clock);

/* What an encoder showed at its timer's last event; the clock stands with the first one. */
struct encoder_latch {
	int64_t clock;
	uint32_t count;
};

/* sserial.c */
int sserial_attach(const struct card_module *module, int instance, int channel, struct hm2_remote *remote,
                   int through_pins);
int sserial_channels(const struct card_module *module, int instance);
size_t sserial_line_records(const struct card_module *module, int instance, hm2_line_record *records,
                            size_t capacity);

#endif
