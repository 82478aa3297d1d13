/* The compiled plan of process data: where each value lies and what is done with it. */
#ifndef HM2_PROCESS_DATA_H
#define HM2_PROCESS_DATA_H

#include "hm2.h"

#include <stdatomic.h>

/* Where up to 64 bits lie in an image: in one, two or three words. */
typedef struct hm2_window {
	uint16_t low, middle, top; /* word indices; those not needed repeat low */
	uint8_t shift;             /* of the least significant bit in the low word */
	uint8_t bits;
} hm2_window;

/* What unpack and pack do, one loop each: a run of equal operations needs no decisions per field. Narrow is up
 * to 32 bits, which never take more than two words. */
enum hm2_operation_kind {
	HM2_OPERATION_RAW,
	HM2_OPERATION_BOOLEAN,
	HM2_OPERATION_UNSIGNED, /* narrow */
	HM2_OPERATION_SIGNED,   /* narrow */
	HM2_OPERATION_LONG_UNSIGNED,
	HM2_OPERATION_LONG_SIGNED,
	HM2_OPERATION_FLOAT,
	HM2_OPERATION_DOUBLE,
	HM2_OPERATION_COUNTER,
	HM2_OPERATION_COUNTER_LOW, /* the lower part of a counter in two parts; `other` finds the upper */
	HM2_OPERATION_NOTHING,     /* the upper part: done with the lower */
	HM2_OPERATION_KINDS
};

typedef struct hm2_unpack_operation {
	hm2_window window;
	uint64_t mask;
	double scale;
	double full;       /* UNSIGNED: 2^bits - 1 */
	uint64_t previous; /* counters: the last reading */
	uint64_t total;    /* sum of all movements, modulo 2^64 */
	uint64_t zero;     /* total that counts as 0 */
	uint32_t field;
	uint32_t other;    /* operation of the other part */
	_Atomic uint32_t zero_wanted;
} hm2_unpack_operation;

/* From a value to raw bits. */
typedef struct hm2_pack_operation {
	uint64_t mask;
	uint64_t invert; /* BOOLEAN */
	double scale;    /* infinite where the user's cannot be divided by: the output rests */
	double full;     /* UNSIGNED: 2^bits - 1 */
	double low, high;
	uint32_t field;
	uint32_t bits;
} hm2_pack_operation;

/* Raw bits of a field that go into one word: turned left by so many bits, then those of the mask. */
typedef struct hm2_placement {
	uint32_t mask;
	uint32_t invert; /* BITS, STREAM */
	uint32_t field;
	uint32_t turn;
} hm2_placement;

/* A word of the output image, put together in one go from all fields that have bits in it. */
typedef struct hm2_packed_word {
	uint32_t word;
	uint32_t keep; /* bits nobody writes */
	const hm2_placement *end;
} hm2_packed_word;

struct hm2_process_data {
	const uint32_t *inputs;
	uint32_t *outputs;
	double *values;
	uint64_t *raw;
	hm2_unpack_operation *unpack; /* sorted by kind */
	hm2_unpack_operation *unpack_end[HM2_OPERATION_KINDS];
	hm2_pack_operation *pack;
	hm2_pack_operation *pack_end[HM2_OPERATION_KINDS];
	hm2_placement *placements; /* sorted by word */
	size_t placement_count;
	hm2_packed_word *words;
	size_t word_count;
	hm2_field *fields;
	uint32_t *operations; /* of each field; HM2_NO_OPERATION for PAD and written counters */
	size_t field_count;
};

#define HM2_NO_OPERATION UINT32_MAX

static inline uint64_t hm2_low_bits(uint32_t bits)
{
	return UINT64_MAX >> (64 - bits);
}

/* The low word of a value turned left by 0 to 63 bits. */
static inline uint32_t hm2_turned(uint64_t value, uint32_t turn)
{
	return (uint32_t)(value << (turn & 63) | value >> (-turn & 63));
}

#endif
