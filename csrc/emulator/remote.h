/* An LBP remote at the end of a serial line: bytes come in with their times, bytes go out with
 * theirs. It knows nothing of the FPGA, so the same model serves SSERIAL, a serial port and a pseudo
 * terminal. All of its interface is public (hm2.h, "emulated remotes"): hm2_line_byte,
 * hm2_remote_line_receive, _peek, _pop, hm2_remote_advance and hm2_remote_exchange. */
#ifndef HM2_EMULATOR_REMOTE_H
#define HM2_EMULATOR_REMOTE_H

#include "hm2.h"

#endif
