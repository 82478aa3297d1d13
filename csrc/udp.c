/* The bus to an Ethernet card: LBP16 in UDP datagrams. Fact sheet lbp16.md 1-3, 8. */
#include "clock.h"
#include "error.h"
#include "udp.h"

#include <stdlib.h>
#include <string.h>
#include <sys/random.h>

void hm2_udp_defaults(hm2_udp_config *config)
{
	*config = (hm2_udp_config){
		.spin_ns = 30000, /* measured: covers the answer of an idle link, see performance.md 3 */
		.retry_ns = HM2_UDP_RETRY_NS,
		.error_increment = 2,
		.error_decrement = 1,
		.error_limit = 10,
	};
}

static int given_up(const struct hm2_udp *udp, hm2_error *error)
{
	const int status = hm2_error_set(error, HM2_ERR_LINK, "udp link");

	if (error) {
		error->expected = (uint32_t)udp->config.error_limit;
		error->received = (uint32_t)udp->counters.error_level;
	}
	return status;
}

static int succeeded(struct hm2_udp *udp)
{
	hm2_udp_counters *counters = &udp->counters;

	counters->exchanges++;
	counters->error_level -= udp->config.error_decrement;
	if (counters->error_level < 0)
		counters->error_level = 0;
	return HM2_OK;
}

/* A failed exchange: what was in it stays as evidence unless it was the last straw. */
static int failed(struct hm2_udp *udp, int status, hm2_error *error)
{
	hm2_udp_counters *counters = &udp->counters;

	counters->missed += (uint64_t)udp->unanswered;
	udp->sent = udp->unanswered = 0;
	udp->raw = NULL;
	counters->error_level += udp->config.error_increment;
	if (udp->config.error_limit <= 0 || counters->error_level < udp->config.error_limit)
		return status;
	counters->error_level = udp->config.error_limit;
	counters->failed = 1;
	return given_up(udp, error);
}

static int udp_begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	struct hm2_udp *udp = self;
	int status;

	if (udp->counters.failed)
		return given_up(udp, error);
	udp->raw = NULL;
	udp->list = (struct udp_list){.transfers = transfers, .count = count};
	status = udp_send_window(udp, error);
	return status == HM2_OK ? status : failed(udp, status, error);
}

static int udp_finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	struct hm2_udp *udp = self;
	int status = udp_await(udp, deadline_ns, error);

	while (status == HM2_OK && udp->list.at.transfer < udp->list.count) {
		status = udp_send_window(udp, error);
		if (status == HM2_OK)
			status = udp_await(udp, deadline_ns, error);
	}
	return status == HM2_OK ? succeeded(udp) : failed(udp, status, error);
}

static int64_t udp_now_ns(void *self)
{
	struct hm2_udp *udp = self;

	return udp->carrier.now_ns(udp->carrier.self);
}

static void udp_pause_ns(void *self, int64_t ns)
{
	struct hm2_udp *udp = self;

	udp->carrier.pause_ns(udp->carrier.self, ns);
}

static uint64_t udp_disturbances(void *self)
{
	const struct hm2_udp *udp = self;

	return __atomic_load_n(&udp->disturbances, __ATOMIC_RELAXED);
}

static void udp_close(void *self)
{
	struct hm2_udp *udp = self;

	udp->carrier.close(udp->carrier.self);
	free(udp);
}

/* Numbers start anywhere, so that what an earlier program left in the card is not taken for ours. */
static void draw_numbers(struct hm2_udp *udp)
{
	uint32_t numbers[2];

	if (getrandom(numbers, sizeof numbers, GRND_NONBLOCK) != (ssize_t)sizeof numbers) {
		numbers[0] = (uint32_t)hm2_clock_now_ns();
		numbers[1] = ~numbers[0];
	}
	udp->sequence = numbers[0];
	udp->probe = numbers[1];
}

int hm2_udp_carrier_bus(const hm2_carrier *carrier, const hm2_udp_config *config, hm2_bus *bus,
                        struct hm2_udp **udp, hm2_error *error)
{
	struct hm2_udp *self = calloc(1, sizeof *self);

	if (!self)
		return hm2_error_set(error, HM2_ERR_NO_MEMORY, "udp");
	if (config)
		self->config = *config;
	else
		hm2_udp_defaults(&self->config);
	self->carrier = *carrier;
	draw_numbers(self);
	*bus = (hm2_bus){self, udp_begin, udp_finish, udp_now_ns, udp_pause_ns, udp_close,
	                 udp_disturbances};
	*udp = self;
	return HM2_OK;
}

void hm2_udp_get_counters(const struct hm2_udp *udp, hm2_udp_counters *counters)
{
	*counters = udp->counters;
}

void hm2_udp_clear(struct hm2_udp *udp)
{
	udp->counters.error_level = 0;
	udp->counters.failed = 0;
	udp->synchronized = 0;
}

void hm2_udp_give_up(struct hm2_udp *udp)
{
	udp->counters.failed = 1;
}

int hm2_udp_lbp16(struct hm2_udp *udp, const uint8_t *commands, size_t length, uint8_t *reply, size_t reply_size,
                  int64_t deadline_ns, hm2_error *error)
{
	struct udp_datagram *datagram = &udp->window[0];
	int status;

	udp->compiled.count = 0; /* its datagram is overwritten */
	status = udp_datagram_raw(datagram, commands, length, reply_size);
	if (status != HM2_OK)
		return hm2_error_set(error, status, "udp lbp16");
	if (udp->counters.failed)
		return given_up(udp, error);
	udp->list = (struct udp_list){0};
	udp->sent = udp->unanswered = 1;
	udp->probe_pending = udp->probes = 0;
	udp->raw = reply;
	datagram->first = udp->sequence + 1;
	status = udp_send_datagram(udp, datagram, error);
	if (status == HM2_OK)
		status = udp_await(udp, deadline_ns, error);
	if (status != HM2_OK)
		return failed(udp, status, error);
	udp->raw = NULL;
	return succeeded(udp);
}

int hm2_udp_send(struct hm2_udp *udp, const uint8_t *bytes, size_t length, hm2_error *error)
{
	return udp_send_bytes(udp, bytes, length, error);
}
