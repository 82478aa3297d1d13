/* What an SSERIAL instance consists of; seen by emulator/sslbp*.c only. */
#ifndef HM2_EMULATOR_SSLBP_STATE_H
#define HM2_EMULATOR_SSLBP_STATE_H

#include "registers.h"
#include "sslbp.h"
#include "sslbp_cost.h"

#define MAX_CHANNELS 8
#define MAX_DATA_REGISTERS 7
#define FIFO_SIZE 16
#define TX_RING 32 /* a full FIFO behind a byte still on the line */
#define FRAME_SIZE 16
#define RAM_SIZE 0x200
#define ROM_WORDS 2048
#define CHANNEL_BLOCKS 0x70
#define CHANNEL_STRIDE 0x32
#define NEVER INT64_MAX
#define TIMER_POWER_UP_PERIOD 2

/* Times are cycles of the processor unless they end in _ps. */
struct sslbp_uart {
	hm2_line_byte tx[TX_RING]; /* pushed, not yet heard by the remote */
	unsigned tx_head, tx_count;
	int64_t tx_free;    /* when the next start bit can fall */
	int64_t tx_emptied; /* when the FIFO became or becomes empty */
	uint8_t rx[FIFO_SIZE];
	unsigned rx_count;
	uint8_t broken;   /* a stop bit was low */
	uint8_t awake;    /* a rate has been loaded since the power-up */
	int64_t bit_ps;   /* 0: no rate loaded */
	int64_t pitch;    /* from byte to byte */
	uint8_t receives, transmits;
	struct hm2_remote *remote;
};

/* The free-running tick counter: a new divider begins after the tick in progress. */
struct sslbp_timer {
	int64_t origin; /* when `count` was reached */
	uint32_t count;
	uint32_t period;
	int64_t next_origin; /* where next_period begins; NEVER: nowhere */
	uint32_t next_period;
};

struct sslbp_post {
	int64_t at;
	uint32_t value;
	uint8_t channel, reg;
};

#define POSTS 8

enum sslbp_place { PLACE_HELD, PLACE_RESET, PLACE_CLEAR, PLACE_FORGET, PLACE_INIT, PLACE_TOP, PLACE_DOORBELL, PLACE_EXECUTE, PLACE_CHANNEL };

struct hm2_sslbp {
	int channels;
	int data_registers;
	uint32_t clock_hz;
	int64_t cycle_ps;
	int64_t now; /* as far as the host has been served */
	int wire;

	/* the mailbox */
	uint16_t command;
	uint16_t decoded; /* the command as the processor read it */
	uint8_t doorbell;
	uint16_t argument; /* DATA as the host wrote it */
	uint8_t result;    /* DATA as the host reads it */
	uint32_t written[MAX_CHANNELS][1 + MAX_DATA_REGISTERS]; /* CS, interface data */
	uint32_t shown[MAX_CHANNELS][1 + MAX_DATA_REGISTERS];
	struct sslbp_post posts[POSTS]; /* register writes of the turn in progress */
	unsigned post_count;

	/* the processor */
	enum sslbp_place place;
	int turn;    /* channel, in PLACE_CHANNEL */
	int64_t cpu; /* when that begins */
	int64_t top; /* when the pass in progress began */
	int64_t skipped; /* of the time since: whole passes not gone through */
	uint8_t ram[RAM_SIZE];
	uint16_t rom[ROM_WORDS];
	struct sslbp_timer timer;
	struct sslbp_uart uarts[MAX_CHANNELS];
	hm2_line_record records[HM2_LINE_RECORDS_KEPT];
	size_t record_head, record_count;
};

static inline uint8_t *sslbp_block(struct hm2_sslbp *s, int channel)
{
	return s->ram + CHANNEL_BLOCKS + CHANNEL_STRIDE * channel;
}

static inline uint8_t sslbp_existing(const struct hm2_sslbp *s)
{
	return (uint8_t)((1u << s->channels) - 1);
}

static inline uint8_t sslbp_state(struct hm2_sslbp *s, int channel)
{
	return sslbp_block(s, channel)[HM2_SSLBP_CHANNEL_STATE];
}

/* sslbp_uart.c */
void sslbp_uart_set_rate(struct hm2_sslbp *s, int channel, uint32_t baud);
void sslbp_uart_flush(struct hm2_sslbp *s, int channel);
void sslbp_uart_reset(struct hm2_sslbp *s, int channel);
/* Let bytes arrive on both ends up to that cycle. */
void sslbp_uart_run(struct hm2_sslbp *s, int channel, int64_t until);
int64_t sslbp_uart_next_event(struct hm2_sslbp *s, int channel);
/* Queue a frame (CRC added unless switched off), its first start bit not before `at`; returns the
 * cycles the processor waited for the FIFO to become empty. */
int sslbp_uart_send(struct hm2_sslbp *s, int channel, uint8_t *frame, size_t length, int64_t at);

/* sslbp_ram.c */
void sslbp_ram_reset(struct hm2_sslbp *s);
uint8_t sslbp_ram_read(struct hm2_sslbp *s, unsigned address);
void sslbp_ram_write(struct hm2_sslbp *s, unsigned address, uint8_t value);
uint32_t sslbp_get32(const uint8_t *bytes);
void sslbp_put32(uint8_t *bytes, uint32_t value);
/* Show a register to the host at the end of the turn, or some cycles before it. */
void sslbp_show(struct hm2_sslbp *s, int channel, int reg, uint32_t value, int64_t at);

/* sslbp_timer.c */
uint16_t sslbp_timer_at(const struct hm2_sslbp *s, int64_t cycle);
/* First cycle at which the 8-bit distance from `start` is at least `ticks`. */
int64_t sslbp_timer_reaches(const struct hm2_sslbp *s, int64_t from, uint8_t start, uint8_t ticks);
void sslbp_timer_set_period(struct hm2_sslbp *s, int64_t cycle, uint32_t period);

/* sslbp_command.c: the top of a pass, which completes a command, then looks for a new one; return cycles. */
int sslbp_command_complete(struct hm2_sslbp *s);
int sslbp_command_begin(struct hm2_sslbp *s);
/* The end of a command that took long. */
int sslbp_command_execute(struct hm2_sslbp *s);
/* What a pending command adds to a pass that does not complete it; negative: it does. */
int sslbp_command_quiet(struct hm2_sslbp *s);
void sslbp_global_init(struct hm2_sslbp *s);

/* sslbp_channel.c: a channel's turn; returns cycles. */
int sslbp_channel_turn(struct hm2_sslbp *s, int channel);
/* Cycles of that turn while nothing happens, and when something next can. */
int sslbp_channel_quiet(struct hm2_sslbp *s, int channel, int64_t from, int64_t *until);
int sslbp_channel_fail(struct hm2_sslbp *s, int channel, uint8_t fault, unsigned counter);

/* sslbp_frame.c: what a sending state sends, and what the state after it waits for. */
size_t sslbp_frame(struct hm2_sslbp *s, int channel, uint8_t *frame);
/* Bytes of the answer without CRC; -1: this state does not wait for one. */
int sslbp_answer_size(struct hm2_sslbp *s, int channel);

/* sslbp_start.c, sslbp_run.c: a good answer, and states that neither send nor wait; return cycles. */
int sslbp_answer_start(struct hm2_sslbp *s, int channel);
int sslbp_check(struct hm2_sslbp *s, int channel);
int sslbp_answer_run(struct hm2_sslbp *s, int channel);
int sslbp_ready(struct hm2_sslbp *s, int channel, uint8_t state);

/* sslbp_cost.c */
int sslbp_cost_to_start_bit(unsigned state);
int sslbp_cost_after_clock(unsigned state);
int sslbp_cost_of_waiting(unsigned state);
int sslbp_cost_of_sending(unsigned state, const uint8_t *frame, size_t length);
int sslbp_cost_of_answer(unsigned state, unsigned size);

/* sslbp_loop.c */
void sslbp_run(struct hm2_sslbp *s, int64_t until);
void sslbp_run_instantly(struct hm2_sslbp *s);

#endif
