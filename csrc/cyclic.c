/* Participants of a cycle: plain words, and the encoders of a module. */
#include "cycle.h"

size_t cyclic_words_list(void *self, hm2_transfer *transfers, size_t capacity)
{
	const hm2_cyclic_words *words = self;
	if (!words->enabled)
		return 0;
	if (capacity)
		transfers[0] = words->transfer;
	return 1;
}

void hm2_cyclic_words_part(hm2_cyclic_words *words, hm2_cyclic *part)
{
	const int writes = words->transfer.flags & HM2_TRANSFER_WRITE;
	part->self = words;
	part->reads = writes ? NULL : cyclic_words_list;
	part->writes = writes ? cyclic_words_list : NULL;
	part->process = NULL;
}

static hm2_transfer burst(uint32_t address, uint32_t count, uint32_t *words)
{
	const hm2_transfer transfer = {address, (uint16_t)count, HM2_TRANSFER_READ, words};
	return transfer;
}

/* TSCount first: it is the "now" of the stamps that come with the counts. */
static size_t encoders_reads(void *self, hm2_transfer *transfers, size_t capacity)
{
	const hm2_encoders *encoders = self;
	if (capacity >= 3) {
		transfers[0] = burst(encoders->timestamp_address, 1, encoders->words);
		transfers[1] = burst(encoders->count_address, encoders->count, encoders->words + 1);
		transfers[2] = burst(encoders->control_address, encoders->count,
		                     encoders->words + 1 + encoders->count);
	}
	return 3;
}

static size_t encoders_writes(void *self, hm2_transfer *transfers, size_t capacity)
{
	hm2_encoders *encoders = self;
	size_t wanted = 0, listed = 0;
	for (uint32_t i = 0; i < encoders->count; i++)
		wanted += encoders->encoders[i].write_control != 0;
	for (uint32_t i = 0; i < encoders->count && wanted <= capacity; i++) {
		hm2_encoder *encoder = &encoders->encoders[i];
		if (!encoder->write_control)
			continue;
		transfers[listed] = burst(encoders->control_address + i * encoders->instance_stride, 1,
		                          &encoder->control_word);
		transfers[listed++].flags = HM2_TRANSFER_WRITE;
		/* not again before a reply: behind an index nobody has seen yet it would arm for the next one */
		encoder->write_control = 0;
	}
	return wanted;
}

static void encoders_process(void *self, int64_t now_ns)
{
	hm2_encoders *encoders = self;
	hm2_timebase_update(&encoders->timebase, encoders->words[0], now_ns);
	for (uint32_t i = 0; i < encoders->count; i++)
		hm2_encoder_update(&encoders->encoders[i], &encoders->timebase, encoders->words[1 + i],
		                   encoders->words[1 + encoders->count + i]);
}

void hm2_encoders_part(hm2_encoders *encoders, hm2_cyclic *part)
{
	part->self = encoders;
	part->reads = encoders_reads;
	part->writes = encoders_writes;
	part->process = encoders_process;
}
