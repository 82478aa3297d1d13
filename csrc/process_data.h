/* The compiled plan of process data: where each value lies and what is done with it. */
#ifndef HM2_PROCESS_DATA_H
#define HM2_PROCESS_DATA_H

#include "hm2.h"

/* Where up to 64 bits lie in an image: in one, two or three words. */
typedef struct hm2_window {
	uint16_t low, middle, top; /* word indices; those not needed repeat low */
	uint8_t shift;             /* of the least significant bit in the low word */
	uint8_t bits;
} hm2_window;

/* What unpack does, one loop each: a run of equal operations needs no decisions per field. */
enum hm2_unpack_kind {
	HM2_UNPACK_RAW,
	HM2_UNPACK_BOOLEAN,
	HM2_UNPACK_UNSIGNED,
	HM2_UNPACK_SIGNED,      /* up to 32 bits */
	HM2_UNPACK_LONG_SIGNED, /* 33 to 64 bits */
	HM2_UNPACK_FLOAT,
	HM2_UNPACK_DOUBLE,
	HM2_UNPACK_COUNTER,
	HM2_UNPACK_COUNTER_LOW, /* the lower part of a counter in two parts; `other` finds the upper */
	HM2_UNPACK_NOTHING,     /* the upper part: done with the lower */
	HM2_UNPACK_KINDS
};

enum hm2_pack_kind {
	HM2_PACK_RAW,
	HM2_PACK_BOOLEAN,
	HM2_PACK_UNSIGNED,
	HM2_PACK_SIGNED,
	HM2_PACK_LONG_SIGNED,
	HM2_PACK_FLOAT,
	HM2_PACK_DOUBLE,
	HM2_PACK_KINDS
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
} hm2_unpack_operation;

typedef struct hm2_pack_operation {
	hm2_window window;
	uint64_t mask;
	uint64_t invert;
	double scale;
	double full;
	double low, high;
	uint32_t field;
	uint32_t unused;
} hm2_pack_operation;

struct hm2_process_data {
	const uint32_t *inputs;
	uint32_t *outputs;
	double *values;
	uint64_t *raw;
	uint32_t unpack_end[HM2_UNPACK_KINDS]; /* operations are sorted by kind */
	uint32_t pack_end[HM2_PACK_KINDS];
	hm2_unpack_operation *unpack;
	hm2_pack_operation *pack;
	hm2_field *fields;
	uint32_t *operations; /* of each field; HM2_NO_OPERATION for PAD and written counters */
	size_t field_count;
};

#define HM2_NO_OPERATION UINT32_MAX

static inline uint64_t hm2_low_bits(uint32_t bits)
{
	return UINT64_MAX >> (64 - bits);
}

#endif
