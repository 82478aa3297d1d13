/* Whatever asks for memory says so when it gets none, and leaves nothing behind: every request of everything that is
 * made is refused once, each in turn. */
/* link: -Wl,--wrap=malloc -Wl,--wrap=calloc -Wl,--wrap=aligned_alloc -Wl,--wrap=free */
#include <stdlib.h>
#include <string.h>
#include <unistd.h>

#include "check.h"
#include "hm2.h"
#include "opened.h"
#include "refused_memory.h"

/* Makes one thing, frees it and everything around it, and returns what making it said. */
typedef int maker(hm2_error *error);

static int64_t bus_now(void *self)
{
	(void)self;
	return 0;
}

static void bus_close(void *self)
{
	(void)self;
}

static const hm2_bus BUS = {.now_ns = bus_now, .close = bus_close};

static int make_board(hm2_error *error)
{
	struct hm2_board *board = NULL;
	const int status = hm2_board_open(&BUS, &board, error);
	hm2_board_free(board);
	return status;
}

static int make_cycle(hm2_error *error)
{
	struct hm2_cycle *cycle = NULL;
	const int status = hm2_cycle_new(NULL, &cycle, error);
	hm2_cycle_free(cycle);
	return status;
}

static int make_record_ring(hm2_error *error)
{
	struct hm2_record_ring *ring = NULL;
	const int status = hm2_record_ring_new(8, 64, &ring, error);
	hm2_record_ring_free(ring);
	return status;
}

static int make_engine(hm2_error *error)
{
	struct hm2_engine *engine = NULL;
	hm2_engine_config config;
	uint32_t word = 0;
	const hm2_signal signal = {&word, HM2_SIGNAL_U32, -1, 0};
	hm2_engine_defaults(&config);
	config.virtual_time = 1;
	const int status = hm2_engine_new(NULL, NULL, &config, &signal, 1, &signal, 1, &engine, error);
	hm2_engine_free(engine);
	return status;
}

static int make_image(hm2_error *error)
{
	const uint32_t address = 0x100, word = 1;
	hm2_bus bus;
	const int status = hm2_image_bus(&address, &word, 1, &bus, error);
	if (status == HM2_OK)
		bus.close(bus.self);
	return status;
}

static int make_memory_map(hm2_error *error)
{
	char path[] = "/tmp/hm2-refused-XXXXXX";
	const int file = mkstemp(path);
	CHECK(file >= 0 && ftruncate(file, HM2_ADDRESS_SPACE) == 0);
	const int status = open_map(path, error);
	close(file);
	unlink(path);
	return status;
}

static int make_process_data(hm2_error *error)
{
	struct hm2_process_data *data = NULL;
	uint32_t words[3] = {0, 0, 0};
	double value = 0;
	uint64_t raw = 0;
	const hm2_image image = {words, 3, 1, 3, 3, 1};
	const hm2_field field = {.kind = HM2_FIELD_UNSIGNED, .partner = -1, .bits = 8, .scale = 1, .high = 1};
	const int status = hm2_process_data_new(&field, 1, &image, &image, &value, &raw, &data, error);
	hm2_process_data_free(data);
	return status;
}

static int make_sserial(hm2_error *error)
{
	const hm2_sserial_config config = {0x5A00, 0x100, 0x40, 0, 8, 3};
	struct hm2_sserial *port = NULL;
	const int status = hm2_sserial_open(NULL, &config, &port, error);
	hm2_sserial_free(port);
	return status;
}

/* ---- the emulated card, with every module that it knows ---- */

static void describe(uint32_t idrom[256])
{
	static const uint32_t header[16] = {3,  64, 768,      0x4153454D,  0x54534554, 9,  144, 3,
	                                    72, 24, 33333333, 200000000, 4,          64, 256, 256};
	static const uint8_t tags[] = {0x01, 0x02, 0x03, 0x04, 0x05, 0x06, 0x08, 0x09, 0x0A, 0x0C, 0x0D, 0x0E, 0x13, 0x1A,
	                               0x1B, 0x1C, 0x1E, 0x23, 0x2C, 0x2D, 0xC0, 0xC1, 0xC3, 0xC7, 0xC8};
	memset(idrom, 0, 256 * sizeof *idrom);
	memcpy(idrom, header, sizeof header);
	for (uint32_t i = 0; i < sizeof tags; i++) {
		const uint32_t instances = tags[i] == 0x03 ? 3 : 2, registers = tags[i] == 0xC1 ? 6 : 2;
		idrom[16 + 3 * i] = instances << 24 | 1u << 16 | tags[i];
		idrom[17 + 3 * i] = registers << 16 | (0x1000 + 0x800 * i);
	}
	for (uint32_t i = 0; i < 72; i++)
		idrom[192 + i % 64] = 0x03000000u;
}

static hm2_emulator *new_card(hm2_error *error, int *status)
{
	static uint32_t idrom[256];
	const hm2_emulator_options options = {.clock = HM2_CLOCK_VIRTUAL, .interrupt = 1};
	hm2_emulator *card = NULL;
	describe(idrom);
	idrom[8] = 24; /* one port: its pins fit */
	idrom[7] = 1;
	*status = hm2_emulator_new(idrom, 256, &options, &card, error);
	CHECK((card != NULL) == (*status == HM2_OK));
	return card;
}

static int make_emulated_card(hm2_error *error)
{
	int status;
	hm2_emulator_free(new_card(error, &status));
	return status;
}

static int make_motor(hm2_error *error)
{
	static hm2_dc_motor motor;
	int status;
	hm2_emulator *card = new_card(error, &status);
	if (card)
		status = hm2_emulator_add_dc_motor(card, &motor, error);
	hm2_emulator_free(card);
	return status;
}

static int make_remote(hm2_error *error)
{
	hm2_remote *remote = hm2_remote_new();
	int status = remote ? hm2_remote_add_flash(remote, 0x10000, 12, 8) : HM2_ERR_NO_MEMORY;
	error->status = status;
	hm2_remote_free(remote);
	return status;
}

static hm2_ethernet_config ethernet_config(void)
{
	return (hm2_ethernet_config){.name = "7I92", .flash_id = 0x13, .lbp_version = 3};
}

static int make_ethernet(hm2_error *error)
{
	const hm2_ethernet_config config = ethernet_config();
	struct hm2_ethernet *ethernet = hm2_ethernet_new(&config, NULL);
	error->status = ethernet ? HM2_OK : HM2_ERR_NO_MEMORY;
	hm2_ethernet_free(ethernet);
	return error->status;
}

static int make_ethernet_server(hm2_error *error)
{
	struct hm2_ethernet_server *server = NULL;
	const int status = hm2_ethernet_server_open(NULL, "127.0.0.1", 0, &server, error);
	hm2_ethernet_server_free(server);
	return status;
}

static int make_fault_bus(hm2_error *error)
{
	const hm2_mailbox mailbox = {0, 0, 0, 0};
	hm2_bus bus;
	struct hm2_fault_bus *faulty = hm2_fault_bus_new(&BUS, &mailbox, &bus);
	error->status = faulty ? HM2_OK : HM2_ERR_NO_MEMORY;
	hm2_fault_bus_free(faulty);
	return error->status;
}

static int make_fault_link(hm2_error *error)
{
	hm2_carrier carrier;
	struct hm2_fault_link *link = hm2_fault_link_new(NULL, &BUS, 0, &carrier);
	error->status = link ? HM2_OK : HM2_ERR_NO_MEMORY;
	hm2_fault_link_free(link);
	return error->status;
}

/* `requests`: at least so many, or a request has been lost sight of. */
static void refuse_each(const char *name, maker *make, long requests)
{
	for (long number = 1;; number++) {
		hm2_error error = {.status = 1};
		const long out = memory_out;
		memory_refuse(number);
		const int status = make(&error);
		const int refused = memory_asked >= number;
		memory_refuse(0);
		if (memory_out != out || status != (refused ? HM2_ERR_NO_MEMORY : HM2_OK))
			fprintf(stderr, "%s: request %ld of memory: status %d\n", name, number, status);
		CHECK_EQUAL(memory_out, out);
		CHECK_EQUAL(status, refused ? HM2_ERR_NO_MEMORY : HM2_OK);
		if (!refused) {
			CHECK(number > requests);
			return;
		}
		CHECK_EQUAL(error.status, HM2_ERR_NO_MEMORY);
	}
}

int main(void)
{
	refuse_each("board", make_board, 1);
	refuse_each("cycle", make_cycle, 1);
	refuse_each("record ring", make_record_ring, 2);
	refuse_each("engine", make_engine, 12);
	refuse_each("image", make_image, 1);
	refuse_each("memory map", make_memory_map, 1);
	refuse_each("process data", make_process_data, 7);
	refuse_each("sserial", make_sserial, 1);
	refuse_each("udp", open_udp, 2);
	refuse_each("udp floor", open_udp_floor, 1);
	refuse_each("emulated card", make_emulated_card, 26);
	refuse_each("motor", make_motor, 27);
	refuse_each("remote", make_remote, 2);
	refuse_each("ethernet", make_ethernet, 3);
	refuse_each("ethernet server", make_ethernet_server, 1);
	refuse_each("fault bus", make_fault_bus, 1);
	refuse_each("fault link", make_fault_link, 1);
	return CHECK_RESULT();
}
