/* What the operating system refuses is said with its errno, at the place where it happened, and nothing stays open. */
/* link: -Wl,--wrap=open -Wl,--wrap=close -Wl,--wrap=fstat -Wl,--wrap=mmap -Wl,--wrap=socket -Wl,--wrap=connect -Wl,--wrap=bind -Wl,--wrap=getsockname -Wl,--wrap=send -Wl,--wrap=recv -Wl,--wrap=sendto -Wl,--wrap=getrandom -Wl,--wrap=eventfd -Wl,--wrap=pthread_create -Wl,--wrap=sem_wait -Wl,--wrap=clock_nanosleep -Wl,--wrap=mlockall */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "check.h"
#include "hm2.h"
#include "opened.h"
#include "refused_calls.h"

/* An attempt that must fail, with and without a place for the evidence. */
typedef int attempt(hm2_error *error);

static void check_refused(attempt *try, enum call call, int code, const char *where, int detail)
{
	const int files = files_open;
	hm2_error error;
	memset(&error, 0x55, sizeof error);
	refuse(call, code, 1);
	CHECK_EQUAL(try(NULL), HM2_ERR_IO);
	refuse(call, code, 1);
	CHECK_EQUAL(try(&error), HM2_ERR_IO);
	refuse(NOTHING, 0, 0);
	CHECK_EQUAL(error.status, HM2_ERR_IO);
	CHECK_EQUAL(error.os_errno, code);
	CHECK_EQUAL(error.detail, detail);
	CHECK(strcmp(error.where, where) == 0);
	CHECK_EQUAL(files_open, files);
}

/* ---- a mapped file ---- */

static char card_file[] = "/tmp/hm2-system-XXXXXX";

static int map_card(hm2_error *error)
{
	return open_map(card_file, error);
}

static int map_short_file(hm2_error *error)
{
	CHECK(truncate(card_file, HM2_ADDRESS_SPACE - 1) == 0);
	const int status = map_card(error);
	CHECK(truncate(card_file, HM2_ADDRESS_SPACE) == 0);
	return status;
}

static void test_a_mapped_file_says_why_it_cannot_be_had(void)
{
	hm2_error error;
	const int file = mkstemp(card_file);
	CHECK(file >= 0 && ftruncate(file, HM2_ADDRESS_SPACE) == 0);
	__real_close(file);
	const int missing[] = {ENOENT, ENOTDIR}, forbidden[] = {EACCES, EPERM, EROFS};
	for (int i = 0; i < 2; i++)
		check_refused(map_card, OPEN, missing[i], "memory map open", HM2_MEMORY_MAP_NOT_FOUND);
	for (int i = 0; i < 3; i++)
		check_refused(map_card, OPEN, forbidden[i], "memory map open", HM2_MEMORY_MAP_PERMISSION);
	check_refused(map_card, OPEN, EMFILE, "memory map open", HM2_MEMORY_MAP_OTHER);
	check_refused(map_card, FSTAT, EIO, "memory map size", HM2_MEMORY_MAP_OTHER);
	check_refused(map_card, MMAP, EPERM, "memory map", HM2_MEMORY_MAP_LOCKDOWN);
	check_refused(map_card, MMAP, EACCES, "memory map", HM2_MEMORY_MAP_LOCKDOWN);
	check_refused(map_card, MMAP, ENODEV, "memory map", HM2_MEMORY_MAP_OTHER);
	check_refused(map_short_file, NOTHING, 0, "memory map size", HM2_MEMORY_MAP_TOO_SMALL);
	(void)map_short_file(&error);
	CHECK_EQUAL(error.expected, HM2_ADDRESS_SPACE);
	CHECK_EQUAL(error.received, HM2_ADDRESS_SPACE - 1);
	CHECK_EQUAL(map_card(&error), HM2_OK);
	CHECK_EQUAL(open_map("/dev/zero", &error), HM2_OK); /* a device has no size */
	unlink(card_file);
}

/* ---- an Ethernet card ---- */

static struct hm2_udp *link_to_card;

static int send_bytes(hm2_error *error)
{
	static const uint8_t bytes[4];
	return hm2_udp_send(link_to_card, bytes, sizeof bytes, error);
}

static void test_a_socket_that_cannot_be_had(void)
{
	struct hm2_udp *udp = NULL;
	hm2_error error;
	hm2_bus bus;
	check_refused(open_udp, SOCKET, EMFILE, "udp connect", 0);
	check_refused(open_udp, CONNECT, EACCES, "udp connect", 0);
	CHECK_EQUAL(hm2_udp_bus("card.example", 27181, NULL, &bus, &udp, &error), HM2_ERR_RANGE);
	CHECK(strcmp(error.where, "udp address") == 0);
	refuse(GETRANDOM, EAGAIN, 1); /* early after the boot: the numbers then come from the clock */
	CHECK_EQUAL(open_udp(&error), HM2_OK);
	CHECK_EQUAL(refused_times, 0);
}

/* To a socket that takes datagrams and never answers. */
static int open_link(hm2_bus *bus)
{
	hm2_error error;
	const int peer = __real_socket(AF_INET, SOCK_DGRAM, 0);
	struct sockaddr address = {.sa_family = AF_INET};
	socklen_t size = sizeof address;
	CHECK(__real_bind(peer, &address, size) == 0 && __real_getsockname(peer, &address, &size) == 0);
	const uint16_t port = (uint16_t)((uint8_t)address.sa_data[0] << 8 | (uint8_t)address.sa_data[1]);
	CHECK_EQUAL(hm2_udp_bus("127.0.0.1", port, NULL, bus, &link_to_card, &error), HM2_OK);
	return peer;
}

/* The first ECONNREFUSED may be the echo of an earlier datagram (ICMP): the datagram is sent again, once. */
static void test_a_datagram_that_is_not_taken(void)
{
	hm2_error error;
	hm2_bus bus;
	const int peer = open_link(&bus);
	for (int i = 0; i < 2; i++) {
		refuse(SEND, i ? EINTR : ECONNREFUSED, 1);
		CHECK_EQUAL(send_bytes(&error), HM2_OK);
	}
	check_refused(send_bytes, SEND, ENETUNREACH, "udp send", 0);
	refuse(SEND, ECONNREFUSED, 2);
	CHECK_EQUAL(send_bytes(&error), HM2_ERR_IO);
	CHECK_EQUAL(error.os_errno, ECONNREFUSED);
	bus.close(bus.self);
	__real_close(peer);
}

static int read_word(struct hm2_board *board, hm2_error *error)
{
	uint32_t word;
	hm2_board_set_timeout_ns(board, 20000000);
	return hm2_read(board, 0x100, &word, 1, error);
}

static void test_an_answer_that_cannot_be_taken(void)
{
	struct hm2_board *board = NULL;
	hm2_error error;
	hm2_bus bus;
	const int peer = open_link(&bus);
	CHECK_EQUAL(hm2_board_open(&bus, &board, &error), HM2_OK);
	refuse(RECV, EINTR, 1); /* a signal is no answer and no failure: what comes behind it decides */
	CHECK_EQUAL(read_word(board, &error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(refused_times, 0);
	refuse(RECV, ENETDOWN, 1);
	CHECK_EQUAL(read_word(board, &error), HM2_ERR_IO);
	CHECK_EQUAL(error.os_errno, ENETDOWN);
	CHECK(strcmp(error.where, "udp receive") == 0);
	hm2_board_free(board);
	__real_close(peer);
}

/* ---- the emulated card's server ---- */

static struct hm2_ethernet *ethernet;
static struct hm2_ethernet_server *server;

static int open_server(hm2_error *error)
{
	struct hm2_ethernet_server *opened_server = NULL;
	const int status = hm2_ethernet_server_open(ethernet, "127.0.0.1", 0, &opened_server, error);
	CHECK((opened_server != NULL) == (status == HM2_OK));
	hm2_ethernet_server_free(opened_server);
	return status;
}

static int open_server_at_no_address(hm2_error *error)
{
	struct hm2_ethernet_server *opened_server = NULL;
	const int status = hm2_ethernet_server_open(ethernet, "card.example", 0, &opened_server, error);
	CHECK(opened_server == NULL);
	return status;
}

static int open_server_twice(hm2_error *error)
{
	struct hm2_ethernet_server *other = NULL;
	const int status = hm2_ethernet_server_open(ethernet, "127.0.0.1", hm2_ethernet_server_port(server), &other, error);
	CHECK(other == NULL);
	return status;
}

static int start_server(hm2_error *error)
{
	return hm2_ethernet_server_start(server, 0, 0, -1, error);
}

static void test_a_server_that_cannot_be_had(void)
{
	const hm2_ethernet_config config = {.name = "7I92", .flash_id = 0x13, .lbp_version = 3};
	hm2_error error;
	ethernet = hm2_ethernet_new(&config, NULL);
	const enum call calls[] = {EVENTFD, SOCKET, BIND, GETSOCKNAME};
	for (int i = 0; i < 4; i++)
		check_refused(open_server, calls[i], EMFILE, "ethernet server bind", 0);
	check_refused(open_server_at_no_address, NOTHING, EINVAL, "ethernet server bind", 0);
	CHECK_EQUAL(hm2_ethernet_server_open(ethernet, "127.0.0.1", 0, &server, &error), HM2_OK);
	check_refused(open_server_twice, NOTHING, EADDRINUSE, "ethernet server bind", 0);
	check_refused(start_server, PTHREAD_CREATE, EAGAIN, "ethernet server thread", 0);
	CHECK_EQUAL(start_server(&error), HM2_OK);
	CHECK_EQUAL(start_server(&error), HM2_OK); /* runs already */
	hm2_ethernet_server_stop(server);
	hm2_ethernet_server_stop(server);
	hm2_ethernet_server_free(server);
	hm2_ethernet_server_free(NULL);
	hm2_ethernet_free(ethernet);
	hm2_ethernet_free(NULL);
}

/* A firewall or a closed client must not end the card: what cannot be sent is counted, the next is answered. */
static void test_a_reply_that_cannot_be_sent(void)
{
	const hm2_ethernet_config config = {.name = "7I92", .flash_id = 0x13, .lbp_version = 3};
	hm2_ethernet_server_counters counters;
	struct hm2_board *board = NULL;
	hm2_error error;
	hm2_bus bus;
	ethernet = hm2_ethernet_new(&config, NULL);
	CHECK_EQUAL(hm2_ethernet_server_open(ethernet, "127.0.0.1", 0, &server, &error), HM2_OK);
	CHECK_EQUAL(start_server(&error), HM2_OK);
	CHECK_EQUAL(hm2_udp_bus("127.0.0.1", hm2_ethernet_server_port(server), NULL, &bus, &link_to_card, &error), HM2_OK);
	CHECK_EQUAL(hm2_board_open(&bus, &board, &error), HM2_OK);
	refuse(SENDTO, EPERM, 1);
	CHECK_EQUAL(read_word(board, &error), HM2_ERR_TIMEOUT);
	CHECK_EQUAL(read_word(board, &error), HM2_OK);
	hm2_ethernet_server_get_counters(server, &counters);
	CHECK_EQUAL(counters.send_errors, 1);
	CHECK_EQUAL(counters.requests, 2);
	hm2_board_free(board);
	hm2_ethernet_server_free(server);
	hm2_ethernet_free(ethernet);
}

/* ---- the floor of UDP exchanges ---- */

static struct hm2_udp_floor *udp_floor;

static size_t floor_request = 16;
static uint32_t floor_window = 2;

static int exchange_with_floor(hm2_error *error)
{
	static const uint8_t request[16];
	uint64_t ns[2];
	return hm2_udp_floor_exchanges(hm2_udp_floor_port(udp_floor), request, floor_request, 0, floor_window, 2, ns, error);
}

static int look_at_a_socket(hm2_error *error)
{
	uint64_t ns[2];
	return hm2_udp_floor_looks(2, ns, error);
}

static void test_a_floor_that_cannot_be_had(void)
{
	hm2_error error;
	const enum call calls[] = {SOCKET, BIND, GETSOCKNAME, PTHREAD_CREATE}, exchanges[] = {SOCKET, CONNECT, SEND, RECV};
	for (int i = 0; i < 4; i++)
		check_refused(open_udp_floor, calls[i], EMFILE, "udp floor", 0);
	CHECK_EQUAL(hm2_udp_floor_open(7, 0, 0, -1, &udp_floor, &error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_udp_floor_open(HM2_LBP16_MAX_PAYLOAD + 1, 0, 0, -1, &udp_floor, &error), HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_udp_floor_open(64, 0, 0, 0, &udp_floor, &error), HM2_OK);
	CHECK_EQUAL(exchange_with_floor(&error), HM2_OK);
	for (int i = 0; i < 4; i++)
		check_refused(exchange_with_floor, exchanges[i], ENETDOWN, "udp floor", 0);
	refuse(RECV, EINTR, 1); /* a signal: what comes behind it counts */
	CHECK_EQUAL(exchange_with_floor(&error), HM2_OK);
	CHECK_EQUAL(refused_times, 0);
	floor_window = 1; /* no datagram ahead of the one that is timed */
	check_refused(exchange_with_floor, SEND, ENETDOWN, "udp floor", 0);
	check_refused(look_at_a_socket, SOCKET, EMFILE, "udp floor", 0);
	CHECK_EQUAL(look_at_a_socket(&error), HM2_OK);
	floor_request = 15; /* shorter than any request: nothing comes back */
	CHECK_EQUAL(exchange_with_floor(&error), HM2_ERR_IO);
	CHECK_EQUAL(error.os_errno, ETIMEDOUT);
	hm2_udp_floor_close(udp_floor);
}

/* ---- the engine ---- */

struct card {
	int64_t now_ns;
};

static int card_begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	(void)self;
	(void)transfers;
	(void)count;
	(void)error;
	return HM2_OK;
}

static int card_finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	(void)self;
	(void)deadline_ns;
	(void)error;
	return HM2_OK;
}

static int64_t card_now_ns(void *self)
{
	return ((struct card *)self)->now_ns;
}

static void card_pause_ns(void *self, int64_t ns)
{
	((struct card *)self)->now_ns += ns;
}

static void card_close(void *self)
{
	(void)self;
}

static struct hm2_engine *engine;

static int start_engine(hm2_error *error)
{
	return hm2_engine_start(engine, NULL, error);
}

static void test_a_thread_that_cannot_be_had_leaves_the_port_to_its_user(void)
{
	struct card card = {0};
	const hm2_bus bus = {&card, card_begin, card_finish, card_now_ns, card_pause_ns, card_close, NULL};
	const hm2_sserial_config port_config = {0x5A00, 0x100, 0x40, 0, 8, 3};
	struct hm2_board *board = NULL;
	struct hm2_cycle *cycle = NULL;
	struct hm2_sserial *port = NULL;
	hm2_engine_config config;
	hm2_engine_refusals refusals;
	hm2_engine_status status;
	hm2_error error;
	hm2_engine_defaults(&config);
	config.priority = 1000; /* no such priority, no such processor: the system says EINVAL */
	config.cpu = 100000;
	config.lock_memory = 1;
	CHECK_EQUAL(hm2_board_open(&bus, &board, &error), HM2_OK);
	CHECK_EQUAL(hm2_cycle_new(board, &cycle, &error), HM2_OK);
	CHECK_EQUAL(hm2_sserial_open(board, &port_config, &port, &error), HM2_OK);
	CHECK_EQUAL(hm2_engine_new(board, cycle, &config, NULL, 0, NULL, 0, &engine, &error), HM2_OK);
	CHECK_EQUAL(hm2_engine_add_port(engine, port, &error), HM2_OK);
	check_refused(start_engine, PTHREAD_CREATE, EAGAIN, "engine start", 0);
	hm2_engine_read(engine, &status, NULL, NULL);
	CHECK_EQUAL(status.running, 0);
	CHECK_EQUAL(hm2_sserial_stop(port, 0, &error), HM2_OK); /* not lent to an engine that does not run */
	refuse(SEM_WAIT, EINTR, 1);
	CHECK_EQUAL(hm2_engine_start(engine, &refusals, &error), HM2_OK);
	CHECK_EQUAL(refused_times, 0);
	CHECK_EQUAL(refusals.priority, EINVAL);
	CHECK_EQUAL(refusals.cpu, EINVAL);
	CHECK_EQUAL(hm2_sserial_stop(port, 0, &error), HM2_ERR_BUSY);
	hm2_engine_stop(engine);
	refuse(MLOCKALL, EPERM, 1);
	CHECK_EQUAL(hm2_engine_start(engine, &refusals, &error), HM2_OK);
	CHECK_EQUAL(refusals.lock_memory, EPERM);
	hm2_engine_free(engine);
	hm2_sserial_free(port);
	hm2_cycle_free(cycle);
	hm2_board_free(board);
	CHECK_EQUAL(munlockall(), 0);
}

/* ---- the clock ---- */

static void test_a_signal_neither_shortens_a_pause_nor_keeps_it_awake(void)
{
	const uint32_t address = 0, word = 0;
	hm2_bus bus;
	CHECK_EQUAL(hm2_image_bus(&address, &word, 1, &bus, NULL), HM2_OK);
	const int64_t start_ns = bus.now_ns(bus.self);
	refuse(CLOCK_NANOSLEEP, EINTR, 1);
	bus.pause_ns(bus.self, 3000000);
	CHECK(bus.now_ns(bus.self) - start_ns >= 3000000);
	CHECK_EQUAL(asked, 2); /* asleep again */
	bus.pause_ns(bus.self, -1);
	bus.pause_ns(bus.self, 1000); /* too short to sleep */
	bus.close(bus.self);
}

int main(void)
{
	test_a_mapped_file_says_why_it_cannot_be_had();
	test_a_socket_that_cannot_be_had();
	test_a_datagram_that_is_not_taken();
	test_an_answer_that_cannot_be_taken();
	test_a_server_that_cannot_be_had();
	test_a_reply_that_cannot_be_sent();
	test_a_floor_that_cannot_be_had();
	test_a_thread_that_cannot_be_had_leaves_the_port_to_its_user();
	test_a_signal_neither_shortens_a_pause_nor_keeps_it_awake();
	return CHECK_RESULT();
}
