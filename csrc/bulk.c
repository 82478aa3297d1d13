/* Decodes recorded cycles into columns, block by block: the words of a block are first turned into rows,
 * then each field is a loop over contiguous memory that the compiler turns into vector instructions. A block
 * stays in the processor's cache, so that the time is that of writing the output. */
#include <string.h>

#ifdef __SSE2__
#include <emmintrin.h>
#endif

#include "error.h"
#include "process_data.h"

#define BLOCK 512
#define LINE 8 /* doubles in a line of the cache */
#define CACHE_BYTES (4u << 20) /* output beyond this goes past the cache: about a share of a third level */
#define INLINE static inline __attribute__((always_inline))

typedef uint32_t block_rows[HM2_BULK_WORDS][BLOCK];

typedef struct block {
	block_rows rows;
	uint32_t narrow[BLOCK]; /* raw bits of the field at work, if up to 32 */
	uint64_t wide[BLOCK];   /* the same, if more */
	uint8_t truths[BLOCK];
	size_t count;
	size_t padded;  /* up to a whole line; what is computed there goes nowhere */
	int past_cache; /* see put_bytes */
} block;

static const size_t sizes[] = {
	[HM2_COLUMN_F64] = 8, [HM2_COLUMN_F32] = 4, [HM2_COLUMN_U32] = 4, [HM2_COLUMN_U64] = 8, [HM2_COLUMN_U8] = 1,
};

static inline uint32_t load_le32(const uint8_t *bytes)
{
	return (uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

/* x / divisor, correctly rounded, for divisors that are integers of up to 32 bits. A division per value takes
 * longer than writing the result. With a fused multiply-add the quotient by the reciprocal can be corrected
 * instead: its remainder is a small multiple of the last place and so computed without rounding, and no
 * quotient by so small a divisor lies close enough to the middle between two doubles for what error is left
 * to matter. Near the ends of the range of doubles this does not hold: see may_fuse. */
INLINE double divided(double x, double divisor, double reciprocal, int fused)
{
	if (!fused)
		return x / divisor;
	double quotient = x * reciprocal;
	return __builtin_fma(__builtin_fma(-quotient, divisor, x), reciprocal, quotient);
}

static int may_fuse(const hm2_column *column)
{
	double magnitude = column->scale < 0 ? -column->scale : column->scale;
	return column->bits <= 32 && magnitude > 1e-200 && magnitude < 1e200;
}

/* Where a field of up to 32 bits lies in the rows. */
typedef struct narrow {
	const uint32_t *low, *high; /* the same row if one word holds it all */
	uint32_t shift, mask;
} narrow;

static inline narrow narrow_of(const block *at, const hm2_column *column, uint32_t word)
{
	uint32_t shift = column->offset % 32;
	uint32_t next = shift + column->bits > 32 ? word + column->word_stride : word;
	return (narrow){at->rows[word], at->rows[next], shift, (uint32_t)hm2_low_bits(column->bits)};
}

/* One expression for one word and for two: what a single word contributes twice lies above the mask. */
#define NARROW(i) ((low[i] >> shift | high[i] << 1 << (31 - shift)) & mask)
#define NARROW_ROWS(from)                                         \
	const uint32_t *restrict low = (from).low;                     \
	const uint32_t *restrict high = (from).high;                   \
	uint32_t shift = (from).shift, mask = (from).mask

INLINE void get_narrow(block *at, narrow from)
{
	NARROW_ROWS(from);
	uint32_t *restrict raw = at->narrow;
	for (size_t i = 0; i < at->count; i++)
		raw[i] = NARROW(i);
}

INLINE void get_wide(block *at, const hm2_column *column, uint32_t word)
{
	uint32_t shift = column->offset % 32;
	const uint32_t *restrict low = at->rows[word];
	const uint32_t *restrict middle = at->rows[word + column->word_stride];
	uint64_t *restrict raw = at->wide;
	uint64_t mask = hm2_low_bits(column->bits);
	for (size_t i = 0; i < at->padded; i++)
		raw[i] = (low[i] | (uint64_t)middle[i] << 32) >> shift & mask;
	if (shift + column->bits <= 64)
		return;
	const uint32_t *restrict top = at->rows[word + 2 * column->word_stride];
	for (size_t i = 0; i < at->padded; i++)
		raw[i] = (raw[i] | (uint64_t)top[i] << (64 - shift)) & mask;
}

/* Where the values of a column go. */
struct sink {
	uint8_t *to;
	size_t count;
	int singles;    /* F32 instead of F64 */
	int past_cache; /* and 16-byte aligned */
};

/* Past the cache if the whole output would not fit there anyway: the lines need not be read before they are
 * overwritten, which halves the traffic. Done as the values come, so that the memory works while we count. */
INLINE void put_bytes(uint8_t *to, const void *from, size_t size, int past_cache)
{
#ifdef __SSE2__
	if (past_cache) {
		for (size_t at = 0; at < size; at += 16) {
			const __m128i *part = (const __m128i *)(const void *)((const uint8_t *)from + at);
			_mm_stream_si128((__m128i *)(void *)(to + at), _mm_loadu_si128(part));
		}
		return;
	}
#else
	(void)past_cache;
#endif
	memcpy(to, from, size);
}

INLINE void put_line(const struct sink *sink, size_t first, const double line[LINE])
{
	if (!sink->singles) {
		put_bytes(sink->to + first * sizeof(double), line, LINE * sizeof(double), sink->past_cache);
		return;
	}
	float rounded[LINE];
	for (size_t i = 0; i < LINE; i++)
		rounded[i] = (float)line[i];
	put_bytes(sink->to + first * sizeof(float), rounded, sizeof rounded, sink->past_cache);
}

INLINE void put_rest(const struct sink *sink, size_t first, const double *rest)
{
	for (size_t i = 0; first + i < sink->count; i++) {
		float rounded = (float)rest[i];
		if (sink->singles)
			memcpy(sink->to + (first + i) * sizeof rounded, &rounded, sizeof rounded);
		else
			memcpy(sink->to + (first + i) * sizeof(double), &rest[i], sizeof(double));
	}
}

/* The value of every record i, a line of the cache at a time. Rows have room for a whole last line. */
#define FILL(sink, value)                                        \
	for (size_t first = 0; first < (sink)->count; first += LINE) { \
		double line[LINE];                                         \
		for (size_t k = 0; k < LINE; k++) {                        \
			size_t i = first + k;                                  \
			line[k] = (value);                                     \
		}                                                          \
		if (first + LINE <= (sink)->count)                         \
			put_line(sink, first, line);                           \
		else                                                       \
			put_rest(sink, first, line);                           \
	}

INLINE void scale_signed(const struct sink *sink, const hm2_column *column, narrow from, int fused)
{
	NARROW_ROWS(from);
	double scale = column->scale, full = 2147483647.0, reciprocal = 1.0 / full;
	uint32_t align = 32 - column->bits;
	FILL(sink, divided((double)(int32_t)(NARROW(i) << align), full, reciprocal, fused) * scale)
}

INLINE void scale_unsigned(const struct sink *sink, const hm2_column *column, narrow from, int fused)
{
	NARROW_ROWS(from);
	double scale = column->scale, full = mask, reciprocal = 1.0 / full;
	if (column->bits == 32)
		FILL(sink, divided((double)NARROW(i) * scale, full, reciprocal, fused))
	else /* conversion of a signed int is an instruction everywhere */
		FILL(sink, divided((double)(int32_t)NARROW(i) * scale, full, reciprocal, fused))
}

INLINE void scale_wide(const struct sink *sink, const hm2_column *column, const uint64_t *restrict raw)
{
	double scale = column->scale, full = (double)hm2_low_bits(column->bits);
	uint32_t align = 64 - column->bits;
	if (column->kind == HM2_FIELD_SIGNED)
		FILL(sink, (double)(int64_t)(raw[i] << align) / 9223372036854775808.0 * scale)
	else
		FILL(sink, (double)raw[i] * scale / full)
}

INLINE double as_float(uint32_t bits)
{
	float value;
	memcpy(&value, &bits, sizeof value);
	return (double)value;
}

INLINE double as_double(uint64_t bits)
{
	double value;
	memcpy(&value, &bits, sizeof value);
	return value;
}

INLINE void put_values(block *at, const hm2_column *column, const struct sink *sink, uint32_t word, int fused)
{
	if (column->bits > 32) {
		get_wide(at, column, word);
		if (column->kind == HM2_FIELD_FLOAT)
			FILL(sink, as_double(at->wide[i]))
		else
			scale_wide(sink, column, at->wide);
		return;
	}
	narrow from = narrow_of(at, column, word);
	NARROW_ROWS(from);
	fused = fused && may_fuse(column);
	if (column->kind == HM2_FIELD_FLOAT)
		FILL(sink, as_float(NARROW(i)))
	else if (column->kind == HM2_FIELD_SIGNED && fused)
		scale_signed(sink, column, from, 1);
	else if (column->kind == HM2_FIELD_SIGNED)
		scale_signed(sink, column, from, 0);
	else if (fused)
		scale_unsigned(sink, column, from, 1);
	else
		scale_unsigned(sink, column, from, 0);
}

INLINE void get_truths(block *at, int wide)
{
	if (wide)
		for (size_t i = 0; i < at->count && i < BLOCK; i++)
			at->truths[i] = at->wide[i] != 0;
	else
		for (size_t i = 0; i < at->count && i < BLOCK; i++)
			at->truths[i] = at->narrow[i] != 0;
}

/* Raw bits, or whether there are any. Gives where they are. */
INLINE const void *get_raw(block *at, const hm2_column *column, uint32_t word)
{
	int wide = column->bits > 32;
	if (column->type == HM2_COLUMN_U32 && column->bits == 32 && column->offset % 32 == 0)
		return at->rows[word];
	if (wide)
		get_wide(at, column, word);
	else
		get_narrow(at, narrow_of(at, column, word));
	if (column->type == HM2_COLUMN_U8) {
		get_truths(at, wide);
		return at->truths;
	}
	if (column->type == HM2_COLUMN_U32)
		return at->narrow;
	if (!wide)
		for (size_t i = 0; i < at->count; i++)
			at->wide[i] = at->narrow[i];
	return at->wide;
}

INLINE void decode_columns(block *at, const hm2_column *columns, size_t count, size_t first, int fused)
{
	for (const hm2_column *column = columns; column < columns + count; column++) {
		uint32_t word = column->first_word + column->offset / 32 * column->word_stride;
		size_t size = sizes[column->type];
		struct sink sink = {(uint8_t *)column->data + first * size, at->count, column->type == HM2_COLUMN_F32, 0};
		sink.past_cache = at->past_cache && ((uintptr_t)sink.to & 15) == 0;
		if (column->type == HM2_COLUMN_F64 || column->type == HM2_COLUMN_F32)
			put_values(at, column, &sink, word, fused);
		else if (at->count == BLOCK)
			put_bytes(sink.to, get_raw(at, column, word), BLOCK * size, sink.past_cache);
		else
			memcpy(sink.to, get_raw(at, column, word), at->count * size);
	}
}

/* The same code for what every processor has and for two wider levels. */
static void decode_plain(block *at, const hm2_column *columns, size_t count, size_t first)
{
	decode_columns(at, columns, count, first, 0);
}

typedef void decoder(block *at, const hm2_column *columns, size_t count, size_t first);

#if defined(__x86_64__) && defined(__GNUC__)
__attribute__((target("avx2,fma"))) static void decode_avx2(block *at, const hm2_column *columns, size_t count,
                                                             size_t first)
{
	decode_columns(at, columns, count, first, 1);
}

__attribute__((target("avx512f,avx512dq,avx512vl,avx512bw,fma"))) static void
decode_avx512(block *at, const hm2_column *columns, size_t count, size_t first)
{
	decode_columns(at, columns, count, first, 1);
}

static decoder *choose_decoder(void)
{
	if (!__builtin_cpu_supports("avx2") || !__builtin_cpu_supports("fma"))
		return decode_plain;
	if (!__builtin_cpu_supports("avx512dq") || !__builtin_cpu_supports("avx512vl") ||
	    !__builtin_cpu_supports("avx512bw"))
		return decode_avx2;
	return decode_avx512;
}
#else
static decoder *choose_decoder(void)
{
	return decode_plain;
}
#endif

static void fill_rows(block *at, const uint8_t *records, size_t stride, uint32_t words)
{
	for (uint32_t word = 0; word < words; word++) {
		const uint8_t *from = records + 4 * (size_t)word;
		uint32_t *restrict row = at->rows[word];
		for (size_t i = 0; i < at->count; i++)
			row[i] = load_le32(from + i * stride);
		for (size_t i = at->count; i < at->padded; i++)
			row[i] = 0;
	}
}

static int is_type_of_kind(const hm2_column *column)
{
	switch (column->type) {
	case HM2_COLUMN_F64:
	case HM2_COLUMN_F32:
		return column->kind == HM2_FIELD_UNSIGNED || column->kind == HM2_FIELD_SIGNED ||
		       (column->kind == HM2_FIELD_FLOAT && (column->bits == 32 || column->bits == 64));
	case HM2_COLUMN_U32: return column->bits <= 32;
	case HM2_COLUMN_U64: return 1;
	case HM2_COLUMN_U8: return column->kind == HM2_FIELD_BOOLEAN;
	default: return 0;
	}
}

static int check_column(const hm2_column *column, uint32_t words)
{
	if (column->bits < 1 || column->bits > 64 || !is_type_of_kind(column) || !column->data)
		return HM2_ERR_RANGE;
	uint64_t last = ((uint64_t)column->offset + column->bits - 1) / 32;
	if (column->first_word + last * column->word_stride >= words)
		return HM2_ERR_RANGE;
	return HM2_OK;
}

int hm2_bulk_decode(const uint8_t *records, size_t stride, uint32_t words, size_t count,
                    const hm2_column *columns, size_t column_count, hm2_error *error)
{
	int status = words < 1 || words > HM2_BULK_WORDS ? HM2_ERR_RANGE : HM2_OK;
	size_t index = 0;
	for (; status == HM2_OK && index < column_count; index++)
		status = check_column(&columns[index], words);
	if (status != HM2_OK) {
		hm2_error_set(error, status, "bulk decode");
		if (error)
			error->index = (int32_t)index - 1;
		return status;
	}
	decoder *decode = choose_decoder();
	size_t output = 0;
	for (index = 0; index < column_count; index++)
		output += count * sizes[columns[index].type];
	block at;
	at.past_cache = output > CACHE_BYTES;
	for (size_t first = 0; first < count; first += BLOCK) {
		at.count = count - first < BLOCK ? count - first : BLOCK;
		at.padded = (at.count + LINE - 1) / LINE * LINE;
		fill_rows(&at, records + first * stride, stride, words);
		decode(&at, columns, column_count, first);
	}
#ifdef __SSE2__
	_mm_sfence();
#endif
	return HM2_OK;
}
