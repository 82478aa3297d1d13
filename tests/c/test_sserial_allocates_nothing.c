/* A cycle of a port with eight channels and their process data allocates nothing, whatever happens in it. */
/* no sanitizers */
/* link: -Wl,--wrap=malloc -Wl,--wrap=calloc -Wl,--wrap=realloc */
#include "mailbox.h"

#include "counted_malloc.h"

static struct mailbox box;

int main(void)
{
	static double values[16];
	static uint64_t raw[16];
	static hm2_field fields[16];
	struct hm2_process_data *data = NULL;
	uint32_t requested = 0;
	mailbox_open(&box);
	hm2_sserial_image *image = hm2_sserial_get_image(box.port);
	const hm2_image in = {&image->inputs[0][0], 56, 8, 3, 7, 1};
	const hm2_image out = {&image->outputs[0][0], 56, 8, 3, 7, 1};
	for (int32_t i = 0; i < 16; i++)
		fields[i] = (hm2_field){.channel = i / 2, .kind = HM2_FIELD_SIGNED, .partner = -1, .bits = 13,
		                        .direction = i % 2 ? HM2_FIELD_OUTPUT : HM2_FIELD_INPUT,
		                        .scale = 10, .low = -10, .high = 10};
	CHECK_EQUAL(hm2_process_data_new(fields, 16, &in, &out, values, raw, &data, NULL), HM2_OK);
	hm2_sserial_set_process_data(box.port, data);
	CHECK_EQUAL(hm2_sserial_start(box.port, 0xFF, HM2_SSERIAL_NORMAL, &box.error), 0);
	CHECK(allocations > 0); /* the counter counts */
	allocations = 0;
	for (uint32_t cycle = 0; cycle < 1000; cycle++) {
		box.words[DATA / 4] = cycle % 7 ? 0 : cycle & 0xFF;
		box.words[CS / 4 + cycle % 8] = 0x00420000 | cycle << 24;
		box.words[USER0 / 4] = cycle;
		values[1] = 0.001 * cycle;
		CHECK(hm2_sserial_doit(box.port, cycle % 3 ? 0xFF : cycle & 0xFF, &box.error) >= 0);
		CHECK(hm2_sserial_cycle(box.port, 0xFF, &requested, &box.error) >= 0);
		box.now_ns += 1000000;
	}
	CHECK_EQUAL(allocations, 0);
	hm2_process_data_free(data);
	mailbox_free(&box);
	return CHECK_RESULT();
}
