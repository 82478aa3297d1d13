/* How a byte on a serial line (8N1) is heard, by either end. */
#ifndef HM2_EMULATOR_LINE_H
#define HM2_EMULATOR_LINE_H

#include "hm2.h"

#define BITS_PER_BYTE 10
#define STOP_BIT_MIDDLE_HALF_BITS 19
#define BAUD_TOLERANCE 25 /* 1/25: at 4 % the stop bit of an 8N1 byte is still hit */

/* When who receives at `bit_ps` samples the stop bit, and so has the byte. */
static inline int64_t line_heard_ps(const hm2_line_byte *byte, int64_t bit_ps)
{
	return byte->start_ps + STOP_BIT_MIDDLE_HALF_BITS * bit_ps / 2;
}

static inline int line_misheard(const hm2_line_byte *byte, int64_t bit_ps)
{
	int64_t off = byte->bit_ps > bit_ps ? byte->bit_ps - bit_ps : bit_ps - byte->bit_ps;
	return byte->framing_error || off * BAUD_TOLERANCE > bit_ps;
}

#endif
