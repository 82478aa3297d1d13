/* The cycle engine: its thread, from the first cycle to the one that has sent the zeroes. */
#include "engine.h"

#include <errno.h>
#include <sched.h>
#include <semaphore.h>
#include <signal.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <time.h>

#define STACK_BYTES 65536
#define DOIT_MOST_NS (LIMIT_DOIT_NS / MARGIN + 100000)
#define LAST_CYCLES 2           /* with outputs off: a DOIT may have been too soon for the first */
#define SLEEP_MOST_NS 20000000LL /* a stop is noticed after so long at most */

void hm2_engine_defaults(hm2_engine_config *config)
{
	*config = (hm2_engine_config){
		.period_ns = 1000000,
		.early_ns = 60000,
		.reply_ns = 800000,
		.dead_man_ns = 100000000,
		.style = HM2_ENGINE_PIPELINED,
		.stale_limit = 5,
		.overrun = HM2_OVERRUN_SKIP,
		.fault_increment = 10,
		.fault_decrement = 1,
		.fault_limit = 200,
		.cpu = -1,
	};
}

static int refuse(hm2_error *error, int64_t limit, int64_t value)
{
	hm2_error_set(error, HM2_ERR_RANGE, "engine");
	if (error) {
		error->expected = (uint32_t)limit;
		error->received = (uint32_t)value;
	}
	return HM2_ERR_RANGE;
}

int hm2_engine_new(struct hm2_board *board, struct hm2_cycle *cycle, const hm2_engine_config *config,
                   const hm2_signal *inputs, size_t input_count, const hm2_signal *outputs, size_t output_count,
                   struct hm2_engine **engine, hm2_error *error)
{
	if (input_count > HM2_ENGINE_SIGNALS || output_count > HM2_ENGINE_SIGNALS)
		return refuse(error, HM2_ENGINE_SIGNALS, (int64_t)(input_count + output_count));
	if (config->period_ns < 10000)
		return refuse(error, 10000, config->period_ns);
	struct hm2_engine *made = calloc(1, sizeof *made);
	if (!made)
		return hm2_error_set(error, HM2_ERR_NO_MEMORY, "engine");
	made->board = board;
	made->cycle = cycle;
	made->config = *config;
	made->status.off = HM2_OFF_IDLE;
	engine_record_new(&made->image);
	int status = engine_data_new(made, inputs, input_count, outputs, output_count) && engine_trace_new(made)
	                     ? HM2_OK
	                     : hm2_error_set(error, HM2_ERR_NO_MEMORY, "engine");
	if (status == HM2_OK)
		status = hm2_record_ring_new(HM2_ENGINE_EVENTS, sizeof(hm2_engine_event), &made->events, error);
	if (status != HM2_OK) {
		hm2_engine_free(made);
		return status;
	}
	engine_publish(made);
	*engine = made;
	return HM2_OK;
}

void hm2_engine_free(struct hm2_engine *engine)
{
	if (!engine)
		return;
	hm2_engine_stop(engine);
	hm2_record_ring_free(engine->events);
	engine_data_free(engine);
	engine_trace_free(engine);
	free(engine);
}

int hm2_engine_add_port(struct hm2_engine *engine, struct hm2_sserial *port, hm2_error *error)
{
	if (engine->port_count == HM2_ENGINE_PORTS)
		return refuse(error, HM2_ENGINE_PORTS, HM2_ENGINE_PORTS + 1);
	engine->ports[engine->port_count++].port = port;
	return HM2_OK;
}

/* Virtual time is the card's. Real time is read without going through the card: an emulated one would work out all it
 * has missed at each look. */
int64_t engine_now_ns(const struct hm2_engine *engine)
{
	return engine->config.virtual_time ? hm2_board_now_ns(engine->board) : hm2_clock_now_ns();
}

static void wait_until_due(struct hm2_engine *engine)
{
	const int64_t due_ns = engine->due_ns;
	if (engine->config.virtual_time) {
		hm2_board_pause_ns(engine->board, due_ns - engine_now_ns(engine));
		engine_prepare(engine, due_ns);
		return;
	}
	const int64_t wake_ns = due_ns - engine->config.early_ns;
	for (int64_t now_ns = hm2_clock_now_ns(); now_ns < wake_ns && !atomic_load(&engine->stopping);
	     now_ns = hm2_clock_now_ns()) {
		const int64_t to_ns = wake_ns - now_ns > SLEEP_MOST_NS ? now_ns + SLEEP_MOST_NS : wake_ns;
		const struct timespec until = {(time_t)(to_ns / 1000000000), (long)(to_ns % 1000000000)};
		clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &until, NULL);
	}
	engine_prepare(engine, due_ns);
	while (hm2_clock_now_ns() < due_ns && !atomic_load(&engine->stopping))
		;
}

static void one_cycle(struct hm2_engine *engine)
{
	wait_until_due(engine);
	engine_cycle(engine);
	engine_schedule(engine);
}

/* Each is given the time that a DOIT takes at most: whoever comes next finds the remotes off. */
static void last_cycles(struct hm2_engine *engine)
{
	engine_off(engine, HM2_OFF_STOP);
	for (uint32_t i = 0; i < engine->port_count; i++)
		engine_lend_no_more(&engine->ports[i]); /* the zeroes need its DOIT */
	for (int i = 0; i < LAST_CYCLES; i++) {
		engine->elapsed_periods = 1; /* no controller is to divide by no time */
		engine_prepare(engine, engine_now_ns(engine));
		engine_cycle(engine);
		if (engine->config.virtual_time)
			hm2_board_pause_ns(engine->board, DOIT_MOST_NS);
		else
			hm2_clock_pause_ns(DOIT_MOST_NS);
	}
}

/* ---- the thread ---- */

static void ask_for_real_time(struct hm2_engine *engine)
{
	const hm2_engine_config *config = &engine->config;
	hm2_engine_refusals *refusals = &engine->refusals;
	*refusals = (hm2_engine_refusals){0, 0, 0};
	if (config->lock_memory && mlockall(MCL_CURRENT | MCL_FUTURE))
		refusals->lock_memory = errno;
	if (config->cpu >= 0) {
		cpu_set_t set;
		CPU_ZERO(&set);
		if (config->cpu < CPU_SETSIZE)
			CPU_SET((size_t)config->cpu, &set);
		refusals->cpu = pthread_setaffinity_np(pthread_self(), sizeof set, &set);
	}
	if (config->priority > 0) {
		const struct sched_param parameter = {.sched_priority = config->priority};
		refusals->priority = pthread_setschedparam(pthread_self(), SCHED_FIFO, &parameter);
	}
}

static void touch_stack(void)
{
	volatile uint8_t stack[STACK_BYTES];
	for (size_t i = 0; i < sizeof stack; i += 1024)
		stack[i] = 0;
}

struct launch {
	struct hm2_engine *engine;
	sem_t ready;
};

static void *run(void *argument)
{
	struct launch *launch = argument;
	struct hm2_engine *engine = launch->engine;
	ask_for_real_time(engine);
	touch_stack();
	engine->due_ns = engine_now_ns(engine) + engine->config.period_ns; /* locking memory may have taken many */
	sem_post(&launch->ready); /* launch is gone from here on */
	while (!atomic_load(&engine->stopping))
		one_cycle(engine);
	last_cycles(engine);
	return NULL;
}

static void set_use(struct hm2_engine *engine, int use)
{
	for (uint32_t i = 0; i < engine->port_count; i++)
		hm2_sserial_set_use(engine->ports[i].port, use);
}

static void prepare(struct hm2_engine *engine)
{
	engine->status.off = HM2_OFF_IDLE;
	engine->status.running = 1;
	engine->status.stale = 0;
	engine->elapsed_periods = 1;
	engine->overruns_in_a_row = 0;
	engine->shuttings = board_shuttings(engine->board);
	engine->has_outputs = 0;
	engine->due_ns = engine_now_ns(engine) + engine->config.period_ns;
	(void)engine_take_outputs(engine); /* what was meant for the last run is not for this one */
	for (uint32_t i = 0; i < engine->port_count; i++) {
		atomic_store(&engine->ports[i].state, HM2_PORT_RUNNING);
		engine->ports[i].leaving = 0;
		engine->ports[i].channels = engine->ports[i].port->started & engine->ports[i].port->cyclic;
		engine->ports[i].level = engine->status.port_level[i] = engine->status.port_state[i] = 0;
		engine->ports[i].port->hidden_in_a_row = engine->status.port_stale[i] = 0;
	}
	engine_load_outputs(engine);
	engine_reset_axes(engine);
	set_use(engine, HM2_SSERIAL_USE_CYCLE);
	engine_publish(engine);
}

static void end(struct hm2_engine *engine)
{
	atomic_store(&engine->running, 0);
	engine->status.running = 0;
	set_use(engine, HM2_SSERIAL_USE_ANY);
	engine_publish(engine);
}

/* The card's signals are the caller's: a handler in this thread would be a cycle that waits for Python. */
static int launch_thread(struct hm2_engine *engine, struct launch *launch)
{
	sigset_t all, before;
	sigfillset(&all);
	pthread_sigmask(SIG_SETMASK, &all, &before);
	const int problem = pthread_create(&engine->thread, NULL, run, launch);
	pthread_sigmask(SIG_SETMASK, &before, NULL);
	return problem;
}

int hm2_engine_start(struct hm2_engine *engine, hm2_engine_refusals *refusals, hm2_error *error)
{
	struct launch launch = {.engine = engine};
	if (engine->status.running)
		return hm2_error_set(error, HM2_ERR_BUSY, "engine start");
	prepare(engine);
	atomic_store(&engine->stopping, 0);
	if (engine->config.virtual_time)
		return HM2_OK;
	atomic_store(&engine->running, 1);
	sem_init(&launch.ready, 0, 0);
	const int problem = launch_thread(engine, &launch);
	if (problem) {
		sem_destroy(&launch.ready);
		end(engine);
		hm2_error_set(error, HM2_ERR_IO, "engine start");
		if (error)
			error->os_errno = problem;
		return HM2_ERR_IO;
	}
	while (sem_wait(&launch.ready) != 0)
		; /* a signal */
	sem_destroy(&launch.ready);
	if (refusals)
		*refusals = engine->refusals;
	return HM2_OK;
}

void hm2_engine_stop(struct hm2_engine *engine)
{
	if (atomic_load(&engine->running)) {
		atomic_store(&engine->stopping, 1);
		pthread_join(engine->thread, NULL);
	} else if (engine->status.running) {
		last_cycles(engine);
	} else {
		return;
	}
	end(engine);
}

int hm2_engine_step(struct hm2_engine *engine, hm2_error *error)
{
	if (atomic_load(&engine->running) || !engine->status.running)
		return hm2_error_set(error, HM2_ERR_BUSY, "engine step");
	one_cycle(engine);
	return HM2_OK;
}

void hm2_engine_abandon(struct hm2_engine *engine)
{
	atomic_store(&engine->running, 0);
	engine->status.running = 0;
	shared_words_abandon(&engine->shared); /* or whoever looks would wait for a thread that is not there */
	shared_words_abandon(&engine->trace.shared);
	engine_publish(engine);
}
