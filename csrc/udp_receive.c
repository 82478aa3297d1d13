/* What a datagram that came in means: an answer, something stale, or news of what got lost. */
#include "udp.h"

static uint64_t bit(uint32_t sequence)
{
	return (uint64_t)1 << (sequence & 63);
}

/* Sent again under a newer number: nothing is in doubt. */
static int superseded(const struct hm2_udp *udp, uint32_t sequence)
{
	for (int i = 0; i < udp->sent; i++) {
		const struct udp_datagram *datagram = &udp->window[i];

		if (sequence - datagram->first < datagram->sequence - datagram->first)
			return 1;
	}
	return 0;
}

/* The requests (after, until] were never carried out; none of them is answered, `after` is not before the last that is. */
static void count_lost(struct hm2_udp *udp, uint32_t after, uint32_t until)
{
	int writes = 0;

	for (uint32_t sequence = after + 1; sequence != until + 1; sequence++) {
		udp->counters.requests_lost++;
		if (!superseded(udp, sequence))
			writes |= until - sequence > 63 || (udp->wrote & bit(sequence)) != 0;
	}
	udp->counters.writes_lost += (uint64_t)writes;
}

/* Others ask for it meanwhile. */
static void disturb(struct hm2_udp *udp)
{
	__atomic_fetch_add(&udp->disturbances, 1, __ATOMIC_RELAXED);
}

/* The card came to a request of `sequence` when it had carried it out, or a newer one, already. */
static int is_again(const struct hm2_udp *udp, uint32_t sequence, uint32_t before)
{
	return udp->synchronized && udp->sequence - before < UDP_RECENT && before - sequence < UDP_RECENT;
}

/* Right behind itself a request that only reads disturbs nothing. */
static void count_again(struct hm2_udp *udp, uint32_t sequence, uint32_t before)
{
	udp->counters.repeated++;
	if (before != sequence || udp->sequence - sequence > 63 || udp->wrote & bit(sequence))
		disturb(udp);
}

/* Its writes undid newer ones. */
static void count_old(struct hm2_udp *udp, uint32_t old, uint32_t age)
{
	udp->counters.out_of_order++;
	disturb(udp);
	if (age >= 63 || udp->wrote & bit(old))
		udp->counters.writes_lost++;
}

/* `before` is the number the card held when it came to this datagram. */
static void judge(struct hm2_udp *udp, const struct udp_datagram *datagram, uint32_t before)
{
	const uint32_t sequence = datagram->sequence;
	const uint32_t age = sequence - 1 - before;         /* 0: exactly as it should be */
	const uint32_t open = sequence - 1 - udp->confirmed; /* how many before it were in doubt */

	if (!udp->synchronized)
		return;
	if (before == sequence) {
		count_again(udp, sequence, before);
	} else if (age < sequence - datagram->first) {
		/* an earlier sending of it came after all */
		if (datagram->writes)
			count_again(udp, sequence, before);
	} else if (age == 0) {
		return;
	} else if (is_again(udp, sequence, before)) {
		count_old(udp, sequence, udp->sequence - sequence);
	} else if (age <= open && open < UDP_RECENT) {
		count_lost(udp, before, sequence - 1);
	} else if (age < UDP_RECENT) {
		count_old(udp, before, age);
	} else {
		udp->counters.foreign++;
	}
}

/* Only what was sent is ever confirmed, so newer is newer, however long nothing was. */
static void confirm(struct hm2_udp *udp, uint32_t sequence)
{
	if (!udp->synchronized || sequence - udp->confirmed < UINT32_C(1) << 31)
		udp->confirmed = sequence;
	udp->synchronized = 1;
}

static void take(struct hm2_udp *udp, struct udp_datagram *datagram, const uint8_t *reply)
{
	if (udp->raw) {
		for (size_t i = 0; i < datagram->reply_size - UDP_OVERHEAD; i++)
			udp->raw[i] = reply[4 + i];
	} else if (udp->compiled.count) {
		udp_compiled_unpack(&udp->compiled, reply);
	} else {
		udp_datagram_unpack(datagram, &udp->list, reply);
	}
	datagram->answered = 1;
	udp->unanswered--;
	udp->counters.replies++;
	judge(udp, datagram, udp_get32(reply));
	confirm(udp, datagram->sequence);
}

static int is_probe(const struct hm2_udp *udp, const uint8_t *reply, size_t length)
{
	return udp->probe_pending && length == UDP_PROBE_REPLY && udp_get32(reply + 4) == udp->probe;
}

int udp_receive(struct hm2_udp *udp, const uint8_t *reply, size_t length)
{
	uint32_t sequence;

	if (is_probe(udp, reply, length)) {
		udp->probe_answer = udp_get32(reply);
		udp->probe_pending = 0;
		return 1;
	}
	if (length < UDP_OVERHEAD || length > HM2_LBP16_MAX_PAYLOAD) {
		udp->counters.malformed++;
		return 0;
	}
	sequence = udp_get32(reply + length - 4);
	for (int i = 0; i < udp->sent; i++) {
		struct udp_datagram *datagram = &udp->window[i];

		if (datagram->sequence != sequence || datagram->answered)
			continue;
		if (datagram->reply_size == length)
			take(udp, datagram, reply);
		else
			udp->counters.malformed++;
		return 0;
	}
	udp->counters.discarded++;
	/* a reply that came twice tells of an older number; one to a request that was carried out twice does not */
	if (is_again(udp, sequence, udp_get32(reply)))
		count_again(udp, sequence, udp_get32(reply));
	return 0;
}
