/* Bulk decode takes the same bits out of recorded registers as unpack does out of live ones. */
#include "../../../csrc/error.c"
#undef __SSE2__ /* only the portable half */
#undef __x86_64__
#include "../../../csrc/bulk.c"
#include "prove.h"

/* Fields of up to 32 bits, in one word or over two. */
/* proof: --overflow-check --unwind 2 */
void prove_narrow_fields(void)
{
	const uint32_t low[1] = {nondet_uint32()}, high[1] = {nondet_uint32()};
	const uint32_t bits = nondet_uint8(), shift = nondet_uint8();
	const size_t i = 0;
	ASSUME(bits >= 1 && bits <= 32 && shift < 32);
	const uint32_t mask = (uint32_t)hm2_low_bits(bits);
	const uint64_t both = low[0] | (uint64_t)high[0] << 32;
	PROVE(shift + bits <= 32 || NARROW(i) == (both >> shift & mask));
	PROVE(shift + bits > 32 || (low[0] >> shift & mask) == (uint32_t)((low[i] >> shift | low[i] << 1 << (31 - shift)) & mask));
}
