/* hostmot2: the public C interface. This file is also the cffi cdef, so it holds
 * declarations, enums and integer defines only: no inline code, no conditionals.
 *
 * Conventions
 *   word     32 bits; address = byte address in the card's 64 KiB register file
 *   returns  HM2_OK (0) or a negative hm2_status; evidence goes to the caller's hm2_error
 *   buffers  belong to the caller and always come with a size
 *   time     nanoseconds (_ns) on the bus's own clock; the emulator's engine counts picoseconds (_ps)
 *   threads  an object is used by one thread at a time; different objects are independent
 */
#ifndef HM2_H
#define HM2_H

#include <stddef.h>
#include <stdint.h>

/* ---- status and evidence (error.c) ------------------------------------------------------ */

enum hm2_status {
	HM2_OK = 0,
	HM2_ERR_IO = -1,        /* the operating system refused; os_errno says why */
	HM2_ERR_TIMEOUT = -2,   /* no answer before the deadline */
	HM2_ERR_PROTOCOL = -3,  /* an answer that cannot be right: expected, received */
	HM2_ERR_RANGE = -4,     /* an argument outside its range: expected = limit, received = value */
	HM2_ERR_ALIGN = -5,     /* an address that is not a multiple of four */
	HM2_ERR_CLOSED = -6,    /* used after close */
	HM2_ERR_BUSY = -7,      /* the card is still at work on the last command */
	HM2_ERR_NO_MEMORY = -8,
	HM2_ERR_READ_ONLY = -9,
	HM2_ERR_FORMAT = -10    /* a table in the card's or a remote's memory is broken: address, detail */
};

typedef struct hm2_error {
	int32_t status;    /* enum hm2_status */
	int32_t os_errno;  /* for HM2_ERR_IO */
	int32_t detail;    /* a code of the layer that failed, named in `where` */
	int32_t index;     /* channel, module, pin or record number; -1: none */
	uint32_t address;
	uint32_t expected;
	uint32_t received;
	char where[32];    /* short static text: "sserial doit", "idrom" */
} hm2_error;

const char *hm2_status_name(int status);

/* ---- the register interface (every transport, and the emulator, offers this) ------------- */

#define HM2_TRANSFER_READ 0
#define HM2_TRANSFER_WRITE 1
#define HM2_TRANSFER_SAME_ADDRESS 2 /* flag: a FIFO, the address does not advance */

typedef struct hm2_transfer {
	uint32_t address; /* multiple of 4, below 0x10000 */
	uint16_t count;   /* words */
	uint16_t flags;   /* HM2_TRANSFER_* */
	uint32_t *words;  /* read: filled in by finish; write: taken by begin */
} hm2_transfer;

/* Transfers happen in list order. `begin` may send and return at once; `finish` waits for the
 * answers of the last begin until deadline_ns on the bus's clock. A list stays valid in between.
 * One begin is outstanding at a time. All members are required. */
typedef struct hm2_bus {
	void *self;
	int (*begin)(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error);
	int (*finish)(void *self, int64_t deadline_ns, hm2_error *error);
	int64_t (*now_ns)(void *self);             /* the clock deadlines are measured on */
	void (*pause_ns)(void *self, int64_t ns);  /* let that time pass (virtual clocks step) */
	void (*close)(void *self);
} hm2_bus;

/* ---- the board (board.c): checked words over any bus ------------------------------------- */

#define HM2_ADDRESS_SPACE 0x10000u        /* bytes of the register file */
#define HM2_BOARD_TIMEOUT_NS 200000000LL  /* of an exchange, unless set otherwise */

struct hm2_board;

typedef struct hm2_board_counters {
	uint64_t exchanges; /* lists of transfers that came back whole */
	uint64_t failures;  /* lists that did not */
	uint64_t words_read;
	uint64_t words_written;
} hm2_board_counters;

/* Takes over a copy of the bus and closes it in hm2_board_close. On failure the bus stays the caller's. */
int hm2_board_open(const hm2_bus *bus, struct hm2_board **board, hm2_error *error);
/* Idempotent; every later access fails with HM2_ERR_CLOSED. hm2_board_free closes too. */
void hm2_board_close(struct hm2_board *board);
void hm2_board_free(struct hm2_board *board);
void hm2_board_set_timeout_ns(struct hm2_board *board, int64_t timeout_ns);
void hm2_board_get_counters(const struct hm2_board *board, hm2_board_counters *counters);
/* The bus's clock, and letting its time pass. 0 and nothing after close. */
int64_t hm2_board_now_ns(struct hm2_board *board);
void hm2_board_pause_ns(struct hm2_board *board, int64_t ns);

/* count consecutive words. After a failure the words read are not to be used. */
int hm2_read(struct hm2_board *board, uint32_t address, uint32_t *words, size_t count, hm2_error *error);
int hm2_write(struct hm2_board *board, uint32_t address, const uint32_t *words, size_t count, hm2_error *error);
/* A list of transfers in order, all checked before the first is carried out. */
int hm2_exchange(struct hm2_board *board, const hm2_transfer *transfers, size_t count, hm2_error *error);
/* The two halves of hm2_exchange, for several cards at once and for pipelining. A begin while another is
 * outstanding fails with HM2_ERR_BUSY; after a failed finish nothing is outstanding. */
int hm2_begin(struct hm2_board *board, const hm2_transfer *transfers, size_t count, hm2_error *error);
int hm2_finish(struct hm2_board *board, int64_t deadline_ns, hm2_error *error);

/* ---- a mapped file (memory_map.c): PCI BAR, plain file, shared memory -------------------- */

enum hm2_memory_map_detail {
	HM2_MEMORY_MAP_NOT_FOUND = 1,
	HM2_MEMORY_MAP_PERMISSION, /* the file's mode or owner */
	HM2_MEMORY_MAP_LOCKDOWN,   /* opened, but the kernel forbids the mapping */
	HM2_MEMORY_MAP_TOO_SMALL,  /* expected, received: bytes */
	HM2_MEMORY_MAP_OTHER       /* os_errno says */
};

/* Maps the first 64 KiB of path, shared. Only aligned 32-bit accesses, little endian, in order. */
int hm2_memory_map_bus(const char *path, hm2_bus *bus, hm2_error *error);
/* ---- LBP16 codec (lbp16.c): pure functions on caller buffers, used by both sides ---------- */

#define HM2_LBP16_PORT 27181
#define HM2_LBP16_MAX_PAYLOAD 1472 /* bytes of one datagram, request or reply: never a fragment */
#define HM2_LBP16_MAX_COUNT 127

typedef struct hm2_lbp16_command {
	uint16_t address;      /* in bytes; only with has_address */
	uint8_t write;
	uint8_t has_address;   /* 0: the space's pointer is used */
	uint8_t info;          /* the space's information area instead of its memory */
	uint8_t space;         /* 0..7 */
	uint8_t element_size;  /* bytes: 1, 2, 4, 8 */
	uint8_t increment;     /* the pointer advances by element_size after each element */
	uint8_t count;         /* 1..127 elements */
} hm2_lbp16_command;

/* The 16-bit command word and back. A word with count 0 decodes to count 0. */
uint16_t hm2_lbp16_encode(const hm2_lbp16_command *command);
void hm2_lbp16_decode(uint16_t word, hm2_lbp16_command *command);
/* Append a command (and, for a write, its count * element_size bytes of data) to a packet of
 * *length bytes. HM2_ERR_RANGE and no change when it does not fit or a field is out of range. */
int hm2_lbp16_put(uint8_t *packet, size_t capacity, size_t *length, const hm2_lbp16_command *command,
                  const uint8_t *data);
/* The command at *offset, which moves behind it. A write's data stays in the packet: *data, NULL
 * for a read. HM2_ERR_FORMAT: count 0 or cut short in command or address; HM2_ERR_RANGE: the data
 * of a write runs past the end. */
int hm2_lbp16_next(const uint8_t *packet, size_t length, size_t *offset, hm2_lbp16_command *command,
                   const uint8_t **data);
/* Bytes of reply that a whole packet asks for (0: no datagram comes back). */
int hm2_lbp16_reply_size(const uint8_t *packet, size_t length, size_t *reply_size);

#endif
