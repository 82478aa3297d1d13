/* Datagrams on a connected UDP socket, in real time. */
#include "clock.h"
#include "error.h"
#include "udp.h"

#include <arpa/inet.h>
#include <errno.h>
#include <netinet/in.h>
#include <poll.h>
#include <stdlib.h>
#include <sys/socket.h>
#include <time.h>
#include <unistd.h>

struct udp_socket {
	int file;
};

static int socket_send(void *self, const uint8_t *bytes, size_t length)
{
	const struct udp_socket *udp = self;

	/* the first refusal may be the echo of an earlier datagram (ICMP), the second is about this one */
	for (int attempt = 0; attempt < 2; attempt++) {
		if (send(udp->file, bytes, length, MSG_NOSIGNAL) >= 0)
			return 0;
		if (errno != ECONNREFUSED && errno != EINTR)
			break;
	}
	return -errno;
}

static int socket_receive(void *self, uint8_t *bytes, size_t capacity)
{
	const struct udp_socket *udp = self;
	const ssize_t length = recv(udp->file, bytes, capacity, MSG_DONTWAIT);

	if (length >= 0)
		return (int)length;
	return errno == EINTR ? -EAGAIN : -errno;
}

static void socket_wait(void *self, int64_t ns)
{
	const struct udp_socket *udp = self;
	struct pollfd file = {.fd = udp->file, .events = POLLIN};
	const struct timespec time = {.tv_sec = ns / 1000000000, .tv_nsec = ns % 1000000000};

	ppoll(&file, 1, &time, NULL);
}

static int64_t socket_now_ns(void *self)
{
	(void)self;
	return hm2_clock_now_ns();
}

static void socket_pause_ns(void *self, int64_t ns)
{
	(void)self;
	hm2_clock_pause_ns(ns);
}

static void socket_close(void *self)
{
	struct udp_socket *udp = self;

	if (udp->file >= 0)
		close(udp->file);
	free(udp);
}

static int open_socket(struct udp_socket *udp, const struct sockaddr_in *address, hm2_error *error)
{
	int status;

	udp->file = socket(AF_INET, SOCK_DGRAM | SOCK_CLOEXEC, 0);
	if (udp->file >= 0 && connect(udp->file, (const struct sockaddr *)address, sizeof *address) == 0)
		return HM2_OK;
	status = hm2_error_set(error, HM2_ERR_IO, "udp connect");
	if (error)
		error->os_errno = errno;
	return status;
}

int hm2_udp_bus(const char *host, uint16_t port, const hm2_udp_config *config, hm2_bus *bus,
                struct hm2_udp **udp, hm2_error *error)
{
	struct sockaddr_in address = {.sin_family = AF_INET, .sin_port = htons(port)};
	struct udp_socket *self;
	int status;

	if (inet_pton(AF_INET, host, &address.sin_addr) != 1)
		return hm2_error_set(error, HM2_ERR_RANGE, "udp address");
	self = calloc(1, sizeof *self);
	if (!self)
		return hm2_error_set(error, HM2_ERR_NO_MEMORY, "udp");
	const hm2_carrier carrier = {self,          socket_send,     socket_receive, socket_wait,
	                             socket_now_ns, socket_pause_ns, socket_close};
	status = open_socket(self, &address, error);
	if (status == HM2_OK)
		status = hm2_udp_carrier_bus(&carrier, config, bus, udp, error);
	if (status != HM2_OK)
		socket_close(self);
	return status;
}
