/* Faults by their edges: each is reported once when it appears, on every channel, every time.
 *
 * In firmware up to 1.43 most bits stay set until a stop, later ones may clear them; an edge is right
 * for both. Whether this one transfer failed is the DATA bit's to say, never a sticky bit's. */
#include "sserial.h"

static void put(struct hm2_sserial *port, const hm2_sserial_event *event)
{
	if (port->event_count == HM2_SSERIAL_EVENTS) {
		port->lost_events++;
		return;
	}
	port->events[(port->first_event + port->event_count++) % HM2_SSERIAL_EVENTS] = *event;
}

static uint32_t watched_word(const struct hm2_sserial *port, uint32_t channel)
{
	const struct sserial_channel *known = &port->channels[channel];
	return port->image.inputs[channel][known->watch_register] & known->watch_mask;
}

void sserial_watch_transfer(struct hm2_sserial *port, uint32_t channel, uint32_t cs, int failed)
{
	struct sserial_channel *known = &port->channels[channel];
	const uint32_t faults = cs & CS_FAULTS;
	const uint32_t word = watched_word(port, channel);
	const uint32_t bit = 1u << channel;
	const hm2_sserial_event event = {
		.transfer = port->counters.doits,
		.channel = (int32_t)channel,
		.failed = failed && !(port->failed & bit),
		.cs = cs,
		.rising = faults & ~known->last_faults,
		.word = word,
		.word_rising = word & ~known->last_word,
	};
	known->last_faults = faults;
	known->last_word = word;
	port->failed = failed ? port->failed | bit : port->failed & ~bit;
	if (!event.failed && !event.rising && !event.word_rising)
		return;
	hm2_sserial_event stamped = event;
	stamped.time_ns = hm2_board_now_ns(port->board);
	put(port, &stamped);
}

/* The remote fault byte may be left over from before the start (SSLBP observed 2, "Chatter"), so it is
 * not taken as known: the first transfer shows what holds. */
void sserial_watch_start(struct hm2_sserial *port, uint32_t mask)
{
	for (uint32_t channel = 0; channel < port->config.channels; channel++) {
		const uint32_t cs = port->image.cs[channel];
		const uint32_t faults = cs & CS_FAULTS & ~HM2_SSERIAL_CS_REMOTE_FAULT_MASK;
		if (!(mask & 1u << channel))
			continue;
		port->channels[channel].last_faults = faults;
		port->channels[channel].last_word = 0;
		if (!faults)
			continue;
		const hm2_sserial_event event = {
			.time_ns = hm2_board_now_ns(port->board),
			.channel = (int32_t)channel,
			.cs = cs,
			.rising = faults,
		};
		put(port, &event);
	}
}

void hm2_sserial_watch(struct hm2_sserial *port, uint32_t channel, uint32_t input_register, uint32_t mask)
{
	if (channel >= CHANNELS || input_register >= DATA_REGISTERS)
		return;
	port->channels[channel].watch_register = input_register;
	port->channels[channel].watch_mask = mask;
}

uint32_t hm2_sserial_pending_events(const struct hm2_sserial *port)
{
	return port->event_count;
}

size_t hm2_sserial_take_events(struct hm2_sserial *port, hm2_sserial_event *events, size_t capacity,
                               uint64_t *lost)
{
	size_t taken = 0;
	for (; taken < capacity && port->event_count; taken++) {
		events[taken] = port->events[port->first_event];
		port->first_event = (port->first_event + 1) % HM2_SSERIAL_EVENTS;
		port->event_count--;
	}
	*lost = port->lost_events;
	port->lost_events = 0;
	return taken;
}
