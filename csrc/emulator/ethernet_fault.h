/* Loss, duplication, delay and reordering of datagrams, from a seeded generator. */
#ifndef HM2_EMULATOR_ETHERNET_FAULT_H
#define HM2_EMULATOR_ETHERNET_FAULT_H

#include <netinet/in.h>

#include "hm2.h"

#define FAULT_MAX_DATAGRAM 2048
#define FAULT_WAITING 64

typedef struct fault_datagram {
	struct sockaddr_in peer;
	size_t length;
	uint8_t bytes[FAULT_MAX_DATAGRAM];
} fault_datagram;

struct fault_entry {
	int64_t due_us;  /* INT64_MAX: free */
	uint64_t order;  /* of equal due times the older goes first */
	int held;        /* reordered: goes as soon as another has passed */
	fault_datagram datagram;
};

/* One direction. */
struct fault_line {
	hm2_ethernet_fault fault;
	uint64_t state; /* generator */
	uint64_t order;
	int waiting;
	int held;
	struct fault_entry entries[FAULT_WAITING];
	uint64_t lost, duplicated, reordered, overflows;
};

void fault_init(struct fault_line *line, uint64_t seed);
void fault_seed(struct fault_line *line, uint64_t seed);
int fault_active(const struct fault_line *line);
/* A datagram enters the line. */
void fault_put(struct fault_line *line, const fault_datagram *datagram, int64_t now_us);
/* The next one that is due, copied out and removed; 0 when there is none. */
int fault_take(struct fault_line *line, int64_t now_us, fault_datagram *datagram);
/* When the next one will be due; INT64_MAX: none waits. */
int64_t fault_due_us(const struct fault_line *line);

#endif
