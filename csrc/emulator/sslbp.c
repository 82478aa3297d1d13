/* One SSERIAL instance: its registers, and what the host's accesses do (sserial.md 1.2). */
#include "sslbp_state.h"

#include <stdlib.h>
#include <string.h>

#define PICOSECONDS 1000000000000ll
#define COMMAND_HELD HM2_SSLBP_COMMAND_RESET
#define ROM_MARKER 0xABCD

static void reset_processor(struct hm2_sslbp *s)
{
	s->place = PLACE_HELD;
	s->post_count = 0;
	for (int c = 0; c < s->channels; c++)
		sslbp_uart_reset(s, c);
}

static void release_processor(struct hm2_sslbp *s)
{
	s->place = PLACE_RESET;
	s->cpu = s->now;
}

void hm2_sslbp_power_up(struct hm2_sslbp *s)
{
	s->command = s->decoded = s->argument = 0;
	s->doorbell = s->result = 0;
	memset(s->written, 0, sizeof s->written);
	memset(s->shown, 0, sizeof s->shown);
	memset(s->ram, 0, sizeof s->ram);
	memset(s->rom, 0, sizeof s->rom);
	s->rom[ROM_WORDS - 1] = ROM_MARKER;
	s->timer = (struct sslbp_timer){.origin = s->now + COST_TIMER_ORIGIN, .period = TIMER_POWER_UP_PERIOD,
	                                .next_origin = NEVER, .next_period = TIMER_POWER_UP_PERIOD};
	for (int c = 0; c < s->channels; c++)
		s->uarts[c].awake = 0;
	reset_processor(s);
	release_processor(s);
	if (!s->wire)
		sslbp_run_instantly(s);
}

struct hm2_sslbp *hm2_sslbp_new(int channels, int data_registers, uint32_t clock_hz)
{
	if (channels < 1 || channels > MAX_CHANNELS || data_registers < 1 || data_registers > MAX_DATA_REGISTERS ||
	    clock_hz == 0)
		return NULL;
	struct hm2_sslbp *s = calloc(1, sizeof *s);
	if (s == NULL)
		return NULL;
	s->channels = channels;
	s->data_registers = data_registers;
	s->clock_hz = clock_hz;
	s->cycle_ps = (PICOSECONDS + clock_hz / 2) / clock_hz;
	s->wire = 1;
	for (int c = 0; c < channels; c++)
		s->uarts[c].receives = s->uarts[c].transmits = 1;
	hm2_sslbp_power_up(s);
	return s;
}

void hm2_sslbp_free(struct hm2_sslbp *sslbp)
{
	free(sslbp);
}

void hm2_sslbp_attach(struct hm2_sslbp *sslbp, int channel, struct hm2_remote *remote)
{
	sslbp->uarts[channel].remote = remote;
}

void hm2_sslbp_connect(struct hm2_sslbp *sslbp, int channel, int receive, int transmit)
{
	sslbp->uarts[channel].receives = receive != 0;
	sslbp->uarts[channel].transmits = transmit != 0;
}

void hm2_sslbp_set_wire(struct hm2_sslbp *sslbp, int on)
{
	sslbp->wire = on;
	if (!on)
		sslbp_run_instantly(sslbp);
}

void hm2_sslbp_advance(struct hm2_sslbp *sslbp, int64_t now_ps)
{
	int64_t until = now_ps / sslbp->cycle_ps;
	if (until < sslbp->now)
		return;
	if (sslbp->wire) {
		sslbp_run(sslbp, until);
	} else {
		sslbp->now = sslbp->cpu = until;
		if (sslbp->command)
			sslbp_run_instantly(sslbp);
	}
	for (int c = 0; c < sslbp->channels; c++)
		if (sslbp->uarts[c].remote != NULL)
			hm2_remote_advance(sslbp->uarts[c].remote, now_ps);
}

uint32_t hm2_sslbp_read(struct hm2_sslbp *sslbp, int reg, int channel)
{
	if (reg == HM2_SSERIAL_COMMAND)
		return sslbp->command;
	if (reg == HM2_SSERIAL_DATA)
		return sslbp->command & COMMAND_HELD ? sslbp->rom[sslbp->command % ROM_WORDS] : sslbp->result;
	if (channel < 0 || channel >= sslbp->channels || reg > HM2_SSERIAL_CS + sslbp->data_registers)
		return 0;
	return sslbp->shown[channel][reg - HM2_SSERIAL_CS];
}

static void write_command(struct hm2_sslbp *s, uint32_t value)
{
	if (value & HM2_SSERIAL_COMMAND_IGNORE_MASK)
		return;
	s->command = (uint16_t)value;
	s->doorbell = 1;
	if (value & COMMAND_HELD)
		reset_processor(s);
	else if (s->place == PLACE_HELD)
		release_processor(s);
	if (!s->wire)
		sslbp_run_instantly(s);
}

void hm2_sslbp_write(struct hm2_sslbp *sslbp, int reg, int channel, uint32_t value)
{
	if (reg == HM2_SSERIAL_COMMAND) {
		write_command(sslbp, value);
	} else if (reg == HM2_SSERIAL_DATA) {
		sslbp->argument = (uint16_t)value;
		if (sslbp->command & COMMAND_HELD)
			sslbp->rom[sslbp->command % ROM_WORDS] = (uint16_t)value;
	} else if (channel >= 0 && channel < sslbp->channels && reg <= HM2_SSERIAL_CS + sslbp->data_registers) {
		sslbp->written[channel][reg - HM2_SSERIAL_CS] = value;
	}
}
