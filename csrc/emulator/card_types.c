/* The table of modules the emulated card knows: one row each. */
#include "card_modules.h"

static const struct card_module_type *const types[] = {
	&irq_type,
	&watchdog_type,
	&ioport_type,
	&encoder_type,
	&muxed_encoder_type,
	&muxed_select_type,
	&stepgen_type,
	&pwmgen_type,
	&dpll_type,
	&ssr_type,
	&outm_type,
	&sserial_type,
	&sserial_b_type,
	&rcpwm_type,
	&tp_pwm_type,
	&inm_type,
	&inmux_type,
	&oneshot_type,
	&period_type,
	&resolver_type,
	&ssi_type,
	&uart_tx_type,
	&uart_rx_type,
	&pktuart_tx_type,
	&pktuart_rx_type,
	&bspi_type,
	&dbspi_type,
};

const struct card_module_type *card_module_type(uint8_t gtag)
{
	for (size_t i = 0; i < sizeof types / sizeof *types; i++)
		if (types[i]->gtag == gtag)
			return types[i];
	return NULL;
}
