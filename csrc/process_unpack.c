/* From register words to values. The formulas are those of sserial.md 6. */
#include <string.h>

#include "process_data.h"

static inline uint64_t get_narrow(const uint32_t *words, const hm2_unpack_operation *operation)
{
	const hm2_window *window = &operation->window;
	return (words[window->low] | (uint64_t)words[window->middle] << 32) >> window->shift & operation->mask;
}

static inline uint64_t get_any(const uint32_t *words, const hm2_unpack_operation *operation)
{
	const hm2_window *window = &operation->window;
	uint64_t bits = (words[window->low] | (uint64_t)words[window->middle] << 32) >> window->shift;
	if (window->top != window->low)
		bits |= (uint64_t)words[window->top] << (64 - window->shift);
	return bits & operation->mask;
}

static void unpack_narrow(const struct hm2_process_data *data)
{
	const uint32_t *words = data->inputs;
	double *values = data->values;
	uint64_t *raw = data->raw;
	const hm2_unpack_operation *operation = data->unpack_end[HM2_OPERATION_BOOLEAN];
	const hm2_unpack_operation *end = data->unpack_end[HM2_OPERATION_UNSIGNED];
	for (; operation < end; operation++) {
		uint64_t bits = get_narrow(words, operation);
		raw[operation->field] = bits;
		values[operation->field] = (double)(int64_t)bits * operation->scale / operation->full;
	}
	end = data->unpack_end[HM2_OPERATION_SIGNED];
	for (; operation < end; operation++) {
		uint64_t bits = get_narrow(words, operation);
		int32_t aligned = (int32_t)((uint32_t)bits << (32 - operation->window.bits));
		raw[operation->field] = bits;
		values[operation->field] = (double)aligned / 2147483647.0 * operation->scale;
	}
}

static void unpack_long(struct hm2_process_data *data)
{
	const hm2_unpack_operation *operation = data->unpack_end[HM2_OPERATION_SIGNED];
	const hm2_unpack_operation *end = data->unpack_end[HM2_OPERATION_LONG_UNSIGNED];
	for (; operation < end; operation++) {
		uint64_t bits = get_any(data->inputs, operation);
		data->raw[operation->field] = bits;
		data->values[operation->field] = (double)bits * operation->scale / operation->full;
	}
	end = data->unpack_end[HM2_OPERATION_LONG_SIGNED];
	for (; operation < end; operation++) {
		uint64_t bits = get_any(data->inputs, operation);
		int64_t aligned = (int64_t)(bits << (64 - operation->window.bits));
		data->raw[operation->field] = bits;
		data->values[operation->field] = (double)aligned / 9223372036854775808.0 * operation->scale;
	}
}

static void unpack_floats(struct hm2_process_data *data)
{
	const hm2_unpack_operation *operation = data->unpack_end[HM2_OPERATION_LONG_SIGNED];
	const hm2_unpack_operation *end = data->unpack_end[HM2_OPERATION_FLOAT];
	for (; operation < end; operation++) {
		uint64_t bits = get_narrow(data->inputs, operation);
		uint32_t word = (uint32_t)bits;
		float value;
		memcpy(&value, &word, sizeof value);
		data->raw[operation->field] = bits;
		data->values[operation->field] = (double)value;
	}
	end = data->unpack_end[HM2_OPERATION_DOUBLE];
	for (; operation < end; operation++) {
		uint64_t bits = get_any(data->inputs, operation);
		data->raw[operation->field] = bits;
		memcpy(&data->values[operation->field], &bits, sizeof bits);
	}
}

/* The movement since the last reading is the difference modulo 2^bits that lies within half the range. */
static void counter_move(struct hm2_process_data *data, hm2_unpack_operation *operation, uint64_t reading,
                         uint32_t bits)
{
	if (atomic_load_explicit(&operation->zero_wanted, memory_order_relaxed)) {
		atomic_store_explicit(&operation->zero_wanted, 0, memory_order_relaxed);
		operation->zero = operation->total;
	}
	uint64_t difference = (reading - operation->previous) << (64 - bits);
	operation->total += (uint64_t)((int64_t)difference >> (64 - bits));
	operation->previous = reading;
	uint64_t count = operation->total - operation->zero;
	data->raw[operation->field] = count;
	data->values[operation->field] = (double)(int64_t)count / operation->scale;
}

static void unpack_counters(struct hm2_process_data *data)
{
	hm2_unpack_operation *operation = data->unpack_end[HM2_OPERATION_DOUBLE];
	const hm2_unpack_operation *end = data->unpack_end[HM2_OPERATION_COUNTER];
	for (; operation < end; operation++)
		counter_move(data, operation, get_any(data->inputs, operation), operation->window.bits);
	end = data->unpack_end[HM2_OPERATION_COUNTER_LOW];
	for (; operation < end; operation++) {
		hm2_unpack_operation *upper = data->unpack + operation->other;
		uint32_t bits = operation->window.bits;
		uint64_t reading = get_any(data->inputs, upper) << bits | get_any(data->inputs, operation);
		bits += upper->window.bits;
		counter_move(data, operation, reading, bits);
		counter_move(data, upper, reading, bits);
	}
}

void hm2_process_data_unpack(struct hm2_process_data *data)
{
	const hm2_unpack_operation *operation = data->unpack;
	const hm2_unpack_operation *end = data->unpack_end[HM2_OPERATION_RAW];
	for (; operation < end; operation++)
		data->raw[operation->field] = get_any(data->inputs, operation);
	end = data->unpack_end[HM2_OPERATION_BOOLEAN];
	for (; operation < end; operation++) {
		uint64_t bits = get_any(data->inputs, operation);
		data->raw[operation->field] = bits;
		data->values[operation->field] = bits != 0 ? 1.0 : 0.0;
	}
	unpack_narrow(data);
	unpack_long(data);
	unpack_floats(data);
	unpack_counters(data);
}
