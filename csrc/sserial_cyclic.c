/* A port's pipeline inside a board's cycle: the same rules as hm2_sserial_cycle, in the cycle's exchange. */
#include "board.h"
#include "sserial.h"

#include <string.h>

void sserial_launching(struct hm2_sserial *port)
{
	port->failures = board_failed(port->board);
}

/* Of an exchange that did not come back nobody knows whether its DOIT has started, or when it will. The registers then
 * hold its result or the one before: good if that one has not been taken yet. */
void sserial_note_launch(struct hm2_sserial *port)
{
	if (!port->launched)
		return;
	if (board_failed(port->board) != port->failures) {
		port->late = MAY_BE_LATE;
		port->hidden |= !port->flying;
	}
	port->flying = port->launched;
	port->launched = 0;
}

/* A network delivered a datagram twice or late, and with it a DOIT that nobody expected. The firmware ends that one,
 * forgets the other and shows 0xFF in DATA (sserial.md 2.1): this costs two cycles, and is no reason to stop. */
void sserial_overwritten(struct hm2_sserial *port)
{
	port->late = LATE_AT_WORK;
	port->hidden = 1;
	port->counters.overwritten++;
}

/* Of a DOIT in doubt nobody knows when it began, a network may have kept it for longer than it takes: the limit runs from
 * the first look that finds it at work. */
int sserial_is_hung(struct hm2_sserial *port, int64_t now_ns)
{
	if (port->late == MAY_BE_LATE) {
		port->late = LATE_AT_WORK;
		port->busy_until_ns = now_ns + port->busy_limit_ns;
	}
	return now_ns >= port->busy_until_ns;
}

int sserial_is_result(struct hm2_sserial *port)
{
	/* 0xFF with fewer channels asked for is the answer to no DOIT, but to one written over another at work */
	const int hidden = port->hidden ||
	                   (port->lists.data == HM2_SSLBP_RESULT_INVALID && port->lists.mask != HM2_SSLBP_RESULT_INVALID);
	port->late = NO_DOUBT;
	port->hidden = 0;
	port->counters.hidden += (uint64_t)hidden;
	return !hidden;
}

static size_t list(const hm2_transfer *from, size_t count, hm2_transfer *transfers, size_t capacity)
{
	if (count <= capacity)
		memcpy(transfers, from, count * sizeof *from);
	return count;
}

/* What others wrote before, and did not see completed, is looked at like a DOIT in doubt: no result comes of it. */
static void take_over(struct hm2_sserial *port)
{
	const uint32_t running = port->cyclic & port->started;
	if (!port->busy || port->flying || !running || port->mode != HM2_SSERIAL_NORMAL)
		return;
	port->flying = running;
	port->late = MAY_BE_LATE;
	port->hidden = 1;
}

static size_t cyclic_reads(void *self, hm2_transfer *transfers, size_t capacity)
{
	struct hm2_sserial *port = self;
	port->reading = 0;
	if (port->use == HM2_SSERIAL_USE_OTHERS)
		return 0;
	sserial_note_launch(port);
	take_over(port);
	if (!port->flying)
		return 0;
	sserial_compile(port, port->flying);
	port->reading = 1;
	return list(port->lists.transfers, port->lists.reads, transfers, capacity);
}

/* Never over a command that may be at work. In an exchange that also reads, the answer to that comes too
 * late, so only a DOIT that must be over by now is followed by the next, and none that may be late itself. */
static int may_write(const struct hm2_sserial *port, uint32_t running)
{
	if (port->hung || port->late)
		return 0;
	if (!port->busy)
		return 1;
	return port->reading && port->lists.mask == running && sserial_is_over(port, hm2_board_now_ns(port->board));
}

static size_t cyclic_writes(void *self, hm2_transfer *transfers, size_t capacity)
{
	struct hm2_sserial *port = self;
	if (port->use == HM2_SSERIAL_USE_OTHERS)
		return 0;
	const uint32_t running = port->cyclic & port->started;
	if (!running || port->mode != HM2_SSERIAL_NORMAL)
		return 0;
	if (!may_write(port, running)) {
		port->counters.too_soon++;
		return 0;
	}
	if (port->process_data)
		hm2_process_data_pack(port->process_data);
	sserial_compile(port, running);
	sserial_prepare_doit(port);
	sserial_launching(port);
	port->launched = running;
	return list(&port->lists.transfers[port->lists.reads], port->lists.writes, transfers, capacity);
}

/* Written over or not, it has the time of a DOIT to end. */
static void still_at_work(struct hm2_sserial *port, int followed, int64_t now_ns)
{
	port->hung = !followed && sserial_is_hung(port, now_ns);
	if (!followed)
		return;
	port->launched = 0;
	sserial_arrived(port);
	sserial_overwritten(port);
}

static void take(struct hm2_sserial *port)
{
	if (sserial_is_result(port)) {
		port->landed = port->flying;
		port->landed_failed = (uint32_t)sserial_take_results(port);
		if (port->landed & ~port->landed_failed)
			port->hidden_in_a_row = 0;
	} else {
		port->hidden_in_a_row++;
	}
	port->flying = 0;
}

static void cyclic_process(void *self, int64_t now_ns)
{
	struct hm2_sserial *port = self;
	if (port->use == HM2_SSERIAL_USE_OTHERS)
		return;
	const int followed = port->launched != 0;
	port->landed = port->landed_failed = 0;
	if (!port->reading) {
		if (followed)
			sserial_arrived(port);
		sserial_note_launch(port);
		return;
	}
	port->reading = 0;
	if (port->lists.command != 0) {
		still_at_work(port, followed, now_ns);
		return;
	}
	take(port);
	port->busy = followed;
	if (followed)
		sserial_arrived(port);
	sserial_note_launch(port);
	if (port->process_data && port->landed)
		hm2_process_data_unpack(port->process_data);
}

void hm2_sserial_part(struct hm2_sserial *port, hm2_cyclic *part)
{
	*part = (hm2_cyclic){port, cyclic_reads, cyclic_writes, cyclic_process};
}

void hm2_sserial_set_cyclic(struct hm2_sserial *port, uint32_t mask)
{
	port->cyclic = mask & 0xFFu;
}

void hm2_sserial_set_use(struct hm2_sserial *port, int use)
{
	port->use = use;
}

int sserial_check_use(const struct hm2_sserial *port, const char *where, hm2_error *error)
{
	if (port->use != HM2_SSERIAL_USE_CYCLE)
		return HM2_OK;
	return sserial_fail(error, HM2_ERR_BUSY, where, HM2_SSERIAL_LENT, -1);
}

int sserial_cyclic_news(struct hm2_sserial *port, uint32_t *requested, uint32_t *failed)
{
	*requested = port->landed;
	*failed = port->landed_failed;
	port->landed = port->landed_failed = 0;
	if (port->hung)
		return -1;
	return *requested != 0;
}

int hm2_sserial_cyclic_result(struct hm2_sserial *port, uint32_t *requested, hm2_error *error)
{
	uint32_t failed;
	if (sserial_cyclic_news(port, requested, &failed) < 0) {
		port->hung = 0;
		return sserial_hung(port, "sserial cycle", error);
	}
	return (int)failed | (port->event_count ? HM2_SSERIAL_NEWS : 0);
}
