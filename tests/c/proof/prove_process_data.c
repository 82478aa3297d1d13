/* Process data in a channel of 224 bits: every offset and width at once, every content. */
#include "../../../csrc/error.c"
#include "../../../csrc/process_data.c"
#include "../../../csrc/process_pack.c"
#include "../../../csrc/process_unpack.c"
#include "prove.h"

#define WORDS 7
#define BITS (32 * WORDS)

typedef struct channel {
	uint32_t words[WORDS];
} channel;

channel nondet_channel(void);

static channel now, before;
static uint32_t *const words = now.words;
static double values[1];
static uint64_t raw[1];
static hm2_field field;
static uint32_t operations[1];
static hm2_placement placements[3];
static hm2_packed_word packed[3];
static const hm2_image image = {now.words, WORDS, 1, WORDS, 1, 1};

static uint64_t mask_of(uint32_t bits)
{
	return bits == 64 ? UINT64_MAX : ((uint64_t)1 << bits) - 1;
}

/* Bit number i of the channel. */
static int bit(const uint32_t *from, uint32_t i)
{
	return from[i / 32] >> i % 32 & 1;
}

/* A field anywhere in a channel of any content, as far as the driver's own check accepts it. */
static void any_field(int32_t kind, int32_t direction)
{
	const hm2_field any = {.kind = kind, .direction = direction, .partner = -1, .bits = nondet_uint32(),
	                       .offset = nondet_uint32(), .scale = 1.0, .low = -1.0, .high = 1.0};

	ASSUME(check_field(&any, 0, &image, NULL) == HM2_OK);
	PROVE(any.bits >= 1 && any.bits <= 64 && any.offset <= BITS - any.bits);
	field = any;
	before = now = nondet_channel();
}

/* Any 64 bits packed at any place, looked at in any word: exactly the field's bits are written, each where it
 * belongs; all others stay, and so do all other words. */
/* proof: --overflow-check --unwind 3 */
void prove_pack_writes_its_bits_only(void)
{
	struct hm2_process_data data = {.outputs = words, .raw = raw, .placements = placements, .words = packed,
	                                .fields = &field, .operations = operations, .field_count = 1};
	any_field(HM2_FIELD_BITS, HM2_FIELD_OUTPUT);
	const uint32_t word = nondet_uint8();
	ASSUME(word < WORDS);
	add_word(&data, &image, word);
	PROVE(data.placement_count <= 1 && data.word_count == data.placement_count);
	PROVE(placements[0].turn < 64);
	const uint64_t written = raw[0] = nondet_uint64();
	place(&data);
	const uint32_t i = nondet_uint8();
	ASSUME(i < BITS);
	if (i / 32 == word && i >= field.offset && i < field.offset + field.bits)
		PROVE(bit(words, i) == (int)(written >> (i - field.offset) & 1));
	else
		PROVE(bit(words, i) == bit(before.words, i));
}

/* What unpack takes out of any content is what lies there. */
/* proof: --overflow-check --unwind 3 */
void prove_unpack_reads_its_bits(void)
{
	any_field(HM2_FIELD_BITS, HM2_FIELD_INPUT);
	const hm2_unpack_operation operation = {.window = window_of(&field, &image), .mask = hm2_low_bits(field.bits)};
	const uint64_t got = get_any(words, &operation);
	const uint32_t i = nondet_uint8();
	ASSUME(i < 64);
	PROVE(operation.window.shift < 32 && operation.window.bits == field.bits);
	PROVE(operation.window.low < WORDS && operation.window.middle < WORDS && operation.window.top < WORDS);
	PROVE((int)(got >> i & 1) == (i < field.bits ? bit(words, field.offset + i) : 0));
	PROVE((got & ~mask_of(field.bits)) == 0);
	if (field.bits <= 32)
		PROVE(get_narrow(words, &operation) == got);
}

/* ---- from values to bits: every double, NaN and infinities among them ---- */

static hm2_pack_operation any_operation(uint32_t most_bits)
{
	const hm2_pack_operation operation = {
		.scale = usable(nondet_double()), .low = nondet_double(), .high = nondet_double(), .bits = nondet_uint8(),
	};
	hm2_pack_operation whole = operation;
	ASSUME(operation.bits >= 1 && operation.bits <= most_bits);
	ASSUME(operation.low <= operation.high); /* as Python checks it */
	whole.mask = hm2_low_bits(operation.bits);
	whole.full = (double)whole.mask;
	return whole;
}

/* The clamp: within the limits, or still no number; and what is within stays as it is. */
/* proof: --unwind 3 */
void prove_clamped(void)
{
	const double low = nondet_double(), high = nondet_double(), value = nondet_double();
	ASSUME(low <= high);
	const double result = clamped(value, low, high);
	PROVE(value != value ? result != result : result >= low && result <= high);
	PROVE(!(value >= low && value <= high) || result == value);
}

/* One operation of this kind, as pack would run it. */
static struct hm2_process_data one_pack(int kind, hm2_pack_operation *operation)
{
	struct hm2_process_data data = {
		.values = values, .raw = raw, .pack = operation,
		.pack_end = {[HM2_OPERATION_BOOLEAN] = operation,
		             [HM2_OPERATION_UNSIGNED] = operation + (kind == HM2_OPERATION_UNSIGNED),
		             [HM2_OPERATION_SIGNED] = operation + 1},
	};
	values[0] = nondet_double();
	return data;
}

/* Whatever the value, scale and limits: the bits fit the field. (That clamped() is right makes the conversions to
 * integers right: both limits are values of the type.) */
/* proof: --unwind 3 */
void prove_unsigned_fits(void)
{
	hm2_pack_operation operation = any_operation(32);
	const struct hm2_process_data data = one_pack(HM2_OPERATION_UNSIGNED, &operation);
	pack_narrow(&data);
	PROVE(raw[0] <= operation.mask);
}

/* proof: --unwind 3 */
void prove_signed_fits(void)
{
	hm2_pack_operation operation = any_operation(32);
	const struct hm2_process_data data = one_pack(HM2_OPERATION_SIGNED, &operation);
	pack_narrow(&data);
	PROVE(raw[0] <= operation.mask);
}

/* ---- from bits to values ---- */

/* One operation of this kind on a field anywhere. */
static struct hm2_process_data one_unpack(int kind, int32_t field_kind, hm2_unpack_operation *operation)
{
	struct hm2_process_data data = {
		.inputs = words, .values = values, .raw = raw, .unpack = operation,
		.unpack_end = {[HM2_OPERATION_BOOLEAN] = operation,
		               [HM2_OPERATION_UNSIGNED] = operation + (kind == HM2_OPERATION_UNSIGNED),
		               [HM2_OPERATION_SIGNED] = operation + 1},
	};
	any_field(field_kind, HM2_FIELD_INPUT);
	operation->window = window_of(&field, &image);
	operation->mask = hm2_low_bits(field.bits);
	operation->scale = 1.0;
	return data;
}

/* The sign is that of the field's top bit; full scale is reached and never passed by more than one step. */
/* proof: --unwind 3 */
void prove_sign_extension(void)
{
	hm2_unpack_operation operation = {0};
	struct hm2_process_data data = one_unpack(HM2_OPERATION_SIGNED, HM2_FIELD_SIGNED, &operation);
	ASSUME(field.bits <= 32);
	unpack_narrow(&data);
	const uint64_t top = raw[0] >> (field.bits - 1);
	PROVE(top == 1 ? values[0] < 0.0 : values[0] >= 0.0);
	PROVE(values[0] >= -2147483648.0 / 2147483647.0 && values[0] <= 1.0);
}

/* A counter of any width moves by the one difference within half its range that leads from reading to reading. */
/* proof: --overflow-check --unwind 2 */
void prove_counter_takes_the_short_way(void)
{
	hm2_unpack_operation operation = {0};
	struct hm2_process_data data = {.values = values, .raw = raw, .unpack = &operation};
	const uint32_t bits = nondet_uint8();
	ASSUME(bits >= 1 && bits <= 64);
	const uint64_t from = nondet_uint64() & mask_of(bits), to = nondet_uint64() & mask_of(bits);
	operation.previous = from;
	operation.total = nondet_uint64();
	operation.scale = 1.0;
	const uint64_t before_total = operation.total;
	counter_move(&data, &operation, to, bits);
	const int64_t moved = (int64_t)(operation.total - before_total);
	PROVE(((from + (uint64_t)moved) & mask_of(bits)) == to);
	PROVE(bits == 64 || (moved >= -((int64_t)1 << (bits - 1)) && moved < (int64_t)1 << (bits - 1)));
	PROVE(operation.previous == to);
}
