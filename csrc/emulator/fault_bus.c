/* A bus between a driver and a card on which every word that is moved is counted, and may go wrong. */
#include "fault.h"

#include <stdlib.h>
#include <string.h>

struct hm2_fault_bus {
	hm2_bus inner;
	struct fault_plan plan;
	uint64_t limit;       /* of steps: beyond it the bus is dead */
	int outcome;          /* what finish will say: a status, 1: carried out but the answer is lost */
	hm2_mailbox mailbox;
	uint32_t stuck_word;  /* what the stuck command register shows; 0: it is not stuck */
	int stuck_release;    /* enum hm2_stuck_until */
	uint32_t last_command;
};

enum { ANSWER_LOST = 1 };

static int fail(hm2_error *error, int status, uint32_t address)
{
	if (error) {
		memset(error, 0, sizeof *error);
		error->status = status;
		error->index = -1;
		error->address = address;
		strncpy(error->where, "fault bus", sizeof error->where - 1);
	}
	return status;
}

static int pass(struct hm2_fault_bus *bus, uint32_t address, int flags, uint32_t *word, hm2_error *error)
{
	const hm2_transfer transfer = {address, 1, (uint16_t)(flags & HM2_TRANSFER_WRITE), word};
	const int status = bus->inner.begin(bus->inner.self, &transfer, 1, error);

	return status == HM2_OK ? bus->inner.finish(bus->inner.self, INT64_MAX, error) : status;
}

static int releases(const struct hm2_fault_bus *bus, uint32_t word)
{
	if (bus->stuck_release == HM2_STUCK_FOR_GOOD)
		return 0;
	return word & bus->mailbox.reset_mask ||
	       (bus->stuck_release == HM2_STUCK_UNTIL_UNJAM && word == bus->mailbox.unjam);
}

/* The command register as a firmware that hangs leaves it. 1: the access has been dealt with. */
static int stuck(struct hm2_fault_bus *bus, uint32_t address, int write, uint32_t *word)
{
	if (!bus->stuck_word || address != bus->mailbox.command)
		return 0;
	if (!write) {
		*word = bus->stuck_word;
		return 1;
	}
	if (*word & bus->mailbox.ignore_mask)
		return 1;
	if (releases(bus, *word)) {
		bus->stuck_word = 0;
		return 0;
	}
	if (*word)
		bus->stuck_word = *word;
	return 1;
}

static void note_command(struct hm2_fault_bus *bus, uint32_t address, int write, uint32_t word)
{
	if (write && address == bus->mailbox.command && word && !(word & bus->mailbox.ignore_mask))
		bus->last_command = word;
}

static int access(struct hm2_fault_bus *bus, uint32_t address, int flags, uint32_t *word, hm2_error *error)
{
	const int write = (flags & HM2_TRANSFER_WRITE) != 0;

	note_command(bus, address, write, *word);
	return stuck(bus, address, write, word) ? HM2_OK : pass(bus, address, flags, word, error);
}

static int corrupt(struct hm2_fault_bus *bus, const hm2_fault *fault, uint32_t address, int flags, uint32_t *word,
                   hm2_error *error)
{
	if (flags & HM2_TRANSFER_WRITE)
		return fail(error, HM2_ERR_PROTOCOL, address); /* parity: the card has not taken it */
	const int status = access(bus, address, flags, word, error);
	*word ^= (uint32_t)fault->value;
	return status;
}

/* One word of a list, with what is due at this step. */
static int one_word(struct hm2_fault_bus *bus, uint32_t address, int flags, uint32_t *word, hm2_error *error)
{
	const hm2_fault *fault = fault_step(&bus->plan);

	if (bus->limit && bus->plan.steps > bus->limit)
		return fail(error, HM2_ERR_IO, address);
	switch (fault ? fault->kind : HM2_FAULT_NONE) {
	case HM2_FAULT_LOST:
		bus->outcome = HM2_ERR_TIMEOUT;
		return HM2_ERR_TIMEOUT;
	case HM2_FAULT_ANSWER_LOST: bus->outcome = ANSWER_LOST; break;
	case HM2_FAULT_SHORT: bus->outcome = HM2_ERR_PROTOCOL; break;
	case HM2_FAULT_LATE: bus->inner.pause_ns(bus->inner.self, fault->value); break;
	case HM2_FAULT_TWICE: (void)access(bus, address, flags, word, error); break;
	case HM2_FAULT_CORRUPT: return corrupt(bus, fault, address, flags, word, error);
	case HM2_FAULT_STUCK:
		bus->stuck_word = bus->last_command ? bus->last_command : bus->mailbox.unjam;
		bus->stuck_release = (int)fault->value;
		break;
	default: break;
	}
	return access(bus, address, flags, word, error);
}

static int bus_begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	struct hm2_fault_bus *bus = self;

	bus->outcome = HM2_OK;
	for (size_t i = 0; i < count; i++) {
		const hm2_transfer *transfer = &transfers[i];
		const int same = (transfer->flags & HM2_TRANSFER_SAME_ADDRESS) != 0;

		for (uint32_t n = 0; n < transfer->count; n++) {
			const int status = one_word(bus, transfer->address + (same ? 0 : 4 * n), transfer->flags,
			                            transfer->words + n, error);

			if (bus->outcome == HM2_ERR_TIMEOUT)
				return HM2_OK; /* told by finish, when the time is over */
			if (status != HM2_OK)
				return status;
		}
	}
	return HM2_OK;
}

static int bus_finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	struct hm2_fault_bus *bus = self;
	const int outcome = bus->outcome;

	bus->outcome = HM2_OK;
	if (outcome == HM2_OK)
		return HM2_OK;
	if (outcome == HM2_ERR_PROTOCOL)
		return fail(error, HM2_ERR_PROTOCOL, 0);
	bus->inner.pause_ns(bus->inner.self, deadline_ns - bus->inner.now_ns(bus->inner.self));
	return fail(error, HM2_ERR_TIMEOUT, 0);
}

static int64_t bus_now_ns(void *self)
{
	const struct hm2_fault_bus *bus = self;

	return bus->inner.now_ns(bus->inner.self);
}

static void bus_pause_ns(void *self, int64_t ns)
{
	struct hm2_fault_bus *bus = self;

	bus->inner.pause_ns(bus->inner.self, ns);
}

static void bus_close(void *self)
{
	(void)self; /* both belong to whoever made them */
}

struct hm2_fault_bus *hm2_fault_bus_new(const hm2_bus *inner, const hm2_mailbox *mailbox, hm2_bus *bus)
{
	struct hm2_fault_bus *self = calloc(1, sizeof *self);

	if (!self)
		return NULL;
	self->inner = *inner;
	self->mailbox = *mailbox;
	*bus = (hm2_bus){self, bus_begin, bus_finish, bus_now_ns, bus_pause_ns, bus_close, NULL};
	return self;
}

void hm2_fault_bus_free(struct hm2_fault_bus *bus)
{
	free(bus);
}

void hm2_fault_bus_set(struct hm2_fault_bus *bus, const hm2_fault *faults, size_t count, uint64_t limit)
{
	fault_plan_set(&bus->plan, faults, count);
	bus->limit = limit;
	bus->stuck_word = 0;
	bus->outcome = HM2_OK;
}

uint64_t hm2_fault_bus_steps(const struct hm2_fault_bus *bus, uint64_t *fired)
{
	if (fired)
		*fired = bus->plan.fired;
	return bus->plan.steps;
}
