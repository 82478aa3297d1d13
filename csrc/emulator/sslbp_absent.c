/* Stands in until the SSLBP firmware model is linked: an SSERIAL instance that never answers. */
#include <stdlib.h>

#include "sslbp.h"

#define WEAK __attribute__((weak))

WEAK struct hm2_sslbp *hm2_sslbp_new(int channels, int data_registers, uint32_t clock_hz)
{
	(void)channels;
	(void)data_registers;
	(void)clock_hz;
	return calloc(1, 1);
}

WEAK void hm2_sslbp_free(struct hm2_sslbp *sslbp)
{
	free(sslbp);
}

WEAK void hm2_sslbp_attach(struct hm2_sslbp *sslbp, int channel, struct hm2_remote *remote)
{
	(void)sslbp;
	(void)channel;
	(void)remote;
}

WEAK void hm2_sslbp_connect(struct hm2_sslbp *sslbp, int channel, int receive, int transmit)
{
	(void)sslbp;
	(void)channel;
	(void)receive;
	(void)transmit;
}

WEAK void hm2_sslbp_set_wire(struct hm2_sslbp *sslbp, int on)
{
	(void)sslbp;
	(void)on;
}

WEAK void hm2_sslbp_advance(struct hm2_sslbp *sslbp, int64_t now_ps)
{
	(void)sslbp;
	(void)now_ps;
}

WEAK uint32_t hm2_sslbp_read(struct hm2_sslbp *sslbp, int reg, int channel)
{
	(void)sslbp;
	(void)reg;
	(void)channel;
	return 0;
}

WEAK void hm2_sslbp_write(struct hm2_sslbp *sslbp, int reg, int channel, uint32_t value)
{
	(void)sslbp;
	(void)reg;
	(void)channel;
	(void)value;
}
