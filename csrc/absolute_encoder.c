/* Absolute encoders: readings taken only when they are new and whole, positions extended over their wrap. */
#include "hm2.h"

static uint64_t run(uint64_t data, uint32_t shift, uint32_t bits)
{
	if (shift > 63)
		return 0;
	return (data >> shift) & (bits > 63 ? UINT64_MAX : (UINT64_C(1) << bits) - 1);
}

static uint64_t position_of(const hm2_absolute *channel)
{
	uint64_t position = run(channel->data, channel->low_shift, channel->low_bits);
	if (channel->high_bits)
		position |= run(channel->data, channel->high_shift, channel->high_bits) << channel->low_bits;
	for (uint32_t s = 1; channel->gray && s < 64; s *= 2)
		position ^= position >> s;
	return position;
}

/* The shorter way round, as a signed number of `bits` bits. */
static int64_t step(uint64_t from, uint64_t to, uint32_t bits)
{
	const uint32_t unused = 64 - bits;
	return (int64_t)((to - from) << unused) >> unused;
}

void hm2_absolute_update(hm2_absolute *channel, uint64_t data)
{
	const uint32_t bits = channel->low_bits + channel->high_bits;
	channel->data = run(data, 0, channel->bits);
	if (bits >= 1 && bits <= 64) {
		const uint64_t position = position_of(channel);
		if (channel->valid)
			channel->count += step(channel->last, position, bits);
		else
			channel->count = (int64_t)position;
		channel->last = position;
	}
	channel->valid = 1;
}

static hm2_transfer burst(uint32_t address, uint32_t count, uint16_t flags, uint32_t *words)
{
	const hm2_transfer transfer = {address, (uint16_t)count, flags, words};
	return transfer;
}

/* High words first: reading the low ones tells the hardware that the data has been taken. */
static size_t absolutes_reads(void *self, hm2_transfer *transfers, size_t capacity)
{
	const hm2_absolutes *all = self;
	const uint32_t n = all->count;
	uint32_t *words = all->words;
	if (capacity >= 4) {
		transfers[0] = burst(all->busy_address, 1, HM2_TRANSFER_READ, words);
		transfers[1] = burst(all->control_address, n, HM2_TRANSFER_READ, words + 1);
		transfers[2] = burst(all->high_address, n, HM2_TRANSFER_READ, words + 1 + n);
		transfers[3] = burst(all->low_address, n, HM2_TRANSFER_READ, words + 1 + 2 * n);
	}
	return 4;
}

static size_t absolutes_writes(void *self, hm2_transfer *transfers, size_t capacity)
{
	const hm2_absolutes *all = self;
	if (!all->start)
		return 0;
	all->words[1 + 3 * all->count] = UINT32_MAX;
	if (capacity)
		transfers[0] = burst(all->busy_address, 1, HM2_TRANSFER_WRITE, all->words + 1 + 3 * all->count);
	return 1;
}

static void absolutes_process(void *self, int64_t now_ns)
{
	const hm2_absolutes *all = self;
	const uint32_t n = all->count;
	(void)now_ns;
	for (uint32_t i = 0; i < n; i++) {
		hm2_absolute *channel = &all->channels[i];
		const uint32_t control = all->words[1 + i];
		const int busy = ((all->words[0] >> i) & 1) != 0 || (control & all->control_busy_mask) != 0;
		channel->fresh = channel->bits != 0 && !busy && (control & all->control_available_mask) != 0;
		channel->missed = channel->fresh ? 0 : channel->missed + 1;
		if (channel->fresh)
			hm2_absolute_update(channel, (uint64_t)all->words[1 + n + i] << 32 | all->words[1 + 2 * n + i]);
	}
}

void hm2_absolutes_part(hm2_absolutes *absolutes, hm2_cyclic *part)
{
	part->self = absolutes;
	part->reads = absolutes_reads;
	part->writes = absolutes_writes;
	part->process = absolutes_process;
}
