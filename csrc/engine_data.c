/* The engine's vectors: gathered from and scattered to the participants' memory by the thread, exchanged with everybody
 * else without locks. */
#include "engine.h"

#include <linux/futex.h>
#include <math.h>
#include <stdlib.h>
#include <string.h>
#include <sys/syscall.h>
#include <unistd.h>

static double *vector(size_t count)
{
	return calloc(count + 1, sizeof(double));
}

static hm2_signal *copied(const hm2_signal *signals, size_t count)
{
	hm2_signal *copy = calloc(count + 1, sizeof *copy);
	if (copy && count)
		memcpy(copy, signals, count * sizeof *copy);
	return copy;
}

int engine_data_new(struct hm2_engine *engine, const hm2_signal *inputs, size_t input_count,
                    const hm2_signal *outputs, size_t output_count)
{
	int complete = 1;
	engine->input_count = input_count;
	engine->output_count = output_count;
	engine->inputs = copied(inputs, input_count);
	engine->outputs = copied(outputs, output_count);
	engine->input_values = vector(input_count);
	engine->output_values = vector(output_count);
	for (int i = 0; i < 3; i++) {
		engine->mail.buffers[i] = vector(output_count);
		complete &= engine->mail.buffers[i] != NULL;
	}
	engine->mail.between = 1;
	engine->mail.readers = 2;
	engine->commands = engine->mail.buffers[2];
	engine->shared.count = STATUS_WORDS + input_count + output_count;
	engine->shared.words = calloc(engine->shared.count, sizeof *engine->shared.words);
	return complete && engine->inputs && engine->outputs && engine->input_values && engine->output_values &&
	       engine->shared.words;
}

void engine_data_free(struct hm2_engine *engine)
{
	free(engine->inputs);
	free(engine->outputs);
	free(engine->input_values);
	free(engine->output_values);
	for (int i = 0; i < 3; i++)
		free(engine->mail.buffers[i]);
	free(engine->shared.words);
}

static uint64_t integer(const hm2_signal *signal)
{
	if (signal->type == HM2_SIGNAL_I32 || signal->type == HM2_SIGNAL_U32) {
		uint32_t word;
		memcpy(&word, signal->place, sizeof word);
		return word;
	}
	uint64_t wide;
	memcpy(&wide, signal->place, sizeof wide);
	return wide;
}

static double load(const hm2_signal *signal)
{
	if (signal->type == HM2_SIGNAL_F64) {
		double value;
		memcpy(&value, signal->place, sizeof value);
		return value;
	}
	const uint64_t value = integer(signal);
	if (signal->bit >= 0)
		return (double)(value >> signal->bit & 1);
	if (signal->type == HM2_SIGNAL_I32)
		return (double)(int32_t)(uint32_t)value;
	return signal->type == HM2_SIGNAL_I64 ? (double)(int64_t)value : (double)value;
}

/* To the nearest, limited to what the type holds: a conversion beyond it would be undefined. */
static uint64_t rounded(const hm2_signal *signal, double value)
{
	const double nearest = nearbyint(value);
	switch (signal->type) {
	case HM2_SIGNAL_I32:
		return (uint32_t)(int32_t)fmin(fmax(nearest, INT32_MIN), INT32_MAX);
	case HM2_SIGNAL_U32:
		return (uint32_t)fmin(fmax(nearest, 0.0), UINT32_MAX);
	case HM2_SIGNAL_I64:
		return (uint64_t)(int64_t)fmin(fmax(nearest, -0x1p63), 0x1p63 - 1024);
	default:
		return (uint64_t)fmin(fmax(nearest, 0.0), 0x1p64 - 2048);
	}
}

static void store(const hm2_signal *signal, double value)
{
	if (signal->type == HM2_SIGNAL_F64) {
		memcpy(signal->place, &value, sizeof value);
		return;
	}
	uint64_t word = signal->bit < 0 ? rounded(signal, value) : 0;
	if (signal->bit >= 0)
		word = (integer(signal) & ~(1ull << signal->bit)) | (uint64_t)(value != 0.0) << signal->bit;
	if (signal->type == HM2_SIGNAL_I32 || signal->type == HM2_SIGNAL_U32) {
		const uint32_t half = (uint32_t)word;
		memcpy(signal->place, &half, sizeof half);
	} else {
		memcpy(signal->place, &word, sizeof word);
	}
}

void hm2_signals_load(const hm2_signal *signals, size_t count, double *values)
{
	for (size_t i = 0; i < count; i++)
		if (signals[i].place)
			values[i] = load(&signals[i]);
}

void hm2_signals_store(const hm2_signal *signals, size_t count, const double *values)
{
	for (size_t i = 0; i < count; i++)
		if (signals[i].place)
			store(&signals[i], values[i]);
}

void engine_gather(struct hm2_engine *engine)
{
	hm2_signals_load(engine->inputs, engine->input_count, engine->input_values);
}

void engine_scatter(struct hm2_engine *engine)
{
	hm2_signals_store(engine->outputs, engine->output_count, engine->output_values);
}

void engine_load_outputs(struct hm2_engine *engine)
{
	memset(engine->output_values, 0, engine->output_count * sizeof *engine->output_values);
	hm2_signals_load(engine->outputs, engine->output_count, engine->output_values);
}

uint64_t hm2_engine_write(struct hm2_engine *engine, const double *outputs)
{
	struct engine_mail *mail = &engine->mail;
	memcpy(mail->buffers[mail->writers], outputs, engine->output_count * sizeof *outputs);
	mail->numbers[mail->writers] = ++mail->written;
	mail->writers = atomic_exchange_explicit(&mail->between, mail->writers | MAIL_FRESH, memory_order_acq_rel) &
	                ~MAIL_FRESH;
	return mail->written;
}

int engine_take_outputs(struct hm2_engine *engine)
{
	struct engine_mail *mail = &engine->mail;
	if (!(atomic_load_explicit(&mail->between, memory_order_relaxed) & MAIL_FRESH))
		return 0;
	mail->readers = atomic_exchange_explicit(&mail->between, mail->readers, memory_order_acq_rel) & ~MAIL_FRESH;
	engine->commands = mail->buffers[mail->readers];
	engine->status.outputs = mail->numbers[mail->readers];
	return 1;
}

static void put_doubles(shared_words *shared, size_t at, const double *values, size_t count)
{
	for (size_t i = 0; i < count; i++) {
		uint64_t word;
		memcpy(&word, &values[i], sizeof word);
		shared_words_put(shared, at + i, &word, 1);
	}
}

void engine_publish(struct hm2_engine *engine)
{
	shared_words *shared = &engine->shared;
	uint64_t status[STATUS_WORDS];
	memcpy(status, &engine->status, sizeof status);
	shared_words_begin(shared);
	shared_words_put(shared, 0, status, STATUS_WORDS);
	put_doubles(shared, STATUS_WORDS, engine->input_values, engine->input_count);
	put_doubles(shared, STATUS_WORDS + engine->input_count, engine->output_values, engine->output_count);
	shared_words_end(shared);
	atomic_store(&engine->published, (uint32_t)engine->status.cycles);
	if (atomic_load(&engine->waiters))
		syscall(SYS_futex, &engine->published, FUTEX_WAKE_PRIVATE, INT32_MAX, NULL, NULL, 0);
}

void hm2_engine_read(const struct hm2_engine *engine, hm2_engine_status *status, double *inputs, double *outputs)
{
	uint64_t words[STATUS_WORDS + 2 * HM2_ENGINE_SIGNALS];
	while (!shared_words_try(&engine->shared, 0, words, engine->shared.count))
		sched_yield();
	if (status)
		memcpy(status, words, sizeof *status);
	if (inputs)
		memcpy(inputs, &words[STATUS_WORDS], engine->input_count * sizeof *inputs);
	if (outputs)
		memcpy(outputs, &words[STATUS_WORDS + engine->input_count], engine->output_count * sizeof *outputs);
}

int hm2_engine_wait(struct hm2_engine *engine, uint64_t cycles, int64_t timeout_ns)
{
	const int64_t end_ns = hm2_clock_now_ns() + timeout_ns;
	for (;;) {
		const uint32_t published = atomic_load(&engine->published);
		const int64_t left_ns = end_ns - hm2_clock_now_ns();
		if ((int32_t)(published - (uint32_t)cycles) > 0)
			return 1;
		if (left_ns <= 0 || !atomic_load(&engine->running))
			return 0;
		const struct timespec left = {(time_t)(left_ns / 1000000000), (long)(left_ns % 1000000000)};
		atomic_fetch_add(&engine->waiters, 1);
		syscall(SYS_futex, &engine->published, FUTEX_WAIT_PRIVATE, published, &left, NULL, 0);
		atomic_fetch_sub(&engine->waiters, 1);
	}
}
