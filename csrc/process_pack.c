/* From values to register words. The formulas are those of sserial.md 6. */
#include <string.h>

#include "process_data.h"

/* Every value is masked and replaces exactly its own bits, so a neighbour is never disturbed. */
static inline void window_put(uint32_t *words, const hm2_pack_operation *operation, uint64_t bits)
{
	const hm2_window *window = &operation->window;
	uint32_t shift = window->shift;
	uint64_t mask = operation->mask;
	bits &= mask;
	words[window->low] = (words[window->low] & ~(uint32_t)(mask << shift)) | (uint32_t)(bits << shift);
	if (window->middle == window->low)
		return;
	mask >>= 32 - shift;
	bits >>= 32 - shift;
	words[window->middle] = (words[window->middle] & ~(uint32_t)mask) | (uint32_t)bits;
	if (window->top == window->low)
		return;
	words[window->top] = (words[window->top] & ~(uint32_t)(mask >> 32)) | (uint32_t)(bits >> 32);
}

/* NaN compares false with both limits and stays NaN. */
static inline double clamped(double value, const hm2_pack_operation *operation)
{
	value = value < operation->low ? operation->low : value;
	return value > operation->high ? operation->high : value;
}

/* value / scale; 0.0 where that is not a number or the scale is 0, so that such an output is at rest. */
static inline double portion(double value, const hm2_pack_operation *operation)
{
	double result = clamped(value, operation) / operation->scale;
	return result == result && operation->scale != 0.0 ? result : 0.0;
}

static inline uint64_t unsigned_bits(double scaled, const hm2_pack_operation *operation)
{
	if (!(scaled > 0.0))
		return 0;
	return scaled >= operation->full ? operation->mask : (uint64_t)scaled;
}

static inline uint64_t signed_bits(double scaled, const hm2_pack_operation *operation)
{
	int32_t aligned = scaled >= 2147483647.0    ? INT32_MAX
	                  : scaled <= -2147483648.0 ? INT32_MIN
	                                            : (int32_t)scaled;
	return (uint64_t)(aligned >> (32 - operation->window.bits)) & operation->mask;
}

static inline uint64_t long_signed_bits(double scaled, const hm2_pack_operation *operation)
{
	int64_t aligned = scaled >= 9223372036854775808.0    ? INT64_MAX
	                  : scaled <= -9223372036854775808.0 ? INT64_MIN
	                                                     : (int64_t)scaled;
	return (uint64_t)(aligned >> (64 - operation->window.bits)) & operation->mask;
}

static void pack_scaled(struct hm2_process_data *data, const hm2_pack_operation *operation)
{
	const hm2_pack_operation *end = data->pack + data->pack_end[HM2_PACK_UNSIGNED];
	for (; operation < end; operation++) {
		double scaled = portion(data->values[operation->field], operation) * operation->full;
		uint64_t bits = unsigned_bits(scaled, operation);
		data->raw[operation->field] = bits;
		window_put(data->outputs, operation, bits);
	}
	end = data->pack + data->pack_end[HM2_PACK_SIGNED];
	for (; operation < end; operation++) {
		double scaled = portion(data->values[operation->field], operation) * 2147483647.0;
		uint64_t bits = signed_bits(scaled, operation);
		data->raw[operation->field] = bits;
		window_put(data->outputs, operation, bits);
	}
	end = data->pack + data->pack_end[HM2_PACK_LONG_SIGNED];
	for (; operation < end; operation++) {
		double scaled = portion(data->values[operation->field], operation) * 9223372036854775808.0;
		uint64_t bits = long_signed_bits(scaled, operation);
		data->raw[operation->field] = bits;
		window_put(data->outputs, operation, bits);
	}
}

static void pack_floats(struct hm2_process_data *data, const hm2_pack_operation *operation)
{
	const hm2_pack_operation *end = data->pack + data->pack_end[HM2_PACK_FLOAT];
	for (; operation < end; operation++) {
		float value = (float)clamped(data->values[operation->field], operation);
		uint32_t bits;
		memcpy(&bits, &value, sizeof bits);
		data->raw[operation->field] = bits;
		window_put(data->outputs, operation, bits);
	}
	end = data->pack + data->pack_end[HM2_PACK_DOUBLE];
	for (; operation < end; operation++) {
		double value = clamped(data->values[operation->field], operation);
		uint64_t bits;
		memcpy(&bits, &value, sizeof bits);
		data->raw[operation->field] = bits;
		window_put(data->outputs, operation, bits);
	}
}

void hm2_process_data_pack(struct hm2_process_data *data)
{
	const hm2_pack_operation *operation = data->pack;
	const hm2_pack_operation *end = data->pack + data->pack_end[HM2_PACK_RAW];
	for (; operation < end; operation++)
		window_put(data->outputs, operation, data->raw[operation->field] ^ operation->invert);
	end = data->pack + data->pack_end[HM2_PACK_BOOLEAN];
	for (; operation < end; operation++) {
		double value = data->values[operation->field];
		int on = value > 0.0 || value < 0.0; /* NaN is off */
		uint64_t bits = (on != 0) != (operation->invert != 0) ? operation->mask : 0;
		data->raw[operation->field] = bits;
		window_put(data->outputs, operation, bits);
	}
	pack_scaled(data, operation);
	pack_floats(data, data->pack + data->pack_end[HM2_PACK_LONG_SIGNED]);
}
