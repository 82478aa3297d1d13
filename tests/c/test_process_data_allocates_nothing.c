/* A cycle of process data allocates nothing. */
/* no sanitizers */
/* link: -Wl,--wrap=malloc -Wl,--wrap=calloc -Wl,--wrap=realloc */
#include "check.h"
#include "counted_malloc.h"
#include "hm2.h"

static const int32_t KINDS[] = {HM2_FIELD_BITS,    HM2_FIELD_UNSIGNED, HM2_FIELD_SIGNED,    HM2_FIELD_STREAM,
                                HM2_FIELD_BOOLEAN, HM2_FIELD_ENCODER,  HM2_FIELD_FLOAT,     HM2_FIELD_ENCODER_H,
                                HM2_FIELD_ENCODER_L};
enum { KIND_COUNT = sizeof KINDS / sizeof KINDS[0], CHANNELS = 8 };

int main(void)
{
	static hm2_field fields[CHANNELS * KIND_COUNT * 2];
	static uint32_t inputs[CHANNELS * 9], outputs[CHANNELS * 9];
	static double values[CHANNELS * KIND_COUNT * 2];
	static uint64_t raw[CHANNELS * KIND_COUNT * 2];
	const hm2_image in = {inputs, CHANNELS * 9, CHANNELS, 9, 9, 1};
	const hm2_image out = {outputs, CHANNELS * 9, CHANNELS, 9, 1, CHANNELS};
	size_t count = 0;
	for (int32_t channel = 0; channel < CHANNELS; channel++)
		for (uint32_t i = 0; i < 2 * KIND_COUNT; i++) {
			fields[count] = (hm2_field){.channel = channel, .kind = KINDS[i / 2], .partner = -1, .bits = 32,
			                            .direction = i % 2 ? HM2_FIELD_OUTPUT : HM2_FIELD_INPUT,
			                            .offset = i / 2 * 32, .scale = 10, .low = -10, .high = 10};
			values[count++] = 0.25 * i;
		}
	struct hm2_process_data *data = NULL;
	CHECK_EQUAL(hm2_process_data_new(fields, count, &in, &out, values, raw, &data, NULL), HM2_OK);
	CHECK(allocations > 0); /* the counter counts */
	allocations = 0;
	for (uint32_t cycle = 0; cycle < 1000; cycle++) {
		for (size_t i = 0; i < sizeof inputs / sizeof inputs[0]; i++)
			inputs[i] = inputs[i] * 1664525u + 1013904223u + cycle;
		hm2_process_data_unpack(data);
		hm2_process_data_pack(data);
	}
	CHECK_EQUAL(allocations, 0);
	hm2_process_data_free(data);
	return CHECK_RESULT();
}
