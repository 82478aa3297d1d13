/* A port lent for a moment, for what a cycle does not do: reading the firmware's counters, say. */
#include "engine.h"

static void hold(struct engine_port *port)
{
	if (port->held)
		return;
	port->held = 1;
	port->cyclic = port->port->cyclic;
	hm2_sserial_set_cyclic(port->port, 0);
}

static void go_on(struct engine_port *port)
{
	if (!port->held)
		return;
	port->held = 0;
	hm2_sserial_set_cyclic(port->port, port->cyclic);
}

/* Behind a good cycle. The results of the last DOIT are the cycle's to take: with one on its way nothing is lent. */
void engine_lend(struct engine_port *port)
{
	int wanted = atomic_load(&port->wanted);
	if (wanted != WANTED) {
		go_on(port);
		return;
	}
	hold(port);
	if (port->port->flying)
		return;
	if (!atomic_compare_exchange_strong(&port->wanted, &wanted, GRANTED))
		return; /* taken back meanwhile */
	go_on(port);
	hm2_sserial_set_use(port->port, HM2_SSERIAL_USE_OTHERS);
	atomic_store_explicit(&port->state, HM2_PORT_LENT, memory_order_release);
}

void engine_lend_no_more(struct engine_port *port)
{
	atomic_store(&port->wanted, NOT_WANTED);
	go_on(port);
}

static int is_lent(struct engine_port *port)
{
	if (atomic_load_explicit(&port->state, memory_order_acquire) != HM2_PORT_LENT)
		return 0;
	atomic_store(&port->wanted, NOT_WANTED); /* the engine looks again when the port is back */
	return 1;
}

int hm2_engine_lend_port(struct hm2_engine *engine, uint32_t number, int wanted)
{
	if (number >= engine->port_count)
		return 0;
	struct engine_port *port = &engine->ports[number];
	int before = wanted ? NOT_WANTED : WANTED;
	atomic_compare_exchange_strong(&port->wanted, &before, wanted ? WANTED : NOT_WANTED);
	while (!wanted && before == GRANTED && !is_lent(port))
		; /* about to be lent */
	return is_lent(port);
}
