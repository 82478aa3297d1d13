/* What the model checker ESBMC understands, and nothing else does: any value, what may be assumed of it, and
 * what must follow. Every `prove_NAME` function of tests/c/proof is one proof; tools/prove.py runs them. */
#ifndef PROVE_H
#define PROVE_H

#include <stddef.h>
#include <stdint.h>

void __ESBMC_assume(_Bool condition);
void __ESBMC_assert(_Bool condition, const char *what);

uint8_t nondet_uint8(void);
uint16_t nondet_uint16(void);
uint32_t nondet_uint32(void);
uint64_t nondet_uint64(void);
double nondet_double(void);

#define ASSUME(condition) __ESBMC_assume(condition)
#define PROVE(condition) __ESBMC_assert(condition, #condition)

#endif
