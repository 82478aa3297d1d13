/* Any bytes as replies to the driver: whatever a card or a stranger sends, only memory of the transfers is
 * written, and only by a reply with the number and length asked for. The socket's other end is this file. */
#include <arpa/inet.h>
#include <netinet/in.h>
#include <stdlib.h>
#include <string.h>
#include <sys/socket.h>
#include <unistd.h>

#include "hm2.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length);

#define GUARD 0xA5A5A5A5u
#define WORDS 40

static int server = -1;
static hm2_bus bus;

static void connect_both(void)
{
	struct sockaddr_in address = {.sin_family = AF_INET, .sin_addr = {htonl(INADDR_LOOPBACK)}};
	socklen_t size = sizeof address;
	const hm2_udp_config config = {.spin_ns = 0, .retry_ns = 0};
	struct hm2_udp *udp;
	hm2_error error;

	server = socket(AF_INET, SOCK_DGRAM, 0);
	if (bind(server, (struct sockaddr *)&address, size) < 0 ||
	    getsockname(server, (struct sockaddr *)&address, &size) < 0 ||
	    hm2_udp_bus("127.0.0.1", ntohs(address.sin_port), &config, &bus, &udp, &error) != HM2_OK)
		abort();
}

/* The request's own number, so that the fuzzer gets past it: put at the end of a piece when asked for. */
static void answer(const uint8_t *bytes, size_t length)
{
	uint8_t request[2048], reply[2048];
	struct sockaddr_in client;
	socklen_t size = sizeof client;
	const ssize_t got = recvfrom(server, request, sizeof request, 0, (struct sockaddr *)&client, &size);

	while (got >= 12 && length >= 3) {
		const int true_number = bytes[0] & 1;
		size_t piece = (size_t)(bytes[1] | bytes[2] << 8) % 1900;

		bytes += 3;
		length -= 3;
		if (piece > length)
			piece = length;
		memcpy(reply, bytes, piece);
		if (true_number && piece >= 4)
			memcpy(reply + piece - 4, request + got - 8, 4);
		sendto(server, reply, piece, 0, (struct sockaddr *)&client, size);
		bytes += piece;
		length -= piece;
	}
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
	uint32_t words[WORDS + 2], out = 7;
	const hm2_transfer list[2] = {{0x1000, 1, HM2_TRANSFER_WRITE, &out}, {0x2000, WORDS, HM2_TRANSFER_READ, words + 1}};
	hm2_error error;

	if (server < 0)
		connect_both();
	memset(words, 0xA5, sizeof words);
	if (bus.begin(bus.self, list, 2, &error) != HM2_OK)
		abort();
	answer(bytes, length);
	if (bus.finish(bus.self, bus.now_ns(bus.self), &error) != HM2_OK && words[1] != GUARD)
		abort(); /* half an answer */
	if (words[0] != GUARD || words[WORDS + 1] != GUARD || out != 7)
		abort();
	return 0;
}
