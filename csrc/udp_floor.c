/* The least that an exchange over UDP takes on this machine, and the driver's cycle timed beside it. */
#include "clock.h"
#include "error.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <pthread.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

#define MAX_DATAGRAM 2048
#define LOST_NS 1000000000 /* a reply that has not come by then will not come */
#define EARLY_NS 60000    /* woken so much early, the rest is spent awake */

struct hm2_udp_floor {
	int socket;
	uint16_t port;
	size_t reply_size;
	uint32_t spin_us;
	pthread_t thread;
	atomic_int stopping;
};

static int system_error(hm2_error *error, const char *where)
{
	const int code = errno;
	const int status = hm2_error_set(error, HM2_ERR_IO, where);

	if (error)
		error->os_errno = code;
	return status;
}

/* What udp_receive wants to see: the number before first, the datagram's own last. */
static void answer(struct hm2_udp_floor *floor, const uint8_t *request, size_t length, const struct sockaddr_in *peer)
{
	uint8_t reply[MAX_DATAGRAM] = {0};

	if (length < 16)
		return;
	memcpy(reply + floor->reply_size - 4, request + length - 8, 4);
	sendto(floor->socket, reply, floor->reply_size, MSG_DONTWAIT, (const struct sockaddr *)peer, sizeof *peer);
}

static void *floor_main(void *argument)
{
	struct hm2_udp_floor *floor = argument;
	struct pollfd file = {.fd = floor->socket, .events = POLLIN};
	uint8_t request[MAX_DATAGRAM];
	int64_t spin_until = 0;

	while (!atomic_load_explicit(&floor->stopping, memory_order_acquire)) {
		struct sockaddr_in peer;
		socklen_t size = sizeof peer;
		const ssize_t length = recvfrom(floor->socket, request, sizeof request, MSG_DONTWAIT,
		                                (struct sockaddr *)&peer, &size);

		if (length >= 0) {
			answer(floor, request, (size_t)length, &peer);
			spin_until = hm2_clock_now_ns() + (int64_t)floor->spin_us * 1000;
		} else if (hm2_clock_now_ns() >= spin_until) {
			poll(&file, 1, 20);
		}
	}
	return NULL;
}

static int start_thread(struct hm2_udp_floor *floor, int fifo_priority, int cpu)
{
	const struct sched_param parameter = {.sched_priority = fifo_priority};
	pthread_attr_t attributes;
	cpu_set_t cpus;
	int code;

	pthread_attr_init(&attributes);
	if (fifo_priority > 0) {
		pthread_attr_setinheritsched(&attributes, PTHREAD_EXPLICIT_SCHED);
		pthread_attr_setschedpolicy(&attributes, SCHED_FIFO);
		pthread_attr_setschedparam(&attributes, &parameter);
	}
	if (cpu >= 0) {
		CPU_ZERO(&cpus);
		CPU_SET((size_t)cpu, &cpus);
		pthread_attr_setaffinity_np(&attributes, sizeof cpus, &cpus);
	}
	code = pthread_create(&floor->thread, &attributes, floor_main, floor);
	pthread_attr_destroy(&attributes);
	return code;
}

int hm2_udp_floor_open(size_t reply_size, uint32_t spin_us, int fifo_priority, int cpu,
                       struct hm2_udp_floor **floor, hm2_error *error)
{
	struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
	socklen_t size = sizeof address;
	struct hm2_udp_floor *self;

	if (reply_size < 8 || reply_size > HM2_LBP16_MAX_PAYLOAD)
		return hm2_error_set(error, HM2_ERR_RANGE, "udp floor");
	self = calloc(1, sizeof *self);
	if (!self)
		return hm2_error_set(error, HM2_ERR_NO_MEMORY, "udp floor");
	self->reply_size = reply_size;
	self->spin_us = spin_us;
	self->socket = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	errno = self->socket < 0 || bind(self->socket, (struct sockaddr *)&address, size) < 0 ||
	                        getsockname(self->socket, (struct sockaddr *)&address, &size) < 0
	                ? errno
	                : start_thread(self, fifo_priority, cpu);
	if (errno) {
		const int status = system_error(error, "udp floor");

		if (self->socket >= 0)
			close(self->socket);
		free(self);
		return status;
	}
	self->port = ntohs(address.sin_port);
	*floor = self;
	return HM2_OK;
}

void hm2_udp_floor_close(struct hm2_udp_floor *floor)
{
	if (!floor)
		return;
	atomic_store_explicit(&floor->stopping, 1, memory_order_release);
	pthread_join(floor->thread, NULL);
	close(floor->socket);
	free(floor);
}

uint16_t hm2_udp_floor_port(const struct hm2_udp_floor *floor)
{
	return floor->port;
}

/* The transport's wait policy with nothing around it. */
static ssize_t receive(int file, uint8_t *reply, size_t capacity, uint32_t spin_ns)
{
	struct pollfd wait = {.fd = file, .events = POLLIN};
	const int64_t start = hm2_clock_now_ns();

	for (;;) {
		const ssize_t length = recv(file, reply, capacity, MSG_DONTWAIT);
		int64_t spent;

		if (length >= 0 || (errno != EAGAIN && errno != EINTR))
			return length;
		spent = hm2_clock_now_ns() - start;
		if (spent > LOST_NS) {
			errno = ETIMEDOUT;
			return -1;
		}
		if (spent >= spin_ns)
			poll(&wait, 1, LOST_NS / 1000000);
	}
}

/* Two loops that look at a socket at their own pace fall into step, and the step then decides what an exchange
 * takes: by a whole look, 6 % of it. So each starts at another moment. */
static void out_of_step(uint32_t *state)
{
	const int64_t start = hm2_clock_now_ns();

	*state = *state * 1664525u + 1013904223u;
	while (hm2_clock_now_ns() - start < (int64_t)(*state >> 22)) /* up to 1023 ns */
		;
}

int hm2_udp_floor_looks(uint32_t count, uint64_t *ns, hm2_error *error)
{
	const int file = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	uint8_t reply[MAX_DATAGRAM];

	if (file < 0)
		return system_error(error, "udp floor");
	for (uint32_t i = 0; i < count; i++) {
		const int64_t start = hm2_clock_now_ns();

		(void)recv(file, reply, sizeof reply, MSG_DONTWAIT);
		ns[i] = (uint64_t)(hm2_clock_now_ns() - start);
	}
	close(file);
	return HM2_OK;
}

static int exchange(int file, const uint8_t *request, size_t length, uint32_t spin_ns, uint32_t window, uint32_t count,
                    uint64_t *ns)
{
	uint8_t reply[MAX_DATAGRAM];
	uint32_t state = 1;
	int64_t last = hm2_clock_now_ns();

	for (uint32_t i = 1; i < window; i++) {
		if (send(file, request, length, 0) < 0)
			return -1;
	}
	for (uint32_t i = 0; i < count; i++) {
		int64_t now;

		if (window == 1) {
			out_of_step(&state);
			last = hm2_clock_now_ns();
		}
		if (send(file, request, length, 0) < 0 || receive(file, reply, sizeof reply, spin_ns) < 0)
			return -1;
		now = hm2_clock_now_ns();
		ns[i] = (uint64_t)(now - last);
		last = now;
	}
	return 0;
}

int hm2_udp_floor_exchanges(uint16_t port, const uint8_t *request, size_t length, uint32_t spin_ns,
                            uint32_t window, uint32_t count, uint64_t *ns, hm2_error *error)
{
	struct sockaddr_in address = {
		.sin_family = AF_INET, .sin_port = htons(port), .sin_addr = {htonl(INADDR_LOOPBACK)}};
	const int file = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	int status = HM2_OK;

	if (file < 0 || connect(file, (struct sockaddr *)&address, sizeof address) < 0 ||
	    exchange(file, request, length, spin_ns, window, count, ns) < 0)
		status = system_error(error, "udp floor");
	if (file >= 0)
		close(file);
	return status;
}

int hm2_udp_floor_cycle_run(hm2_udp_floor_cycle *cycle)
{
	int status;

	if (cycle->process_data)
		hm2_process_data_pack(cycle->process_data);
	status = hm2_cycle_run(cycle->cycle, &cycle->error);
	if (status == HM2_OK && cycle->process_data)
		hm2_process_data_unpack(cycle->process_data);
	return status;
}

int hm2_udp_floor_cycles(hm2_udp_floor_cycle *cycle, uint32_t count, uint64_t *ns)
{
	for (uint32_t i = 0; i < count; i++) {
		out_of_step(&cycle->state);

		const int64_t start = hm2_clock_now_ns();
		const int status = hm2_udp_floor_cycle_run(cycle);

		if (status != HM2_OK)
			return status;
		ns[i] = (uint64_t)(hm2_clock_now_ns() - start);
	}
	return HM2_OK;
}

static void wait_until(int64_t due_ns)
{
	const int64_t wake_ns = due_ns - EARLY_NS;
	const struct timespec time = {.tv_sec = wake_ns / 1000000000, .tv_nsec = wake_ns % 1000000000};

	clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &time, NULL);
	while (hm2_clock_now_ns() < due_ns)
		;
}

/* at[0] is when the cycle was due. Late: over by more than a period after that. */
static void account(hm2_udp_floor_timing *timing, uint32_t cycle, const int64_t *at, int64_t period_ns)
{
	hm2_udp_floor_late late = {.cycle = cycle};

	if (at[HM2_UDP_FLOOR_STAGES] - at[0] <= period_ns)
		return;
	timing->late++;
	for (int stage = 0; stage < HM2_UDP_FLOOR_STAGES; stage++) {
		late.ns[stage] = at[stage + 1] - at[stage];
		if (late.ns[stage] > late.ns[late.stage])
			late.stage = stage;
	}
	if (timing->recorded < timing->capacity)
		timing->lates[timing->recorded++] = late;
}

void hm2_udp_floor_periodic(hm2_udp_floor_cycle *cycle, int64_t period_ns, uint32_t count,
                            hm2_udp_floor_timing *timing)
{
	int64_t due = hm2_clock_now_ns() + period_ns;

	for (uint32_t i = 0; i < count; i++) {
		int64_t at[HM2_UDP_FLOOR_STAGES + 1] = {due};
		int status;

		wait_until(due);
		at[1] = hm2_clock_now_ns();
		if (cycle->process_data)
			hm2_process_data_pack(cycle->process_data);
		status = hm2_cycle_begin(cycle->cycle, &cycle->error);
		at[2] = hm2_clock_now_ns();
		if (status == HM2_OK)
			status = hm2_cycle_finish(cycle->cycle, at[2] + LOST_NS, &cycle->error);
		if (status == HM2_OK && cycle->process_data)
			hm2_process_data_unpack(cycle->process_data);
		at[3] = hm2_clock_now_ns();
		timing->cycles++;
		timing->lost += status != HM2_OK;
		account(timing, i, at, period_ns);
		for (due += period_ns; due <= at[3]; due += period_ns)
			timing->skipped++; /* never two cycles back to back to catch up */
	}
}

void hm2_udp_floor_nothing(uint32_t count, uint64_t *ns)
{
	for (uint32_t i = 0; i < count; i++) {
		const int64_t start = hm2_clock_now_ns();

		ns[i] = (uint64_t)(hm2_clock_now_ns() - start);
	}
}
