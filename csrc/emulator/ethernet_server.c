/* The emulated card on the network: one thread between a UDP socket and the engine. */
#include "ethernet_fault.h"
#include "ethernet.h"
#include "inheriting_mutex.h"

#include <arpa/inet.h>
#include <errno.h>
#include <poll.h>
#include <sched.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>
#include <sys/eventfd.h>
#include <sys/socket.h>
#include <unistd.h>

struct hm2_ethernet_server {
	struct hm2_ethernet *ethernet;
	int socket;
	int wake; /* eventfd: the thread is to look at `stopping` */
	uint16_t port;
	uint32_t spin_us;
	pthread_t thread;
	int running;
	pid_t owner; /* of the thread */
	atomic_int stopping;
	pthread_mutex_t mutex; /* fault lines */
	atomic_int faulty;     /* faults have been asked for: without any, the lines are not looked at */
	struct fault_line lines[2];
	atomic_uint_least64_t requests, replies, send_errors;
	fault_datagram in, out, due;
};

static int fail(hm2_error *error, int status, int os_errno, const char *where)
{
	if (error) {
		memset(error, 0, sizeof *error);
		error->status = status;
		error->os_errno = os_errno;
		error->index = -1;
		strncpy(error->where, where, sizeof error->where - 1);
	}
	return status;
}

static int bind_socket(struct hm2_ethernet_server *server, const char *host, uint16_t port)
{
	struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
	socklen_t size = sizeof address;

	if (inet_pton(AF_INET, host, &address.sin_addr) != 1) {
		errno = EINVAL;
		return -1;
	}
	server->socket = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	if (server->socket < 0 || bind(server->socket, (struct sockaddr *)&address, size) < 0 ||
	    getsockname(server->socket, (struct sockaddr *)&address, &size) < 0)
		return -1;
	server->port = ntohs(address.sin_port);
	return 0;
}

int hm2_ethernet_server_open(struct hm2_ethernet *ethernet, const char *host, uint16_t port,
                             struct hm2_ethernet_server **server, hm2_error *error)
{
	struct hm2_ethernet_server *self = calloc(1, sizeof *self);
	int status = HM2_OK;

	*server = NULL;
	if (!self)
		return fail(error, HM2_ERR_NO_MEMORY, 0, "ethernet server");
	self->ethernet = ethernet;
	self->socket = -1;
	self->wake = eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK);
	inheriting_mutex_init(&self->mutex);
	fault_init(&self->lines[HM2_ETHERNET_REQUESTS], 1);
	fault_init(&self->lines[HM2_ETHERNET_REPLIES], 2);
	if (self->wake < 0 || bind_socket(self, host, port) < 0)
		status = fail(error, HM2_ERR_IO, errno, "ethernet server bind");
	if (status != HM2_OK) {
		hm2_ethernet_server_free(self);
		return status;
	}
	*server = self;
	return HM2_OK;
}

uint16_t hm2_ethernet_server_port(const struct hm2_ethernet_server *server)
{
	return server->port;
}

static void send_reply(struct hm2_ethernet_server *server, const fault_datagram *datagram)
{
	const ssize_t sent = sendto(server->socket, datagram->bytes, datagram->length, MSG_DONTWAIT,
	                            (const struct sockaddr *)&datagram->peer, sizeof datagram->peer);

	/* a firewall or a closed client must not end the card */
	if (sent < 0)
		atomic_fetch_add_explicit(&server->send_errors, 1, memory_order_relaxed);
	else
		atomic_fetch_add_explicit(&server->replies, 1, memory_order_relaxed);
}

/* A request has arrived at the card; the answer leaves it. */
static void serve(struct hm2_ethernet_server *server, const fault_datagram *request)
{
	struct fault_line *line = &server->lines[HM2_ETHERNET_REPLIES];

	server->out.length =
		ethernet_handle(server->ethernet, request->bytes, request->length, server->out.bytes);
	if (server->out.length == 0)
		return;
	server->out.peer = request->peer;
	if (fault_active(line))
		fault_put(line, &server->out, ethernet_now_us());
	else
		send_reply(server, &server->out);
	ethernet_sent(server->ethernet);
}

static void serve_due(struct hm2_ethernet_server *server)
{
	struct fault_line *requests = &server->lines[HM2_ETHERNET_REQUESTS];
	struct fault_line *replies = &server->lines[HM2_ETHERNET_REPLIES];

	while (fault_take(requests, ethernet_now_us(), &server->due))
		serve(server, &server->due);
	while (fault_take(replies, ethernet_now_us(), &server->due))
		send_reply(server, &server->due);
}

/* 1: a datagram was handled. */
static int receive(struct hm2_ethernet_server *server)
{
	struct fault_line *line = &server->lines[HM2_ETHERNET_REQUESTS];
	fault_datagram *in = &server->in;
	socklen_t size = sizeof in->peer;
	const ssize_t length = recvfrom(server->socket, in->bytes, sizeof in->bytes, MSG_DONTWAIT,
	                                (struct sockaddr *)&in->peer, &size);

	if (length < 0)
		return 0;
	in->length = (size_t)length;
	atomic_fetch_add_explicit(&server->requests, 1, memory_order_relaxed);
	if (!atomic_load_explicit(&server->faulty, memory_order_acquire)) {
		serve(server, in);
		return 1;
	}
	pthread_mutex_lock(&server->mutex);
	if (fault_active(line))
		fault_put(line, in, ethernet_now_us());
	else
		serve(server, in);
	pthread_mutex_unlock(&server->mutex);
	return 1;
}

/* Faulted datagrams on their way; returns when the next one is due. */
static int64_t turn(struct hm2_ethernet_server *server)
{
	int64_t requests, replies;

	pthread_mutex_lock(&server->mutex);
	serve_due(server);
	requests = fault_due_us(&server->lines[HM2_ETHERNET_REQUESTS]);
	replies = fault_due_us(&server->lines[HM2_ETHERNET_REPLIES]);
	pthread_mutex_unlock(&server->mutex);
	return requests < replies ? requests : replies;
}

static void sleep_until(struct hm2_ethernet_server *server, int64_t due_us)
{
	struct pollfd files[2] = {{.fd = server->socket, .events = POLLIN}, {.fd = server->wake, .events = POLLIN}};
	const int64_t left = due_us == INT64_MAX ? 0 : due_us - ethernet_now_us();
	const struct timespec time = {.tv_sec = left / 1000000, .tv_nsec = left % 1000000 * 1000};

	if (due_us != INT64_MAX && left <= 0)
		return;
	ppoll(files, 2, due_us == INT64_MAX ? NULL : &time, NULL);
}

static void *thread_main(void *argument)
{
	struct hm2_ethernet_server *server = argument;
	int64_t spin_until = INT64_MAX; /* INT64_MAX: since the last datagram nobody has looked at the clock */

	while (!atomic_load_explicit(&server->stopping, memory_order_acquire)) {
		const int received = receive(server);
		int64_t due = INT64_MAX;

		if (server->lines[0].waiting || server->lines[1].waiting)
			due = turn(server);
		if (received) {
			spin_until = INT64_MAX;
			continue;
		}
		if (spin_until == INT64_MAX)
			spin_until = ethernet_now_us() + server->spin_us;
		if (ethernet_now_us() >= spin_until)
			sleep_until(server, due);
	}
	return NULL;
}

static int create_thread(struct hm2_ethernet_server *server, int fifo_priority, int cpu)
{
	pthread_attr_t attributes;
	const struct sched_param parameter = {.sched_priority = fifo_priority};
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
	code = pthread_create(&server->thread, &attributes, thread_main, server);
	pthread_attr_destroy(&attributes);
	return code;
}

int hm2_ethernet_server_start(struct hm2_ethernet_server *server, uint32_t spin_us, int fifo_priority, int cpu,
                              hm2_error *error)
{
	if (server->running)
		return HM2_OK;
	server->spin_us = spin_us;
	atomic_store(&server->stopping, 0);
	const int problem = create_thread(server, fifo_priority, cpu);
	if (problem)
		return fail(error, HM2_ERR_IO, problem, "ethernet server thread");
	server->running = 1;
	server->owner = getpid();
	return HM2_OK;
}

void hm2_ethernet_server_stop(struct hm2_ethernet_server *server)
{
	uint64_t drained;

	if (!server->running)
		return;
	if (server->owner != getpid()) { /* a forked child: the thread is its parent's, and so is what wakes it */
		server->running = 0;
		return;
	}
	atomic_store_explicit(&server->stopping, 1, memory_order_release);
	(void)eventfd_write(server->wake, 1); /* it cannot be full: each stop empties it */
	pthread_join(server->thread, NULL);
	server->running = 0;
	(void)eventfd_read(server->wake, &drained);
}

void hm2_ethernet_server_free(struct hm2_ethernet_server *server)
{
	if (!server)
		return;
	hm2_ethernet_server_stop(server);
	if (server->socket >= 0)
		close(server->socket);
	if (server->wake >= 0)
		close(server->wake);
	pthread_mutex_destroy(&server->mutex);
	free(server);
}

void hm2_ethernet_server_set_fault(struct hm2_ethernet_server *server, int direction, const hm2_ethernet_fault *fault)
{
	pthread_mutex_lock(&server->mutex);
	server->lines[direction & 1].fault = *fault;
	/* never back to 0: what waits in a line must come out of it */
	if (fault_active(&server->lines[direction & 1]))
		atomic_store_explicit(&server->faulty, 1, memory_order_release);
	pthread_mutex_unlock(&server->mutex);
}

void hm2_ethernet_server_set_seed(struct hm2_ethernet_server *server, uint64_t seed)
{
	pthread_mutex_lock(&server->mutex);
	fault_seed(&server->lines[0], seed);
	fault_seed(&server->lines[1], ~seed);
	pthread_mutex_unlock(&server->mutex);
}

void hm2_ethernet_server_get_counters(struct hm2_ethernet_server *server, hm2_ethernet_server_counters *counters)
{
	pthread_mutex_lock(&server->mutex);
	counters->requests = atomic_load(&server->requests);
	counters->replies = atomic_load(&server->replies);
	counters->send_errors = atomic_load(&server->send_errors);
	counters->lost = server->lines[0].lost + server->lines[1].lost;
	counters->duplicated = server->lines[0].duplicated + server->lines[1].duplicated;
	counters->reordered = server->lines[0].reordered + server->lines[1].reordered;
	counters->overflows = server->lines[0].overflows + server->lines[1].overflows;
	pthread_mutex_unlock(&server->mutex);
}
