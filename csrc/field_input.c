/* Field inputs: the words of an exchange, and hand wheels' 8-bit counters extended to 64 bits. */
#include "hm2.h"

#define COUNTERS 4 /* of an instance */

void hm2_field_input_update(hm2_field_input *input)
{
	for (int k = 0; k < COUNTERS; k++) {
		const uint8_t now = (uint8_t)(input->mpg >> 8 * k);
		const uint8_t last = (uint8_t)(input->last_mpg >> 8 * k);
		if (input->valid)
			input->counts[k] += (int8_t)(uint8_t)(now - last);
	}
	input->last_mpg = input->mpg;
	input->valid = 1;
}

static hm2_transfer one(uint32_t address, uint32_t *word)
{
	const hm2_transfer transfer = {address, 1, HM2_TRANSFER_READ, word};
	return transfer;
}

static size_t reads(void *self, hm2_transfer *transfers, size_t capacity)
{
	const hm2_field_inputs *all = self;
	const size_t listed = 3 * (size_t)all->count;
	if (listed > capacity)
		return listed;
	for (uint32_t i = 0; i < all->count; i++) {
		hm2_field_input *input = &all->inputs[i];
		const uint32_t offset = i * all->instance_stride;
		*transfers++ = one(all->filtered_address + offset, &input->filtered);
		*transfers++ = one(all->raw_address + offset, &input->raw);
		*transfers++ = one(all->mpg_address + offset, &input->mpg);
	}
	return listed;
}

static void process(void *self, int64_t now_ns)
{
	const hm2_field_inputs *all = self;
	(void)now_ns;
	for (uint32_t i = 0; i < all->count; i++)
		hm2_field_input_update(&all->inputs[i]);
}

void hm2_field_inputs_part(hm2_field_inputs *inputs, hm2_cyclic *part)
{
	part->self = inputs;
	part->reads = reads;
	part->writes = NULL;
	part->process = process;
}
