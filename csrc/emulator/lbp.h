/* The byte protocol LBP: header bits, local registers, special RPCs (fact sheet sserial.md 4). */
#ifndef HM2_EMULATOR_LBP_H
#define HM2_EMULATOR_LBP_H

#include <stddef.h>
#include <stdint.h>

/* The two top bits of a header. Type 0 ends a stored RPC and is invalid on the wire. */
enum lbp_type { LBP_TYPE_END, LBP_TYPE_DATA, LBP_TYPE_RPC, LBP_TYPE_LOCAL };

/* The other bits of a data header; LBP_WRITE serves the local registers too. */
enum lbp_header { LBP_WRITE = 0x20, LBP_RPC_DATA = 0x10, LBP_AUTO_INCREMENT = 0x08, LBP_ADDRESS = 0x04 };

#define LBP_SIZE(header) ((size_t)1 << ((header) & 3))
#define LBP_SIZE_MAX 8

enum lbp_rpc { LBP_DISCOVERY = 0xBB, LBP_UNIT_NUMBER = 0xBC, LBP_PROCESS_DATA = 0xBD };

/* Local registers: read 0xC0 + n, written 0xE0 + n. */
enum lbp_local {
	LBP_LISTEN_ADDRESS = 0x00,
	LBP_STATUS = 0x01,
	LBP_CRC_ENABLE = 0x02,
	LBP_CRC_ERRORS = 0x03,
	LBP_SOFTWARE_MODE = 0x06,
	LBP_CLEAR_FAULTS = 0x07,
	LBP_RPC_MEMORY = 0x0A,
	LBP_TIMEOUT = 0x0B,
	LBP_SPACE = 0x0C,
	LBP_NAME = 0x10, /* and 0x11..0x13 */
	LBP_CAPABILITY = 0x14,
	LBP_REVISION = 0x15,
	LBP_HARDWARE_MODE = 0x16,
	LBP_FAULT = 0x17, /* written: LEDs */
	LBP_POINTER_LOW = 0x18,
	LBP_POINTER_HIGH = 0x19,
	LBP_VERSION = 0x1A, /* written: added to the pointer */
	LBP_UNIT_ID = 0x1B, /* written as 0x1D */
	LBP_RPC_PITCH = 0x1C,
	LBP_RPC_SIZE_LOW = 0x1D,
	LBP_RPC_SIZE_HIGH = 0x1E, /* written: processor reset if the data is 0x5A */
	LBP_COOKIE = 0x1F         /* written: parser reset, no data */
};

#define LBP_RESET_PARSER 0xFF
#define LBP_RESET_KEY 0x5A

enum lbp_status {
	LBP_STATUS_CRC = 0x01,
	LBP_STATUS_WATCHDOG = 0x08,
	LBP_STATUS_BUFFER = 0x10,
	LBP_STATUS_INVALID = 0x20,
	LBP_STATUS_TIMEOUT = 0x40
};

enum lbp_space { LBP_SPACE_RAM = 0, LBP_SPACE_EEPROM = 1, LBP_SPACE_FLASH = 2 };

/* CRC-8/MAXIM-DOW. Over data and its CRC it is 0; over nothing it is 0. */
uint8_t hm2_lbp_crc8(const uint8_t *bytes, size_t length);
uint8_t hm2_lbp_crc8_add(uint8_t crc, uint8_t byte);
/* Bytes of the command that starts with this header; 0: there is no such command.
 * process_bytes: what the host sends after 0xBD. */
size_t hm2_lbp_command_length(uint8_t header, size_t process_bytes);

#endif
