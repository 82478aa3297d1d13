/* hostmot2: the public C interface. This file is also the cffi cdef, so it holds
 * declarations, enums and integer defines only: no inline code, no conditionals.
 *
 * Conventions
 *   word     32 bits; address = byte address in the card's 64 KiB register file
 *   returns  HM2_OK (0) or a negative hm2_status; evidence goes to the caller's hm2_error
 *            (NULL: none is wanted)
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
	HM2_ERR_FORMAT = -10,   /* a table in the card's or a remote's memory is broken: address, detail */
	HM2_ERR_GATED = -11,    /* writes are held back until the user has acknowledged a watchdog bite */
	HM2_ERR_ABSENT = -13,   /* the word is not in the recording */
	HM2_ERR_LINK = -12      /* too many exchanges in a row failed: expected = limit, received = level */
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
 * One begin is outstanding at a time. All members but the last are required. */
typedef struct hm2_bus {
	void *self;
	int (*begin)(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error);
	int (*finish)(void *self, int64_t deadline_ns, hm2_error *error);
	int64_t (*now_ns)(void *self);             /* the clock deadlines are measured on */
	void (*pause_ns)(void *self, int64_t ns);  /* let that time pass (virtual clocks step) */
	void (*close)(void *self);
	/* How often an old request was carried out after a newer one, or one that writes twice, as an exchange of now
	 * has shown; from any thread. NULL: this bus delivers nothing late or twice. */
	uint64_t (*disturbances)(void *self);
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
/* As the bus tells it; 0 after close. What takes several exchanges is good only if this has not changed meanwhile. */
uint64_t hm2_board_disturbances(struct hm2_board *board);

/* While the gate is shut every list with a write in it fails with HM2_ERR_GATED and nothing is sent. Shut by
 * a watchdog bite; opened by whoever has decided that the machine may move again. */
void hm2_board_set_gate(struct hm2_board *board, int shut);
int hm2_board_gate_is_shut(const struct hm2_board *board);
/* From now on, and for good, every list with a write in it fails with HM2_ERR_READ_ONLY and cycles write nothing. */
void hm2_board_set_read_only(struct hm2_board *board);
int hm2_board_takes_writes(const struct hm2_board *board);

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

/* ---- recorded words (image.c): a card that can only be looked at -------------------------- */

/* A bus that reads the given words at the given addresses (copied), HM2_ERR_ABSENT elsewhere; writes fail
 * with HM2_ERR_READ_ONLY. HM2_ERR_ALIGN, HM2_ERR_RANGE: an address that cannot be, index = which. */
int hm2_image_bus(const uint32_t *addresses, const uint32_t *words, size_t count, hm2_bus *bus, hm2_error *error);

/* ---- process data (process_data.c, process_unpack.c, process_pack.c) ----------------------- */

/* The type and direction bytes of a process data descriptor (sserial.md 5.1). */
enum hm2_field_kind {
	HM2_FIELD_PAD = 0x00,
	HM2_FIELD_BITS = 0x01,
	HM2_FIELD_UNSIGNED = 0x02,
	HM2_FIELD_SIGNED = 0x03,
	HM2_FIELD_STREAM = 0x06,
	HM2_FIELD_BOOLEAN = 0x07,
	HM2_FIELD_ENCODER = 0x08,
	HM2_FIELD_FLOAT = 0x10,
	HM2_FIELD_ENCODER_H = 0x18,
	HM2_FIELD_ENCODER_L = 0x28
};

enum hm2_field_direction { HM2_FIELD_INPUT = 0x00, HM2_FIELD_OUTPUT = 0x80 };

typedef struct hm2_field {
	int32_t channel;
	int32_t kind;      /* enum hm2_field_kind */
	int32_t direction; /* enum hm2_field_direction; a bidirectional element is two fields */
	int32_t partner;   /* ENCODER_H and _L: index of the other part, -1: none, a counter by itself */
	uint32_t bits;     /* 1..64; FLOAT 32 or 64 */
	uint32_t offset;   /* of the least significant bit, from bit 0 of the channel's first word */
	double scale;      /* user units at full scale; counters: counts per user unit */
	double low, high;  /* user units; outputs are clamped to them before anything else */
	uint64_t invert;   /* BITS: mask of bits written inverted; BOOLEAN: not zero inverts */
} hm2_field;

/* Register words of all channels: word w of channel c is words[c * channel_stride + w * word_stride].
 * A direction nothing lies in has count 0. */
typedef struct hm2_image {
	uint32_t *words;
	uint32_t count;             /* words in the buffer */
	uint32_t channels;
	uint32_t words_per_channel; /* 3 or 7 */
	uint32_t channel_stride;
	uint32_t word_stride;
} hm2_image;

struct hm2_process_data;

/* Compile a plan. values and raw have one entry per field; they and the images belong to the caller and
 * are used until free. What they hold:
 *   UNSIGNED, SIGNED, FLOAT    values: user units       raw: the bits in the image
 *   BOOLEAN                    values: 0.0 or 1.0       raw: the bits in the image
 *   BITS, STREAM               values: unused           raw: the bits, also what is to be written
 *   ENCODER and its parts      values: count / scale    raw: count, two's complement
 * HM2_ERR_RANGE: index = the field that cannot be, expected = limit, received = value. */
int hm2_process_data_new(const hm2_field *fields, size_t count, const hm2_image *inputs,
                         const hm2_image *outputs, double *values, uint64_t *raw,
                         struct hm2_process_data **process_data, hm2_error *error);
void hm2_process_data_free(struct hm2_process_data *process_data);
/* All inputs: image to values and raw. All outputs: values and raw to image. One call for a whole port;
 * neither fails, allocates or looks at anything outside the caller's buffers. */
void hm2_process_data_unpack(struct hm2_process_data *process_data);
void hm2_process_data_pack(struct hm2_process_data *process_data);
/* Change what the user may change. Takes effect at the next unpack or pack. */
int hm2_process_data_configure(struct hm2_process_data *process_data, size_t index, double scale, double low,
                               double high, uint64_t invert, hm2_error *error);
/* Counters: the next count of this field is relative to where it stands now. Any thread, also during an unpack. */
int hm2_process_data_zero(struct hm2_process_data *process_data, size_t index, hm2_error *error);
/* Counters of a channel as at the beginning: the next reading counts from 0. For a remote started anew. */
void hm2_process_data_restart(struct hm2_process_data *process_data, int channel);
/* Counters of `to` go on from where those of `from` stand; both were made of the same fields. */
void hm2_process_data_carry_on(struct hm2_process_data *to, const struct hm2_process_data *from);

/* ---- bulk decode (bulk.c): recorded cycles to columns --------------------------------------- */

enum hm2_column_type { HM2_COLUMN_F64, HM2_COLUMN_F32, HM2_COLUMN_U32, HM2_COLUMN_U64, HM2_COLUMN_U8 };

#define HM2_BULK_WORDS 64 /* of one record, at most */

/* One field over many records. Same formulas and bit-identical results as unpack; counters come as
 * their readings. UNSIGNED, SIGNED, FLOAT fill F64 or F32 (the F64 value rounded), BOOLEAN fills U8 with
 * 0 and 1, all kinds fill U32 (up to 32 bits) and U64 with raw bits. */
typedef struct hm2_column {
	void *data;           /* one entry per record */
	int32_t type;         /* enum hm2_column_type */
	int32_t kind;         /* enum hm2_field_kind */
	uint32_t bits;
	uint32_t offset;      /* of the least significant bit, from bit 0 of first_word */
	uint32_t first_word;  /* of the field's channel within a record */
	uint32_t word_stride; /* words between consecutive registers of the channel */
	double scale;
} hm2_column;

/* Records are little-endian register words, `stride` bytes apart, at any alignment; every record has
 * `words` words. HM2_ERR_RANGE: index = the column that cannot be. */
int hm2_bulk_decode(const uint8_t *records, size_t stride, uint32_t words, size_t count,
                    const hm2_column *columns, size_t column_count, hm2_error *error);

/* ---- latency histogram (histogram.c): fixed memory, a few nanoseconds per value ------------- */

/* Buckets are at most 1/128 of their value wide, up to 2^40 ns (18 minutes); beyond, values share the last
 * one. Minimum, maximum and sum are exact. All zero is an empty histogram. One thread records; others may
 * look, and see each number whole. */
typedef struct hm2_histogram {
	uint64_t count;
	uint64_t sum_ns;
	int64_t minimum_ns; /* of nothing: 0 */
	int64_t maximum_ns;
	uint64_t buckets[4352];
} hm2_histogram;

/* While another thread records: every number whole, the sum of the buckets as at some moment. */
void hm2_histogram_copy(hm2_histogram *into, const hm2_histogram *from);
/* A time before its beginning (negative) is counted as 0. */
void hm2_histogram_record(hm2_histogram *histogram, int64_t ns);
void hm2_histogram_record_many(hm2_histogram *histogram, const int64_t *ns, size_t count);
void hm2_histogram_merge(hm2_histogram *into, const hm2_histogram *from);
void hm2_histogram_reset(hm2_histogram *histogram);
/* The value that `percent` (0..100) of the values do not exceed, rounded up to the edge of its bucket but never
 * beyond the maximum; 0 gives the minimum. -1: nothing recorded, or percent out of range. */
int64_t hm2_histogram_percentile(const hm2_histogram *histogram, double percent);
/* Smallest value of a bucket, and for index = number of buckets the end of the last; -1 beyond. */
int64_t hm2_histogram_bucket_start(size_t index);

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

/* ---- emulated remotes (emulator/remote*.c) ---------------------------------------------- */

/* An LBP remote at the end of a serial line. A fresh one is a stand-in for tests: alive, no
 * watchdog, no fault, any software mode, 64 KiB of RAM holding zeros, memory space 1 seen at RAM
 * 0x0400. Times are picoseconds of the clock the bytes come with. */
typedef struct hm2_remote hm2_remote;

enum hm2_remote_model {
	HM2_REMOTE_GENERIC = 0,
	HM2_REMOTE_8I20 = 1, /* predates discovery; answers without a fault byte */
	HM2_REMOTE_7I64 = 2
};

/* What of a remote is one number. hm2_remote_set refuses values outside the range. */
enum hm2_remote_knob {
	HM2_REMOTE_NAME,              /* four characters, the first in the low byte */
	HM2_REMOTE_UNIT,              /* unit number */
	HM2_REMOTE_MODEL,             /* enum hm2_remote_model */
	HM2_REMOTE_RECEIVE_SIZE,      /* bytes of a process answer, fault byte included */
	HM2_REMOTE_TRANSMIT_SIZE,     /* bytes the host sends after 0xBD */
	HM2_REMOTE_PTOC,
	HM2_REMOTE_GTOC,
	HM2_REMOTE_SOFTWARE_MODE,     /* last one received */
	HM2_REMOTE_HARDWARE_MODE,
	HM2_REMOTE_REVISION,          /* software revision, local register 0xD5 */
	HM2_REMOTE_CAPABILITY,        /* local register 0xD4 */
	HM2_REMOTE_ALIVE,             /* 0: powered off or unplugged, neither hears nor speaks */
	HM2_REMOTE_FAULT,             /* fault byte */
	HM2_REMOTE_FAULT_CLEARS,      /* 0: clearing faults does not help */
	HM2_REMOTE_FAULT_GATES,       /* 1: outputs are off and not taken while there is a fault */
	HM2_REMOTE_FAULT_AT_RESET,    /* fault after power-up and reset */
	HM2_REMOTE_FAULT_ADDRESS,     /* RAM word that shows the fault byte; -1: none */
	HM2_REMOTE_CLEAR_BUSY_READS,  /* so many more reads of the clear-faults flag find it busy */
	HM2_REMOTE_WATCHDOG_PS,       /* 0: off; not used with a watchdog address */
	HM2_REMOTE_WATCHDOG_ADDRESS,  /* RAM word with the time in units; -1: none */
	HM2_REMOTE_WATCHDOG_UNIT_PS,
	HM2_REMOTE_UNIT_ADDRESS,      /* RAM long that is the unit number; -1: none */
	HM2_REMOTE_TURNAROUND_PS,     /* middle of the last stop bit to the start of the answer */
	HM2_REMOTE_BAUD,
	HM2_REMOTE_BAUD_ADDRESS,      /* EEPROM word with the baud rate's index, used at reset; -1: none */
	HM2_REMOTE_CRC_ADDRESS,       /* EEPROM word that is not 0 if CRCs are checked, used at reset; -1: none */
	HM2_REMOTE_PWM_ADDRESS,       /* 8I20: EEPROM word with its PWM rate in Hz, the watchdog's unit; -1: none */
	HM2_REMOTE_SETUP_MODE,        /* 1: set-up jumper in place, from the next reset on: 115200 baud, long timeout */
	HM2_REMOTE_TIMEOUT_BITS,      /* a longer gap ends a frame, local register 0xCB; 0: never */
	HM2_REMOTE_CRC,               /* 0: no CRC byte either way, and no answer without data */
	HM2_REMOTE_COOKIE,
	HM2_REMOTE_BAD_COOKIES,       /* so many more cookies are 0x55 */
	HM2_REMOTE_ANSWERS_UNIT,      /* 0: silent on the unit number RPC */
	HM2_REMOTE_ANSWERS_DISCOVERY, /* 0: silent on the discovery RPC */
	HM2_REMOTE_FAULT_WORD,        /* 8I20: its faults, the word at 0x0852 */
	HM2_REMOTE_FAULT_WORD_ON_ENABLE, /* 8I20: fault word after enabling; 0: unchanged */
	HM2_REMOTE_PID_OFF_READS,     /* 8I20: so many more reads of 0x08FE give 0 */
	HM2_REMOTE_SUPERVISED,        /* 8I20: 1 a drive (brake, faults, limits), 0 words and nothing behind them */
	HM2_REMOTE_ENABLE_INPUT,      /* 8I20: its external enable input; 0: not driven */
	HM2_REMOTE_FAULT_OUTPUT,      /* 8I20: its fault output; 1: on, no fault but masked ones */
	HM2_REMOTE_INJECT_BAD_CRC,    /* so many answers with an inverted CRC */
	HM2_REMOTE_INJECT_TRUNCATE,   /* bytes missing at the end of the next answer */
	HM2_REMOTE_INJECT_EXTRA,      /* surplus bytes after the next answer: E0, E1, .. */
	HM2_REMOTE_INJECT_BREAK,      /* so many answers whose last stop bit is low */
	HM2_REMOTE_INJECT_SKIP,       /* so many frames are obeyed but not answered */
	HM2_REMOTE_STATUS,            /* LBP status, local register 0xC1 */
	HM2_REMOTE_CRC_ERRORS,
	HM2_REMOTE_SPACE,             /* memory space data commands mean, local register 0xCC */
	HM2_REMOTE_LEDS,
	HM2_REMOTE_ERASE_PS,          /* flash: how long an erase keeps it busy */
	HM2_REMOTE_PROGRAM_PS,        /* flash: how long a write does */
	HM2_REMOTE_KNOBS
};

/* What reached the remote's memory by an LBP data write. */
typedef struct hm2_remote_write {
	int64_t time_ps;
	uint16_t address;
	uint8_t space;
	uint8_t size;
	uint8_t data[8];
} hm2_remote_write;

#define HM2_REMOTE_WRITES_KEPT 4096
#define HM2_REMOTE_DATA_MAX 255

hm2_remote *hm2_remote_new(void);
void hm2_remote_free(hm2_remote *remote);
int hm2_remote_set(hm2_remote *remote, int knob, int64_t value);
int64_t hm2_remote_get(const hm2_remote *remote, int knob);
/* Power-up: EEPROM and flash stay, everything else starts afresh. */
void hm2_remote_reset(hm2_remote *remote);
/* Process data: what the remote sends (without the fault byte, but for 8I20 and 7I64) and what it
 * was last sent. The getters return the whole length and copy at most `capacity` bytes. */
int hm2_remote_set_inputs(hm2_remote *remote, const uint8_t *bytes, size_t length);
size_t hm2_remote_inputs(hm2_remote *remote, uint8_t *bytes, size_t capacity);
size_t hm2_remote_outputs(hm2_remote *remote, uint8_t *bytes, size_t capacity);
/* Memory as the remote's own processor sees it: no limits, no log. space: as for 0xEC. */
int hm2_remote_peek(hm2_remote *remote, int space, uint32_t address, uint8_t *bytes, size_t length);
int hm2_remote_poke(hm2_remote *remote, int space, uint32_t address, const uint8_t *bytes, size_t length);
/* As poke to RAM, and so again after every reset. */
int hm2_remote_load(hm2_remote *remote, uint32_t address, const uint8_t *bytes, size_t length);
/* The memory the line may read, first..last; without any call: all of it. */
int hm2_remote_allow(hm2_remote *remote, int space, uint16_t first, uint16_t last, int writable);
/* The last HM2_REMOTE_WRITES_KEPT writes, oldest first; returns how many were ever made. */
uint64_t hm2_remote_writes(const hm2_remote *remote, hm2_remote_write *writes, size_t capacity, size_t *count);
void hm2_remote_clear_writes(hm2_remote *remote);
/* An EEPROM of its own as memory space 1 (at most HM2_REMOTE_EEPROM_MAX bytes). */
int hm2_remote_add_eeprom(hm2_remote *remote, size_t size);
/* A flash, erased, behind the window of memory space 2. size: whole erase blocks, at most
 * HM2_REMOTE_FLASH_MAX; a write block is at most 4096 bytes. peek and poke see the flash itself. */
int hm2_remote_add_flash(hm2_remote *remote, size_t size, int log2_erase, int log2_write);
/* At reset `size` bytes of EEPROM are copied to RAM: non-volatile to working parameter. */
int hm2_remote_add_copy(hm2_remote *remote, uint16_t eeprom_address, uint16_t ram_address, uint16_t size);
/* A software mode. With one or more of them every other mode is illegal (fault 0x40). */
int hm2_remote_add_mode(hm2_remote *remote, uint8_t mode, uint8_t receive_size, uint8_t transmit_size,
                        uint16_t ptoc, uint16_t gtoc);
/* The next process data element of that mode, packed in the order of the calls and kept right-justified
 * in RAM at `address`. direction as in the tables: 0x00 input, 0x40 both, 0x80 output. address 0: pad. */
int hm2_remote_add_element(hm2_remote *remote, uint8_t mode, uint8_t bits, uint8_t direction, uint16_t address);

#define HM2_REMOTE_EEPROM_MAX 4096
#define HM2_REMOTE_FLASH_MAX 0x100000

/* One 8N1 byte on the line. */
typedef struct hm2_line_byte {
	int64_t start_ps;      /* falling edge of the start bit */
	int64_t bit_ps;        /* duration of one bit */
	uint8_t value;
	uint8_t framing_error; /* stop bit low (break) */
} hm2_line_byte;

/* A byte whose stop bit has been sampled (middle of the stop bit = start + 9.5 bits) arrives. */
void hm2_remote_line_receive(hm2_remote *remote, const hm2_line_byte *byte);
/* The next byte the remote has decided to send, oldest first; 0 when there is none. It may lie
 * in the future. Once peeked it will be sent: nothing but power-off takes it back. */
int hm2_remote_line_peek(hm2_remote *remote, hm2_line_byte *byte);
void hm2_remote_line_pop(hm2_remote *remote);
/* Bring the remote's own timers (gap, watchdog, busy polls) up to now. */
void hm2_remote_advance(hm2_remote *remote, int64_t now_ps);
/* Zero wire time: hand over a whole frame with its CRC and get the whole answer with its CRC.
 * Returns the answer's length, 0 for silence (and for an answer longer than capacity). Same rules as
 * the byte path, no time passes; an answer with a low stop bit comes without its last byte. */
size_t hm2_remote_exchange(hm2_remote *remote, const uint8_t *frame, size_t length, uint8_t *answer,
                           size_t capacity);

/* ---- the emulated card (emulator/card.c) --------------------------------------------------- */

/* What undecoded registers and wholly undriven reads give: recognisable, never a plausible value. */
#define HM2_EMULATOR_UNDRIVEN 0xDEADBEEF

#define HM2_CLOCK_VIRTUAL 0 /* stands still until advanced */
#define HM2_CLOCK_REAL 1    /* brought up to CLOCK_MONOTONIC at each access */

#define HM2_LEVEL_LOW 0
#define HM2_LEVEL_HIGH 1
#define HM2_LEVEL_FLOATING 2 /* nothing drives it: pulled up, reads 1 */
#define HM2_LEVEL_CONTENTION 3 /* the card and the outside drive against each other: reads as outside */
#define HM2_LEVEL_RELEASE (-1) /* for drive: let go */

typedef struct hm2_emulator hm2_emulator;

typedef struct hm2_emulator_options {
	int32_t clock;            /* HM2_CLOCK_* */
	int32_t wire_off;         /* 1: serial bytes take no time */
	int32_t strict;           /* 1: undecoded addresses are errors */
	int32_t sserial_channels; /* of each SSERIAL instance; 0: as many as the pins say */
	uint32_t sserial_clock_hz; /* ClockMed, the SSERIAL processor's clock; 0: 100 MHz */
	int32_t leds;
	int32_t interrupt;        /* 1: has the interrupt registers (PCI cards) */
} hm2_emulator_options;

/* idrom: the words from the IDROM offset (0x400) on, at most 256. */
int hm2_emulator_new(const uint32_t *idrom, size_t words, const hm2_emulator_options *options,
                     hm2_emulator **out, hm2_error *error);
void hm2_emulator_free(hm2_emulator *card);
int hm2_emulator_read(hm2_emulator *card, uint32_t address, uint32_t *words, size_t count, hm2_error *error);
int hm2_emulator_write(hm2_emulator *card, uint32_t address, const uint32_t *words, size_t count,
                       hm2_error *error);
/* The same card as a transport. The bus borrows the card: free the card after closing the bus. */
int hm2_emulator_bus(hm2_emulator *card, hm2_bus *out);

int64_t hm2_emulator_now_ps(const hm2_emulator *card);
int64_t hm2_emulator_clocks(const hm2_emulator *card); /* rising edges of ClockLow so far */
void hm2_emulator_advance_ps(hm2_emulator *card, int64_t ps);
void hm2_emulator_advance_clocks(hm2_emulator *card, int64_t clocks);
/* Bring every part up to now (real clock: up to this moment), as an access would for its own part. */
void hm2_emulator_sync(hm2_emulator *card);

/* Borrowed; NULL takes the remote off. through_pins: 0 wired to the SSERIAL instance itself,
 * 1 heard only while the channel's pins are switched to their secondary function. */
int hm2_emulator_attach(hm2_emulator *card, int instance, int channel, struct hm2_remote *remote,
                        int through_pins);
int hm2_emulator_sserial_channels(const hm2_emulator *card, int instance); /* 0: no such instance */
/* Memory of a remote that hangs on the card, as hm2_remote_peek and _poke, between two accesses of a driver. */
int hm2_emulator_peek_remote(hm2_emulator *card, struct hm2_remote *remote, int space, uint32_t address,
                             uint8_t *bytes, size_t length);
int hm2_emulator_poke_remote(hm2_emulator *card, struct hm2_remote *remote, int space, uint32_t address,
                             const uint8_t *bytes, size_t length);

/* A byte seen on one of the serial lines of an SSERIAL instance. */
typedef struct hm2_line_record {
	hm2_line_byte byte;
	int32_t channel;
	int32_t to_remote; /* 1 sent by the card, 0 by the remote */
} hm2_line_record;

#define HM2_LINE_RECORDS_KEPT 4096

/* Takes up to `capacity` of the last HM2_LINE_RECORDS_KEPT bytes, oldest first; returns how many. */
size_t hm2_emulator_line_records(hm2_emulator *card, int instance, hm2_line_record *records, size_t capacity);

int hm2_emulator_pins(const hm2_emulator *card);
int hm2_emulator_pin_drive(hm2_emulator *card, int pin, int level);
int hm2_emulator_pin_level(hm2_emulator *card, int pin); /* HM2_LEVEL_*; HM2_ERR_RANGE */

/* Encoders plugged into the card's encoder inputs, muxed ones numbered as the card counts them. Each
 * call plugs one in and takes effect as time goes on; HM2_ERR_RANGE: no such input or value. */
int hm2_emulator_encoders(const hm2_emulator *card);
int hm2_emulator_encoder_plug(hm2_emulator *card, int encoder, int plugged);
/* Quadrature, the first edge after one period, A before B when counts > 0. */
int hm2_emulator_encoder_run(hm2_emulator *card, int encoder, int64_t edge_period_ps, int64_t counts);
/* Step and direction: A 50 % pulses, the first rising after half a period; B 1 when pulses > 0. */
int hm2_emulator_encoder_pulses(hm2_emulator *card, int encoder, int64_t period_ps, int64_t pulses);
/* Quadrature at a rate in 2^-20 counts per second until told otherwise; no fraction is lost. */
int hm2_emulator_encoder_rate(hm2_emulator *card, int encoder, int64_t rate);
int hm2_emulator_encoder_set(hm2_emulator *card, int encoder, int a, int b, int z);
/* Z is high while the position modulo every is less than width; every 0: no pattern. */
int hm2_emulator_encoder_index(hm2_emulator *card, int encoder, int64_t every, int64_t width);
int hm2_emulator_encoder_preset(hm2_emulator *card, int encoder, int64_t position);
int hm2_emulator_encoder_position(hm2_emulator *card, int encoder, int64_t *position);
int hm2_emulator_set_mux_delay_ps(hm2_emulator *card, int64_t delay_ps);
/* What the multiplexer of an InMux offers: bit n is the level of input n. HM2_ERR_RANGE: no such instance. */
int hm2_emulator_inmux_set(hm2_emulator *card, int unit, uint32_t levels);
/* A signal at a period meter, from now on; period 0: none. HM2_ERR_RANGE */
int hm2_emulator_period_signal(hm2_emulator *card, int unit, int64_t period_ps, int64_t high_ps);
/* A resolver's shaft: where it is now, in 2^-32 electrical turns, and how it turns on. HM2_ERR_RANGE */
int hm2_emulator_resolver_set(hm2_emulator *card, int channel, uint32_t angle, double turns_per_second);
int hm2_emulator_resolver_flag(hm2_emulator *card, int channel, int flag); /* its bit in the status register */
int hm2_emulator_resolver_angle(hm2_emulator *card, int channel, uint32_t *angle);
/* An SSI encoder and what it sends; plugged 0: its line floats. HM2_ERR_RANGE */
int hm2_emulator_ssi_set(hm2_emulator *card, int channel, int plugged, uint64_t value);
/* Bytes for a UART's receiver, at its bit rate; HM2_ERR_RANGE: no such instance, or more than 4096 wait. What its
 * transmitter has sent since the last call. */
int hm2_emulator_uart_send(hm2_emulator *card, int unit, const uint8_t *bytes, size_t count);
int hm2_emulator_uart_received(hm2_emulator *card, int unit, uint8_t *bytes, size_t capacity, size_t *count);
/* A frame that a packet UART has received, with the flags of its frame word; 1 to 1023 bytes. The oldest frame
 * that was sent: 1, 0 if there is none; capacity: at least 1023. HM2_ERR_RANGE */
int hm2_emulator_pktuart_send(hm2_emulator *card, int unit, const uint8_t *bytes, size_t count, uint32_t flags);
int hm2_emulator_pktuart_received(hm2_emulator *card, int unit, uint8_t *bytes, size_t capacity, size_t *count);

/* A word that went out on a buffered SPI. */
typedef struct hm2_spi_record {
	uint32_t value;
	uint32_t bits;
	uint32_t chip_select;
	uint32_t channel;
} hm2_spi_record;

/* Answers to the next words, one each, 256 at most; what went out since the last call, 256 at most. HM2_ERR_RANGE */
int hm2_emulator_bspi_answer(hm2_emulator *card, int unit, const uint32_t *words, size_t count);
int hm2_emulator_bspi_sent(hm2_emulator *card, int unit, hm2_spi_record *records, size_t capacity, size_t *count);
uint32_t hm2_emulator_leds(const hm2_emulator *card);    /* bit n: LED CRn+1 is lit */
int hm2_emulator_interrupt(hm2_emulator *card);          /* 1: INT is asserted */
/* ---- encoders (encoder.c, encoder_index.c): 16-bit counts and timestamps made whole ------- */

/* TSCount of one encoder module, extended past its 16 bits with the host's clock. */
typedef struct hm2_timebase {
	double seconds_per_tick; /* (TSDiv + 2) / ClockLow; set by the caller, > 0 */
	int64_t ticks;           /* TSCount, extended */
	int64_t now_ns;          /* host time of the last update */
	int32_t valid;           /* 0 until the first update */
} hm2_timebase;

void hm2_timebase_update(hm2_timebase *timebase, uint32_t timestamp_count, int64_t now_ns);

enum hm2_encoder_request {
	HM2_ENCODER_NONE = 0,
	HM2_ENCODER_INDEX = 1,  /* latch at the index, count 0 there */
	HM2_ENCODER_LATCH = 2,  /* latch at the index, count untouched */
	HM2_ENCODER_PROBE = 3   /* latch at the probe input, count untouched */
};

/* One encoder; the caller owns it and zeroes it first. The driver is level-triggered: control_word is
 * what CCR shall read back, and it is written again until it does, so a lost write repairs itself. */
typedef struct hm2_encoder {
	/* settings */
	double scale;             /* counts per unit, not 0 */
	double velocity_timeout;  /* seconds without a count after which the velocity is 0 */
	uint32_t settings;        /* CCR: polarity, filter, mode, masks, probe polarity; no latch bits */
	uint32_t readable;        /* CCR bits the hardware drives (versions without probe leave 13, 12) */
	int32_t request;          /* enum hm2_encoder_request; becomes NONE when the event has come */
	/* results */
	int64_t raw_count;        /* counts since the first update, from the register's value then */
	int64_t zero;             /* raw_count at count 0 */
	int64_t latched;          /* raw_count at the last index or probe event */
	uint64_t events;          /* index and probe events so far */
	double position;          /* units */
	double interpolated;      /* units, carried on at the velocity since the last count */
	double velocity;          /* units per second */
	uint32_t control;         /* CCR as last read */
	int32_t quad_error;       /* sticky: A and B changed together; the caller clears it */
	/* what to write */
	uint32_t control_word;    /* CCR as it shall be */
	int32_t write_control;    /* 1: write control_word in this cycle */
	/* private */
	int64_t event_count, event_ticks;
	int32_t valid, moving, direction, index_state;
} hm2_encoder;

/* Takes in one reading of Count and CCR made right after TSCount was read into the timebase. Moves of
 * 32768 counts and more between two updates cannot be told from shorter ones (16-bit counter). */
void hm2_encoder_update(hm2_encoder *encoder, const hm2_timebase *timebase, uint32_t count, uint32_t control);
/* count 0 here and now, in software: the hardware's counter is never cleared. */
void hm2_encoder_zero(hm2_encoder *encoder);

/* ---- one exchange of everything (cycle.c): what takes part, and in which order ----------- */

#define HM2_CYCLE_PARTS 32      /* participants of one cycle */
#define HM2_CYCLE_TRANSFERS 256 /* transfers of one exchange, all participants together */

/* A participant of the cycle: a module, an SSERIAL port, a block of words. `reads` and `writes` append
 * this cycle's transfers to a list with room for `capacity` and return how many they are (more than
 * capacity: they did not fit, nothing was appended); words stay valid until the exchange is over.
 * `process` takes in what was read; it is called only when the whole exchange has succeeded. Any member
 * but self may be NULL. None may allocate, block or fail. */
typedef struct hm2_cyclic {
	void *self;
	size_t (*reads)(void *self, hm2_transfer *transfers, size_t capacity);
	size_t (*writes)(void *self, hm2_transfer *transfers, size_t capacity);
	void (*process)(void *self, int64_t now_ns);
} hm2_cyclic;

typedef struct hm2_cycle_counters {
	uint64_t cycles;   /* exchanges that came back whole */
	uint64_t failures; /* exchanges that did not: values are those of the last good cycle */
} hm2_cycle_counters;

struct hm2_cycle;

/* The board stays the caller's and outlives the cycle. */
int hm2_cycle_new(struct hm2_board *board, struct hm2_cycle **cycle, hm2_error *error);
void hm2_cycle_free(struct hm2_cycle *cycle);
/* Participants read and write in the order they were added; all reads come before all writes.
 * HM2_ERR_RANGE: more than HM2_CYCLE_PARTS. */
int hm2_cycle_add(struct hm2_cycle *cycle, const hm2_cyclic *part, hm2_error *error);
/* Read, write, process: one exchange. While the board's gate is shut nothing is written. The reads see what the writes of earlier cycles caused. */
int hm2_cycle_run(struct hm2_cycle *cycle, hm2_error *error);
/* The same in two halves; several cards begin before the first finishes. */
int hm2_cycle_begin(struct hm2_cycle *cycle, hm2_error *error);
int hm2_cycle_finish(struct hm2_cycle *cycle, int64_t deadline_ns, hm2_error *error);
/* Reads and processing alone, or writes alone: for control between them (two exchanges a cycle). */
int hm2_cycle_read(struct hm2_cycle *cycle, hm2_error *error);
int hm2_cycle_write(struct hm2_cycle *cycle, hm2_error *error);
void hm2_cycle_get_counters(const struct hm2_cycle *cycle, hm2_cycle_counters *counters);

/* A participant made of plain words: a fixed transfer into the caller's buffer each cycle. */
typedef struct hm2_cyclic_words {
	hm2_transfer transfer; /* words point into the caller's buffer */
	int32_t enabled;       /* 0: left out of the cycle */
} hm2_cyclic_words;

void hm2_cyclic_words_part(hm2_cyclic_words *words, hm2_cyclic *part);

/* The watchdog's part: status is read each cycle; armed, the counter is reloaded each cycle. A bite is kept in
 * has_bitten until the owner clears it, and shuts the board's gate. */
typedef struct hm2_watchdog {
	struct hm2_board *board;
	uint32_t status_address, reset_address;
	uint32_t status, reset; /* words of the exchange */
	int32_t armed;
	int32_t has_bitten;
} hm2_watchdog;

void hm2_watchdog_part(hm2_watchdog *watchdog, hm2_cyclic *part);

/* The DPLL's part: sync is read each cycle. While settling counts down the phase is written, and control0 last. */
typedef struct hm2_dpll {
	uint32_t sync_address, phase_address, control0_address;
	uint32_t sync, phase, control0; /* words of the exchange */
	int32_t settling;               /* cycles that still write */
	int32_t written;                /* private */
} hm2_dpll;

void hm2_dpll_part(hm2_dpll *dpll, hm2_cyclic *part);

/* All encoders of one module: TSCount, then counts, then controls; controls written only when they must be. */
typedef struct hm2_encoders {
	hm2_timebase timebase;
	hm2_encoder *encoders;   /* count of them */
	uint32_t *words;         /* room for 1 + 2 * count words */
	uint32_t count;
	uint32_t count_address, control_address, timestamp_address; /* of instance 0 */
	uint32_t instance_stride;
} hm2_encoders;

void hm2_encoders_part(hm2_encoders *encoders, hm2_cyclic *part);

/* ---- the IDROM (idrom.c, idrom_check.c): pure functions on the caller's buffers ---------- */

#define HM2_ID_ADDRESS 0x0100u       /* cookie, config name (2 words), IDROM offset */
#define HM2_ID_WORDS 4
#define HM2_IDROM_HEADER_WORDS 16
#define HM2_IDROM_MODULES_MAX 48     /* descriptors looked at; the firmware holds 32 */
#define HM2_IDROM_MODULE_WORDS 3
#define HM2_IDROM_PINS_MAX 1000      /* IOWidth limit */
#define HM2_IDROM_NONE 0xFFFFFFFFu   /* "not known" for an expected value */

/* Why HM2_ERR_FORMAT, in hm2_error.detail. address: of the offending word; index: descriptor or pin. */
enum hm2_broken_idrom {
	HM2_BROKEN_COOKIE = 1,
	HM2_BROKEN_CONFIG_NAME,
	HM2_BROKEN_OFFSET,
	HM2_BROKEN_TYPE,
	HM2_BROKEN_PORT_WIDTH,
	HM2_BROKEN_IO_PORTS,
	HM2_BROKEN_IO_WIDTH,            /* not IOPorts times PortWidth */
	HM2_BROKEN_IO_WIDTH_LIMIT,
	HM2_BROKEN_CLOCK_LOW,
	HM2_BROKEN_CLOCK_HIGH,
	HM2_BROKEN_PIN_OFFSET,
	HM2_BROKEN_PIN_LIST_SHORT,      /* primary tag 0; expected: IOWidth */
	HM2_BROKEN_PIN_PRIMARY_TAG,
	HM2_BROKEN_PIN_RANGE,           /* bit of its port beyond 31 */
	HM2_BROKEN_MODULE_OFFSET,
	HM2_BROKEN_MODULE_LIST_UNTERMINATED,
	HM2_BROKEN_MODULE_CLOCK_TAG,
	HM2_BROKEN_MODULE_STRIDE_SELECT,
	HM2_BROKEN_MODULE_STRIDE_ZERO,  /* address: of the stride in the header */
	HM2_BROKEN_MODULE_RANGE,        /* received: the highest register address */
	HM2_BROKEN_MODULE_ALIGNMENT,    /* received: the base or stride that is not of whole words */
	HM2_BROKEN_IOPORT_MISSING,
	HM2_BROKEN_IOPORT_COUNT,
	HM2_BROKEN_MODULE_DUPLICATE,    /* expected: index of the first */
	HM2_BROKEN_MODULE_VERSION,      /* the module's form is not supported: expected, received of the */
	HM2_BROKEN_MODULE_REGISTERS,    /* ... first of these four that differs */
	HM2_BROKEN_MODULE_INSTANCE_STRIDE,
	HM2_BROKEN_MODULE_MULTIPLE,
	HM2_BROKEN_PIN_UNIT,            /* expected: the module's instances */
	HM2_BROKEN_PIN_DUPLICATE_OUTPUT /* expected: index of the first pin */
};

typedef struct hm2_idrom {
	uint32_t offset; /* byte address of the header */
	uint32_t type;
	uint32_t module_offset; /* from the header */
	uint32_t pin_offset;
	char config_name[12]; /* 8 characters, NUL padded */
	char board_name[12];
	uint32_t fpga_size; /* in the vendor's unit, thousands of gates or logic cells */
	uint32_t fpga_pins;
	uint32_t io_ports;
	uint32_t io_width;
	uint32_t port_width;
	uint32_t clock_low; /* Hz */
	uint32_t clock_high;
	uint32_t instance_stride[2]; /* bytes */
	uint32_t register_stride[2];
} hm2_idrom;

typedef struct hm2_module_descriptor {
	uint32_t address;  /* of the descriptor itself */
	uint32_t multiple; /* bit r: register r exists once per instance */
	uint32_t register_stride; /* bytes, selected */
	uint32_t instance_stride;
	uint32_t clock; /* Hz, selected */
	uint16_t base;
	uint8_t gtag;
	uint8_t version;
	uint8_t clock_tag;
	uint8_t instances;
	uint8_t registers;
	uint8_t stride_selects; /* 3..0 register, 7..4 instance */
} hm2_module_descriptor;

typedef struct hm2_pin_descriptor {
	uint8_t secondary_pin; /* bit 7: output */
	uint8_t secondary_tag; /* gtag, 0: GPIO only */
	uint8_t secondary_unit; /* instance; bit 7: shared by all */
	uint8_t primary_tag;
} hm2_pin_descriptor;

/* The four words at HM2_ID_ADDRESS: fills in offset and config_name. */
int hm2_idrom_parse_id(const uint32_t words[4], hm2_idrom *idrom, hm2_error *error);
int hm2_idrom_check_type(const hm2_idrom *idrom, uint32_t type, hm2_error *error);
/* The 16 words at idrom->offset, in LinuxCNC's order of checks. expected_*: of a known board, else
 * HM2_IDROM_NONE; an unknown board may have 1..32 pins per port and any number of ports but none. */
int hm2_idrom_parse_header(const uint32_t words[16], uint32_t expected_port_width, uint32_t expected_io_ports,
                           hm2_idrom *idrom, hm2_error *error);
/* The io_width words at offset + pin_offset; hm2_idrom_check_pin_offset first, before reading them. */
int hm2_idrom_check_pin_offset(const hm2_idrom *idrom, hm2_error *error);
int hm2_idrom_parse_pins(const hm2_idrom *idrom, const uint32_t *words, size_t word_count,
                         hm2_pin_descriptor *pins, size_t capacity, hm2_error *error);
/* *words: how many to read at offset + module_offset; at most 3 * HM2_IDROM_MODULES_MAX. */
int hm2_idrom_check_module_offset(const hm2_idrom *idrom, size_t *words, hm2_error *error);
int hm2_idrom_parse_modules(const hm2_idrom *idrom, const uint32_t *words, size_t word_count,
                            hm2_module_descriptor *modules, size_t capacity, size_t *count, hm2_error *error);
/* One IOPort module, of the one known form and with as many instances as the header has ports; no known
 * module twice. */
int hm2_idrom_check_modules(const hm2_idrom *idrom, const hm2_module_descriptor *modules, size_t count,
                            hm2_error *error);
/* Whether modules[index] has a form (version, registers, instance stride, multiple) the driver knows.
 * Modules the driver has no form for pass. */
int hm2_idrom_check_form(const hm2_module_descriptor *modules, size_t index, hm2_error *error);
/* Units within the module's instances, no output on two pins. From pin `first` on, so that a caller who
 * accepts a finding goes on behind it. */
int hm2_idrom_check_pins(const hm2_idrom *idrom, const hm2_module_descriptor *modules, size_t module_count,
                         const hm2_pin_descriptor *pins, size_t pin_count, size_t first, hm2_error *error);

/* ---- emulated Ethernet engine (emulator/ethernet*.c): LBP16 as the card's firmware answers --- */

struct hm2_ethernet;

/* The HostMot2 register file behind memory space 0. Only self, read and write are required. */
typedef struct hm2_ethernet_card {
	void *self;
	/* consecutive words; never past 0xFFFC */
	void (*read)(void *self, uint32_t address, uint32_t *words, size_t count);
	void (*write)(void *self, uint32_t address, const uint32_t *words, size_t count);
	void (*enter)(void *self); /* around a packet's accesses, for a card shared with other threads */
	void (*leave)(void *self);
	void (*reload)(void *self); /* the FPGA was configured anew: power-up state */
	/* Wait for the next rising edge of a DPLL line (0 reference, 1..4 timers), at most timeout_us.
	 * Returns microseconds waited, or -1 when the time ran out. Without it every wait runs out. */
	int64_t (*wait_edge)(void *self, int line, uint32_t timeout_us);
	void (*pause_us)(void *self, int64_t us); /* let time pass; without it the engine's thread sleeps */
	int64_t (*now_us)(void *self); /* the engine's clock; without it that of the machine */
} hm2_ethernet_card;

typedef struct hm2_ethernet_config {
	char name[16];             /* NUL padded; EEPROM and information space */
	uint8_t mac[6];            /* in reading order: 00 60 1b .. */
	uint8_t ip[4];             /* EEPROM address, a.b.c.d */
	uint8_t jumpers;           /* 0 fixed, 1 EEPROM, 2 BOOTP, 3 invalid */
	uint8_t flash_id;          /* 0x10 1 Mbit .. 0x15 32 Mbit */
	uint8_t efinix;            /* image layout and reload words of the T boards */
	uint16_t lbp_version;
	uint16_t firmware_version;
	uint32_t erase_us;         /* time of a sector erase */
	uint32_t restart_us;       /* silence after an engine reset */
	uint32_t reload_us;        /* silence after an FPGA reload */
} hm2_ethernet_config;

#define HM2_ETHERNET_IMAGE_USER 0
#define HM2_ETHERNET_IMAGE_FALLBACK 1
#define HM2_ETHERNET_IMAGE_NONE 2 /* nothing bootable: the card is dead until power-up */

/* card NULL: a register file of plain memory. The card is not owned. NULL: no memory, or a bad config. */
struct hm2_ethernet *hm2_ethernet_new(const hm2_ethernet_config *config, const hm2_ethernet_card *card);
void hm2_ethernet_free(struct hm2_ethernet *ethernet);
/* The interface of an emulated card; borrowed, so free the card last. */
void hm2_ethernet_emulator(struct hm2_emulator *card, hm2_ethernet_card *out);
/* Between the two no packet is processed: for looking into or steering a card that is being served. The
 * same thread may nest them. */
void hm2_ethernet_hold(struct hm2_ethernet *ethernet);
void hm2_ethernet_release(struct hm2_ethernet *ethernet);
/* One datagram in; the reply's length, 0 for none. reply holds HM2_LBP16_MAX_PAYLOAD bytes. Safe from
 * any thread, as are all below. */
size_t hm2_ethernet_process(struct hm2_ethernet *ethernet, const uint8_t *request, size_t length, uint8_t *reply);
/* Power off and on: EEPROM and flash stay, everything else starts anew. */
void hm2_ethernet_power_up(struct hm2_ethernet *ethernet);
/* Look at and set a 16-bit word of space 2, 4, 6 or 7 without side effects and keys; 0 when out of range. */
uint16_t hm2_ethernet_peek(struct hm2_ethernet *ethernet, int space, uint32_t address);
void hm2_ethernet_poke(struct hm2_ethernet *ethernet, int space, uint32_t address, uint16_t value);
uint32_t hm2_ethernet_flash_size(struct hm2_ethernet *ethernet);
int hm2_ethernet_flash_read(struct hm2_ethernet *ethernet, uint32_t address, uint8_t *bytes, size_t count);
int hm2_ethernet_flash_write(struct hm2_ethernet *ethernet, uint32_t address, const uint8_t *bytes, size_t count);
int hm2_ethernet_image(struct hm2_ethernet *ethernet); /* the image last booted */

/* ---- its UDP server (emulator/ethernet_server.c, ethernet_fault.c) ------------------------- */

struct hm2_ethernet_server;

/* What happens to datagrams of one direction, drawn independently for each. Probabilities in parts per
 * million. A reordered datagram waits until the next one has passed it, at most 50 ms. */
typedef struct hm2_ethernet_fault {
	uint32_t loss_ppm;
	uint32_t duplicate_ppm;
	uint32_t reorder_ppm;
	uint32_t delay_us;
	uint32_t jitter_us; /* added to delay_us: uniform 0..jitter_us */
} hm2_ethernet_fault;

#define HM2_ETHERNET_REQUESTS 0
#define HM2_ETHERNET_REPLIES 1

typedef struct hm2_ethernet_server_counters {
	uint64_t requests;    /* received from the socket */
	uint64_t replies;     /* given to the socket */
	uint64_t send_errors;
	uint64_t lost;        /* by injection, both directions; likewise the next two */
	uint64_t duplicated;
	uint64_t reordered;
	uint64_t overflows;   /* dropped because too many were waiting */
} hm2_ethernet_server_counters;

/* Binds a UDP socket; host is a dotted IPv4 address, port 0 takes a free one. The engine is not owned. */
int hm2_ethernet_server_open(struct hm2_ethernet *ethernet, const char *host, uint16_t port,
                             struct hm2_ethernet_server **server, hm2_error *error);
/* Stops, closes the socket. */
void hm2_ethernet_server_free(struct hm2_ethernet_server *server);
uint16_t hm2_ethernet_server_port(const struct hm2_ethernet_server *server);
/* One thread. spin_us: how long after a datagram the next is awaited without sleeping. fifo_priority 0:
 * normal scheduling. cpu -1: any. */
int hm2_ethernet_server_start(struct hm2_ethernet_server *server, uint32_t spin_us, int fifo_priority, int cpu,
                              hm2_error *error);
void hm2_ethernet_server_stop(struct hm2_ethernet_server *server);
/* While running, too. The same seed and the same datagrams give the same faults. */
void hm2_ethernet_server_set_fault(struct hm2_ethernet_server *server, int direction,
                                   const hm2_ethernet_fault *fault);
void hm2_ethernet_server_set_seed(struct hm2_ethernet_server *server, uint64_t seed);
void hm2_ethernet_server_get_counters(struct hm2_ethernet_server *server, hm2_ethernet_server_counters *counters);
/* ---- tables of contents in a remote's memory (discovery.c): pure, on foreign bytes --------- */

#define HM2_TOC_ENTRIES 256 /* of one table, at most */
#define HM2_TOC_STRING 48   /* bytes of a string with its NUL, at most */

enum hm2_toc_table { HM2_PTOC = 0, HM2_GTOC = 1 };

/* hm2_error.detail where `where` is "ptoc" or "gtoc"; index = entry, address = in the remote's memory */
enum hm2_toc_detail {
	HM2_TOC_POINTER = 1,     /* received = a pointer that cannot be */
	HM2_TOC_TOO_LONG,        /* no end after HM2_TOC_ENTRIES */
	HM2_TOC_LOOP,            /* the same pointer twice */
	HM2_TOC_CROSSES_END,     /* a record runs over the end of the 64 KiB */
	HM2_TOC_RECORD_TYPE,     /* neither process data nor mode descriptor */
	HM2_TOC_BITS,            /* a width its type cannot have: expected = limit */
	HM2_TOC_DIRECTION,
	HM2_TOC_NOT_IN_PTOC,     /* non-volatile types */
	HM2_TOC_PARAMETER_SIZE,  /* a parameter not of 8, 16, 32 or 64 bits */
	HM2_TOC_STRING_END,      /* no NUL */
	HM2_TOC_NOT_A_NUMBER,    /* limit */
	HM2_TOC_INFINITE,        /* limit, of a type other than FLOAT */
	HM2_TOC_LIMITS,          /* minimum above maximum */
	HM2_TOC_INPUT_BITS,      /* more than the process data reply or the registers hold */
	HM2_TOC_OUTPUT_BITS
};

/* What was put right, bits of hm2_toc_record.warnings. */
enum hm2_toc_warning {
	HM2_TOC_UNKNOWN_TYPE = 1, /* its size is known, so it is kept as padding */
	HM2_TOC_UNPRINTABLE = 2,  /* characters replaced by underscores */
	HM2_TOC_NO_NAME = 4
};

typedef struct hm2_toc_record {
	uint32_t address;           /* of the record */
	uint8_t record_type;        /* 0xA0 process data, 0xB0 mode */
	uint8_t bits, data_type, direction;
	float minimum, maximum;
	uint16_t parameter_address;
	uint8_t mode_index, mode_type;
	uint8_t is_process_data;    /* GTOC: the element is in the PTOC, too */
	uint32_t warnings;
	char unit[48];
	char name[48];
} hm2_toc_record;

/* Reads `size` bytes (1, 2, 4 or 8, never beyond the record) at an address below 0x10000. */
typedef struct hm2_toc_memory {
	void *self;
	int (*fetch)(void *self, uint32_t address, uint32_t size, uint8_t *bytes, hm2_error *error);
} hm2_toc_memory;

/* The records of the table at `pointer`, in its order. ptoc: for a GTOC the records of the PTOC, else
 * NULL. HM2_ERR_FORMAT for a broken table; a failing fetch ends with its status. */
int hm2_toc_read(const hm2_toc_memory *memory, uint32_t pointer, int table, const hm2_toc_record *ptoc,
                 size_t ptoc_count, hm2_toc_record *records, size_t capacity, size_t *count,
                 hm2_error *error);
/* The same from `length` bytes that lie at address `base` of the remote. */
int hm2_toc_read_buffer(const uint8_t *bytes, size_t length, uint32_t base, uint32_t pointer, int table,
                        const hm2_toc_record *ptoc, size_t ptoc_count, hm2_toc_record *records,
                        size_t capacity, size_t *count, hm2_error *error);
/* Whether the elements fit: receive_size and transmit_size are bytes of the process data exchange (with
 * the fault byte; 0: not known), registers the interface data registers. Gives the sums. */
int hm2_toc_check_sizes(const hm2_toc_record *ptoc, size_t count, uint32_t receive_size,
                        uint32_t transmit_size, uint32_t registers, uint32_t *input_bits,
                        uint32_t *output_bits, hm2_error *error);

/* ---- SSERIAL (sserial.c, sserial_command.c, sserial_doit.c, sserial_remote.c) ------------- */

#define HM2_SSERIAL_CHANNELS 8       /* of one instance, at most */
#define HM2_SSERIAL_DATA_REGISTERS 7 /* 32-bit interface data registers of a channel, at most */
#define HM2_SSERIAL_EVENTS 64        /* kept until taken */
#define HM2_SSERIAL_NEWS 0x100       /* in a result: events are waiting */

struct hm2_sserial;

/* From the card's module descriptor and pin descriptors; nothing is looked up later. */
typedef struct hm2_sserial_config {
	uint32_t base;            /* COMMAND of instance 0 */
	uint32_t register_stride; /* bytes */
	uint32_t instance_stride; /* bytes */
	uint32_t instance;
	uint32_t channels;        /* 1..8 */
	uint32_t data_registers;  /* 3 (gtag C1) or 7 (C6) */
} hm2_sserial_config;

enum hm2_sserial_mode { HM2_SSERIAL_STOPPED = 0, HM2_SSERIAL_NORMAL, HM2_SSERIAL_SETUP };

/* hm2_error.detail where `where` begins with "sserial" */
enum hm2_sserial_detail {
	HM2_SSERIAL_UNJAMMED = 1,   /* hung command: aborted, then all channels stopped */
	HM2_SSERIAL_RESET,          /* hung command: only a reset of the processor helped */
	HM2_SSERIAL_DEAD,           /* hung command: not even that */
	HM2_SSERIAL_MODE_CONFLICT,  /* channels run in the other mode: stop them first */
	HM2_SSERIAL_NOT_STARTED,    /* the channel (index) is not started in the mode that this needs */
	HM2_SSERIAL_NO_FIRMWARE,    /* the processor does not answer as SSLBP does: expected, received */
	HM2_SSERIAL_REMOTE_SILENT,  /* no usable answer from the remote: address, received = CS */
	HM2_SSERIAL_TOO_SOON,       /* the last DOIT is still at work; nothing was written */
	HM2_SSERIAL_LENT            /* the cycle engine has the port */
};

/* What start left in a channel's registers. */
typedef struct hm2_sserial_identity {
	uint32_t cs;
	uint32_t unit_number;
	uint32_t name; /* four characters, the first in the low byte */
	uint32_t toc;  /* GTOC << 16 | PTOC; 0: the remote has no tables */
} hm2_sserial_identity;

/* Registers as last exchanged, [channel][register]. Inputs of a failed transfer keep the last good values. */
typedef struct hm2_sserial_image {
	uint32_t cs[8];
	uint32_t inputs[8][7];
	uint32_t outputs[8][7]; /* the caller's to write */
} hm2_sserial_image;

typedef struct hm2_sserial_counters {
	uint64_t doits;      /* transfers completed */
	uint64_t too_soon;   /* pipelined transfers not begun because the last one was at work */
	uint64_t hung;       /* commands that never completed */
	uint64_t overwritten; /* DOITs written over one that a network had delivered twice or late */
	uint64_t hidden;     /* results not taken: they might have been old ones */
	uint64_t failed[8]; /* transfers whose DATA bit was set */
	int64_t last_doit_ns; /* from the DOIT's write to the read that saw it complete, at most */
} hm2_sserial_counters;

/* Faults by edges, for one channel. */
typedef struct hm2_fault_watch {
	uint32_t faults; /* fault bits of CS in the transfer before */
	uint32_t word;
	int32_t failed;
	uint32_t rising; /* results of the last step */
	uint32_t word_rising;
} hm2_fault_watch;

/* One transfer's CS, watched fault word and DATA bit. Returns 1 when something is new. */
int hm2_fault_watch_step(hm2_fault_watch *watch, uint32_t cs, uint32_t word, int failed);

/* A fault that was not there in the transfer before. Sticky bits rise once per stop, live ones each time. */
typedef struct hm2_sserial_event {
	uint64_t transfer;    /* number of the DOIT, as in counters.doits; 0: the start itself */
	int64_t time_ns;      /* on the bus's clock */
	int32_t channel;
	int32_t failed;       /* this DOIT's DATA bit */
	uint32_t cs;
	uint32_t rising;      /* fault and status bits of CS that have appeared */
	uint32_t word;        /* the watched input word (hm2_sserial_watch) */
	uint32_t word_rising;
} hm2_sserial_event;

int hm2_sserial_open(struct hm2_board *board, const hm2_sserial_config *config, struct hm2_sserial **port,
                     hm2_error *error);
void hm2_sserial_free(struct hm2_sserial *port); /* touches no register */

/* Processor reset; afterwards all channels are stopped and baud rates are the default. */
int hm2_sserial_reset(struct hm2_sserial *port, hm2_error *error);
/* Zeroes the outputs, sends them to running channels, stops. mask 0: STOP ALL. */
int hm2_sserial_stop(struct hm2_sserial *port, uint32_t mask, hm2_error *error);
/* mode: HM2_SSERIAL_NORMAL or _SETUP. Returns the mask of channels that did not start, or a status.
 * Outputs of channels not yet running become zero. A channel that never completes its start (a remote
 * whose clear-fault flag is stuck) is stopped and reported as failed; the others stay started. */
int hm2_sserial_start(struct hm2_sserial *port, uint32_t mask, int mode, hm2_error *error);
/* Sent to the remote at its next start; 0 unless set. */
void hm2_sserial_set_software_mode(struct hm2_sserial *port, uint32_t channel, uint32_t mode);
uint32_t hm2_sserial_started(const struct hm2_sserial *port);
int hm2_sserial_mode(const struct hm2_sserial *port);
void hm2_sserial_get_identity(const struct hm2_sserial *port, uint32_t channel, hm2_sserial_identity *identity);

/* How many process bits a channel moves: only registers that carry some are touched in the cycle. */
int hm2_sserial_set_bits(struct hm2_sserial *port, uint32_t channel, uint32_t input_bits, uint32_t output_bits,
                         hm2_error *error);
/* Bits of an input register that report faults of the remote (8I20: its FAULT word), the lowest its
 * watchdog; mask 0: none. */
void hm2_sserial_watch(struct hm2_sserial *port, uint32_t channel, uint32_t input_register, uint32_t mask);
hm2_sserial_image *hm2_sserial_get_image(struct hm2_sserial *port);
/* Process data on the image's words: packed before each transfer, unpacked after it. Not owned; NULL: none. */
void hm2_sserial_set_process_data(struct hm2_sserial *port, struct hm2_process_data *process_data);

/* Writes outputs, DOIT, waits, reads results and inputs. Returns the mask of failed channels (named but
 * not started ones included) and HM2_SSERIAL_NEWS, or a status. */
int hm2_sserial_doit(struct hm2_sserial *port, uint32_t mask, hm2_error *error);
/* One step of a pipeline: reads the results of the last DOIT, then writes outputs and the next DOIT
 * without waiting for it. *requested: the channels the result speaks of, 0 in the first step. */
int hm2_sserial_cycle(struct hm2_sserial *port, uint32_t mask, uint32_t *requested, hm2_error *error);
/* The pipeline as part of a board's cycle: reads results, writes outputs and DOIT for `mask` as long as
 * its channels run. A DOIT is left out where the last one may still be at work (counters.too_soon). */
void hm2_sserial_part(struct hm2_sserial *port, hm2_cyclic *part);
void hm2_sserial_set_cyclic(struct hm2_sserial *port, uint32_t mask);
/* After each exchange of the cycle: the result it brought as from hm2_sserial_cycle. A DOIT that hangs is
 * dug out here. */
int hm2_sserial_cyclic_result(struct hm2_sserial *port, uint32_t *requested, hm2_error *error);
/* Who may use the port: a cycle in a thread of its own, or everybody else. Lent to a cycle, all other operations
 * fail with HM2_ERR_BUSY and HM2_SSERIAL_LENT; taken back, the cycle leaves the port out. */
enum hm2_sserial_use { HM2_SSERIAL_USE_ANY, HM2_SSERIAL_USE_CYCLE, HM2_SSERIAL_USE_OTHERS };
void hm2_sserial_set_use(struct hm2_sserial *port, int use);
/* The write to COMMAND that the firmware ignores, allowed at any time. */
int hm2_sserial_ignored_write(struct hm2_sserial *port, hm2_error *error);

void hm2_sserial_get_counters(const struct hm2_sserial *port, hm2_sserial_counters *counters);
/* Oldest first; *lost counts those that found no room since the last call. Returns how many were taken. */
size_t hm2_sserial_take_events(struct hm2_sserial *port, hm2_sserial_event *events, size_t capacity,
                               uint64_t *lost);

/* Local variables of the firmware, 12-bit byte addresses, little endian. */
int hm2_sserial_read_local(struct hm2_sserial *port, uint32_t address, uint8_t *bytes, size_t count,
                           hm2_error *error);
int hm2_sserial_write_local(struct hm2_sserial *port, uint32_t address, const uint8_t *bytes, size_t count,
                            hm2_error *error);

/* Memory of a remote that was started in setup mode. size: 1, 2, 4 or 8 bytes. space: 0 RAM, 1 EEPROM,
 * 2 flash; left at 0. A transfer whose DATA bit is set is repeated; after the last try no value. */
int hm2_sserial_read_remote(struct hm2_sserial *port, uint32_t channel, uint32_t space, uint32_t address,
                            uint32_t size, uint64_t *value, hm2_error *error);
int hm2_sserial_write_remote(struct hm2_sserial *port, uint32_t channel, uint32_t space, uint32_t address,
                             uint32_t size, uint64_t value, hm2_error *error);
/* hm2_toc_read from the memory of a remote started in setup mode. */
int hm2_sserial_read_toc(struct hm2_sserial *port, uint32_t channel, uint32_t pointer, int table,
                         const hm2_toc_record *ptoc, size_t ptoc_count, hm2_toc_record *records,
                         size_t capacity, size_t *count, hm2_error *error);
/* One raw pass-through access: command 0x40..0x7F (address is sent where bit 2 says so) or local
 * 0xC0..0xFF. No repetition. Returns HM2_ERR_TIMEOUT when the DATA bit is set. */
int hm2_sserial_access(struct hm2_sserial *port, uint32_t channel, uint32_t command, uint32_t address,
                       uint64_t *value, hm2_error *error);

/* ---- an Ethernet card (udp*.c) -------------------------------------------------------------- */

/* Every datagram carries a sequence number: it reads the one of the datagram before it out of the card's
 * scratch words, and writes and reads back its own. So every write is acknowledged, no late, duplicated
 * or reordered reply is taken for a fresh one, and a lost request is told from a lost reply. */

struct hm2_udp;

#define HM2_UDP_RETRY_NS 25000000LL

typedef struct hm2_udp_config {
	uint32_t spin_ns;        /* an answer is awaited without sleeping for so long, then with poll */
	int64_t retry_ns;        /* an exchange unanswered for so long is repeated if that is safe; 0: never.
	                          * Cycles have deadlines below it, so they are never repeated. */
	int32_t error_increment; /* added to the error level by a failed exchange */
	int32_t error_decrement; /* taken off by a good one */
	int32_t error_limit;     /* at this level the link is given up until hm2_udp_clear; 0: never */
} hm2_udp_config;

typedef struct hm2_udp_counters {
	uint64_t exchanges;     /* that came back whole */
	uint64_t requests;      /* datagrams sent */
	uint64_t replies;       /* datagrams received and taken */
	uint64_t missed;        /* datagrams given up without their reply */
	uint64_t requests_lost; /* the card says it never carried them out */
	uint64_t writes_lost;   /* events after which writes are in doubt: configuration is to be written anew */
	uint64_t discarded;     /* replies of no datagram outstanding: late or duplicated */
	uint64_t malformed;     /* replies of the right number and a wrong length */
	uint64_t repeated;      /* requests that reached the card twice */
	uint64_t out_of_order;  /* an old request was carried out after a newer one */
	uint64_t foreign;       /* another program used the card in between */
	uint64_t retries;
	int32_t error_level;
	int32_t failed;         /* the link was given up */
} hm2_udp_counters;

/* What carries datagrams to one card and back, and its clock: a UDP socket, or an emulated card with virtual time
 * (which must be waited on with spin_ns 0). All members are required. */
typedef struct hm2_carrier {
	void *self;
	int (*send)(void *self, const uint8_t *bytes, size_t length); /* 0, or a negative errno */
	int (*receive)(void *self, uint8_t *bytes, size_t capacity);  /* length; -EAGAIN: none there; other negative errno */
	void (*wait)(void *self, int64_t ns);                         /* until one may be there, so long at most */
	int64_t (*now_ns)(void *self);
	void (*pause_ns)(void *self, int64_t ns);
	void (*close)(void *self);
} hm2_carrier;

void hm2_udp_defaults(hm2_udp_config *config);
/* host: dotted IPv4 address. config NULL: defaults. Sends nothing. On success the bus owns *udp, which is
 * good until the bus's close. */
int hm2_udp_bus(const char *host, uint16_t port, const hm2_udp_config *config, hm2_bus *bus,
                struct hm2_udp **udp, hm2_error *error);
/* The same on any carrier, which the bus then owns. */
int hm2_udp_carrier_bus(const hm2_carrier *carrier, const hm2_udp_config *config, hm2_bus *bus,
                        struct hm2_udp **udp, hm2_error *error);
void hm2_udp_get_counters(const struct hm2_udp *udp, hm2_udp_counters *counters);
/* Error level 0 again, and the card's last sequence number unknown (after a restart of its engine). */
void hm2_udp_clear(struct hm2_udp *udp);
/* As by too many errors: every exchange fails with HM2_ERR_LINK until hm2_udp_clear. */
void hm2_udp_give_up(struct hm2_udp *udp);
/* Any LBP16 commands as one datagram; reply_size is what they must bring. Commands without a write and
 * with an address each are repeated after retry_ns; all others never. */
int hm2_udp_lbp16(struct hm2_udp *udp, const uint8_t *commands, size_t length, uint8_t *reply, size_t reply_size,
                  int64_t deadline_ns, hm2_error *error);
/* Send bytes as they are and await nothing: for the reload that no card answers. */
int hm2_udp_send(struct hm2_udp *udp, const uint8_t *bytes, size_t length, hm2_error *error);
/* ---- step generators (stepgen.c): position feedback and the rate that follows a command --- */

/* One step generator; the caller owns it and zeroes it first. */
typedef struct hm2_stepgen {
	/* settings */
	double scale;            /* steps per unit, not 0 */
	double clock_hz;         /* of the module */
	double max_velocity;     /* units/s, > 0; INFINITY: what the pulse times allow */
	double max_acceleration; /* units/s^2; 0: not limited */
	double max_step_rate;    /* steps/s the pulse times allow */
	int32_t position_control;/* 1: follow position_command, 0: velocity_command */
	int32_t enable;          /* 0: rate 0 at once */
	/* commands */
	double position_command, velocity_command; /* units, units/s */
	/* results */
	int64_t subcounts;       /* 1/65536 step, since the first update */
	double position;         /* units: subcounts / 65536 / scale */
	double velocity;         /* units/s, as commanded to the hardware */
	uint32_t rate;           /* rate register: signed, steps/s * 2^32 / clock */
	/* private */
	double last_command;
	int64_t last_ns;
	uint32_t accumulator;
	int32_t valid;
} hm2_stepgen;

/* Takes in the accumulator (16.16 steps) and sets `rate` for the coming period. Moves of 32768 steps and
 * more between two updates cannot be told from shorter ones. */
void hm2_stepgen_update(hm2_stepgen *stepgen, uint32_t accumulator, int64_t now_ns);

typedef struct hm2_stepgens {
	hm2_stepgen *stepgens;
	uint32_t *words; /* room for 2 * count: accumulators read, rates written */
	uint32_t count;
	uint32_t rate_address, accumulator_address; /* of instance 0, contiguous */
} hm2_stepgens;

void hm2_stepgens_part(hm2_stepgens *stepgens, hm2_cyclic *part);

/* ---- field inputs InM and InMux (field_input.c): counts extended to 64 bits ------------------ */



/* One instance; the caller owns it and zeroes it first. */
typedef struct hm2_field_input {
	uint32_t filtered, raw, mpg; /* words of the exchange: inputs, and four counters of 8 bits */
	int64_t counts[4]; /* since the first update */
	uint32_t last_mpg;
	int32_t valid;
} hm2_field_input;

/* Takes in the mpg word. Moves of 128 counts and more between two updates cannot be told from shorter ones. */
void hm2_field_input_update(hm2_field_input *input);

typedef struct hm2_field_inputs {
	hm2_field_input *inputs;
	uint32_t count;
	uint32_t filtered_address, raw_address, mpg_address; /* of instance 0 */
	uint32_t instance_stride;
} hm2_field_inputs;

void hm2_field_inputs_part(hm2_field_inputs *inputs, hm2_cyclic *part);

/* ---- resolvers (resolver.c): electrical turns extended to 64 bits ---------------------------- */

/* One resolver; the caller owns it and zeroes it first. Angles are in 2^-32 electrical turns. */
typedef struct hm2_resolver {
	int64_t turns;        /* since switched on; the first reading is its angle */
	int64_t zero;         /* turns of position 0 */
	int32_t index_enable; /* 1: the next index sets `zero` there and clears this */
	uint32_t index_divisor; /* electrical turns between two indexes, > 0 */
	uint32_t last;
	int32_t valid;
} hm2_resolver;

/* Takes in a position. Moves of half a turn and more between two updates cannot be told from shorter ones. */
void hm2_resolver_update(hm2_resolver *resolver, uint32_t position);

typedef struct hm2_resolvers {
	hm2_resolver *resolvers; /* count of them */
	uint32_t *words;         /* room for 1 + 2 * count: status, velocities, positions */
	uint32_t count;
	uint32_t status_address, velocity_address, position_address;
} hm2_resolvers;

void hm2_resolvers_part(hm2_resolvers *resolvers, hm2_cyclic *part);

/* ---- absolute encoders (absolute_encoder.c): SSI ------------------------------------------- */

/* One channel; the caller owns it and zeroes it first. */
typedef struct hm2_absolute {
	/* settings: the position within the data, from one or two runs of bits */
	uint32_t bits;                 /* of the data, 1 to 64; 0: channel not used */
	uint32_t low_shift, low_bits;  /* low_bits 0: no position in the data */
	uint32_t high_shift, high_bits;
	int32_t gray;                  /* 1: the position is in Gray code */
	/* results */
	uint64_t data;                 /* last good reading */
	int64_t count;                 /* position extended over its wrap */
	int32_t fresh;                 /* 1: the last exchange brought a new reading */
	uint32_t missed;               /* exchanges in a row that did not */
	int32_t valid;                 /* 1: there has been a good reading */
	/* private */
	uint64_t last;
} hm2_absolute;

void hm2_absolute_update(hm2_absolute *channel, uint64_t data);

/* All channels of a module. Busy flags are read before control, control before data; what a start of all
 * channels brings is there for a later exchange. */
typedef struct hm2_absolutes {
	hm2_absolute *channels;  /* count of them */
	uint32_t *words;         /* room for 2 + 3 * count: busy, controls, high and low words of data, start */
	uint32_t count;
	uint32_t busy_address, control_address, high_address, low_address;
	uint32_t control_busy_mask, control_available_mask;
	int32_t start;           /* 1: write a start in each exchange */
} hm2_absolutes;

void hm2_absolutes_part(hm2_absolutes *absolutes, hm2_cyclic *part);

/* ---- recording (record_ring.c): one record per cycle, from the cycle's thread to a writer ----- */

/* Stages of a cycle, each stamped when it is over. */
enum hm2_engine_stage {
	HM2_STAGE_WAKE,    /* the thread runs: its lateness */
	HM2_STAGE_REQUEST, /* the request is with the bus */
	HM2_STAGE_REPLY,   /* its answer is there */
	HM2_STAGE_UNPACK,  /* readings are values */
	HM2_STAGE_CONTROL, /* outputs are taken over, controllers have run */
	HM2_STAGE_PACK,    /* the values to write are in place */
	HM2_STAGE_WRITE,   /* read-modify-write: the second exchange is over; pipelined: nothing to do */
	HM2_STAGES
};

#define HM2_RECORD_WORDS 256 /* of the register image, at most */

/* What a record begins with. Behind it: the register image (image_words words, a word per address of the layout,
 * the last value where this cycle did not move it), then from the next multiple of 8 bytes the input values and the
 * output values (double). Sizes and layout are fixed for a run. */
typedef struct hm2_record {
	uint64_t cycle;        /* number, from 0; a gap is a dropped record */
	int64_t start_ns;      /* when the cycle was due, CLOCK_MONOTONIC (emulator: the board's clock) */
	uint32_t stage_ns[8];  /* by enum hm2_engine_stage: end of the stage after start_ns; the last one is unused */
	uint64_t outputs;      /* number of the output vector that was used */
	int32_t status;        /* of the cycle's exchanges: enum hm2_status */
	uint32_t flags;        /* HM2_ENGINE_* that held in this cycle */
	uint32_t image_words;
	uint32_t reserved;
	uint32_t fresh[8];     /* bit n: word n of the image was moved by this cycle's exchanges */
} hm2_record;

struct hm2_record_ring;

typedef struct hm2_record_ring_counters {
	uint64_t pushed;   /* records that found room */
	uint64_t dropped;  /* records that did not */
	uint64_t popped;
	uint32_t slots;
	uint32_t record_size;
} hm2_record_ring_counters;

/* slots: a power of two up to 2^24; record_size: bytes, a multiple of 8. One thread pushes, another pops; neither
 * ever waits. The memory is touched here, so that the first pushes find it. HM2_ERR_RANGE, HM2_ERR_NO_MEMORY. */
int hm2_record_ring_new(uint32_t slots, uint32_t record_size, struct hm2_record_ring **ring, hm2_error *error);
void hm2_record_ring_free(struct hm2_record_ring *ring);
/* 1: copied. 0: there is no room, the record is dropped and counted. */
int hm2_record_ring_push(struct hm2_record_ring *ring, const void *record);
/* The same without the copy: where the next record may be put (NULL: no room, counted), and giving it away. */
void *hm2_record_ring_reserve(struct hm2_record_ring *ring);
/* Where the next record will lie, free or not yet: to have its memory at hand. For the pusher. */
const void *hm2_record_ring_next(const struct hm2_record_ring *ring);
void hm2_record_ring_commit(struct hm2_record_ring *ring);
/* Up to `most` records into a buffer of most * record_size bytes, oldest first; returns how many. */
size_t hm2_record_ring_pop_many(struct hm2_record_ring *ring, void *buffer, size_t most);
/* Any thread. */
void hm2_record_ring_get_counters(const struct hm2_record_ring *ring, hm2_record_ring_counters *counters);

/* ---- PID with feed-forward (pid.c) ----------------------------------------------------------- */

/* Owned by the caller and zeroed first. Units: those of command and feedback; output in its own. */
typedef struct hm2_pid {
	/* settings */
	double p, i, d;          /* output per unit of error, per unit s, per unit/s */
	double ff0, ff1, ff2;    /* output per unit of command, per unit/s of it, per unit/s^2 */
	double bias;             /* output */
	double deadband;         /* units: an error within it counts as 0 */
	double max_output;       /* +-; 0: not limited */
	double max_integral;     /* +-, in output; 0: as max_output */
	double max_error;        /* units: beyond it `exceeded` is set; 0: never */
	/* results */
	double error;            /* command - feedback, units */
	double integral;         /* its part of the output */
	double output;
	int32_t saturated;       /* the output is at its limit */
	int32_t exceeded;        /* max_error was exceeded since the last reset */
	/* private */
	double last_command, last_velocity, last_feedback;
	int32_t valid;
} hm2_pid;

/* Forgets the past: integral 0, and no derivative in the next update. Settings stay. */
void hm2_pid_reset(hm2_pid *pid);
/* Velocities that are not a number are taken from the differences. The integral stands still while the output is
 * at its limit and the error would drive it further. */
double hm2_pid_update(hm2_pid *pid, double command, double command_velocity, double feedback,
                      double feedback_velocity, double seconds);

/* ---- the cycle engine (engine*.c): a thread that owns the cycle ------------------------------- */

#define HM2_ENGINE_PORTS 4
#define HM2_ENGINE_AXES 16    /* PID controllers */
#define HM2_ENGINE_CONTROLS 8 /* compiled controllers */
#define HM2_ENGINE_SIGNALS 512 /* inputs, and as many outputs */
#define HM2_ENGINE_SLOWEST 16
#define HM2_ENGINE_EVENTS 1024

struct hm2_engine;

enum hm2_engine_style {
	HM2_ENGINE_PIPELINED,        /* one exchange: what was controlled in the last cycle goes out with the request */
	HM2_ENGINE_READ_MODIFY_WRITE /* two: read, control, write */
};

enum hm2_engine_overrun {
	HM2_OVERRUN_SKIP,    /* periods that were missed are left out */
	HM2_OVERRUN_CATCH_UP /* up to ten are made up for, one right after the other */
};

/* Why outputs are off; bits, also in a record's flags. None: they are on. */
#define HM2_OFF_IDLE 0x0001u     /* nobody has written outputs yet */
#define HM2_OFF_USER 0x0002u     /* disabled on request */
#define HM2_OFF_DEAD_MAN 0x0004u /* outputs were not refreshed in time */
#define HM2_OFF_STALE 0x0008u    /* too many exchanges in a row failed, or brought no new result of a port */
#define HM2_OFF_OVERRUN 0x0010u  /* too many overruns in a row */
#define HM2_OFF_BITE 0x0020u     /* the watchdog has bitten */
#define HM2_OFF_PORT 0x0040u     /* an SSERIAL port was given up */
#define HM2_OFF_FAULT 0x0080u    /* a remote reported a new fault, or its watchdog has bitten */
#define HM2_OFF_ERROR 0x0100u    /* an axis exceeded its following error */
#define HM2_OFF_CONTROL 0x0200u  /* a controller's output is not a number */
#define HM2_OFF_STOP 0x0400u     /* the engine is stopping */
#define HM2_ENGINE_OVERRAN 0x10000u /* flag of a record: the cycle before ended too late */

enum hm2_engine_event_kind {
	HM2_EVENT_ON = 1,        /* outputs are on */
	HM2_EVENT_OFF,           /* outputs went off: value = the HM2_OFF_* that was new */
	HM2_EVENT_OVERRUN,       /* value = periods missed; the first of a series */
	HM2_EVENT_FAILED,        /* an exchange failed (status); the first of a series */
	HM2_EVENT_RECOVERED,     /* value = how many had failed */
	HM2_EVENT_PORT_FAULT,    /* index = port * 8 + channel: words = CS, rising, fault word, rising of it */
	HM2_EVENT_PORT_GIVEN_UP, /* index = port: fault bucket full (value = level), or value = enum hm2_engine_given_up */
	HM2_EVENT_PORT_BACK,     /* index = port: it takes part again; outputs stay off */
	HM2_EVENT_AXIS,          /* index = axis whose following error was exceeded */
	HM2_EVENT_CONTROL        /* index = output that is not a number */
};

typedef struct hm2_engine_event {
	int64_t time_ns; /* on the board's clock */
	uint64_t cycle;
	int32_t kind;
	int32_t index;
	int32_t status;
	int32_t reserved;
	int64_t value;
	uint32_t words[4];
} hm2_engine_event;

/* A place in a participant's memory that is one number of the engine's vectors. */
enum hm2_signal_type { HM2_SIGNAL_F64, HM2_SIGNAL_I64, HM2_SIGNAL_U64, HM2_SIGNAL_I32, HM2_SIGNAL_U32 };

typedef struct hm2_signal {
	void *place;  /* NULL: the number lives in the vector only, as a command for controllers */
	int32_t type; /* enum hm2_signal_type */
	int32_t bit;  /* of an integer, 0 or 1; -1: the whole value */
	int32_t hold; /* of an output: 1 keeps its value while outputs are off, 0 becomes 0 */
} hm2_signal;

/* The number in a place, and a number into it (integers: rounded and limited to the type). Signals without a place are
 * left out. Not for memory that another thread works on. */
void hm2_signals_load(const hm2_signal *signals, size_t count, double *values);
void hm2_signals_store(const hm2_signal *signals, size_t count, const double *values);

/* A compiled controller, called once a cycle between inputs and outputs. `outputs` holds what was written last; what
 * it leaves there goes out. enabled 0: outputs are off, nothing of it goes out. It must not block. */
typedef void (*hm2_control)(void *context, const double *inputs, double *outputs, double seconds, int32_t enabled);

typedef struct hm2_engine_config {
	int64_t period_ns;
	int64_t early_ns;        /* awake so long before the time, spinning */
	int64_t reply_ns;        /* an exchange has failed after so long */
	int64_t dead_man_ns;     /* outputs must be written within it; 0: never */
	int32_t style;           /* enum hm2_engine_style */
	int32_t virtual_time;    /* 1: time passes by hm2_board_pause_ns, as fast as it goes */
	int32_t stale_limit;     /* failed exchanges, or hidden results of a port, in a row that turn outputs off; 0: never */
	int32_t overrun;         /* enum hm2_engine_overrun */
	int32_t overrun_limit;   /* overruns in a row that turn outputs off; 0: never */
	int32_t fault_increment; /* a port's bucket: for a result with a failed channel, */
	int32_t fault_decrement; /* taken off for a good one, */
	int32_t fault_limit;     /* and the level at which the port is given up; 0: never */
	int32_t priority;        /* SCHED_FIFO; 0: as the caller */
	int32_t cpu;             /* -1: any */
	int32_t lock_memory;     /* 1: mlockall */
} hm2_engine_config;

/* What the system refused: errno values, 0: granted or not asked for. */
typedef struct hm2_engine_refusals {
	int32_t priority, cpu, lock_memory;
} hm2_engine_refusals;

/* Values of HM2_EVENT_PORT_GIVEN_UP that are no level of a fault bucket. */
enum hm2_engine_given_up { HM2_GIVEN_UP_DOIT_HUNG = -1, HM2_GIVEN_UP_CHANNELS_STOPPED = -2 };

enum hm2_engine_port_state { HM2_PORT_RUNNING, HM2_PORT_GIVEN_UP, HM2_PORT_LENT };

typedef struct hm2_engine_status {
	uint64_t cycles;       /* done, good or not */
	int64_t start_ns;      /* when the last one was due */
	uint64_t outputs;      /* number of the output vector in use, from 1 */
	uint64_t failures;     /* exchanges that failed */
	uint64_t overruns;     /* cycles that ended after the next was due */
	uint64_t skipped;      /* periods left out */
	uint64_t events_lost;
	int64_t outputs_age_ns;/* since the output vector in use was taken over */
	uint32_t off;          /* HM2_OFF_*; 0: outputs are on */
	int32_t status;        /* of the last cycle's exchanges */
	int32_t stale;         /* failed exchanges in a row */
	int32_t running;
	int32_t port_level[4]; /* fault buckets */
	int32_t port_state[4]; /* enum hm2_engine_port_state; HM2_PORT_RUNNING while lent */
	int32_t port_stale[4]; /* lost or hidden results in a row: the port's inputs are those before */
} hm2_engine_status;

void hm2_engine_defaults(hm2_engine_config *config);
/* Board and cycle stay the caller's and outlive the engine, like everything the signals point to. */
int hm2_engine_new(struct hm2_board *board, struct hm2_cycle *cycle, const hm2_engine_config *config,
                   const hm2_signal *inputs, size_t input_count, const hm2_signal *outputs, size_t output_count,
                   struct hm2_engine **engine, hm2_error *error);
/* Stops first. */
void hm2_engine_free(struct hm2_engine *engine);
/* Before start. The port is part of the cycle already; while the engine has it, only the engine may use it. */
int hm2_engine_add_port(struct hm2_engine *engine, struct hm2_sserial *port, hm2_error *error);
int hm2_engine_add_control(struct hm2_engine *engine, hm2_control control, void *context, hm2_error *error);
/* An axis: indices into outputs (command, command_velocity, output) and inputs (feedback, feedback_velocity); the
 * velocities may be -1. */
int hm2_engine_add_pid(struct hm2_engine *engine, const hm2_pid *settings, int32_t command,
                       int32_t command_velocity, int32_t feedback, int32_t feedback_velocity, int32_t output,
                       hm2_error *error);
/* New settings of an axis, from the next cycle on. HM2_ERR_BUSY: the thread has not taken the last ones yet. Not while another
 * thread starts or stops the engine. */
int hm2_engine_set_pid(struct hm2_engine *engine, uint32_t axis, const hm2_pid *settings, hm2_error *error);
const hm2_pid *hm2_engine_pid(const struct hm2_engine *engine, uint32_t axis);
/* One record per cycle from now on; NULL: none. Before start. image_words: room for the register image. */
void hm2_engine_set_record_ring(struct hm2_engine *engine, struct hm2_record_ring *ring, uint32_t image_words);
uint32_t hm2_engine_record_size(const struct hm2_engine *engine, uint32_t image_words);
/* What the image's words are: address, with bit 0 set for a write. Grows in the first cycles; returns how many. */
size_t hm2_engine_layout(const struct hm2_engine *engine, uint32_t *addresses, size_t capacity);
/* Registers, reads and writes apart, that found no room in the image. */
uint32_t hm2_engine_left_out(const struct hm2_engine *engine);

/* With virtual time there is no thread: hm2_engine_step runs the cycles. refusals may be NULL. */
int hm2_engine_start(struct hm2_engine *engine, hm2_engine_refusals *refusals, hm2_error *error);
/* Outputs off, sent, the thread ended. Idempotent; any thread but the engine's. */
void hm2_engine_stop(struct hm2_engine *engine);
/* One cycle in the caller's thread, when it is due. HM2_ERR_BUSY: not started, or it has a thread. */
int hm2_engine_step(struct hm2_engine *engine, hm2_error *error);
/* In a forked child: the thread is the parent's, nothing is to be stopped. */
void hm2_engine_abandon(struct hm2_engine *engine);

/* The whole output vector, and that somebody is there. One thread at a time. Returns its number. */
uint64_t hm2_engine_write(struct hm2_engine *engine, const double *outputs);
/* The last cycle's vectors, whole and of the same cycle. Any thread; NULL: not wanted. */
void hm2_engine_read(const struct hm2_engine *engine, hm2_engine_status *status, double *inputs, double *outputs);
/* Waits until a cycle after number `cycles` is done: 1, or 0 when the time is over. */
int hm2_engine_wait(struct hm2_engine *engine, uint64_t cycles, int64_t timeout_ns);
/* Outputs on again after they went off: nothing else turns them on. What still holds turns them off again. With
 * none written since the start it does nothing. */
void hm2_engine_enable(struct hm2_engine *engine);
void hm2_engine_disable(struct hm2_engine *engine);
/* After a port was given up: it was started anew and takes part again. Or after it was lent. */
void hm2_engine_port_back(struct hm2_engine *engine, uint32_t port);
/* Whether it is given up now: the status tells what the last cycle knew. */
int hm2_engine_port_is_given_up(const struct hm2_engine *engine, uint32_t port);
/* Ask for a port for a moment, its channels running on: between two of its DOITs the cycle leaves it to others until
 * hm2_engine_port_back. 1: it is lent; 0: not yet, ask again after a cycle. wanted 0 takes the question back; the port may
 * have been lent just before: 1. One thread per port. */
int hm2_engine_lend_port(struct hm2_engine *engine, uint32_t port, int wanted);
size_t hm2_engine_take_events(struct hm2_engine *engine, hm2_engine_event *events, size_t capacity);

/* Durations of stages (HM2_STAGE_WAKE: lateness); HM2_STAGES: of whole cycles; HM2_STAGES + 1: of what follows a
 * cycle, trace, record and the publishing of its values. All while running. */
void hm2_engine_get_histogram(const struct hm2_engine *engine, int stage, hm2_histogram *histogram);
/* The slowest cycles since the beginning, in no order; returns how many. */
size_t hm2_engine_slowest(const struct hm2_engine *engine, hm2_record *records, size_t capacity);
void hm2_engine_reset_trace(struct hm2_engine *engine);

/* ---- an emulated card behind shared memory (emulator/mirror.c) ----------------------------- */

typedef struct hm2_mirror_word {
	uint32_t address;
	uint32_t shown;    /* what the shared word last held; start it with the word itself */
	int32_t readable;  /* 0: reading has side effects or gives nothing, HM2_EMULATOR_UNDRIVEN is shown */
} hm2_mirror_word;

/* One look at 64 KiB of memory shared with a driver: words it has changed are written to the card, in list
 * order, then the card's words are shown, in list order. seen: room for count words. */
int hm2_emulator_mirror(hm2_emulator *card, void *shared, hm2_mirror_word *words, uint32_t *seen, size_t count,
                        hm2_error *error);
/* As many looks, each followed by a pause. */
int hm2_emulator_mirror_looks(hm2_emulator *card, void *shared, hm2_mirror_word *words, uint32_t *seen,
                              size_t count, int looks, int64_t pause_ns, hm2_error *error);

/* ---- machines for the emulated card (emulator/plant.c, plant_motors.c) ------------------- */

/* A value in a remote's memory: what the host commands, or what the machine reports. */
typedef struct hm2_plant_signal {
	hm2_remote *remote; /* NULL: not connected */
	uint32_t address;   /* in RAM */
	int32_t bits;       /* of the value, 1..32 */
	int32_t is_signed;
	int32_t bit;        /* of the value that is meant; -1: the whole value */
	double scale;       /* units per raw count */
} hm2_plant_signal;

/* What all motors have in common: a rotor with inertia and friction, an encoder, limit switches. */
typedef struct hm2_plant_rotor {
	double inertia;          /* kg m^2, > 0 */
	double friction;         /* N m per rad/s */
	double drag;             /* N m, opposes motion */
	double load;             /* N m, from outside, positive turns forward */
	double counts_per_turn;
	int32_t encoder;         /* input of the card; -1: none */
	double low_limit, high_limit; /* turns at which the switches close; low > high: no switches */
	hm2_plant_signal low_switch, high_switch;
	double angle;            /* rad */
	double speed;            /* rad/s */
	double torque;           /* N m, of the motor */
} hm2_plant_rotor;

/* A DC motor on an amplifier that an analog output commands. */
typedef struct hm2_dc_motor {
	hm2_plant_rotor rotor;
	hm2_plant_signal command; /* V */
	hm2_plant_signal enable;  /* 0: the amplifier is off */
	double gain;              /* armature volts per command volt */
	double resistance;        /* ohm, > 0 */
	double inductance;        /* H, > 0 */
	double constant;          /* N m/A, and V per rad/s */
	double current;           /* A */
} hm2_dc_motor;

/* A permanent-magnet motor on an 8I20. */
typedef struct hm2_pm_motor {
	hm2_plant_rotor rotor;
	hm2_plant_signal angle;   /* electrical, in turns */
	hm2_plant_signal current; /* A */
	hm2_plant_signal enable;
	double pole_pairs;
	double constant;          /* N m/A at the best angle */
} hm2_pm_motor;

#define HM2_PLANT_STEP_PS 50000000LL /* 50 us */

/* Couple a motor to the card: it moves as the card's time goes on. The caller owns the struct, keeps it alive
 * and looks at it after hm2_emulator_sync. */
int hm2_emulator_add_dc_motor(hm2_emulator *card, hm2_dc_motor *motor, hm2_error *error);
int hm2_emulator_add_pm_motor(hm2_emulator *card, hm2_pm_motor *motor, hm2_error *error);

/* ---- the floor of cycles, to measure against (engine_floor.c) -------------------------------- */

/* Wakes up on an absolute schedule, `early_ns` before it is due and awake from then on, and notes how late it was.
 * In the caller's thread, with what scheduling that has. */
void hm2_floor_wake(int64_t period_ns, int64_t early_ns, uint32_t cycles, hm2_histogram *lateness);
/* The same exchange again and again; ns: the time of each. */
int hm2_floor_exchanges(struct hm2_board *board, const hm2_transfer *transfers, size_t count, uint32_t exchanges,
                        uint64_t *ns, hm2_error *error);
/* The same record so many times; the time of all. */
uint64_t hm2_floor_pushes(struct hm2_record_ring *ring, const void *record, uint32_t pushes);

/* ---- the floor of UDP exchanges, to measure against (udp_floor.c) --------------------------- */

/* A thread that answers every datagram of at least 16 bytes with reply_size bytes: zeros, and the numbers
 * that make it a card's answer to the UDP transport. No registers behind it: the least a card can do. */
struct hm2_udp_floor;

int hm2_udp_floor_open(size_t reply_size, uint32_t spin_us, int fifo_priority, int cpu,
                       struct hm2_udp_floor **floor, hm2_error *error);
void hm2_udp_floor_close(struct hm2_udp_floor *floor);
uint16_t hm2_udp_floor_port(const struct hm2_udp_floor *floor);
/* Bare send and receive, `window` requests under way, waiting as the transport does. ns: the time of each
 * exchange; with a window above 1 each entry is the time from one reply to the next. */
int hm2_udp_floor_exchanges(uint16_t port, const uint8_t *request, size_t length, uint32_t spin_ns,
                            uint32_t window, uint32_t count, uint64_t *ns, hm2_error *error);

/* A whole cycle: pack, exchange, unpack. */
typedef struct hm2_udp_floor_cycle {
	struct hm2_cycle *cycle;
	struct hm2_process_data *process_data; /* may be NULL */
	hm2_error error;
	uint32_t state; /* of the numbers by which cycles are timed out of step */
} hm2_udp_floor_cycle;

int hm2_udp_floor_cycle_run(hm2_udp_floor_cycle *cycle);
int hm2_udp_floor_cycles(hm2_udp_floor_cycle *cycle, uint32_t count, uint64_t *ns);

/* What a look at a socket with nothing in it takes: who waits awake learns of a reply up to so much late. */
int hm2_udp_floor_looks(uint32_t count, uint64_t *ns, hm2_error *error);

/* Cycles at a fixed period: what was late, and where the time went. A cycle is late when its values are not
 * there one period after its start was due; it belongs to the stage that took longest. */
#define HM2_UDP_FLOOR_WAKE 0   /* the system let the thread run late */
#define HM2_UDP_FLOOR_SEND 1
#define HM2_UDP_FLOOR_ANSWER 2
#define HM2_UDP_FLOOR_STAGES 3

/* A late cycle: its number, the stage that took longest, and how long each took. */
typedef struct hm2_udp_floor_late {
	uint32_t cycle;
	int32_t stage;
	int64_t ns[3];
} hm2_udp_floor_late;

typedef struct hm2_udp_floor_timing {
	uint64_t cycles;
	uint64_t lost;    /* no answer, however late */
	uint64_t late;
	uint64_t skipped; /* periods left out to catch up */
	uint64_t recorded;
	uint64_t capacity;            /* of lates */
	hm2_udp_floor_late *lates;    /* the caller's: the first `recorded` late cycles */
} hm2_udp_floor_timing;

/* capacity and lates are set by the caller. A stage's duration in a late cycle is the time from the one before. */
void hm2_udp_floor_periodic(hm2_udp_floor_cycle *cycle, int64_t period_ns, uint32_t count,
                            hm2_udp_floor_timing *timing);
/* What timing nothing takes, as the other measurements time. */
void hm2_udp_floor_nothing(uint32_t count, uint64_t *ns);

/* ---- faults at counted steps (emulator/fault*.c) ------------------------------------------- */

/* Steps are counted from 1: words moved over a bus, datagrams on a link, answers of a remote. */
enum hm2_fault_kind {
	HM2_FAULT_NONE,        /* nothing but `act` */
	HM2_FAULT_LOST,        /* it never arrives */
	HM2_FAULT_ANSWER_LOST, /* words: carried out, but nobody hears of it before the deadline */
	HM2_FAULT_LATE,        /* by `value` ns */
	HM2_FAULT_TWICE,       /* datagrams: the second one `value` ns later */
	HM2_FAULT_CORRUPT,     /* words: a read has the bits of `value` flipped, a write is refused as damaged;
	                        * datagrams: the byte `value` from the end is flipped; answers: a wrong CRC */
	HM2_FAULT_SHORT,       /* words: carried out, but the answer was cut; else `value` bytes are missing at the end */
	HM2_FAULT_LONG,        /* `value` bytes too many */
	HM2_FAULT_STUCK,       /* words: from here on the mailbox hangs; value: enum hm2_stuck_until */
	HM2_FAULT_BREAK,       /* answers: the last stop bit is low */
	HM2_FAULT_SIGNAL       /* value: signal that is raised in this thread; the step itself is good */
};

enum hm2_stuck_until { HM2_STUCK_UNTIL_UNJAM, HM2_STUCK_UNTIL_RESET, HM2_STUCK_FOR_GOOD };

typedef struct hm2_fault {
	uint64_t step;
	int32_t kind;            /* enum hm2_fault_kind */
	int32_t repeat;          /* steps behind it that are hit, too; -1: all */
	int64_t value;
	void (*act)(void *self); /* called first; NULL: nothing */
	void *self;
} hm2_fault;

/* The command register that can hang, and what writes to it mean. */
typedef struct hm2_mailbox {
	uint32_t command; /* address */
	uint32_t unjam, reset_mask, ignore_mask;
} hm2_mailbox;

struct hm2_fault_bus;

/* A bus that passes each word on to `inner`; closing it closes nothing. NULL: no memory. */
struct hm2_fault_bus *hm2_fault_bus_new(const hm2_bus *inner, const hm2_mailbox *mailbox, hm2_bus *bus);
void hm2_fault_bus_free(struct hm2_fault_bus *bus);
/* Faults (borrowed) from now on, counting from 1 again. Behind `limit` steps every access fails; 0: no limit. */
void hm2_fault_bus_set(struct hm2_fault_bus *bus, const hm2_fault *faults, size_t count, uint64_t limit);
/* Steps since then; fired (may be NULL): at how many a fault was due. */
uint64_t hm2_fault_bus_steps(const struct hm2_fault_bus *bus, uint64_t *fired);

struct hm2_fault_link;

/* A carrier to an engine in this process, on the clock of `card` (virtual), each datagram under way for latency_ns. */
struct hm2_fault_link *hm2_fault_link_new(struct hm2_ethernet *ethernet, const hm2_bus *card, int64_t latency_ns,
                                          hm2_carrier *carrier);
void hm2_fault_link_free(struct hm2_fault_link *link);
/* As for the bus; requests and replies are counted together, in the order in which they are sent. */
void hm2_fault_link_set(struct hm2_fault_link *link, const hm2_fault *faults, size_t count, uint64_t limit);
uint64_t hm2_fault_link_steps(const struct hm2_fault_link *link, uint64_t *fired);

/* As for the bus; steps are the answers that the remote gives. */
void hm2_remote_set_faults(hm2_remote *remote, const hm2_fault *faults, size_t count);
uint64_t hm2_remote_answers(const hm2_remote *remote, uint64_t *fired);

#endif
