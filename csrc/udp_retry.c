/* Asking again without doing anything twice.
 *
 * Reads are simply asked for again, under a new number. What holds a write is first asked about: the
 * card's scratch word tells whether it was carried out. If it was, only its reads are asked for again; if
 * it was not, it is sent again. "Not carried out" must be heard twice: a network that lets a datagram
 * overtake another would deliver the first one in between. */
#include "udp.h"

static int plain_reads(const struct hm2_udp *udp)
{
	for (int i = 0; i < udp->sent; i++) {
		const struct udp_datagram *datagram = &udp->window[i];

		if (!datagram->answered && (datagram->writes || datagram->once))
			return 0;
	}
	return 1;
}

static int resend(struct hm2_udp *udp, struct udp_datagram *datagram, hm2_error *error)
{
	udp->counters.retries++;
	return udp_send_datagram(udp, datagram, error);
}

static int resend_all(struct hm2_udp *udp, hm2_error *error)
{
	int status = HM2_OK;

	for (int i = 0; i < udp->sent && status == HM2_OK; i++) {
		if (!udp->window[i].answered)
			status = resend(udp, &udp->window[i], error);
	}
	return status;
}

static int ask(struct hm2_udp *udp, hm2_error *error)
{
	uint8_t bytes[32];
	const size_t length = udp_probe(bytes, sizeof bytes, ++udp->probe);

	udp->probe_pending = 1;
	return udp_send_bytes(udp, bytes, length, error);
}

/* The one datagram that a probe can tell about: the newest, all others answered. */
static struct udp_datagram *newest(struct hm2_udp *udp)
{
	struct udp_datagram *last = &udp->window[udp->sent - 1];

	return udp->unanswered == 1 && !last->answered ? last : NULL;
}

int udp_retry(struct hm2_udp *udp, hm2_error *error)
{
	if (plain_reads(udp))
		return resend_all(udp, error);
	/* a caller's own commands may reset the card or move its pointers: theirs to repeat */
	if (udp->raw || !newest(udp))
		return HM2_OK;
	return ask(udp, error);
}

int udp_retry_answered(struct hm2_udp *udp, hm2_error *error)
{
	struct udp_datagram *datagram = &udp->window[udp->sent - 1]; /* it was asked about, and is unanswered still */

	if (udp->probe_answer == datagram->sequence) {
		if (datagram->once)
			return HM2_OK; /* a FIFO has given its words: they are gone, the deadline says so */
		udp_datagram_strip(datagram);
		udp->compiled.count = 0; /* it was this datagram */
		udp->probes = 0;
		return resend(udp, datagram, error);
	}
	if (datagram->sequence - udp->probe_answer >= UDP_RECENT)
		return HM2_OK; /* another program's number, or a restarted engine: nothing can be told */
	if (++udp->probes < 2)
		return ask(udp, error);
	udp->probes = 0;
	return resend(udp, datagram, error);
}
