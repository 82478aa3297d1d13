/* What the files of the SSERIAL driver share. Private to csrc/sserial*.c and the cycle engine. */
#ifndef HM2_SSERIAL_H
#define HM2_SSERIAL_H

#include "error.h"
#include "registers.h"

#include <stdatomic.h>

#define CHANNELS HM2_SSERIAL_CHANNELS
#define DATA_REGISTERS HM2_SSERIAL_DATA_REGISTERS
#define CHANNEL_STEP 4u /* bytes between the registers of two channels */

/* Limits: what the firmware takes at most (sserial.md 2, 3.4, 10; SSLBP observed; the slowest
 * processor clock, 50 MHz, and 8 channels) times a margin. They end a wait for a command that will
 * never complete; a working command is never waited for so long. */
#define MARGIN 4
#define LIMIT_LOCAL_NS (250000LL * MARGIN)     /* 4 us; behind a reset the rest of the init, 240 us */
#define LIMIT_STOP_NS (40000LL * MARGIN)       /* 13 us */
#define LIMIT_STOP_ALL_NS (244000LL * MARGIN)  /* 122 us at 100 MHz */
#define LIMIT_RESET_NS (44000LL * MARGIN)      /* 43.4 us */
#define LIMIT_DOIT_NS (510000LL * MARGIN)      /* 255 ticks of 2 us: no receive timer runs longer */
#define LIMIT_ACCESS_NS (50000000LL * 2)       /* setup mode: 250 ticks of 200 us, 49.8 ms seen */
/* One cause of failure ends a start after 21 events: 17 ms normal, 54.6 ms setup. Seven causes are counted. */
#define LIMIT_START_NS (17000000LL * 7 * 2)
#define LIMIT_START_SETUP_NS (54600000LL * 7 * 2)

#define SETTLE_STOP_NS 50000      /* channels initialise up to a loop pass after the stop has completed */
#define SETTLE_RESTART_NS 500000  /* an answer still on its way at an individual stop: 400 us at most */
#define SETTLE_RESET_NS 1000000   /* CS and interface data are stale until the init is over */
#define SETTLE_ACCESS_NS 51000000 /* a failed setup access: its receive timer and late answers run out */

#define POLL_SHORT_NS 1000
#define POLL_START_NS 100000

#define SPACE_UNKNOWN UINT32_MAX

/* Bits of CS that report a fault or the loss of a channel; COM_STATE is not one of them. */
#define CS_FAULTS                                                                                                  \
	(HM2_SSERIAL_CS_REMOTE_FAULT_MASK | HM2_SSERIAL_CS_LOCAL_FAULT_MASK |                                      \
	 ((HM2_CS_STATUS_NOT_READY | HM2_CS_STATUS_NO_REMOTE_ID | HM2_CS_STATUS_COMMUNICATION_ERROR |              \
	   HM2_CS_STATUS_REMOTE_FAULT)                                                                             \
	  << HM2_SSERIAL_CS_STATUS_LSB))

/* Reads, writes, reads again: any run of neighbours is a useful exchange (sserial_doit.c). */
#define LIST_ROWS (1 + DATA_REGISTERS)                        /* CS and interface data */
#define LIST_READS (2 + LIST_ROWS * CHANNELS)                 /* COMMAND, DATA */
#define LIST_WRITES (DATA_REGISTERS * CHANNELS + 1)           /* and DOIT */

struct sserial_lists {
	uint32_t mask;   /* channels compiled for; 0: not compiled */
	size_t reads, writes;
	hm2_transfer transfers[LIST_READS + LIST_WRITES + LIST_READS];
	uint32_t command, data, doit;
	uint32_t in[LIST_ROWS][CHANNELS]; /* row 0: CS; then interface data registers, a word per channel */
	uint32_t out[DATA_REGISTERS][CHANNELS];
};

/* Of a DOIT whose exchange did not come back. */
enum sserial_doubt { NO_DOUBT, MAY_BE_LATE, LATE_AT_WORK };

struct sserial_channel {
	uint32_t software_mode;
	uint32_t input_registers, output_registers; /* that carry process bits */
	uint32_t watch_register, watch_mask;
	hm2_fault_watch watch;
	uint32_t space; /* memory space the remote was left in, or SPACE_UNKNOWN */
	hm2_sserial_identity identity;
};

struct hm2_sserial {
	struct hm2_board *board;
	hm2_sserial_config config;
	_Atomic int use;     /* enum hm2_sserial_use */
	uint32_t started;
	uint32_t used;       /* named in a start since their last stop: stop before the next start */
	int mode;
	int busy;            /* a command was written and not yet seen to complete */
	int64_t busy_until_ns;
	int64_t busy_limit_ns;
	uint32_t flying;     /* channels of a pipelined DOIT whose result has not been read */
	uint32_t cyclic;     /* channels of the board's cycle */
	uint32_t launched;   /* of a DOIT in the cycle's exchange at work */
	uint32_t landed, landed_failed; /* of the result that the cycle's last exchange brought */
	int32_t hidden_in_a_row;        /* results of an engine's cycle, lost or hidden, since the last that was taken */
	int reading;         /* the cycle's exchange at work reads results */
	int hung;            /* the cycle found a DOIT that does not end */
	uint64_t failures;   /* of the board's exchanges, when the last pipelined DOIT was written */
	int late;            /* enum sserial_doubt: no other before a look */
	int hidden;          /* the registers hold no result that could be told from an older one */
	int64_t doit_ns;     /* when the last DOIT was written */
	int64_t expected_ns; /* when to look for the end of a DOIT, from its write */
	int64_t look_ns;     /* what a look takes */
	int chattered;       /* channels were started since the last DOIT */
	struct sserial_channel channels[CHANNELS];
	struct sserial_lists lists;
	struct hm2_process_data *process_data;
	hm2_sserial_image image;
	hm2_sserial_counters counters;
	hm2_sserial_event events[HM2_SSERIAL_EVENTS];
	uint32_t first_event, event_count;
	uint64_t lost_events;
};

/* sserial_command.c: the mailbox */
uint32_t sserial_address(const struct hm2_sserial *port, uint32_t reg, uint32_t channel);
uint32_t sserial_existing(const struct hm2_sserial *port);
int sserial_read(struct hm2_sserial *port, uint32_t reg, uint32_t channel, uint32_t *value, hm2_error *error);
int sserial_write(struct hm2_sserial *port, uint32_t reg, uint32_t channel, uint32_t value, hm2_error *error);
hm2_transfer sserial_word(const struct hm2_sserial *port, uint32_t reg, uint32_t channel, uint32_t *value);
/* Waits for COMMAND to read 0, writes the words, the last of them a command, and waits for its completion. On a
 * network they are one datagram: an old one that comes late cannot put its own words between them. */
int sserial_run(struct hm2_sserial *port, const hm2_transfer *words, size_t count, int64_t limit_ns,
                const char *where, hm2_error *error);
/* The same for a command alone. */
int sserial_command(struct hm2_sserial *port, uint32_t command, int64_t limit_ns, const char *where, hm2_error *error);
int sserial_settle(struct hm2_sserial *port, const char *where, hm2_error *error);
/* Waits for the command that was written; HM2_ERR_TIMEOUT leaves it hung. */
int sserial_wait(struct hm2_sserial *port, int64_t poll_ns, hm2_error *error);
void sserial_written(struct hm2_sserial *port, int64_t limit_ns);
/* Its write is acknowledged: the limit runs from now. A network may have needed to repeat it. */
void sserial_arrived(struct hm2_sserial *port);
/* A hung command: stops everything by what means it takes; returns HM2_ERR_TIMEOUT with the evidence. */
int sserial_recover(struct hm2_sserial *port, const char *where, hm2_error *error);
int sserial_unjam(struct hm2_sserial *port, hm2_error *error);
void sserial_forget(struct hm2_sserial *port, uint32_t mask);
int sserial_fail(hm2_error *error, int status, const char *where, int detail, int channel);

/* sserial_doit.c: a transfer of the image as it is */
void sserial_compile(struct hm2_sserial *port, uint32_t mask);
void sserial_prepare_doit(struct hm2_sserial *port);
/* Whether the last DOIT must be over, whatever it met. */
int sserial_is_over(const struct hm2_sserial *port, int64_t now_ns);
int sserial_take_results(struct hm2_sserial *port);
int sserial_hung(struct hm2_sserial *port, const char *where, hm2_error *error);
int sserial_transfer(struct hm2_sserial *port, uint32_t mask, const char *where, hm2_error *error);
/* Reads the result of a pipelined DOIT that has completed. */
int sserial_collect(struct hm2_sserial *port, hm2_error *error);

/* sserial_cyclic.c: HM2_ERR_BUSY while a cycle in a thread of its own has the port */
int sserial_check_use(const struct hm2_sserial *port, const char *where, hm2_error *error);
/* Before a pipelined DOIT is written. */
void sserial_launching(struct hm2_sserial *port);
/* It is waited for from now on; in doubt if an exchange has failed since. */
void sserial_note_launch(struct hm2_sserial *port);
/* Written over a DOIT that should have been over: lost, and the other's result with it. */
void sserial_overwritten(struct hm2_sserial *port);
/* COMMAND does not read 0, at now_ns or later, and nothing was written over it: whether it will never end. */
int sserial_is_hung(struct hm2_sserial *port, int64_t now_ns);
/* COMMAND reads 0, the registers are read: whether what they hold is a result. Ends all doubt. */
int sserial_is_result(struct hm2_sserial *port);
/* What the cycle's last exchange brought, without ever waiting: 1 if a result, its masks; -1: the DOIT hangs. */
int sserial_cyclic_news(struct hm2_sserial *port, uint32_t *requested, uint32_t *failed);

/* sserial_events.c: faults by edges */
void sserial_watch_transfer(struct hm2_sserial *port, uint32_t channel, uint32_t cs, int failed);
void sserial_watch_start(struct hm2_sserial *port, uint32_t mask);

#endif
