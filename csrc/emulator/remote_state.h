/* What a remote consists of; seen by emulator/remote*.c only. */
#ifndef HM2_EMULATOR_REMOTE_STATE_H
#define HM2_EMULATOR_REMOTE_STATE_H

#include "fault.h"
#include "lbp.h"
#include "remote.h"

#define RAM_SIZE 0x10000
#define RPC_TABLE_SIZE 512 /* 64 entries of 8 bytes */
#define FRAME_MAX 320      /* the longest command is 0xBD with 255 bytes */
#define TX_QUEUE 1024
#define MODES_MAX 16
#define ELEMENTS_MAX 512
#define COPIES_MAX 64
#define RANGES_MAX 16

/* Bytes of one process image, longer than the longest so that elements are moved 9 bytes at a time. */
#define IMAGE_SIZE (HM2_REMOTE_DATA_MAX + 9)

typedef struct remote_mode {
	uint8_t index, receive_size, transmit_size;
	uint8_t both_ways; /* has bidirectional elements */
	uint16_t ptoc, gtoc;
	uint16_t first, count; /* elements */
	uint16_t input_bits, output_bits;
} remote_mode;

typedef struct remote_element {
	uint16_t address;
	uint16_t input_bit, output_bit; /* place in the images */
	uint8_t bits, direction;
} remote_element;

typedef struct remote_copy {
	uint16_t from, to, size;
} remote_copy;

typedef struct remote_range {
	uint16_t first, last;
	uint8_t space, writable;
} remote_range;

/* The receiver between two frames and inside one. */
typedef struct remote_receiver {
	uint8_t frame[FRAME_MAX];
	size_t length;      /* bytes in `frame` */
	size_t boundary;    /* bytes of its complete commands */
	size_t need;        /* where the command in progress ends; == boundary: none in progress */
	uint8_t crc;        /* over `frame` */
	uint8_t discarding; /* until the next gap */
	int64_t end_ps;     /* end of the last byte's stop bit */
} remote_receiver;

typedef struct remote_transmitter {
	hm2_line_byte queue[TX_QUEUE];
	size_t head, count;
	int64_t free_ps; /* the line is busy until then */
} remote_transmitter;

typedef struct remote_flash {
	uint8_t *bytes; /* NULL: no flash */
	size_t size;
	uint32_t offset;
	uint8_t log2_erase, log2_write;
	uint8_t buffer[4096];
} remote_flash;

/* An answer in the making. */
typedef struct remote_answer {
	uint8_t bytes[FRAME_MAX];
	size_t length;
	uint8_t broken; /* last stop bit low */
	int64_t late_ps;
} remote_answer;

struct hm2_remote {
	int64_t knob[HM2_REMOTE_KNOBS];
	int64_t now_ps;
	int64_t fed_ps; /* when the watchdog was last fed */
	int64_t busy_ps; /* at work in the flash until then: no answer before */
	int64_t bit_ps;
	uint8_t locals[0x20]; /* local registers that only keep what is written */
	uint16_t pointer;
	uint8_t pid_enabled; /* 8I20 */
	uint8_t input_image[IMAGE_SIZE];
	uint8_t output_image[IMAGE_SIZE];
	uint8_t inputs_stale;  /* RAM is newer than the image */
	uint8_t outputs_stale; /* the image is newer than RAM */
	size_t input_length;
	const remote_mode *mode; /* NULL: plain, or illegal mode */
	uint8_t illegal_mode;
	remote_receiver rx;
	remote_transmitter tx;
	uint8_t rpc_table[RPC_TABLE_SIZE];
	uint8_t ram[RAM_SIZE];
	uint8_t power_on_ram[RAM_SIZE];
	uint8_t eeprom[HM2_REMOTE_EEPROM_MAX];
	size_t eeprom_size; /* 0: space 1 is RAM + 0x400 */
	remote_flash flash;
	remote_mode modes[MODES_MAX];
	size_t mode_count;
	remote_element elements[ELEMENTS_MAX];
	size_t element_count;
	remote_copy copies[COPIES_MAX];
	size_t copy_count;
	remote_range ranges[RANGES_MAX];
	size_t range_count;
	hm2_remote_write writes[HM2_REMOTE_WRITES_KEPT];
	uint64_t write_count;
	struct fault_plan faults; /* steps: answers */
};

/* remote_commands.c, remote_answer.c: obey a frame without its CRC. 0: answered (into `answer`, no CRC yet), -1: silence. */
int remote_obey(hm2_remote *remote, const uint8_t *frame, size_t length, remote_answer *answer);
/* Bytes of the command with this header; 0: invalid. */
size_t remote_command_length(const hm2_remote *remote, uint8_t header);
/* CRC and injected errors; 0: nothing is to be sent. */
int remote_finish_answer(hm2_remote *remote, remote_answer *answer);
void remote_set_status(hm2_remote *remote, int bit);
void remote_crc_error(hm2_remote *remote);

/* remote_memory.c: what the line may do. 0: done, -1: no such memory. */
int remote_read(hm2_remote *remote, uint16_t address, uint8_t *bytes, size_t length);
int remote_write(hm2_remote *remote, uint16_t address, const uint8_t *bytes, size_t length);

/* remote_flash.c: memory space 2. 0: done, -1: not so. */
int remote_flash_read(hm2_remote *remote, uint16_t address, uint8_t *bytes, size_t length);
int remote_flash_write(hm2_remote *remote, uint16_t address, const uint8_t *bytes, size_t length);

/* remote_process.c */
void remote_process(hm2_remote *remote, const uint8_t *outputs, remote_answer *answer);
void remote_select_mode(hm2_remote *remote, uint8_t mode);
void remote_clear_faults(hm2_remote *remote);
void remote_feed_watchdog(hm2_remote *remote);
void remote_check_watchdog(hm2_remote *remote);
void remote_outputs_off(hm2_remote *remote);
void remote_images_to_ram(hm2_remote *remote);
void remote_ram_to_images(hm2_remote *remote, uint32_t address, size_t length);
void remote_refresh_inputs(hm2_remote *remote);
void remote_inputs_to_ram(hm2_remote *remote);

/* The faults that count: an 8I20 has a word of them, the others a byte. */
int64_t *remote_faults(hm2_remote *remote);
int remote_gated(hm2_remote *remote);
/* After a change of the faults: outputs, RAM. */
void remote_show_faults(hm2_remote *remote);

/* remote_8i20.c: RAM words of the 8I20 that are more than memory. */
void remote_8i20_show_faults(hm2_remote *remote);
void remote_8i20_supervise(hm2_remote *remote); /* conditions of the drive: brake, faults, limits, currents */
void remote_8i20_software_reset(hm2_remote *remote);
int64_t remote_8i20_unmasked(const hm2_remote *remote); /* the faults that stop the drive */
void remote_8i20_before_read(hm2_remote *remote, uint16_t address, size_t length);
void remote_8i20_after_write(hm2_remote *remote, uint16_t address, size_t length);

static inline int remote_alive(const hm2_remote *remote)
{
	return remote->knob[HM2_REMOTE_ALIVE] != 0;
}

#endif
