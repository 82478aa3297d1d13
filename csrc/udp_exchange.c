/* Sending and waiting. */
#include "error.h"
#include "udp.h"

#include <errno.h>

static int io_error(hm2_error *error, const char *where, int code)
{
	const int status = hm2_error_set(error, HM2_ERR_IO, where);

	if (error)
		error->os_errno = code;
	return status;
}

int udp_send_bytes(struct hm2_udp *udp, const uint8_t *bytes, size_t length, hm2_error *error)
{
	const int code = udp->carrier.send(udp->carrier.self, bytes, length);

	if (code)
		return io_error(error, "udp send", -code);
	udp->counters.requests++;
	return HM2_OK;
}

int udp_send_datagram(struct hm2_udp *udp, struct udp_datagram *datagram, hm2_error *error)
{
	const uint64_t bit = (uint64_t)1 << (++udp->sequence & 63);

	udp_datagram_number(datagram, udp->sequence);
	udp->wrote = datagram->writes ? udp->wrote | bit : udp->wrote & ~bit;
	return udp_send_bytes(udp, datagram->bytes, datagram->length, error);
}

static int send_compiled(struct hm2_udp *udp, hm2_error *error)
{
	struct udp_datagram *datagram = &udp->window[0];

	udp_compiled_refill(&udp->compiled, datagram);
	udp->list.at = udp->compiled.end;
	udp->sent = udp->unanswered = 1;
	datagram->first = udp->sequence + 1;
	return udp_send_datagram(udp, datagram, error);
}

int udp_send_window(struct hm2_udp *udp, hm2_error *error)
{
	int status = HM2_OK;

	udp->sent = udp->unanswered = 0;
	udp->probe_pending = udp->probes = 0;
	if (udp->list.at.transfer == 0 && udp->list.at.word == 0 && udp_compiled_same(&udp->compiled, &udp->list))
		return send_compiled(udp, error);
	udp->compiled.count = 0;
	while (status == HM2_OK && udp->sent < UDP_WINDOW && udp->list.at.transfer < udp->list.count) {
		struct udp_datagram *datagram = &udp->window[udp->sent++];

		udp->unanswered++;
		udp_datagram_pack(datagram, &udp->list);
		datagram->first = udp->sequence + 1;
		status = udp_send_datagram(udp, datagram, error);
	}
	if (udp->sent == 1)
		udp_compile(&udp->compiled, &udp->window[0], &udp->list);
	return status;
}

static int timed_out(const struct hm2_udp *udp, hm2_error *error)
{
	const int status = hm2_error_set(error, HM2_ERR_TIMEOUT, "udp reply");

	if (error) {
		error->expected = (uint32_t)udp->sent;
		error->received = (uint32_t)(udp->sent - udp->unanswered);
	}
	return status;
}

/* One datagram, if there is one: 1. 0: none. Negative: the system says the card is not there. */
static int receive_one(struct hm2_udp *udp, hm2_error *error)
{
	const int length = udp->carrier.receive(udp->carrier.self, udp->reply, sizeof udp->reply);

	if (length >= 0) {
		if (udp_receive(udp, udp->reply, (size_t)length)) {
			const int status = udp_retry_answered(udp, error);

			return status == HM2_OK ? 1 : status;
		}
		return 1;
	}
	return length == -EAGAIN ? 0 : io_error(error, "udp receive", -length);
}

int udp_await(struct hm2_udp *udp, int64_t deadline_ns, hm2_error *error)
{
	const hm2_carrier *carrier = &udp->carrier;
	const int64_t start = carrier->now_ns(carrier->self);
	const int64_t retry_ns = udp->config.retry_ns > 0 ? udp->config.retry_ns : INT64_MAX - start;
	int64_t retry_at = start + retry_ns;

	while (udp->unanswered) {
		const int got = receive_one(udp, error);
		int64_t now;

		if (got < 0)
			return got;
		if (!udp->unanswered)
			break;
		now = carrier->now_ns(carrier->self);
		if (now >= deadline_ns)
			return timed_out(udp, error);
		if (now >= retry_at) {
			const int status = udp_retry(udp, error);

			if (status != HM2_OK)
				return status;
			retry_at = now + retry_ns;
		}
		if (!got && now - start >= udp->config.spin_ns)
			carrier->wait(carrier->self, (deadline_ns < retry_at ? deadline_ns : retry_at) - now);
	}
	return HM2_OK;
}
