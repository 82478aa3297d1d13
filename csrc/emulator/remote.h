/* An LBP remote at the end of a serial line: bytes come in with their times, bytes go out with
 * theirs. It knows nothing of the FPGA, so the same model serves SSERIAL and a serial port. */
#ifndef HM2_EMULATOR_REMOTE_H
#define HM2_EMULATOR_REMOTE_H

#include "hm2.h"

/* One 8N1 byte on the line. Times are picoseconds of the engine's clock. */
typedef struct hm2_line_byte {
	int64_t start_ps;      /* falling edge of the start bit */
	int64_t bit_ps;        /* duration of one bit */
	uint8_t value;
	uint8_t framing_error; /* stop bit low (break) */
} hm2_line_byte;

/* A byte whose stop bit has been sampled (middle of the stop bit = start + 9.5 bits) arrives. */
void hm2_remote_line_receive(struct hm2_remote *remote, const hm2_line_byte *byte);
/* The next byte the remote has decided to send, oldest first; 0 when there is none. It may lie
 * in the future. Once peeked it will be sent: nothing but power-off takes it back. */
int hm2_remote_line_peek(struct hm2_remote *remote, hm2_line_byte *byte);
void hm2_remote_line_pop(struct hm2_remote *remote);
/* Bring the remote's own timers (gap, watchdog, busy polls) up to now. */
void hm2_remote_advance(struct hm2_remote *remote, int64_t now_ps);
/* Zero wire time: hand over a whole frame with its CRC and get the whole answer with its CRC.
 * Returns the answer's length, 0 for silence. Same rules as the byte path, no time passes. */
size_t hm2_remote_exchange(struct hm2_remote *remote, const uint8_t *frame, size_t length,
                           uint8_t *answer, size_t capacity);

#endif
