/* One SSERIAL instance: the mailbox registers, the SSLBP 1.43 firmware behind them and its UARTs. */
#ifndef HM2_EMULATOR_SSLBP_H
#define HM2_EMULATOR_SSLBP_H

#include "remote.h"

struct hm2_sslbp;

/* channels 1..8; data_registers 3 (gtag C1) or 7 (C6); clock_hz of the SSERIAL processor (ClockMed). */
struct hm2_sslbp *hm2_sslbp_new(int channels, int data_registers, uint32_t clock_hz);
void hm2_sslbp_free(struct hm2_sslbp *sslbp);
/* The FPGA was configured anew: nothing of before is left but what hangs on the lines. */
void hm2_sslbp_power_up(struct hm2_sslbp *sslbp);
/* The remote on a channel, or NULL for an idle line. Not owned. */
void hm2_sslbp_attach(struct hm2_sslbp *sslbp, int channel, struct hm2_remote *remote);
/* Whether the FPGA pins of the channel are switched to their secondary function (else: no contact). */
void hm2_sslbp_connect(struct hm2_sslbp *sslbp, int channel, int receive, int transmit);
/* With wire off a command's whole effect has happened when its write returns (see ARCHITECTURE.md). */
void hm2_sslbp_set_wire(struct hm2_sslbp *sslbp, int on);
/* What the line to the remote shows: bytes on it, high between them. */
int hm2_sslbp_transmit_level(const struct hm2_sslbp *sslbp, int channel, int64_t now_ps);
/* Run up to now_ps (never backwards). Reads and writes act at the time last advanced to. */
void hm2_sslbp_advance(struct hm2_sslbp *sslbp, int64_t now_ps);
/* reg: register number (0 COMMAND, 1 DATA, 2 CS, 3.. interface data); channel for CS and data. */
uint32_t hm2_sslbp_read(struct hm2_sslbp *sslbp, int reg, int channel);
void hm2_sslbp_write(struct hm2_sslbp *sslbp, int reg, int channel, uint32_t value);
/* Takes bytes seen on the lines, oldest first (see hm2_emulator_line_records). */
size_t hm2_sslbp_line_records(struct hm2_sslbp *sslbp, hm2_line_record *records, size_t capacity);

#endif
