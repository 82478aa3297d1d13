/* The SSERIAL mailbox: one command at a time, waited for, and dug out when it hangs. */
#include "sserial.h"

#include <string.h>

uint32_t sserial_address(const struct hm2_sserial *port, uint32_t reg, uint32_t channel)
{
	const hm2_sserial_config *config = &port->config;
	return config->base + reg * config->register_stride + config->instance * config->instance_stride +
	       channel * CHANNEL_STEP;
}

uint32_t sserial_existing(const struct hm2_sserial *port)
{
	return (1u << port->config.channels) - 1;
}

int sserial_read(struct hm2_sserial *port, uint32_t reg, uint32_t channel, uint32_t *value, hm2_error *error)
{
	return hm2_read(port->board, sserial_address(port, reg, channel), value, 1, error);
}

int sserial_write(struct hm2_sserial *port, uint32_t reg, uint32_t channel, uint32_t value, hm2_error *error)
{
	return hm2_write(port->board, sserial_address(port, reg, channel), &value, 1, error);
}

int sserial_fail(hm2_error *error, int status, const char *where, int detail, int channel)
{
	hm2_error_set(error, status, where);
	if (error) {
		error->detail = detail;
		error->index = channel;
	}
	return status;
}

void sserial_written(struct hm2_sserial *port, int64_t limit_ns)
{
	port->busy = 1;
	port->busy_limit_ns = limit_ns;
	port->busy_until_ns = hm2_board_now_ns(port->board) + limit_ns;
}

void sserial_arrived(struct hm2_sserial *port)
{
	port->busy_until_ns = hm2_board_now_ns(port->board) + port->busy_limit_ns;
}

hm2_transfer sserial_word(const struct hm2_sserial *port, uint32_t reg, uint32_t channel, uint32_t *value)
{
	return (hm2_transfer){sserial_address(port, reg, channel), 1, HM2_TRANSFER_WRITE, value};
}

/* The command is noted as pending before its write: if the write fails on its way, nobody knows
 * whether it has arrived. */
static int write_list(struct hm2_sserial *port, const hm2_transfer *words, size_t count, int64_t limit_ns,
                      hm2_error *error)
{
	sserial_written(port, limit_ns);
	const int status = hm2_exchange(port->board, words, count, error);
	if (status == HM2_OK)
		sserial_arrived(port);
	return status;
}

static int write_command(struct hm2_sserial *port, uint32_t command, int64_t limit_ns, hm2_error *error)
{
	const hm2_transfer word = sserial_word(port, HM2_SSERIAL_COMMAND, 0, &command);
	return write_list(port, &word, 1, limit_ns, error);
}

/* What takes long is looked at less often: the wait grows by 3 % at most, and a remote that does not answer does not
 * keep the bus busy for 50 ms. */
static int64_t next_look_ns(int64_t waited_ns, int64_t poll_ns)
{
	const int64_t share_ns = waited_ns / 32;
	return share_ns > poll_ns ? share_ns : poll_ns;
}

int sserial_wait(struct hm2_sserial *port, int64_t poll_ns, hm2_error *error)
{
	const int64_t start_ns = hm2_board_now_ns(port->board);
	uint32_t command = 0;
	for (;;) {
		/* the clock is read first: after the limit there is always one more look */
		const int64_t now_ns = hm2_board_now_ns(port->board);
		const int expired = now_ns >= port->busy_until_ns;
		const int status = sserial_read(port, HM2_SSERIAL_COMMAND, 0, &command, error);
		if (status != HM2_OK)
			return status;
		if (command == 0) {
			port->busy = port->hung = 0;
			return HM2_OK;
		}
		if (expired)
			break;
		hm2_board_pause_ns(port->board, next_look_ns(now_ns - start_ns, poll_ns));
	}
	hm2_error_set(error, HM2_ERR_TIMEOUT, "sserial");
	if (error) {
		error->address = sserial_address(port, HM2_SSERIAL_COMMAND, 0);
		error->received = command;
	}
	return HM2_ERR_TIMEOUT;
}

int sserial_settle(struct hm2_sserial *port, const char *where, hm2_error *error)
{
	if (!port->busy)
		sserial_written(port, LIMIT_ACCESS_NS); /* someone else's command, if there is one */
	sserial_note_launch(port);
	if (port->late)
		(void)sserial_is_hung(port, hm2_board_now_ns(port->board)); /* this is its first look */
	const int status = sserial_wait(port, POLL_SHORT_NS, error);
	if (status == HM2_ERR_TIMEOUT)
		return sserial_recover(port, where, error);
	return status == HM2_OK && port->flying ? sserial_collect(port, error) : status;
}

int sserial_run(struct hm2_sserial *port, const hm2_transfer *words, size_t count, int64_t limit_ns,
                const char *where, hm2_error *error)
{
	int status = sserial_settle(port, where, error);
	if (status == HM2_OK)
		status = write_list(port, words, count, limit_ns, error);
	if (status == HM2_OK)
		status = sserial_wait(port, POLL_SHORT_NS, error);
	return status == HM2_ERR_TIMEOUT && port->busy ? sserial_recover(port, where, error) : status;
}

int sserial_command(struct hm2_sserial *port, uint32_t command, int64_t limit_ns, const char *where, hm2_error *error)
{
	const hm2_transfer word = sserial_word(port, HM2_SSERIAL_COMMAND, 0, &command);
	return sserial_run(port, &word, 1, limit_ns, where, error);
}

/* Completes whatever hangs; it is not executed itself (sserial.md 2.1). */
int sserial_unjam(struct hm2_sserial *port, hm2_error *error)
{
	const int status = write_command(port, HM2_SSLBP_COMMAND_UNJAM, LIMIT_STOP_NS, error);
	return status == HM2_OK ? sserial_wait(port, POLL_SHORT_NS, error) : status;
}

void sserial_forget(struct hm2_sserial *port, uint32_t mask)
{
	port->started &= ~mask;
	port->used &= ~mask;
	port->flying &= ~mask;
	port->launched &= ~mask;
	port->late = NO_DOUBT;
	port->hidden = 0;
	for (uint32_t channel = 0; channel < CHANNELS; channel++) {
		if (!(mask & 1u << channel))
			continue;
		memset(port->image.outputs[channel], 0, sizeof port->image.outputs[channel]);
		port->channels[channel].watch = (hm2_fault_watch){0, 0, 0, 0, 0};
		/* a stop leaves a remote's space as it is, and the next start may find another remote there */
		port->channels[channel].space = SPACE_UNKNOWN;
	}
	if (!port->started)
		port->mode = HM2_SSERIAL_STOPPED;
}

/* 0x08FF and STOP ALL, else a reset. A failing bus ends the attempt with HM2_SSERIAL_DEAD. */
static int rescue(struct hm2_sserial *port)
{
	int status = sserial_unjam(port, NULL);
	if (status == HM2_OK)
		status = write_command(port, HM2_SSLBP_COMMAND_STOP, LIMIT_STOP_ALL_NS, NULL);
	if (status == HM2_OK)
		status = sserial_wait(port, POLL_SHORT_NS, NULL);
	if (status == HM2_OK) {
		hm2_board_pause_ns(port->board, SETTLE_STOP_NS);
		return HM2_SSERIAL_UNJAMMED;
	}
	return hm2_sserial_reset(port, NULL) == HM2_OK ? HM2_SSERIAL_RESET : HM2_SSERIAL_DEAD;
}

int sserial_recover(struct hm2_sserial *port, const char *where, hm2_error *error)
{
	const uint32_t received = error ? error->received : 0;
	port->counters.hung++;
	const int detail = rescue(port);
	sserial_forget(port, ~0u);
	sserial_fail(error, HM2_ERR_TIMEOUT, where, detail, -1);
	if (error) {
		error->address = sserial_address(port, HM2_SSERIAL_COMMAND, 0);
		error->received = received;
	}
	return HM2_ERR_TIMEOUT;
}
