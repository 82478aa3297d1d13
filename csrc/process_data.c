/* Compiles declared fields into the plan that unpack and pack carry out. */
#include <math.h>
#include <stdlib.h>
#include <string.h>

#include "error.h"
#include "process_data.h"

static const char WHERE[] = "process data";

static int out_of_range(hm2_error *error, size_t field, uint32_t expected, uint32_t received)
{
	hm2_error_set(error, HM2_ERR_RANGE, WHERE);
	if (error) {
		error->index = (int32_t)field;
		error->expected = expected;
		error->received = received;
	}
	return HM2_ERR_RANGE;
}

static int is_counter_part(const hm2_field *field)
{
	return field->kind == HM2_FIELD_ENCODER_H || field->kind == HM2_FIELD_ENCODER_L;
}

static int counter_kind(const hm2_field *field)
{
	if (field->direction != HM2_FIELD_INPUT)
		return -1; /* takes room, is not written */
	if (field->partner < 0)
		return HM2_OPERATION_COUNTER;
	return field->kind == HM2_FIELD_ENCODER_L ? HM2_OPERATION_COUNTER_LOW : HM2_OPERATION_NOTHING;
}

/* What is done with a field; -1: nothing at all. */
static int operation_kind(const hm2_field *field)
{
	int narrow = field->bits <= 32;
	switch (field->kind) {
	case HM2_FIELD_BITS:
	case HM2_FIELD_STREAM: return HM2_OPERATION_RAW;
	case HM2_FIELD_BOOLEAN: return HM2_OPERATION_BOOLEAN;
	case HM2_FIELD_UNSIGNED: return narrow ? HM2_OPERATION_UNSIGNED : HM2_OPERATION_LONG_UNSIGNED;
	case HM2_FIELD_SIGNED: return narrow ? HM2_OPERATION_SIGNED : HM2_OPERATION_LONG_SIGNED;
	case HM2_FIELD_FLOAT: return narrow ? HM2_OPERATION_FLOAT : HM2_OPERATION_DOUBLE;
	case HM2_FIELD_ENCODER: return field->direction == HM2_FIELD_INPUT ? HM2_OPERATION_COUNTER : -1;
	case HM2_FIELD_ENCODER_H:
	case HM2_FIELD_ENCODER_L: return counter_kind(field);
	default: return -1;
	}
}

static int is_kind(int32_t kind)
{
	hm2_field field = {.kind = kind, .bits = 32, .partner = -1};
	return kind == HM2_FIELD_PAD || operation_kind(&field) >= 0;
}

/* The two parts of a counter name each other, lie in the same channel and fit into 64 bits together. */
static int check_partner(const hm2_field *fields, size_t count, size_t index, hm2_error *error)
{
	const hm2_field *field = &fields[index];
	if (!is_counter_part(field) || field->partner < 0)
		return HM2_OK;
	if ((size_t)field->partner >= count)
		return out_of_range(error, index, (uint32_t)count, (uint32_t)field->partner);
	const hm2_field *other = &fields[field->partner];
	if (!is_counter_part(other) || other->kind == field->kind || other->channel != field->channel ||
	    other->direction != field->direction || other->partner != (int32_t)index)
		return out_of_range(error, index, (uint32_t)index, (uint32_t)other->partner);
	if (field->bits + other->bits > 64)
		return out_of_range(error, index, 64, field->bits + other->bits);
	return HM2_OK;
}

static int check_field(const hm2_field *field, size_t index, const hm2_image *image, hm2_error *error)
{
	if (!is_kind(field->kind))
		return out_of_range(error, index, HM2_FIELD_FLOAT, (uint32_t)field->kind);
	if (field->direction != HM2_FIELD_INPUT && field->direction != HM2_FIELD_OUTPUT)
		return out_of_range(error, index, HM2_FIELD_OUTPUT, (uint32_t)field->direction);
	if (field->kind == HM2_FIELD_PAD)
		return HM2_OK;
	if (field->bits < 1 || field->bits > 64)
		return out_of_range(error, index, 64, field->bits);
	if (field->kind == HM2_FIELD_FLOAT && field->bits != 32 && field->bits != 64)
		return out_of_range(error, index, 32, field->bits);
	if (field->channel < 0 || (uint32_t)field->channel >= image->channels)
		return out_of_range(error, index, image->channels, (uint32_t)field->channel);
	uint32_t room = image->words_per_channel * 32;
	if (field->offset >= room || field->bits > room - field->offset)
		return out_of_range(error, index, room, field->offset + field->bits);
	return HM2_OK;
}

/* Every word of every channel lies within the buffer, and a word index fits a window. */
static int check_image(const hm2_image *image, hm2_error *error)
{
	if (image->count == 0 && image->channels == 0)
		return HM2_OK;
	if (image->channels < 1 || image->words_per_channel < 1)
		return out_of_range(error, 0, 1, image->channels);
	if (image->words_per_channel > 1 && image->word_stride < 1)
		return out_of_range(error, 0, 1, image->word_stride);
	if (!image->words || image->count > 0x10000)
		return out_of_range(error, 0, 0x10000, image->count);
	uint64_t last = (uint64_t)(image->channels - 1) * image->channel_stride +
	                (uint64_t)(image->words_per_channel - 1) * image->word_stride;
	if (last >= image->count)
		return out_of_range(error, 0, image->count, last > UINT32_MAX ? UINT32_MAX : (uint32_t)last);
	return HM2_OK;
}

static hm2_window window_of(const hm2_field *field, const hm2_image *image)
{
	uint32_t first = (uint32_t)field->channel * image->channel_stride + field->offset / 32 * image->word_stride;
	uint32_t shift = field->offset % 32;
	uint32_t end = shift + field->bits;
	hm2_window window = {
		.low = (uint16_t)first,
		.middle = (uint16_t)(end > 32 ? first + image->word_stride : first),
		.top = (uint16_t)(end > 64 ? first + 2 * image->word_stride : first),
		.shift = (uint8_t)shift,
		.bits = (uint8_t)field->bits,
	};
	return window;
}

/* Append the operation of every input field of one kind. */
static uint32_t add_unpack(struct hm2_process_data *data, const hm2_image *image, int kind, uint32_t next)
{
	for (size_t i = 0; i < data->field_count; i++) {
		const hm2_field *field = &data->fields[i];
		if (field->direction != HM2_FIELD_INPUT || operation_kind(field) != kind)
			continue;
		data->operations[i] = next;
		data->unpack[next++] = (hm2_unpack_operation){
			.window = window_of(field, image),
			.mask = hm2_low_bits(field->bits),
			.scale = field->scale,
			.full = (double)hm2_low_bits(field->bits),
			.field = (uint32_t)i,
		};
	}
	return next;
}

/* A scale nothing can be divided by puts the output to rest, as an infinite one does. */
static double usable(double scale)
{
	return scale == scale && scale != 0.0 ? scale : (double)INFINITY;
}

static uint32_t add_pack(struct hm2_process_data *data, int kind, uint32_t next)
{
	for (size_t i = 0; i < data->field_count; i++) {
		const hm2_field *field = &data->fields[i];
		if (field->direction != HM2_FIELD_OUTPUT || operation_kind(field) != kind)
			continue;
		data->operations[i] = next;
		data->pack[next++] = (hm2_pack_operation){
			.mask = hm2_low_bits(field->bits),
			.invert = field->invert,
			.scale = usable(field->scale),
			.full = (double)hm2_low_bits(field->bits),
			.low = field->low,
			.high = field->high,
			.field = (uint32_t)i,
			.bits = field->bits,
		};
	}
	return next;
}

/* The parts of all output fields that lie in one word. */
static void add_word(struct hm2_process_data *data, const hm2_image *image, uint32_t word)
{
	size_t first = data->placement_count;
	uint32_t written = 0;
	for (size_t i = 0; i < data->field_count; i++) {
		const hm2_field *field = &data->fields[i];
		if (field->direction != HM2_FIELD_OUTPUT || data->operations[i] == HM2_NO_OPERATION)
			continue;
		hm2_window window = window_of(field, image);
		int part = word == window.low ? 0 : word == window.middle ? 1 : word == window.top ? 2 : -1;
		if (part < 0)
			continue;
		uint32_t right = part == 0 ? 0 : 32 * (uint32_t)part - window.shift;
		uint32_t turn = part == 0 ? window.shift : 64 - right;
		uint64_t mask = hm2_low_bits(field->bits);
		hm2_placement placement = {
			.mask = (uint32_t)(part == 0 ? mask << turn : mask >> right),
			.invert = operation_kind(field) == HM2_OPERATION_RAW ? hm2_turned(field->invert, turn) : 0,
			.field = (uint32_t)i,
			.turn = turn,
		};
		written |= placement.mask;
		data->placements[data->placement_count++] = placement;
	}
	if (data->placement_count > first)
		data->words[data->word_count++] =
			(hm2_packed_word){word, ~written, data->placements + data->placement_count};
}

static void compile(struct hm2_process_data *data, const hm2_image *inputs, const hm2_image *outputs)
{
	for (size_t i = 0; i < data->field_count; i++)
		data->operations[i] = HM2_NO_OPERATION;
	uint32_t next = 0;
	for (int kind = 0; kind < HM2_OPERATION_KINDS; kind++) {
		next = add_unpack(data, inputs, kind, next);
		data->unpack_end[kind] = data->unpack + next;
	}
	for (uint32_t i = 0; i < next; i++) {
		int32_t partner = data->fields[data->unpack[i].field].partner;
		data->unpack[i].other = partner < 0 ? i : data->operations[partner];
	}
	next = 0;
	for (int kind = 0; kind < HM2_OPERATION_KINDS; kind++) {
		next = add_pack(data, kind, next);
		data->pack_end[kind] = data->pack + next;
	}
	for (uint32_t word = 0; word < outputs->count; word++)
		add_word(data, outputs, word);
}

static struct hm2_process_data *allocate(const hm2_field *fields, size_t count)
{
	struct hm2_process_data *data = calloc(1, sizeof *data);
	if (!data)
		return NULL;
	size_t room = count ? count : 1; /* calloc(0) may be NULL */
	data->fields = calloc(room, sizeof *data->fields);
	data->operations = calloc(room, sizeof *data->operations);
	data->unpack = calloc(room, sizeof *data->unpack);
	data->pack = calloc(room, sizeof *data->pack);
	data->placements = calloc(3 * room, sizeof *data->placements);
	data->words = calloc(3 * room, sizeof *data->words);
	if (!data->fields || !data->operations || !data->unpack || !data->pack || !data->placements || !data->words) {
		hm2_process_data_free(data);
		return NULL;
	}
	data->field_count = count;
	if (count)
		memcpy(data->fields, fields, count * sizeof *fields);
	return data;
}

int hm2_process_data_new(const hm2_field *fields, size_t count, const hm2_image *inputs,
                         const hm2_image *outputs, double *values, uint64_t *raw,
                         struct hm2_process_data **process_data, hm2_error *error)
{
	int status = check_image(inputs, error);
	if (status == HM2_OK)
		status = check_image(outputs, error);
	for (size_t i = 0; status == HM2_OK && i < count; i++) {
		const hm2_image *image = fields[i].direction == HM2_FIELD_INPUT ? inputs : outputs;
		status = check_field(&fields[i], i, image, error);
	}
	for (size_t i = 0; status == HM2_OK && i < count; i++)
		status = check_partner(fields, count, i, error);
	if (status != HM2_OK)
		return status;
	struct hm2_process_data *data = allocate(fields, count);
	if (!data)
		return hm2_error_set(error, HM2_ERR_NO_MEMORY, WHERE);
	data->inputs = inputs->words;
	data->outputs = outputs->words;
	data->values = values;
	data->raw = raw;
	compile(data, inputs, outputs);
	*process_data = data;
	return HM2_OK;
}

void hm2_process_data_free(struct hm2_process_data *data)
{
	if (!data)
		return;
	free(data->fields);
	free(data->operations);
	free(data->unpack);
	free(data->pack);
	free(data->placements);
	free(data->words);
	free(data);
}

int hm2_process_data_configure(struct hm2_process_data *data, size_t index, double scale, double low,
                               double high, uint64_t invert, hm2_error *error)
{
	if (index >= data->field_count)
		return out_of_range(error, index, (uint32_t)data->field_count, (uint32_t)index);
	uint32_t at = data->operations[index];
	if (at == HM2_NO_OPERATION)
		return HM2_OK;
	if (data->fields[index].direction == HM2_FIELD_INPUT) {
		data->unpack[at].scale = scale;
		return HM2_OK;
	}
	data->pack[at].scale = usable(scale);
	data->pack[at].low = low;
	data->pack[at].high = high;
	data->pack[at].invert = invert;
	for (size_t i = 0; i < data->placement_count; i++)
		if (data->placements[i].field == index && operation_kind(&data->fields[index]) == HM2_OPERATION_RAW)
			data->placements[i].invert = hm2_turned(invert, data->placements[i].turn);
	return HM2_OK;
}

/* Not a counter: nothing to do. */
int hm2_process_data_zero(struct hm2_process_data *data, size_t index, hm2_error *error)
{
	if (index >= data->field_count)
		return out_of_range(error, index, (uint32_t)data->field_count, (uint32_t)index);
	uint32_t at = data->operations[index];
	if (at == HM2_NO_OPERATION || data->fields[index].direction != HM2_FIELD_INPUT)
		return HM2_OK;
	atomic_store_explicit(&data->unpack[at].zero_wanted, 1, memory_order_relaxed);
	return HM2_OK;
}

void hm2_process_data_restart(struct hm2_process_data *data, int channel)
{
	for (size_t i = 0; i < data->field_count; i++) {
		uint32_t at = data->operations[i];
		if (at == HM2_NO_OPERATION || data->fields[i].channel != channel ||
		    data->fields[i].direction != HM2_FIELD_INPUT)
			continue;
		data->unpack[at].previous = 0;
		data->unpack[at].total = 0;
		data->unpack[at].zero = 0;
		atomic_store_explicit(&data->unpack[at].zero_wanted, 0, memory_order_relaxed);
	}
}

void hm2_process_data_carry_on(struct hm2_process_data *to, const struct hm2_process_data *from)
{
	for (size_t i = 0; i < from->field_count && i < to->field_count; i++) {
		const uint32_t at = from->operations[i];
		if (at == HM2_NO_OPERATION || at != to->operations[i] || from->fields[i].direction != HM2_FIELD_INPUT)
			continue;
		to->unpack[at].previous = from->unpack[at].previous;
		to->unpack[at].total = from->unpack[at].total;
		to->unpack[at].zero = from->unpack[at].zero;
		atomic_store_explicit(&to->unpack[at].zero_wanted,
		                      atomic_load_explicit(&from->unpack[at].zero_wanted, memory_order_relaxed),
		                      memory_order_relaxed);
	}
}
