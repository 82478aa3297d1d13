/* The byte protocol LBP (fact sheet sserial.md 4). Commands and local registers: registers.h. */
#ifndef HM2_EMULATOR_LBP_H
#define HM2_EMULATOR_LBP_H

#include <stddef.h>
#include <stdint.h>

#include "registers.h"

/* Bits of a data header; LBP_WRITE is the same bit in a local one. */
#define LBP_WRITE HM2_LBP_HEADER_ACCESS_WRITE_MASK
#define LBP_RPC_DATA HM2_LBP_HEADER_ACCESS_RPC_DATA_MASK
#define LBP_AUTO_INCREMENT HM2_LBP_HEADER_ACCESS_INCREMENT_MASK
#define LBP_ADDRESS HM2_LBP_HEADER_ACCESS_ADDRESS_MASK

#define LBP_KIND(header) ((unsigned)(header) >> HM2_LBP_HEADER_ACCESS_KIND_LSB)
#define LBP_SIZE(header) ((size_t)1 << ((header) & HM2_LBP_HEADER_ACCESS_SIZE_MASK))

/* CRC-8/MAXIM-DOW. Over data and its CRC it is 0; over nothing it is 0. */
uint8_t hm2_lbp_crc8(const uint8_t *bytes, size_t length);
uint8_t hm2_lbp_crc8_add(uint8_t crc, uint8_t byte);
/* Bytes of the command that starts with this header; 0: there is no such command.
 * process_bytes: what the host sends after 0xBD. */
size_t hm2_lbp_command_length(uint8_t header, size_t process_bytes);

#endif
