/* What a cycle's participants need to know of a board. Private to csrc/board.c, cycle.c, engine*.c and sserial_cyclic.c. */
#ifndef HM2_BOARD_H
#define HM2_BOARD_H

#include "hm2.h"

/* Exchanges that failed, those included that never got to the bus: nothing of them has been carried out for sure. */
uint64_t board_failed(const struct hm2_board *board);
/* One that its maker gave up before it had begun. */
void board_given_up(struct hm2_board *board);
/* How often its gate has been shut. */
uint32_t board_shuttings(const struct hm2_board *board);

#endif
