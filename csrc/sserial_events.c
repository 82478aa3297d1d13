/* Faults by their edges: each is reported once when it appears, on every channel, every time.
 *
 * In firmware up to 1.43 most bits stay set until a stop, later ones may clear them; an edge is right
 * for both. Whether this one transfer failed is the DATA bit's to say, never a sticky bit's. */
#include "sserial.h"

int hm2_fault_watch_step(hm2_fault_watch *watch, uint32_t cs, uint32_t word, int failed)
{
	const uint32_t faults = cs & CS_FAULTS;
	const int newly_failed = failed && !watch->failed;
	watch->rising = faults & ~watch->faults;
	watch->word_rising = word & ~watch->word;
	watch->faults = faults;
	watch->word = word;
	watch->failed = failed != 0;
	return newly_failed || watch->rising || watch->word_rising;
}

static void put(struct hm2_sserial *port, uint32_t channel, uint64_t transfer)
{
	const hm2_fault_watch *watch = &port->channels[channel].watch;
	uint32_t *count = &port->event_count;
	if (*count == HM2_SSERIAL_EVENTS) {
		port->lost_events++;
		return;
	}
	port->events[(port->first_event + (*count)++) % HM2_SSERIAL_EVENTS] = (hm2_sserial_event){
		.transfer = transfer,
		.time_ns = hm2_board_now_ns(port->board),
		.channel = (int32_t)channel,
		.failed = watch->failed,
		.cs = port->image.cs[channel],
		.rising = watch->rising,
		.word = watch->word,
		.word_rising = watch->word_rising,
	};
}

void sserial_watch_transfer(struct hm2_sserial *port, uint32_t channel, uint32_t cs, int failed)
{
	struct sserial_channel *known = &port->channels[channel];
	/* a transfer that failed brought no word: what the image holds may be from before the start */
	const uint32_t word = failed ? known->watch.word
	                             : port->image.inputs[channel][known->watch_register] & known->watch_mask;
	if (hm2_fault_watch_step(&known->watch, cs, word, failed))
		put(port, channel, port->counters.doits);
}

/* The remote fault byte may be left over from before the start (SSLBP observed 2, "Chatter"), so it is
 * not taken as known: the first transfer shows what holds. */
void sserial_watch_start(struct hm2_sserial *port, uint32_t mask)
{
	for (uint32_t channel = 0; channel < port->config.channels; channel++) {
		hm2_fault_watch *watch = &port->channels[channel].watch;
		if (!(mask & 1u << channel))
			continue;
		*watch = (hm2_fault_watch){0, 0, 0, 0, 0};
		if (hm2_fault_watch_step(watch, port->image.cs[channel] & ~HM2_SSERIAL_CS_REMOTE_FAULT_MASK, 0, 0))
			put(port, channel, 0);
	}
}

void hm2_sserial_watch(struct hm2_sserial *port, uint32_t channel, uint32_t input_register, uint32_t mask)
{
	if (channel >= CHANNELS || input_register >= DATA_REGISTERS)
		return;
	port->channels[channel].watch_register = input_register;
	port->channels[channel].watch_mask = mask;
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
