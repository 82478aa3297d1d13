/* What the files of the cycle engine share. Private to csrc/engine*.c. */
#ifndef HM2_ENGINE_H
#define HM2_ENGINE_H

#include "board.h"
#include "clock.h"
#include "cycle.h"
#include "error.h"
#include "shared_words.h"
#include "sserial.h"

#include <pthread.h>

#define ENGINE_REQUEST_ENABLE 1u
#define ENGINE_REQUEST_DISABLE 2u
#define ENGINE_REQUEST_RESET_TRACE 4u
#define STATUS_WORDS (sizeof(hm2_engine_status) / 8)
#define HEADER_WORDS (sizeof(hm2_record) / 8)
#define IMAGE_NONE 0xFFFFu     /* not seen yet */
#define IMAGE_LEFT_OUT 0xFFFEu /* no room */

_Static_assert(sizeof(hm2_engine_status) % 8 == 0, "published as words of 64 bits");
_Static_assert(sizeof(hm2_record) % 8 == 0, "published as words of 64 bits");

/* Outputs on their way to the thread: one buffer is the writer's, one the thread's, one in between. */
struct engine_mail {
	double *buffers[3];
	uint64_t numbers[3];
	_Atomic uint32_t between; /* index of the one in between; MAIL_FRESH: not looked at yet */
	uint32_t writers, readers; /* theirs */
	uint64_t written;          /* vectors so far */
};

#define MAIL_FRESH 4u

struct engine_axis {
	hm2_pid pid;
	int32_t command, command_velocity, feedback, feedback_velocity, output;
};

struct engine_control {
	hm2_control control;
	void *context;
};

enum engine_wanted { NOT_WANTED, WANTED, GRANTED };

struct engine_port {
	struct hm2_sserial *port;
	int32_t level;
	_Atomic int state;  /* enum hm2_engine_port_state */
	_Atomic int wanted; /* enum engine_wanted */
	int held;           /* no new DOIT: it is about to be lent */
	int leaving;        /* cycles until a port given up is everybody's: the zeroes go out first */
	uint32_t cyclic;    /* what its mask was before */
	uint32_t channels;  /* that took part when the run began */
};

/* What the last exchange of a kind moved, and where its words go in the image. */
struct engine_move {
	const uint32_t *from;
	uint16_t slot, count;
};

struct engine_plan {
	size_t transfers, moves;
	uint32_t fresh[HM2_RECORD_WORDS / 32];
	struct engine_move move[HM2_RECORD_WORDS];
	hm2_transfer transfer[HM2_CYCLE_TRANSFERS];
};

/* The register image: a word per address and direction, in the order they were first seen. */
struct engine_image {
	struct hm2_record_ring *ring;
	uint32_t capacity;
	_Atomic uint32_t count, left_out;
	uint32_t address[HM2_RECORD_WORDS]; /* bit 0: write */
	uint32_t words[HM2_RECORD_WORDS];
	uint16_t slots[2][HM2_ADDRESS_SPACE / 4];
	struct engine_plan plans[2]; /* of exchanges that only write; that read */
};

struct engine_trace {
	hm2_histogram stages[HM2_STAGES + 2]; /* as hm2_engine_get_histogram gives them */
	hm2_record slowest[HM2_ENGINE_SLOWEST];
	uint32_t slowest_count;
	shared_words shared; /* count, then the slowest */
};

struct hm2_engine {
	struct hm2_board *board;
	struct hm2_cycle *cycle;
	hm2_engine_config config;
	hm2_engine_status status;
	hm2_engine_refusals refusals;
	hm2_record record; /* of the cycle at work */

	hm2_signal *inputs, *outputs;
	size_t input_count, output_count;
	double *input_values;
	const double *commands; /* the output vector in use */
	double *output_values;  /* what goes out */
	struct engine_mail mail;
	shared_words shared; /* status, inputs, outputs */
	_Atomic uint32_t published; /* low half of status.cycles: a futex */
	_Atomic uint32_t waiters;

	uint32_t axis_count, control_count, port_count;
	struct engine_axis axes[HM2_ENGINE_AXES];
	struct engine_control controls[HM2_ENGINE_CONTROLS];
	struct engine_port ports[HM2_ENGINE_PORTS];
	struct engine_axis *pending_axis;
	hm2_pid pending; /* settings on their way, while pending_full */
	_Atomic int pending_full;

	_Atomic uint32_t requests; /* ENGINE_REQUEST_* */
	int64_t refreshed_ns;      /* when the outputs in use were taken over */
	int has_outputs;           /* they are of this run */
	int64_t due_ns;            /* start of the next cycle */
	int64_t elapsed_periods;   /* since the cycle before */
	int64_t late_periods;      /* of those, passed before this cycle began */
	int32_t overruns_in_a_row;
	uint32_t shuttings; /* of the board's gate, seen so far */
	struct engine_image image;
	struct engine_trace trace;
	struct hm2_record_ring *events;

	pthread_t thread;
	_Atomic int stopping;
	_Atomic int running;
};

/* engine.c: the clock of the schedule */
int64_t engine_now_ns(const struct hm2_engine *engine);

/* engine_cycle.c */
void engine_prepare(struct hm2_engine *engine, int64_t due_ns);
void engine_cycle(struct hm2_engine *engine);
void engine_schedule(struct hm2_engine *engine);

/* engine_data.c: vectors */
int engine_data_new(struct hm2_engine *engine, const hm2_signal *inputs, size_t input_count,
                    const hm2_signal *outputs, size_t output_count);
void engine_data_free(struct hm2_engine *engine);
void engine_gather(struct hm2_engine *engine);
void engine_scatter(struct hm2_engine *engine);
int engine_take_outputs(struct hm2_engine *engine); /* 1: there are new ones */
void engine_load_outputs(struct hm2_engine *engine); /* as they stand in the participants */
void engine_publish(struct hm2_engine *engine);

/* engine_lend.c: behind a port's results of a cycle */
void engine_lend(struct engine_port *port);
void engine_lend_no_more(struct engine_port *port);

/* engine_control.c: between inputs and outputs */
void engine_take_settings(struct hm2_engine *engine);
void engine_reset_axes(struct hm2_engine *engine);
void engine_control(struct hm2_engine *engine);

/* engine_policy.c: what turns outputs off */
void engine_event(struct hm2_engine *engine, int kind, int index, int status, int64_t value, const uint32_t words[4]);
void engine_off(struct hm2_engine *engine, uint32_t reason);
void engine_judge_exchange(struct hm2_engine *engine, int status);
void engine_judge_ports(struct hm2_engine *engine);
void engine_miss_ports(struct hm2_engine *engine);
void engine_judge_outputs(struct hm2_engine *engine); /* and takes new ones */
void engine_judge_time(struct hm2_engine *engine, int64_t missed);

/* engine_record.c: raw words and records */
void engine_record_new(struct engine_image *image);
void engine_plan_capture(struct hm2_engine *engine, int reads);
void engine_capture(struct hm2_engine *engine, int reads);
void engine_push_record(struct hm2_engine *engine);
void engine_warm_record(const struct hm2_engine *engine);

/* engine_trace.c: stamps, histograms */
int engine_trace_new(struct hm2_engine *engine);
void engine_trace_free(struct hm2_engine *engine);
void engine_stamp(struct hm2_engine *engine, int stage);
void engine_trace_cycle(struct hm2_engine *engine);
void engine_trace_rest(struct hm2_engine *engine);
void engine_clear_trace(struct hm2_engine *engine);

#endif
