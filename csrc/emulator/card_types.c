/* The table of modules the emulated card knows: one row for each GTAG. */
#include "card_modules.h"

static const struct {
	uint8_t gtag;
	const struct card_module_type *type;
} types[] = {
	{HM2_GTAG_IRQ, &irq_type},
	{HM2_GTAG_WATCHDOG, &watchdog_type},
	{HM2_GTAG_IOPORT, &ioport_type},
	{HM2_GTAG_ENCODER, &encoder_type},
	{HM2_GTAG_MUXED_ENCODER, &muxed_encoder_type},
	{HM2_GTAG_MUXED_ENCODER_SELECT, &muxed_select_type},
	{HM2_GTAG_STEPGEN, &stepgen_type},
	{HM2_GTAG_PWMGEN, &pwmgen_type},
	{HM2_GTAG_DPLL, &dpll_type},
	{HM2_GTAG_SSR, &ssr_type},
	{HM2_GTAG_OUTM, &outm_type},
	{HM2_GTAG_SSERIAL, &sserial_type},
	{HM2_GTAG_SSERIAL_B, &sserial_type},
	{HM2_GTAG_RCPWM, &rcpwm_type},
	{HM2_GTAG_TP_PWM, &tp_pwm_type},
	{HM2_GTAG_INM, &field_input_type},
	{HM2_GTAG_INMUX, &field_input_type},
	{HM2_GTAG_ONESHOT, &oneshot_type},
	{HM2_GTAG_PERIOD, &period_type},
	{HM2_GTAG_RESOLVER, &resolver_type},
	{HM2_GTAG_SSI, &ssi_type},
	{HM2_GTAG_UART_TX, &uart_tx_type},
	{HM2_GTAG_UART_RX, &uart_rx_type},
	{HM2_GTAG_PKTUART_TX, &pktuart_tx_type},
	{HM2_GTAG_PKTUART_RX, &pktuart_rx_type},
	{HM2_GTAG_BSPI, &bspi_type},
	{HM2_GTAG_DBSPI, &bspi_type},
};

const struct card_module_type *card_module_type(uint8_t gtag)
{
	for (size_t i = 0; i < sizeof types / sizeof *types; i++)
		if (types[i].gtag == gtag)
			return types[i].type;
	return NULL;
}
