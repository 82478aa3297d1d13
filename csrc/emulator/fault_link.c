/* Datagrams between a driver and an emulated card in the same process, counted, on the card's virtual clock, and
 * lost, late, doubled or damaged as a plan says. */
#include "fault.h"

#include <errno.h>
#include <stdlib.h>
#include <string.h>

#define WAITING 64

struct packet {
	int64_t due_ns;
	uint64_t order; /* of equal due times the older goes first */
	int used, to_card;
	size_t length;
	uint8_t bytes[HM2_LBP16_MAX_PAYLOAD];
};

struct hm2_fault_link {
	struct hm2_ethernet *ethernet;
	hm2_bus card; /* its clock */
	int64_t latency_ns;
	struct fault_plan plan;
	uint64_t limit;
	uint64_t order;
	struct packet packets[WAITING];
};

static int64_t now_ns(const struct hm2_fault_link *link)
{
	return link->card.now_ns(link->card.self);
}

/* With no room left it is lost, as on a network. */
static void enqueue(struct hm2_fault_link *link, int to_card, const uint8_t *bytes, size_t length, int64_t late_ns)
{
	for (int i = 0; i < WAITING; i++) {
		struct packet *packet = &link->packets[i];

		if (packet->used)
			continue;
		packet->used = 1;
		packet->due_ns = now_ns(link) + link->latency_ns + late_ns;
		packet->order = link->order++;
		packet->to_card = to_card;
		packet->length = length < sizeof packet->bytes ? length : sizeof packet->bytes;
		memcpy(packet->bytes, bytes, packet->length);
		return;
	}
}

static size_t damage(const hm2_fault *fault, uint8_t *bytes, size_t length, size_t capacity)
{
	const size_t value = (size_t)fault->value;

	switch (fault->kind) {
	case HM2_FAULT_CORRUPT:
		if (value >= 1 && value <= length)
			bytes[length - value] ^= 0x55;
		return length;
	case HM2_FAULT_SHORT: return value < length ? length - value : 0;
	case HM2_FAULT_LONG:
		for (size_t i = 0; i < value && length < capacity; i++)
			bytes[length++] = 0;
		return length;
	default: return length;
	}
}

/* A datagram enters the link: one step. */
static void put(struct hm2_fault_link *link, int to_card, const uint8_t *bytes, size_t length)
{
	uint8_t copy[HM2_LBP16_MAX_PAYLOAD];
	const hm2_fault *fault = fault_step(&link->plan);
	const int kind = fault ? fault->kind : HM2_FAULT_NONE;

	if (kind == HM2_FAULT_LOST || (link->limit && link->plan.steps > link->limit))
		return;
	memcpy(copy, bytes, length);
	if (fault)
		length = damage(fault, copy, length, sizeof copy);
	enqueue(link, to_card, copy, length, kind == HM2_FAULT_LATE ? fault->value : 0);
	if (kind == HM2_FAULT_TWICE)
		enqueue(link, to_card, copy, length, fault->value);
}

static struct packet *first(struct hm2_fault_link *link, int to_card)
{
	struct packet *found = NULL;

	for (int i = 0; i < WAITING; i++) {
		struct packet *packet = &link->packets[i];

		if (packet->used && packet->to_card == to_card &&
		    (!found || packet->due_ns < found->due_ns ||
		     (packet->due_ns == found->due_ns && packet->order < found->order)))
			found = packet;
	}
	return found;
}

static void advance_to(struct hm2_fault_link *link, int64_t time_ns)
{
	const int64_t left = time_ns - now_ns(link);

	if (left > 0)
		link->card.pause_ns(link->card.self, left);
}

static void arrive(struct hm2_fault_link *link, struct packet *packet)
{
	uint8_t reply[HM2_LBP16_MAX_PAYLOAD];

	advance_to(link, packet->due_ns);
	packet->used = 0;
	const size_t length = hm2_ethernet_process(link->ethernet, packet->bytes, packet->length, reply);
	if (length)
		put(link, 0, reply, length);
}

/* Until that time, or until a reply is there if `stop` says so. */
static void progress(struct hm2_fault_link *link, int64_t until_ns, int stop)
{
	for (;;) {
		struct packet *request = first(link, 1);
		const struct packet *reply = first(link, 0);

		if (stop && reply && reply->due_ns <= until_ns && (!request || reply->due_ns <= request->due_ns)) {
			advance_to(link, reply->due_ns);
			return;
		}
		if (!request || request->due_ns > until_ns)
			break;
		arrive(link, request);
	}
	advance_to(link, until_ns);
}

static int link_send(void *self, const uint8_t *bytes, size_t length)
{
	if (length > HM2_LBP16_MAX_PAYLOAD)
		return -EMSGSIZE;
	put(self, 1, bytes, length);
	return 0;
}

static int link_receive(void *self, uint8_t *bytes, size_t capacity)
{
	struct hm2_fault_link *link = self;
	struct packet *packet;

	progress(link, now_ns(link), 0);
	packet = first(link, 0);
	if (!packet || packet->due_ns > now_ns(link))
		return -EAGAIN;
	packet->used = 0;
	const size_t length = packet->length < capacity ? packet->length : capacity;
	memcpy(bytes, packet->bytes, length);
	return (int)length;
}

static void link_wait(void *self, int64_t ns)
{
	struct hm2_fault_link *link = self;

	progress(link, now_ns(link) + ns, 1);
}

static int64_t link_now_ns(void *self)
{
	return now_ns(self);
}

static void link_pause_ns(void *self, int64_t ns)
{
	struct hm2_fault_link *link = self;

	if (ns > 0)
		progress(link, now_ns(link) + ns, 0);
}

static void link_close(void *self)
{
	(void)self; /* it belongs to whoever made it */
}

struct hm2_fault_link *hm2_fault_link_new(struct hm2_ethernet *ethernet, const hm2_bus *card, int64_t latency_ns,
                                          hm2_carrier *carrier)
{
	struct hm2_fault_link *self = calloc(1, sizeof *self);

	if (!self)
		return NULL;
	self->ethernet = ethernet;
	self->card = *card;
	self->latency_ns = latency_ns;
	*carrier = (hm2_carrier){self, link_send, link_receive, link_wait, link_now_ns, link_pause_ns, link_close};
	return self;
}

void hm2_fault_link_free(struct hm2_fault_link *link)
{
	free(link);
}

void hm2_fault_link_set(struct hm2_fault_link *link, const hm2_fault *faults, size_t count, uint64_t limit)
{
	fault_plan_set(&link->plan, faults, count);
	link->limit = limit;
}

uint64_t hm2_fault_link_steps(const struct hm2_fault_link *link, uint64_t *fired)
{
	if (fired)
		*fired = link->plan.fired;
	return link->plan.steps;
}
