/* Process data of a whole channel of 224 bits: every offset and width at once, every content. */
#include "../../../csrc/error.c"
#include "../../../csrc/process_data.c"
#include "../../../csrc/process_pack.c"
#include "../../../csrc/process_unpack.c"
#include "prove.h"

#define WORDS 7

typedef struct bench {
	uint32_t words[WORDS];
	uint32_t before[WORDS];
	double values[1];
	uint64_t raw[1];
	hm2_field field;
	uint32_t operation;
	hm2_unpack_operation unpack;
	hm2_pack_operation pack;
	hm2_placement placements[3];
	hm2_packed_word packed[3];
	hm2_image image;
	struct hm2_process_data data;
} bench;

static uint64_t mask_of(uint32_t bits)
{
	return bits == 64 ? UINT64_MAX : ((uint64_t)1 << bits) - 1;
}

/* A field of this kind and direction anywhere in a channel of any content; the plan is compiled as by the driver. */
static void start(bench *b, int32_t kind, int32_t direction)
{
	hm2_field field = {.kind = kind, .direction = direction, .partner = -1, .bits = nondet_uint8(),
	                   .offset = nondet_uint8(), .scale = 1.0, .low = -1.0, .high = 1.0};

	b->image = (hm2_image){b->words, WORDS, 1, WORDS, 1, 1};
	b->field = field;
	ASSUME(check_field(&b->field, 0, &b->image, NULL) == HM2_OK);
	PROVE(field.bits >= 1 && field.bits <= 64 && field.offset + field.bits <= 32 * WORDS);
	for (int i = 0; i < WORDS; i++)
		b->before[i] = b->words[i] = nondet_uint32();
	b->data = (struct hm2_process_data){
		.inputs = b->words, .outputs = b->words, .values = b->values, .raw = b->raw, .unpack = &b->unpack,
		.pack = &b->pack, .placements = b->placements, .words = b->packed, .fields = &b->field,
		.operations = &b->operation, .field_count = 1,
	};
	compile(&b->data, &b->image, &b->image);
}

/* Bit number i of the channel. */
static int bit(const uint32_t *words, uint32_t i)
{
	return words[i / 32] >> i % 32 & 1;
}

/* Any 64 bits at any place: exactly the field's bits are written, each where it belongs, all others stay, and
 * they read back as they were. */
void prove_bits_round_trip(void)
{
	bench b;
	start(&b, HM2_FIELD_BITS, HM2_FIELD_OUTPUT);
	const uint64_t written = nondet_uint64();
	b.raw[0] = written;
	place(&b.data);
	const uint32_t i = nondet_uint8();
	ASSUME(i < 32 * WORDS);
	const uint32_t offset = b.field.offset, bits = b.field.bits;
	if (i >= offset && i < offset + bits)
		PROVE(bit(b.words, i) == (int)(written >> (i - offset) & 1));
	else
		PROVE(bit(b.words, i) == bit(b.before, i));
}
