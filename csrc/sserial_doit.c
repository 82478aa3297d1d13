/* The cycle: register lists compiled once, one exchange per transfer where time allows, no allocation. */
#include "sserial.h"

#include <string.h>

/* A DOIT's duration varies by a pass of the firmware's loop. Where a look at COMMAND takes less, looks follow each other
 * until it has ended; where a look is a round trip, waiting for the longest is cheaper than another one. */
#define LOOP_PASS_NS 3000
#define RETRY_NS 1000
#define HIDDEN 0x200 /* beside the failed channels: what was read is no result */

static void add(struct sserial_lists *lists, size_t *count, uint32_t address, int flags, uint32_t *words)
{
	hm2_transfer *last = *count ? &lists->transfers[*count - 1] : NULL;
	/* registers of neighbouring channels are neighbours in the scratch rows, too */
	if (last && last->flags == flags && last->address + 4u * last->count == address &&
	    last->words + last->count == words) {
		last->count++;
		return;
	}
	lists->transfers[(*count)++] = (hm2_transfer){address, 1, (uint16_t)flags, words};
}

static void compile_reads(struct hm2_sserial *port, size_t *count)
{
	struct sserial_lists *lists = &port->lists;
	/* COMMAND first: when it reads 0, what is read after it is the result */
	add(lists, count, sserial_address(port, HM2_SSERIAL_COMMAND, 0), HM2_TRANSFER_READ, &lists->command);
	add(lists, count, sserial_address(port, HM2_SSERIAL_DATA, 0), HM2_TRANSFER_READ, &lists->data);
	for (uint32_t row = 0; row <= port->config.data_registers; row++) {
		for (uint32_t channel = 0; channel < port->config.channels; channel++) {
			if (lists->mask & 1u << channel && row <= port->channels[channel].input_registers)
				add(lists, count, sserial_address(port, HM2_SSERIAL_CS + row, channel),
				    HM2_TRANSFER_READ, &lists->in[row][channel]);
		}
	}
}

static void compile_writes(struct hm2_sserial *port, size_t *count)
{
	struct sserial_lists *lists = &port->lists;
	for (uint32_t row = 0; row < port->config.data_registers; row++) {
		for (uint32_t channel = 0; channel < port->config.channels; channel++) {
			if (lists->mask & 1u << channel && row < port->channels[channel].output_registers)
				add(lists, count, sserial_address(port, HM2_SSERIAL_USER0 + row, channel),
				    HM2_TRANSFER_WRITE, &lists->out[row][channel]);
		}
	}
	lists->doit = HM2_SSLBP_COMMAND_DOIT | lists->mask;
	add(lists, count, sserial_address(port, HM2_SSERIAL_COMMAND, 0), HM2_TRANSFER_WRITE, &lists->doit);
}

void sserial_compile(struct hm2_sserial *port, uint32_t mask)
{
	struct sserial_lists *lists = &port->lists;
	size_t count = 0;
	if (lists->mask == mask)
		return;
	lists->mask = mask;
	compile_reads(port, &count);
	lists->reads = count;
	compile_writes(port, &count);
	lists->writes = count - lists->reads;
	memcpy(&lists->transfers[count], lists->transfers, lists->reads * sizeof lists->transfers[0]);
	port->expected_ns = 0;
}

int hm2_sserial_set_bits(struct hm2_sserial *port, uint32_t channel, uint32_t input_bits, uint32_t output_bits,
                         hm2_error *error)
{
	const uint32_t most = port->config.data_registers * 32;
	if (channel >= port->config.channels || input_bits > most || output_bits > most)
		return sserial_fail(error, HM2_ERR_RANGE, "sserial bits", 0, (int)channel);
	struct sserial_channel *known = &port->channels[channel];
	known->input_registers = (input_bits + 31) / 32;
	known->output_registers = (output_bits + 31) / 32;
	/* a register that is no longer read must not show what it once held */
	memset(port->image.inputs[channel], 0, sizeof port->image.inputs[channel]);
	port->lists.mask = 0;
	return HM2_OK;
}

static void gather_outputs(struct hm2_sserial *port)
{
	for (uint32_t row = 0; row < port->config.data_registers; row++) {
		for (uint32_t channel = 0; channel < port->config.channels; channel++)
			port->lists.out[row][channel] = port->image.outputs[channel][row];
	}
}

/* Channels that were asked and are stopped: an old STOP that a network delivered once more. Their bits in DATA are
 * clear and their registers 0 (sslbp_observed.md, DOIT). */
static uint32_t stopped(const struct hm2_sserial *port)
{
	const struct sserial_lists *lists = &port->lists;
	uint32_t mask = 0;
	for (uint32_t channel = 0; channel < port->config.channels; channel++) {
		if (lists->in[0][channel] & HM2_CS_STATUS_NOT_READY << HM2_SSERIAL_CS_STATUS_LSB)
			mask |= 1u << channel;
	}
	return mask;
}

/* Inputs of a channel whose transfer failed are left alone: the registers hold nothing new. */
int sserial_take_results(struct hm2_sserial *port)
{
	struct sserial_lists *lists = &port->lists;
	const uint32_t failed = (lists->data | stopped(port)) & lists->mask;
	port->counters.doits++;
	for (uint32_t channel = 0; channel < port->config.channels; channel++) {
		const uint32_t bit = 1u << channel;
		if (!(lists->mask & bit))
			continue;
		if (failed & bit)
			port->counters.failed[channel]++;
		for (uint32_t row = 0; !(failed & bit) && row < port->channels[channel].input_registers; row++)
			port->image.inputs[channel][row] = lists->in[1 + row][channel];
		port->image.cs[channel] = lists->in[0][channel];
		sserial_watch_transfer(port, channel, lists->in[0][channel], (failed & bit) != 0);
	}
	return (int)failed;
}

/* Looks follow each other, and should begin when about a quarter of the DOITs are over: then the others are seen at once
 * and few looks are in vain. A hiccup of the host moves it by one look at most. */
static void learn_begin(struct hm2_sserial *port, int64_t took_ns, int first_look)
{
	const int64_t step_ns = (took_ns - port->expected_ns) / 32;
	if (first_look)
		port->expected_ns -= port->expected_ns < RETRY_NS / 10 ? port->expected_ns : RETRY_NS / 10;
	else if (!port->expected_ns)
		port->expected_ns = took_ns;
	else
		port->expected_ns += step_ns < RETRY_NS ? step_ns : RETRY_NS;
}

/* One look: a hiccup of the host or a lost datagram must not be learned, so it grows in steps; it creeps back towards
 * the shortest wait that does. */
static void learn_wait(struct hm2_sserial *port, int64_t took_ns, int first_look)
{
	const int64_t most_ns = port->expected_ns + port->expected_ns / 4 + LOOP_PASS_NS;
	const int64_t needs_ns = took_ns + LOOP_PASS_NS;
	if (first_look)
		port->expected_ns -= port->expected_ns / 2048;
	else
		port->expected_ns = port->expected_ns && needs_ns > most_ns ? most_ns : needs_ns;
}

static int looks_are_cheap(const struct hm2_sserial *port)
{
	return port->look_ns < LOOP_PASS_NS;
}

/* Learns from good transfers only: a lost reply takes longer than any that will be waited for, and so does the first
 * after a start, which waits for the chatter; longer than any DOIT takes does not count either. */
static void learn(struct hm2_sserial *port, int64_t took_ns, int first_look, uint32_t failed)
{
	port->counters.last_doit_ns = took_ns;
	if (failed || port->chattered || took_ns > LIMIT_DOIT_NS / MARGIN)
		port->chattered = 0;
	else if (looks_are_cheap(port))
		learn_begin(port, took_ns, first_look);
	else
		learn_wait(port, took_ns, first_look);
}

static int read_results(struct hm2_sserial *port, hm2_error *error)
{
	return hm2_exchange(port->board, port->lists.transfers, port->lists.reads, error);
}

int sserial_hung(struct hm2_sserial *port, const char *where, hm2_error *error)
{
	if (error)
		error->received = port->lists.command;
	return sserial_recover(port, where, error);
}

/* COMMAND, and with it `others` of the list behind it. */
static int look(struct hm2_sserial *port, size_t others, int64_t *seen_ns, hm2_error *error)
{
	*seen_ns = hm2_board_now_ns(port->board);
	const int status = hm2_exchange(port->board, port->lists.transfers, 1 + others, error);
	port->look_ns += (hm2_board_now_ns(port->board) - *seen_ns - port->look_ns) / 8;
	return status;
}

/* Where looks are dear the first is a whole list, so that a well-timed one is the only one.
 * Returns 1 if the first look saw the end, 0 if a later one did, or a status. */
static int look_until_done(struct hm2_sserial *port, int looked, int64_t *seen_ns, hm2_error *error)
{
	struct sserial_lists *lists = &port->lists;
	const size_t others = lists->reads - 1;
	int listed = looked || !looks_are_cheap(port);
	int first = 1;
	*seen_ns = port->doit_ns;
	int status = looked ? HM2_OK : look(port, listed ? others : 0, seen_ns, error);
	for (; status == HM2_OK && lists->command != 0; first = listed = 0) {
		/* the clock is read before the look: after the limit there is always one more */
		if (*seen_ns >= port->busy_until_ns)
			return sserial_hung(port, "sserial doit", error);
		hm2_board_pause_ns(port->board, RETRY_NS);
		status = look(port, 0, seen_ns, error);
	}
	if (status == HM2_OK && !listed)
		status = hm2_exchange(port->board, &lists->transfers[1], others, error);
	return status == HM2_OK ? first : status;
}

/* Outputs and DOIT were written at doit_ns; the first look at the results may have been taken already. */
static int wait_for_doit(struct hm2_sserial *port, int looked, hm2_error *error)
{
	int64_t seen_ns = 0;
	if (!looked)
		hm2_board_pause_ns(port->board, port->expected_ns);
	const int status = look_until_done(port, looked, &seen_ns, error);
	if (status < 0)
		return status;
	port->busy = 0;
	const int failed = sserial_take_results(port);
	learn(port, seen_ns - port->doit_ns, status, (uint32_t)failed);
	return failed;
}

void sserial_prepare_doit(struct hm2_sserial *port)
{
	gather_outputs(port);
	sserial_written(port, LIMIT_DOIT_NS);
	port->doit_ns = port->busy_until_ns - LIMIT_DOIT_NS;
}

static int write_doit(struct hm2_sserial *port, int with_results, hm2_error *error)
{
	struct sserial_lists *lists = &port->lists;
	sserial_prepare_doit(port);
	const int status = hm2_exchange(port->board, &lists->transfers[lists->reads],
	                                lists->writes + (with_results ? lists->reads : 0), error);
	if (status == HM2_OK)
		sserial_arrived(port);
	return status;
}

/* Counted from the answer to its write: a datagram that was lost and repeated starts it late. */
int sserial_is_over(const struct hm2_sserial *port, int64_t now_ns)
{
	return now_ns - (port->busy_until_ns - port->busy_limit_ns) >= LIMIT_DOIT_NS / MARGIN;
}

static int check_running(struct hm2_sserial *port, uint32_t mask, const char *where, hm2_error *error)
{
	if (mask > 0xFFu)
		return sserial_fail(error, HM2_ERR_RANGE, where, 0, -1);
	if (sserial_check_use(port, where, error) != HM2_OK)
		return HM2_ERR_BUSY;
	if (port->started && port->mode != HM2_SSERIAL_NORMAL)
		return sserial_fail(error, HM2_ERR_BUSY, where, HM2_SSERIAL_MODE_CONFLICT, -1);
	return HM2_OK;
}

int sserial_transfer(struct hm2_sserial *port, uint32_t mask, const char *where, hm2_error *error)
{
	int status = port->busy ? sserial_settle(port, where, error) : HM2_OK;
	const uint32_t running = mask & port->started;
	if (status != HM2_OK)
		return status;
	if (!running)
		return (int)mask; /* nothing to send */
	sserial_compile(port, running);
	/* where no time passes on the wire the results are there at once */
	const int at_once = port->expected_ns <= 0;
	status = write_doit(port, at_once, error);
	if (status != HM2_OK)
		return status;
	status = wait_for_doit(port, at_once, error);
	return status < 0 ? status : (int)((uint32_t)status | (mask & ~running));
}

int hm2_sserial_doit(struct hm2_sserial *port, uint32_t mask, hm2_error *error)
{
	static const char where[] = "sserial doit";
	int status = check_running(port, mask, where, error);
	if (status != HM2_OK)
		return status;
	if (port->process_data)
		hm2_process_data_pack(port->process_data);
	status = sserial_transfer(port, mask, where, error);
	if (port->process_data && status >= 0)
		hm2_process_data_unpack(port->process_data);
	return status >= 0 && port->event_count ? status | HM2_SSERIAL_NEWS : status;
}

int sserial_collect(struct hm2_sserial *port, hm2_error *error)
{
	sserial_compile(port, port->flying);
	port->flying = 0;
	const int status = read_results(port, error);
	if (status == HM2_OK && sserial_is_result(port))
		(void)sserial_take_results(port);
	return status;
}

/* Returns the failed channels, or HIDDEN. */
static int finish_flight(struct hm2_sserial *port, int followed, int64_t now_ns, hm2_error *error)
{
	if (port->lists.command == 0) {
		port->flying = 0;
		return sserial_is_result(port) ? sserial_take_results(port) : HIDDEN;
	}
	if (followed)
		sserial_overwritten(port);
	else if (sserial_is_hung(port, now_ns))
		return sserial_hung(port, "sserial cycle", error);
	port->counters.too_soon++;
	return sserial_fail(error, HM2_ERR_BUSY, "sserial cycle", HM2_SSERIAL_TOO_SOON, -1);
}

/* One exchange when the last DOIT must be over by now, else a look before the write: a DOIT is never
 * written over one that is still at work. */
static int step(struct hm2_sserial *port, uint32_t running, hm2_error *error)
{
	struct sserial_lists *lists = &port->lists;
	const int64_t now_ns = hm2_board_now_ns(port->board);
	const int one_exchange = lists->mask == running && !port->late && sserial_is_over(port, now_ns);
	int failed = 0;
	int status = HM2_OK;
	if (one_exchange) {
		port->late = MAY_BE_LATE; /* until it has come back */
		sserial_prepare_doit(port);
		status = hm2_exchange(port->board, lists->transfers, lists->reads + lists->writes, error);
	} else {
		status = read_results(port, error);
	}
	if (status != HM2_OK)
		return status;
	if (one_exchange) {
		port->late = NO_DOUBT;
		sserial_arrived(port);
	}
	failed = finish_flight(port, one_exchange, now_ns, error);
	if (failed < 0 || one_exchange)
		return failed;
	if (running) {
		sserial_compile(port, running);
		status = write_doit(port, 0, error);
	}
	return status == HM2_OK ? failed : status;
}

int hm2_sserial_cycle(struct hm2_sserial *port, uint32_t mask, uint32_t *requested, hm2_error *error)
{
	const uint32_t running = mask & port->started;
	const uint32_t flying = port->flying;
	int failed = 0;
	int status = check_running(port, mask, "sserial cycle", error);
	if (status == HM2_OK && !flying && port->busy)
		status = sserial_settle(port, "sserial cycle", error);
	*requested = 0;
	if (status != HM2_OK)
		return status;
	if (port->process_data)
		hm2_process_data_pack(port->process_data);
	if (flying) {
		sserial_compile(port, flying);
		failed = step(port, running, error);
		if (failed < 0)
			return failed;
		*requested = failed & HIDDEN ? 0 : flying;
		failed &= ~HIDDEN;
	} else if (running) {
		sserial_compile(port, running);
		status = write_doit(port, 0, error);
	}
	if (status != HM2_OK)
		return status;
	port->flying = running;
	if (port->process_data && *requested)
		hm2_process_data_unpack(port->process_data);
	return port->event_count ? failed | HM2_SSERIAL_NEWS : failed;
}

int hm2_sserial_ignored_write(struct hm2_sserial *port, hm2_error *error)
{
	return sserial_write(port, HM2_SSERIAL_COMMAND, 0, HM2_SSERIAL_COMMAND_IGNORE_MASK, error);
}
