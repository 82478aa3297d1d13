/* Resolvers: turns extended to 64 bits, and an index where the angle passes zero. */
#include "hm2.h"

#define TURN (INT64_C(1) << 32)

/* Rounded down, also below zero. */
static int64_t floored(int64_t value, int64_t step)
{
	return value / step - (value % step < 0);
}

void hm2_resolver_update(hm2_resolver *resolver, uint32_t position)
{
	const int64_t before = resolver->turns;
	if (resolver->valid)
		resolver->turns += (int32_t)(position - resolver->last);
	else
		resolver->turns = position;
	resolver->last = position;
	const int64_t step = TURN * resolver->index_divisor;
	const int64_t from = floored(before, step);
	const int64_t to = floored(resolver->turns, step);
	if (resolver->valid && resolver->index_enable && from != to) {
		/* going down the index is the lower end of the turn that was left */
		resolver->zero = (to > from ? to : from) * step;
		resolver->index_enable = 0;
	}
	resolver->valid = 1;
}

static hm2_transfer burst(uint32_t address, uint32_t count, uint32_t *words)
{
	const hm2_transfer transfer = {address, (uint16_t)count, HM2_TRANSFER_READ, words};
	return transfer;
}

static size_t resolvers_reads(void *self, hm2_transfer *transfers, size_t capacity)
{
	const hm2_resolvers *all = self;
	if (capacity >= 3) {
		transfers[0] = burst(all->status_address, 1, all->words);
		transfers[1] = burst(all->velocity_address, all->count, all->words + 1);
		transfers[2] = burst(all->position_address, all->count, all->words + 1 + all->count);
	}
	return 3;
}

static void resolvers_process(void *self, int64_t now_ns)
{
	const hm2_resolvers *all = self;
	(void)now_ns;
	for (uint32_t i = 0; i < all->count; i++)
		hm2_resolver_update(&all->resolvers[i], all->words[1 + all->count + i]);
}

void hm2_resolvers_part(hm2_resolvers *resolvers, hm2_cyclic *part)
{
	part->self = resolvers;
	part->reads = resolvers_reads;
	part->writes = NULL;
	part->process = resolvers_process;
}
