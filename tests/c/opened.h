/* What reaches out of the process, opened and closed again at once; what opening said. */
#ifndef HM2_TEST_OPENED_H
#define HM2_TEST_OPENED_H

#include "hm2.h"

static inline int closed_again(int status, const hm2_bus *bus)
{
	if (status == HM2_OK)
		bus->close(bus->self);
	return status;
}

static inline int open_map(const char *path, hm2_error *error)
{
	hm2_bus bus;
	return closed_again(hm2_memory_map_bus(path, &bus, error), &bus);
}

static inline int open_udp(hm2_error *error)
{
	struct hm2_udp *udp = NULL;
	hm2_bus bus;
	return closed_again(hm2_udp_bus("127.0.0.1", 27181, NULL, &bus, &udp, error), &bus);
}

static inline int open_udp_floor(hm2_error *error)
{
	struct hm2_udp_floor *made = NULL;
	const int status = hm2_udp_floor_open(64, 0, 0, -1, &made, error);
	hm2_udp_floor_close(made);
	return status;
}

#endif
