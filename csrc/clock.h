/* The clock of every bus that works in real time: CLOCK_MONOTONIC. */
#ifndef HM2_CLOCK_H
#define HM2_CLOCK_H

#include <stdint.h>

int64_t hm2_clock_now_ns(void);
void hm2_clock_pause_ns(int64_t ns);

#endif
