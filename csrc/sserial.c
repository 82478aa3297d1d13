/* An SSERIAL port: reset, start, stop and what is known of its channels. */
#include "sserial.h"

#include <stdlib.h>
#include <string.h>

#define REVISION_TRIES 20
#define REVISION_PAUSE_NS 100000

static int check_config(const hm2_sserial_config *config, hm2_error *error)
{
	static const char where[] = "sserial open";
	const int status =
		config->channels < 1 || config->channels > CHANNELS ||
		(config->data_registers != 3 && config->data_registers != DATA_REGISTERS) || config->instance > 3
			? HM2_ERR_RANGE
			: HM2_OK;
	return status == HM2_OK ? status : hm2_error_set(error, status, where);
}

int hm2_sserial_open(struct hm2_board *board, const hm2_sserial_config *config, struct hm2_sserial **port,
                     hm2_error *error)
{
	const int status = check_config(config, error);
	if (status != HM2_OK)
		return status;
	struct hm2_sserial *new_port = calloc(1, sizeof *new_port);
	if (!new_port)
		return hm2_error_set(error, HM2_ERR_NO_MEMORY, "sserial open");
	new_port->board = board;
	new_port->config = *config;
	for (int channel = 0; channel < CHANNELS; channel++) {
		/* until the remote's tables are known every register may carry bits */
		new_port->channels[channel].input_registers = config->data_registers;
		new_port->channels[channel].output_registers = config->data_registers;
		new_port->channels[channel].space = SPACE_UNKNOWN;
	}
	*port = new_port;
	return HM2_OK;
}

void hm2_sserial_free(struct hm2_sserial *port)
{
	free(port);
}

/* The revision reads 0xAA during the init; a command written too early is lost and its register
 * stays, then writing it again works (SSLBP observed 2, "Reset"). */
static int wait_for_firmware(struct hm2_sserial *port, hm2_error *error)
{
	uint32_t revision = HM2_SSLBP_RESULT_STOPPED_ALL;
	int status = HM2_OK;
	for (int i = 0; i < REVISION_TRIES; i++) {
		status = sserial_write(port, HM2_SSERIAL_COMMAND, 0,
		                       HM2_SSLBP_COMMAND_READ_LOCAL | HM2_SSLBP_LOCAL_MINOR_REVISION, error);
		sserial_written(port, LIMIT_LOCAL_NS);
		if (status == HM2_OK)
			status = sserial_wait(port, POLL_SHORT_NS, error);
		if (status == HM2_OK)
			status = sserial_read(port, HM2_SSERIAL_DATA, 0, &revision, error);
		if (status == HM2_OK && revision != HM2_SSLBP_RESULT_STOPPED_ALL)
			return HM2_OK;
		if (status != HM2_OK && status != HM2_ERR_TIMEOUT)
			return status;
		hm2_board_pause_ns(port->board, REVISION_PAUSE_NS);
	}
	sserial_fail(error, HM2_ERR_PROTOCOL, "sserial reset", HM2_SSERIAL_NO_FIRMWARE, -1);
	if (error) {
		error->address = sserial_address(port, HM2_SSERIAL_DATA, 0);
		error->received = revision;
	}
	return HM2_ERR_PROTOCOL;
}

int hm2_sserial_reset(struct hm2_sserial *port, hm2_error *error)
{
	if (sserial_check_use(port, "sserial reset", error) != HM2_OK)
		return HM2_ERR_BUSY;
	sserial_forget(port, ~0u);
	int status = sserial_write(port, HM2_SSERIAL_COMMAND, 0, HM2_SSLBP_COMMAND_RESET, error);
	if (status == HM2_OK)
		status = sserial_write(port, HM2_SSERIAL_COMMAND, 0, HM2_SSLBP_COMMAND_RELEASE, error);
	sserial_written(port, LIMIT_RESET_NS);
	if (status == HM2_OK)
		status = sserial_wait(port, POLL_SHORT_NS, error);
	if (status == HM2_ERR_TIMEOUT)
		return sserial_fail(error, status, "sserial reset", HM2_SSERIAL_DEAD, -1);
	if (status != HM2_OK)
		return status;
	hm2_board_pause_ns(port->board, SETTLE_RESET_NS);
	return wait_for_firmware(port, error);
}

#define ZERO_TRIES 3

/* Best effort: the remote's watchdog ends the outputs too, but later. Nothing is repeated on a bus that is silent. */
static void send_zeroes(struct hm2_sserial *port, uint32_t mask)
{
	const uint32_t running = port->mode == HM2_SSERIAL_NORMAL ? port->started & mask : 0;
	for (uint32_t channel = 0; channel < CHANNELS; channel++) {
		if (mask & 1u << channel)
			memset(port->image.outputs[channel], 0, sizeof port->image.outputs[channel]);
	}
	for (int i = 0; running && i < ZERO_TRIES; i++) {
		const int status = sserial_transfer(port, running, "sserial stop", NULL);
		if (status == 0 || (status < 0 && status != HM2_ERR_PROTOCOL))
			return;
	}
}

int hm2_sserial_stop(struct hm2_sserial *port, uint32_t mask, hm2_error *error)
{
	const uint32_t stopped = mask ? mask : ~0u;
	if (sserial_check_use(port, "sserial stop", error) != HM2_OK)
		return HM2_ERR_BUSY;
	if (mask > 0xFFu)
		return sserial_fail(error, HM2_ERR_RANGE, "sserial stop", 0, -1);
	const uint32_t others = port->started & ~stopped;
	send_zeroes(port, stopped);
	const int status = sserial_command(port, HM2_SSLBP_COMMAND_STOP | mask,
	                                   mask ? LIMIT_STOP_NS : LIMIT_STOP_ALL_NS, "sserial stop", error);
	if (status != HM2_OK)
		return status;
	sserial_forget(port, stopped);
	hm2_board_pause_ns(port->board, SETTLE_STOP_NS);
	/* a DOIT with the zeroes that hung took them along */
	if (!(others & ~port->started))
		return HM2_OK;
	sserial_fail(error, HM2_ERR_TIMEOUT, "sserial stop", HM2_SSERIAL_UNJAMMED, -1);
	if (error)
		error->received = port->lists.doit;
	return HM2_ERR_TIMEOUT;
}

static int write_modes_and_zeroes(struct hm2_sserial *port, uint32_t mask, hm2_error *error)
{
	static const uint32_t zeroes[DATA_REGISTERS] = {0};
	int status = HM2_OK;
	for (uint32_t channel = 0; channel < port->config.channels && status == HM2_OK; channel++) {
		if (!(mask & 1u << channel))
			continue;
		memcpy(port->image.outputs[channel], zeroes, sizeof zeroes);
		memcpy(port->image.inputs[channel], zeroes, sizeof zeroes);
		for (uint32_t reg = 0; reg < port->config.data_registers && status == HM2_OK; reg++)
			status = sserial_write(port, HM2_SSERIAL_USER0 + reg, channel, 0, error);
		if (status == HM2_OK)
			status = sserial_write(port, HM2_SSERIAL_CS, channel,
			                       port->channels[channel].software_mode << HM2_SSERIAL_CS_MODE_LSB, error);
	}
	return status;
}

static int read_identity(struct hm2_sserial *port, uint32_t channel, hm2_error *error)
{
	hm2_sserial_identity *identity = &port->channels[channel].identity;
	int status = sserial_read(port, HM2_SSERIAL_CS, channel, &identity->cs, error);
	if (status == HM2_OK)
		status = sserial_read(port, HM2_SSERIAL_USER0, channel, &identity->unit_number, error);
	if (status == HM2_OK)
		status = sserial_read(port, HM2_SSERIAL_USER1, channel, &identity->name, error);
	if (status == HM2_OK)
		status = sserial_read(port, HM2_SSERIAL_USER2, channel, &identity->toc, error);
	port->image.cs[channel] = identity->cs;
	return status;
}

/* Returns the channels of mask that are not ready in *hanging. */
static int read_identities(struct hm2_sserial *port, uint32_t mask, uint32_t *hanging, hm2_error *error)
{
	int status = HM2_OK;
	*hanging = 0;
	for (uint32_t channel = 0; channel < port->config.channels && status == HM2_OK; channel++) {
		if (!(mask & 1u << channel))
			continue;
		status = read_identity(port, channel, error);
		if (port->image.cs[channel] & HM2_CS_STATUS_NOT_READY << HM2_SSERIAL_CS_STATUS_LSB)
			*hanging |= 1u << channel;
	}
	return status;
}

/* A start that never completes: abort it and stop only the channels it waits for, keeping what they
 * showed. Any further trouble goes the hard way, STOP ALL. */
static int give_up_start(struct hm2_sserial *port, uint32_t mask, uint32_t *failed, hm2_error *error)
{
	uint32_t hanging = 0;
	int status = sserial_unjam(port, error);
	if (status == HM2_OK)
		status = read_identities(port, mask, &hanging, error);
	if (status != HM2_OK || !hanging)
		return sserial_recover(port, "sserial start", error);
	port->counters.hung++;
	*failed = hanging | (mask & ~sserial_existing(port));
	return sserial_command(port, HM2_SSLBP_COMMAND_STOP | hanging, LIMIT_STOP_NS, "sserial start", error);
}

static int run_start(struct hm2_sserial *port, uint32_t mask, int mode, uint32_t *failed, hm2_error *error)
{
	const int normal = mode == HM2_SSERIAL_NORMAL;
	uint32_t hanging = 0;
	int status = sserial_settle(port, "sserial start", error);
	if (status != HM2_OK)
		return status;
	sserial_written(port, normal ? LIMIT_START_NS : LIMIT_START_SETUP_NS);
	status = sserial_write(port, HM2_SSERIAL_COMMAND, 0,
	                       (normal ? HM2_SSLBP_COMMAND_START_NORMAL : HM2_SSLBP_COMMAND_START_SETUP) | mask, error);
	if (status == HM2_OK)
		status = sserial_wait(port, POLL_START_NS, error);
	if (status == HM2_ERR_TIMEOUT)
		return give_up_start(port, mask, failed, error);
	if (status == HM2_OK)
		status = sserial_read(port, HM2_SSERIAL_DATA, 0, failed, error);
	*failed &= mask;
	return status == HM2_OK ? read_identities(port, mask, &hanging, error) : status;
}

/* Channels that have been tried since their last stop keep errors, and some would not start at all. */
static int stop_leftovers(struct hm2_sserial *port, uint32_t mask, hm2_error *error)
{
	const uint32_t leftovers = mask & port->used;
	if (!leftovers)
		return HM2_OK;
	const int status = hm2_sserial_stop(port, leftovers, error);
	hm2_board_pause_ns(port->board, SETTLE_RESTART_NS);
	return status;
}

int hm2_sserial_start(struct hm2_sserial *port, uint32_t mask, int mode, hm2_error *error)
{
	uint32_t failed = 0;
	if (sserial_check_use(port, "sserial start", error) != HM2_OK)
		return HM2_ERR_BUSY;
	if (mask > 0xFFu || (mode != HM2_SSERIAL_NORMAL && mode != HM2_SSERIAL_SETUP))
		return sserial_fail(error, HM2_ERR_RANGE, "sserial start", 0, -1);
	if (port->started && port->mode != mode)
		return sserial_fail(error, HM2_ERR_BUSY, "sserial start", HM2_SSERIAL_MODE_CONFLICT, -1);
	const uint32_t fresh = mask & ~port->started;
	for (uint32_t channel = 0; channel < CHANNELS; channel++) {
		if (fresh & 1u << channel)
			port->channels[channel].identity = (hm2_sserial_identity){0, 0, 0, 0};
	}
	int status = stop_leftovers(port, fresh, error);
	if (status == HM2_OK)
		status = write_modes_and_zeroes(port, fresh, error);
	if (status != HM2_OK || !fresh)
		return status;
	port->used |= fresh;
	status = run_start(port, fresh, mode, &failed, error);
	if (status != HM2_OK)
		return status;
	port->started |= fresh & ~failed;
	sserial_watch_start(port, fresh & ~failed);
	port->mode = port->started ? mode : HM2_SSERIAL_STOPPED;
	port->chattered = 1;
	return (int)failed;
}

void hm2_sserial_set_software_mode(struct hm2_sserial *port, uint32_t channel, uint32_t mode)
{
	if (channel < CHANNELS)
		port->channels[channel].software_mode = mode & 0xFFu;
}

uint32_t hm2_sserial_started(const struct hm2_sserial *port)
{
	return port->started;
}

int hm2_sserial_mode(const struct hm2_sserial *port)
{
	return port->mode;
}

void hm2_sserial_get_identity(const struct hm2_sserial *port, uint32_t channel, hm2_sserial_identity *identity)
{
	*identity = channel < CHANNELS ? port->channels[channel].identity : (hm2_sserial_identity){0, 0, 0, 0};
}

void hm2_sserial_set_process_data(struct hm2_sserial *port, struct hm2_process_data *process_data)
{
	port->process_data = process_data;
}

hm2_sserial_image *hm2_sserial_get_image(struct hm2_sserial *port)
{
	return &port->image;
}

void hm2_sserial_get_counters(const struct hm2_sserial *port, hm2_sserial_counters *counters)
{
	*counters = port->counters;
}
