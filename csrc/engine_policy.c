/* What turns outputs off, and the events that say so. Nothing here turns them on but a request. */
#include "engine.h"

#include <string.h>

#define LEAVING_CYCLES 4 /* zeroes are packed in the first, sent in the second, and a DOIT may have been too soon */

void engine_event(struct hm2_engine *engine, int kind, int index, int status, int64_t value, const uint32_t words[4])
{
	hm2_engine_event event = {
		.time_ns = engine_now_ns(engine),
		.cycle = engine->status.cycles,
		.kind = kind,
		.index = index,
		.status = status,
		.value = value,
	};
	if (words)
		memcpy(event.words, words, sizeof event.words);
	if (!hm2_record_ring_push(engine->events, &event))
		engine->status.events_lost++;
}

void engine_off(struct hm2_engine *engine, uint32_t reason)
{
	if (engine->status.off & reason)
		return;
	engine->status.off |= reason;
	engine_event(engine, HM2_EVENT_OFF, -1, engine->status.status, reason, NULL);
}

static void on(struct hm2_engine *engine)
{
	if (!engine->status.off)
		return;
	engine->status.off = 0;
	engine_reset_axes(engine);
	engine_event(engine, HM2_EVENT_ON, -1, 0, 0, NULL);
}

void engine_judge_exchange(struct hm2_engine *engine, int status)
{
	hm2_engine_status *now = &engine->status;
	now->status = status;
	if (status != HM2_OK) {
		now->failures++;
		if (now->stale++ == 0)
			engine_event(engine, HM2_EVENT_FAILED, -1, status, 0, NULL);
	} else if (now->stale) {
		engine_event(engine, HM2_EVENT_RECOVERED, -1, 0, now->stale, NULL);
		now->stale = 0;
	}
}

static void leave(struct hm2_engine *engine, uint32_t number)
{
	struct engine_port *port = &engine->ports[number];
	port->leaving = 0;
	hm2_sserial_set_use(port->port, HM2_SSERIAL_USE_OTHERS);
	engine->status.port_state[number] = HM2_PORT_GIVEN_UP;
	atomic_store_explicit(&port->state, HM2_PORT_GIVEN_UP, memory_order_release);
}

/* A remote whose answers get lost may well hear: it is told the zeroes before nobody talks to it any more. Not where
 * the DOIT never ended: there is no way to. */
static void give_up(struct hm2_engine *engine, uint32_t number, int64_t value)
{
	engine_event(engine, HM2_EVENT_PORT_GIVEN_UP, (int)number, 0, value, NULL);
	engine_off(engine, HM2_OFF_PORT);
	engine_lend_no_more(&engine->ports[number]); /* or its DOIT would be held back */
	engine->ports[number].leaving = LEAVING_CYCLES;
	if (value == HM2_GIVEN_UP_DOIT_HUNG)
		leave(engine, number);
}

/* A fault that the remote itself reports turns outputs off at once; a reply that was lost fills the bucket. */
static void take_faults(struct hm2_engine *engine, uint32_t number)
{
	hm2_sserial_event event;
	uint64_t lost;
	while (hm2_sserial_take_events(engine->ports[number].port, &event, 1, &lost)) {
		const uint32_t words[4] = {event.cs, event.rising, event.word, event.word_rising};
		engine_event(engine, HM2_EVENT_PORT_FAULT, (int)number * 8 + event.channel, event.failed,
		             (int64_t)event.transfer, words);
		if (event.rising & HM2_SSERIAL_CS_REMOTE_FAULT_MASK || event.word_rising)
			engine_off(engine, HM2_OFF_FAULT);
	}
	engine->status.events_lost += lost;
}

/* Whoever it was lent to may have stopped channels, a command that hung has, and anybody may take them out of the cycle:
 * nothing of theirs would be fresh again. */
static int still_runs(const struct engine_port *port)
{
	const uint32_t cyclic = port->held ? port->cyclic : port->port->cyclic;
	const uint32_t running = port->port->mode == HM2_SSERIAL_NORMAL ? port->port->started : 0;
	return !(port->channels & ~(running & cyclic));
}

static void judge_port(struct hm2_engine *engine, uint32_t number)
{
	struct engine_port *port = &engine->ports[number];
	const hm2_engine_config *config = &engine->config;
	uint32_t requested = 0, failed = 0;
	if (atomic_load_explicit(&port->state, memory_order_acquire) != HM2_PORT_RUNNING)
		return;
	if (engine->status.port_state[number] != HM2_PORT_RUNNING) {
		engine->status.port_state[number] = HM2_PORT_RUNNING;
		port->level = engine->status.port_level[number] = 0;
		port->port->hidden_in_a_row = 0;
		engine_event(engine, HM2_EVENT_PORT_BACK, (int)number, 0, 0, NULL);
	}
	const int news = sserial_cyclic_news(port->port, &requested, &failed);
	take_faults(engine, number);
	if (news > 0)
		port->level += failed ? config->fault_increment : -config->fault_decrement;
	if (port->level < 0)
		port->level = 0;
	engine->status.port_level[number] = port->level;
	engine->status.port_stale[number] = port->port->hidden_in_a_row;
	if (port->leaving) {
		if (news < 0 || --port->leaving == 0)
			leave(engine, number);
	} else if (news < 0) {
		give_up(engine, number, HM2_GIVEN_UP_DOIT_HUNG);
	} else if (!still_runs(port)) {
		give_up(engine, number, HM2_GIVEN_UP_CHANNELS_STOPPED);
	} else if (config->fault_limit && port->level >= config->fault_limit) {
		give_up(engine, number, port->level);
	} else {
		engine_lend(port);
	}
}

void engine_judge_ports(struct hm2_engine *engine)
{
	for (uint32_t i = 0; i < engine->port_count; i++)
		judge_port(engine, i);
}

/* Behind a cycle that could not read: a lost result is not better than a hidden one. */
void engine_miss_ports(struct hm2_engine *engine)
{
	for (uint32_t i = 0; i < engine->port_count; i++) {
		struct engine_port *port = &engine->ports[i];
		if (atomic_load_explicit(&port->state, memory_order_acquire) == HM2_PORT_RUNNING)
			engine->status.port_stale[i] = ++port->port->hidden_in_a_row;
	}
}

void hm2_engine_port_back(struct hm2_engine *engine, uint32_t port)
{
	if (port >= engine->port_count)
		return;
	hm2_sserial_set_use(engine->ports[port].port, HM2_SSERIAL_USE_CYCLE);
	atomic_store_explicit(&engine->ports[port].state, HM2_PORT_RUNNING, memory_order_release);
}

int hm2_engine_port_is_given_up(const struct hm2_engine *engine, uint32_t port)
{
	return port < engine->port_count &&
	       atomic_load_explicit(&engine->ports[port].state, memory_order_acquire) == HM2_PORT_GIVEN_UP;
}

/* A network may lose every other exchange, those with a DOIT: none of them in a row, and yet a port's inputs are old. So
 * for a port lost and hidden results are counted together. */
static int is_stale(const struct hm2_engine *engine)
{
	const hm2_engine_status *now = &engine->status;
	const int32_t limit = engine->config.stale_limit;
	int stale = now->stale >= limit;
	for (uint32_t i = 0; i < engine->port_count; i++)
		stale |= now->port_stale[i] >= limit;
	return limit && stale;
}

/* A bite may have come and been acknowledged since the cycle before, and nobody arms the watchdog but who enables. */
static void judge_gate(struct hm2_engine *engine)
{
	const uint32_t shuttings = board_shuttings(engine->board);
	if (shuttings != engine->shuttings)
		engine_off(engine, HM2_OFF_BITE);
	engine->shuttings = shuttings;
}

/* A remote whose watchdog has bitten takes no outputs until it is started anew: they would be on in name only. Other
 * faults are its user's to judge: a drive without bus voltage may need an output that switches it on. */
static int has_bitten(const struct sserial_channel *remote)
{
	const uint32_t in_cs = HM2_REMOTE_FAULT_WATCHDOG << HM2_SSERIAL_CS_REMOTE_FAULT_LSB;
	const uint32_t in_word = remote->watch_mask & -remote->watch_mask; /* its lowest bit */
	return remote->watch.faults & in_cs || remote->watch.word & in_word;
}

static void judge_remotes(struct hm2_engine *engine, uint32_t number)
{
	const struct engine_port *port = &engine->ports[number];
	if (engine->status.port_state[number] != HM2_PORT_RUNNING || port->leaving)
		engine_off(engine, HM2_OFF_PORT);
	for (uint32_t channel = 0; channel < CHANNELS; channel++)
		if (port->channels >> channel & 1 && has_bitten(&port->port->channels[channel]))
			engine_off(engine, HM2_OFF_FAULT);
}

/* Enabling looks at nothing but the request: what still holds turns outputs off again before they are sent. Requests are
 * looked at before outputs, as who enables has written first, and behind them, as who disables may write then. */
void engine_judge_outputs(struct hm2_engine *engine)
{
	const int64_t now_ns = engine_now_ns(engine);
	judge_gate(engine);
	const uint32_t requests = atomic_exchange(&engine->requests, 0);
	const int fresh = engine_take_outputs(engine);
	if (fresh) {
		engine->refreshed_ns = now_ns;
		engine->has_outputs = 1;
	}
	if (requests & ENGINE_REQUEST_RESET_TRACE)
		engine_clear_trace(engine);
	if (requests & ENGINE_REQUEST_DISABLE)
		engine_off(engine, HM2_OFF_USER);
	if (!(engine->status.off & HM2_OFF_STOP) && engine->has_outputs &&
	    (requests & ENGINE_REQUEST_ENABLE || (fresh && engine->status.off == HM2_OFF_IDLE)))
		on(engine);
	if (atomic_load(&engine->requests) & ENGINE_REQUEST_DISABLE)
		engine_off(engine, HM2_OFF_USER);
	engine->status.outputs_age_ns = now_ns - engine->refreshed_ns;
	if (engine->config.dead_man_ns && engine->status.outputs_age_ns > engine->config.dead_man_ns &&
	    !(engine->status.off & HM2_OFF_IDLE))
		engine_off(engine, HM2_OFF_DEAD_MAN);
	if (is_stale(engine))
		engine_off(engine, HM2_OFF_STALE);
	if (hm2_board_gate_is_shut(engine->board))
		engine_off(engine, HM2_OFF_BITE);
	for (uint32_t i = 0; i < engine->port_count; i++)
		judge_remotes(engine, i);
}

void engine_judge_time(struct hm2_engine *engine, int64_t missed)
{
	if (missed <= 0) {
		engine->overruns_in_a_row = 0;
		return;
	}
	engine->status.overruns++;
	if (engine->overruns_in_a_row++ == 0)
		engine_event(engine, HM2_EVENT_OVERRUN, -1, 0, missed, NULL);
	if (engine->config.overrun_limit && engine->overruns_in_a_row >= engine->config.overrun_limit)
		engine_off(engine, HM2_OFF_OVERRUN);
}

void hm2_engine_enable(struct hm2_engine *engine)
{
	atomic_fetch_or(&engine->requests, ENGINE_REQUEST_ENABLE);
}

/* Both at once: first off, then on. */
void hm2_engine_disable(struct hm2_engine *engine)
{
	atomic_fetch_and(&engine->requests, ~ENGINE_REQUEST_ENABLE);
	atomic_fetch_or(&engine->requests, ENGINE_REQUEST_DISABLE);
}

size_t hm2_engine_take_events(struct hm2_engine *engine, hm2_engine_event *events, size_t capacity)
{
	return hm2_record_ring_pop_many(engine->events, events, capacity);
}
