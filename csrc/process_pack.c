/* From values to register words. The formulas are those of sserial.md 6. */
#include <string.h>

#include "process_data.h"

/* NaN compares false with both limits and stays NaN. */
static inline double clamped(double value, double low, double high)
{
	value = low > value ? low : value;
	return high < value ? high : value;
}

/* The clamped value / scale; 0.0 where that is not a number, so that such an output is at rest. */
static inline double portion(double value, const hm2_pack_operation *operation)
{
	double result = clamped(value, operation->low, operation->high) / operation->scale;
	return result == result ? result : 0.0;
}

static void pack_booleans(const struct hm2_process_data *data)
{
	const hm2_pack_operation *operation = data->pack_end[HM2_OPERATION_RAW];
	const hm2_pack_operation *end = data->pack_end[HM2_OPERATION_BOOLEAN];
	for (; operation < end; operation++) {
		double value = data->values[operation->field];
		int on = value > 0.0 || value < 0.0; /* NaN is off */
		data->raw[operation->field] = on != (operation->invert != 0) ? operation->mask : 0;
	}
}

static void pack_narrow(const struct hm2_process_data *data)
{
	const double *values = data->values;
	uint64_t *raw = data->raw;
	const hm2_pack_operation *operation = data->pack_end[HM2_OPERATION_BOOLEAN];
	const hm2_pack_operation *end = data->pack_end[HM2_OPERATION_UNSIGNED];
	for (; operation < end; operation++) {
		double scaled = portion(values[operation->field], operation) * operation->full;
		raw[operation->field] = (uint64_t)(int64_t)clamped(scaled, 0.0, operation->full);
	}
	end = data->pack_end[HM2_OPERATION_SIGNED];
	for (; operation < end; operation++) {
		double scaled = portion(values[operation->field], operation) * 2147483647.0;
		int32_t aligned = (int32_t)clamped(scaled, -2147483648.0, 2147483647.0);
		raw[operation->field] = (uint64_t)(aligned >> (32 - operation->bits)) & operation->mask;
	}
}

/* 2^63 and 2^64 - 1 are not both doubles and in range: the upper limits need a comparison of their own. */
static void pack_long(const struct hm2_process_data *data)
{
	const hm2_pack_operation *operation = data->pack_end[HM2_OPERATION_SIGNED];
	const hm2_pack_operation *end = data->pack_end[HM2_OPERATION_LONG_UNSIGNED];
	for (; operation < end; operation++) {
		double scaled = portion(data->values[operation->field], operation) * operation->full;
		data->raw[operation->field] = scaled >= operation->full ? operation->mask
		                              : scaled > 0.0            ? (uint64_t)scaled
		                                                        : 0;
	}
	end = data->pack_end[HM2_OPERATION_LONG_SIGNED];
	for (; operation < end; operation++) {
		double scaled = portion(data->values[operation->field], operation) * 9223372036854775808.0;
		int64_t aligned = scaled >= 9223372036854775808.0 ? INT64_MAX
		                                                  : (int64_t)clamped(scaled, -9223372036854775808.0, scaled);
		data->raw[operation->field] = (uint64_t)(aligned >> (64 - operation->bits)) & operation->mask;
	}
}

static void pack_floats(const struct hm2_process_data *data)
{
	const hm2_pack_operation *operation = data->pack_end[HM2_OPERATION_LONG_SIGNED];
	const hm2_pack_operation *end = data->pack_end[HM2_OPERATION_FLOAT];
	for (; operation < end; operation++) {
		float value = (float)clamped(data->values[operation->field], operation->low, operation->high);
		uint32_t bits;
		memcpy(&bits, &value, sizeof bits);
		data->raw[operation->field] = bits;
	}
	end = data->pack_end[HM2_OPERATION_DOUBLE];
	for (; operation < end; operation++) {
		double value = clamped(data->values[operation->field], operation->low, operation->high);
		memcpy(&data->raw[operation->field], &value, sizeof value);
	}
}

/* Every word is put together in a register and stored once. Each value is masked, so a neighbour is never
 * disturbed, and bits of nobody stay as they are. */
static void place(const struct hm2_process_data *data)
{
	uint32_t *image = data->outputs;
	const uint64_t *raw = data->raw;
	const hm2_placement *placement = data->placements;
	const hm2_packed_word *end = data->words + data->word_count;
	for (const hm2_packed_word *word = data->words; word < end; word++) {
		uint32_t bits = image[word->word] & word->keep;
		for (; placement < word->end; placement++) {
			bits |= (hm2_turned(raw[placement->field], placement->turn) ^ placement->invert) & placement->mask;
		}
		image[word->word] = bits;
	}
}

void hm2_process_data_pack(struct hm2_process_data *data)
{
	pack_booleans(data);
	pack_narrow(data);
	pack_long(data);
	pack_floats(data);
	place(data);
}
