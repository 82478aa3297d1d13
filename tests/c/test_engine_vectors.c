/* The engine's numbers: places of every type, limits of what can be added, PID settings, records and the trace. */
#include <float.h>
#include <math.h>
#include <string.h>

#include "check.h"
#include "engine_words.h"
#include "hm2.h"
#include "mailbox.h"

enum { PERIOD_NS = 1000000 };

static struct mailbox mailbox;
static struct hm2_cycle *cycle;
static struct hm2_engine *engine;
static hm2_error error;

static int open_engine(const hm2_signal *inputs, size_t input_count, const hm2_signal *outputs, size_t output_count)
{
	hm2_engine_config config;
	hm2_engine_defaults(&config);
	config.virtual_time = 1;
	config.dead_man_ns = 0;
	mailbox_open(&mailbox);
	CHECK_EQUAL(hm2_cycle_new(mailbox.board, &cycle, NULL), HM2_OK);
	return hm2_engine_new(mailbox.board, cycle, &config, inputs, input_count, outputs, output_count, &engine, &error);
}

static void add_words(hm2_cyclic_words *words)
{
	hm2_cyclic part;
	hm2_cyclic_words_part(words, &part);
	CHECK_EQUAL(hm2_cycle_add(cycle, &part, NULL), HM2_OK);
}

static void close_engine(void)
{
	hm2_engine_free(engine);
	hm2_cycle_free(cycle);
	mailbox_free(&mailbox);
	engine = NULL;
}

static hm2_engine_status step(int cycles)
{
	return engine_steps(engine, cycles);
}

static void test_a_place_holds_what_its_type_can_hold(void)
{
	const struct {
		int32_t type;
		double value, stored;
	} cases[] = {
		{HM2_SIGNAL_F64, 1.5, 1.5},
		{HM2_SIGNAL_I32, -2.6, -3},
		{HM2_SIGNAL_I32, 1e300, INT32_MAX},
		{HM2_SIGNAL_I32, -1e300, INT32_MIN},
		{HM2_SIGNAL_U32, 2.4, 2},
		{HM2_SIGNAL_U32, -1, 0},
		{HM2_SIGNAL_U32, 1e300, UINT32_MAX},
		{HM2_SIGNAL_I64, -1e300, -0x1p63},
		{HM2_SIGNAL_I64, 1e300, 0x1p63 - 1024},
		{HM2_SIGNAL_I64, -3, -3},
		{HM2_SIGNAL_U64, -5, 0},
		{HM2_SIGNAL_U64, 1e300, 0x1p64 - 2048},
		{HM2_SIGNAL_U64, 5, 5},
	};
	for (size_t i = 0; i < sizeof cases / sizeof cases[0]; i++) {
		uint64_t place[2] = {0, 0x5555555555555555};
		double read = 0;
		const hm2_signal signal = {place, cases[i].type, -1, 0};
		hm2_signals_store(&signal, 1, &cases[i].value);
		hm2_signals_load(&signal, 1, &read);
		CHECK(read == cases[i].stored);
		CHECK(place[1] == 0x5555555555555555);
	}
}

static void test_a_bit_leaves_its_neighbours_alone(void)
{
	uint64_t wide = 0xF0;
	uint32_t word = 0xF0, behind[2] = {0, 7};
	const hm2_signal signals[] = {{&wide, HM2_SIGNAL_U64, 40, 0}, {&word, HM2_SIGNAL_U32, 4, 0},
	                              {behind, HM2_SIGNAL_I32, 31, 0}, {NULL, HM2_SIGNAL_F64, -1, 0}};
	const double values[4] = {-0.1, 0.0, 1.0, 3.0};
	double read[4] = {9, 9, 9, 9};
	hm2_signals_store(signals, 4, values);
	CHECK(wide == (1ull << 40 | 0xF0));
	CHECK_EQUAL(word, 0xE0);
	CHECK_EQUAL(behind[0], 0x80000000u);
	CHECK_EQUAL(behind[1], 7);
	hm2_signals_load(signals, 4, read);
	CHECK(read[0] == 1.0 && read[1] == 0.0 && read[2] == 1.0);
	CHECK(read[3] == 9.0); /* without a place: left out */
}

static void check_range(int status, uint32_t expected, uint32_t received)
{
	CHECK_EQUAL(status, HM2_ERR_RANGE);
	CHECK_EQUAL(error.expected, expected);
	CHECK_EQUAL(error.received, received);
}

static void test_what_is_too_much_is_refused(void)
{
	static hm2_signal signals[HM2_ENGINE_SIGNALS + 1];
	hm2_engine_config config;
	check_range(open_engine(signals, HM2_ENGINE_SIGNALS + 1, NULL, 0), HM2_ENGINE_SIGNALS, HM2_ENGINE_SIGNALS + 1);
	close_engine();
	check_range(open_engine(NULL, 0, signals, HM2_ENGINE_SIGNALS + 1), HM2_ENGINE_SIGNALS, HM2_ENGINE_SIGNALS + 1);
	hm2_engine_defaults(&config);
	config.period_ns = 9999;
	check_range(hm2_engine_new(mailbox.board, cycle, &config, NULL, 0, NULL, 0, &engine, &error), 10000, 9999);
	CHECK_EQUAL(hm2_engine_new(mailbox.board, cycle, &config, NULL, 0, NULL, 0, &engine, NULL), HM2_ERR_RANGE);
	close_engine();
	CHECK_EQUAL(open_engine(NULL, 0, NULL, 0), HM2_OK);
	for (int i = 0; i < HM2_ENGINE_PORTS; i++)
		CHECK_EQUAL(hm2_engine_add_port(engine, mailbox.port, &error), HM2_OK);
	check_range(hm2_engine_add_port(engine, mailbox.port, &error), HM2_ENGINE_PORTS, HM2_ENGINE_PORTS + 1);
	close_engine();
}

static int calls, was_enabled;

static void count_call(void *context, const double *inputs, double *outputs, double seconds, int32_t enabled)
{
	(void)inputs;
	calls++;
	was_enabled = enabled;
	CHECK(seconds > 0.0);
	outputs[0] = *(const double *)context;
}

static void test_controllers_are_taken_until_there_is_no_room(void)
{
	double value = 5.0;
	CHECK_EQUAL(open_engine(NULL, 0, NULL, 0), HM2_OK);
	CHECK_EQUAL(hm2_engine_add_control(engine, NULL, NULL, &error), HM2_ERR_RANGE);
	for (int i = 0; i < HM2_ENGINE_CONTROLS; i++)
		CHECK_EQUAL(hm2_engine_add_control(engine, count_call, &value, &error), HM2_OK);
	check_range(hm2_engine_add_control(engine, count_call, &value, &error), HM2_ENGINE_CONTROLS, HM2_ENGINE_CONTROLS);
	CHECK_EQUAL(hm2_engine_add_control(engine, count_call, &value, NULL), HM2_ERR_RANGE);
	close_engine();
}

/* What a controller leaves that is no number never reaches an output: what holds keeps what was last sent. */
static void test_no_number_of_a_controller_goes_out(void)
{
	uint32_t zeroed = 3, held = 4;
	double value = NAN;
	const hm2_signal outputs[] = {{&zeroed, HM2_SIGNAL_U32, -1, 0}, {&held, HM2_SIGNAL_U32, -1, 1}};
	const double commands[] = {6, 7};
	hm2_engine_event event = {0};
	CHECK_EQUAL(open_engine(NULL, 0, outputs, 2), HM2_OK);
	CHECK_EQUAL(hm2_engine_add_control(engine, count_call, &value, &error), HM2_OK);
	CHECK_EQUAL(hm2_engine_start(engine, NULL, NULL), HM2_OK);
	CHECK_EQUAL(step(1).off, HM2_OFF_IDLE);
	CHECK_EQUAL(was_enabled, 0);
	CHECK_EQUAL(zeroed, 0);
	CHECK_EQUAL(held, 4);
	value = 5.0;
	hm2_engine_write(engine, commands);
	CHECK_EQUAL(step(1).off, 0);
	CHECK_EQUAL(was_enabled, 1);
	CHECK_EQUAL(zeroed, 5);
	CHECK_EQUAL(held, 7);
	value = NAN;
	CHECK_EQUAL(step(1).off, HM2_OFF_CONTROL);
	CHECK_EQUAL(zeroed, 0);
	CHECK_EQUAL(held, 7);
	while (hm2_engine_take_events(engine, &event, 1) && event.kind != HM2_EVENT_CONTROL)
		;
	CHECK_EQUAL(event.kind, HM2_EVENT_CONTROL);
	CHECK_EQUAL(event.index, 0);
	close_engine();
}

static void test_an_axis_needs_numbers_that_exist(void)
{
	double values[4] = {0, 0, 0, 0};
	const hm2_signal inputs[] = {{&values[0], HM2_SIGNAL_F64, -1, 0}, {&values[1], HM2_SIGNAL_F64, -1, 0}};
	const hm2_signal outputs[] = {{NULL, HM2_SIGNAL_F64, -1, 0}, {&values[3], HM2_SIGNAL_F64, -1, 0}};
	const hm2_pid pid = {.p = 2.0}, new_pid = {.p = 3.0, .integral = 99.0};
	static const int32_t wrong[][5] = {{2, -1, 0, -1, 1},  {-1, -1, 0, -1, 1}, {0, 2, 0, -1, 1},  {0, -2, 0, -1, 1},
	                                   {0, -1, 2, -1, 1},  {0, -1, -1, -1, 1}, {0, -1, 0, 2, 1},  {0, -1, 0, -2, 1},
	                                   {0, -1, 0, -1, 2},  {0, -1, 0, -1, -1}};
	CHECK_EQUAL(open_engine(inputs, 2, outputs, 2), HM2_OK);
	for (size_t i = 0; i < sizeof wrong / sizeof wrong[0]; i++)
		CHECK_EQUAL(hm2_engine_add_pid(engine, &pid, wrong[i][0], wrong[i][1], wrong[i][2], wrong[i][3], wrong[i][4],
		                               &error),
		            HM2_ERR_RANGE);
	CHECK(hm2_engine_pid(engine, 0) == NULL);
	check_range(hm2_engine_set_pid(engine, 0, &pid, &error), 0, 0);
	for (int i = 0; i < HM2_ENGINE_AXES; i++)
		CHECK_EQUAL(hm2_engine_add_pid(engine, &pid, 0, i ? -1 : 0, 0, i ? -1 : 1, 1, &error), HM2_OK);
	check_range(hm2_engine_add_pid(engine, &pid, 0, -1, 0, -1, 1, &error), HM2_ENGINE_AXES, HM2_ENGINE_AXES);
	CHECK_EQUAL(hm2_engine_set_pid(engine, 1, &new_pid, &error), HM2_OK);
	CHECK_EQUAL(hm2_engine_set_pid(engine, 0, &new_pid, &error), HM2_OK); /* nobody uses them */
	CHECK(hm2_engine_pid(engine, 0)->p == 3.0 && hm2_engine_pid(engine, 1)->p == 3.0);
	CHECK_EQUAL(hm2_engine_start(engine, NULL, NULL), HM2_OK);
	CHECK_EQUAL(hm2_engine_set_pid(engine, HM2_ENGINE_AXES - 1, &new_pid, &error), HM2_OK);
	CHECK(hm2_engine_pid(engine, HM2_ENGINE_AXES - 1)->p == 2.0);
	CHECK_EQUAL(hm2_engine_set_pid(engine, 0, &new_pid, &error), HM2_OK); /* there is no thread to wait for */
	(void)step(1);
	CHECK(hm2_engine_pid(engine, HM2_ENGINE_AXES - 1)->p == 3.0);
	CHECK(hm2_engine_pid(engine, HM2_ENGINE_AXES - 1)->integral == 0.0); /* settings only */
	CHECK_EQUAL(hm2_engine_set_pid(engine, 0, &new_pid, &error), HM2_OK);
	close_engine();
}

/* An engine that was abandoned has no cycle that could take them. */
static void test_settings_that_no_cycle_took_are_not_put_over_later_ones(void)
{
	double values[3] = {0, 0, 0};
	const hm2_signal input = {&values[0], HM2_SIGNAL_F64, -1, 0};
	const hm2_signal outputs[] = {{&values[1], HM2_SIGNAL_F64, -1, 0}, {&values[2], HM2_SIGNAL_F64, -1, 0}};
	const hm2_pid pid = {.p = 2.0}, older = {.p = 3.0}, newer = {.p = 4.0};
	CHECK_EQUAL(open_engine(&input, 1, outputs, 2), HM2_OK);
	CHECK_EQUAL(hm2_engine_add_pid(engine, &pid, 0, -1, 0, -1, 1, &error), HM2_OK);
	CHECK_EQUAL(hm2_engine_start(engine, NULL, NULL), HM2_OK);
	CHECK_EQUAL(hm2_engine_set_pid(engine, 0, &older, &error), HM2_OK);
	hm2_engine_abandon(engine);
	CHECK_EQUAL(hm2_engine_set_pid(engine, 0, &newer, &error), HM2_OK);
	CHECK_EQUAL(hm2_engine_start(engine, NULL, NULL), HM2_OK);
	(void)step(1);
	CHECK(hm2_engine_pid(engine, 0)->p == 4.0);
	close_engine();
}

/* ---- records ---- */

enum { IMAGE_WORDS = 3 };

static void test_a_record_holds_as_many_words_as_there_is_room_for(void)
{
	uint32_t burst[2] = {0, 0}, fifo[2] = {0, 0}, out = 9, addresses[8] = {0}, capacity = 0;
	uint8_t record[512];
	struct hm2_record_ring *ring = NULL;
	hm2_record head;
	hm2_cyclic_words words[] = {{{0x1000, 2, HM2_TRANSFER_READ, burst}, 1},
	                            {{0x2000, 2, HM2_TRANSFER_READ | HM2_TRANSFER_SAME_ADDRESS, fifo}, 1},
	                            {{0x1000, 1, HM2_TRANSFER_WRITE, &out}, 1}};
	CHECK_EQUAL(open_engine(NULL, 0, NULL, 0), HM2_OK);
	for (int i = 0; i < 3; i++)
		add_words(&words[i]);
	capacity = hm2_engine_record_size(engine, IMAGE_WORDS);
	CHECK_EQUAL(capacity, sizeof head + 16);
	CHECK_EQUAL(hm2_record_ring_new(4, capacity, &ring, NULL), HM2_OK);
	hm2_engine_set_record_ring(engine, ring, IMAGE_WORDS);
	CHECK_EQUAL(hm2_engine_start(engine, NULL, NULL), HM2_OK);
	mailbox.words[0x1000 / 4] = 11;
	mailbox.words[0x1004 / 4] = 12;
	mailbox.words[0x2000 / 4] = 13;
	mailbox.words[0x2004 / 4] = 14; /* of a FIFO the last word stays: this bus reads on */
	(void)step(1);
	CHECK_EQUAL(hm2_engine_layout(engine, addresses, 2), 3); /* the written word found no room */
	CHECK_EQUAL(hm2_engine_left_out(engine), 1);
	CHECK_EQUAL(addresses[0], 0x1000);
	CHECK_EQUAL(addresses[1], 0x1004);
	CHECK_EQUAL(addresses[2], 0);
	CHECK_EQUAL(hm2_engine_layout(engine, addresses, 8), 3);
	CHECK_EQUAL(addresses[2], 0x2000);
	CHECK_EQUAL(hm2_record_ring_pop_many(ring, record, 1), 1);
	memcpy(&head, record, sizeof head);
	CHECK_EQUAL(head.image_words, 3);
	CHECK_EQUAL(head.fresh[0], 7);
	const uint32_t *image = (const uint32_t *)(const void *)(record + sizeof head);
	CHECK_EQUAL(image[0], 11);
	CHECK_EQUAL(image[1], 12);
	CHECK_EQUAL(image[2], fifo[1]);
	words[1].enabled = 0; /* another list: what is not moved is not fresh, and keeps its last value */
	(void)step(6);
	hm2_record_ring_counters counters;
	hm2_record_ring_get_counters(ring, &counters);
	CHECK_EQUAL(counters.dropped, 2);
	CHECK_EQUAL(hm2_record_ring_pop_many(ring, record, 1), 1);
	memcpy(&head, record, sizeof head);
	CHECK_EQUAL(head.fresh[0], 3);
	CHECK_EQUAL(image[2], fifo[1]);
	close_engine();
	hm2_record_ring_free(ring);
}

enum { AGAIN = 85, APART = 3 };

static size_t read_over_and_over(void *self, hm2_transfer *transfers, size_t capacity)
{
	uint32_t(*words)[APART] = self;
	for (size_t i = 0; i < AGAIN && AGAIN <= capacity; i++)
		transfers[i] = (hm2_transfer){0x1000, APART, HM2_TRANSFER_READ, words[i]};
	return AGAIN;
}

/* 0x1000 and 0x1008 come first, so the word between them is no neighbour in the image: three moves for each reading. */
static void test_a_word_that_a_record_could_not_take_in_is_not_fresh(void)
{
	static uint32_t first, third, last, again[AGAIN][APART];
	static hm2_cyclic_words list[3];
	uint8_t record[512];
	hm2_record head;
	struct hm2_record_ring *ring = NULL;
	CHECK_EQUAL(open_engine(NULL, 0, NULL, 0), HM2_OK);
	const hm2_cyclic part = {again, read_over_and_over, NULL, NULL};
	list[0] = (hm2_cyclic_words){{0x1000, 1, HM2_TRANSFER_READ, &first}, 1};
	list[1] = (hm2_cyclic_words){{0x1008, 1, HM2_TRANSFER_READ, &third}, 1};
	list[2] = (hm2_cyclic_words){{0x2000, 1, HM2_TRANSFER_READ, &last}, 1};
	add_words(&list[0]);
	add_words(&list[1]);
	CHECK_EQUAL(hm2_cycle_add(cycle, &part, NULL), HM2_OK);
	add_words(&list[2]);
	CHECK_EQUAL(hm2_record_ring_new(4, hm2_engine_record_size(engine, 8), &ring, NULL), HM2_OK);
	hm2_engine_set_record_ring(engine, ring, 8);
	CHECK_EQUAL(hm2_engine_start(engine, NULL, NULL), HM2_OK);
	mailbox.words[0x1004 / 4] = 12;
	mailbox.words[0x2000 / 4] = 13;
	(void)step(1);
	CHECK_EQUAL(hm2_record_ring_pop_many(ring, record, 1), 1);
	memcpy(&head, record, sizeof head);
	const uint32_t *image = (const uint32_t *)(const void *)(record + sizeof head);
	CHECK_EQUAL(head.image_words, 4);
	CHECK_EQUAL(head.fresh[0], 7);
	CHECK_EQUAL(image[2], 12);
	CHECK_EQUAL(image[3], 0);
	close_engine();
	hm2_record_ring_free(ring);
}

/* The board looks at it, and it never gets to the bus. */
static void test_a_list_that_is_refused_is_not_recorded(void)
{
	static uint32_t word;
	static hm2_cyclic_words beyond = {{HM2_ADDRESS_SPACE * 4u, 1, HM2_TRANSFER_WRITE, &word}, 1};
	struct hm2_record_ring *ring = NULL;
	uint32_t address;
	CHECK_EQUAL(open_engine(NULL, 0, NULL, 0), HM2_OK);
	add_words(&beyond);
	CHECK_EQUAL(hm2_record_ring_new(4, hm2_engine_record_size(engine, 8), &ring, NULL), HM2_OK);
	hm2_engine_set_record_ring(engine, ring, 8);
	CHECK_EQUAL(hm2_engine_start(engine, NULL, NULL), HM2_OK);
	CHECK_EQUAL(step(2).status, HM2_ERR_RANGE);
	CHECK_EQUAL(hm2_engine_layout(engine, &address, 1), 0);
	close_engine();
	hm2_record_ring_free(ring);
}

static void test_rings_that_cannot_be(void)
{
	struct hm2_record_ring *ring = NULL;
	check_range(hm2_record_ring_new(1, 8, &ring, &error), 1u << 24, 1);
	check_range(hm2_record_ring_new(3, 8, &ring, &error), 1u << 24, 3);
	check_range(hm2_record_ring_new(1u << 25, 8, &ring, &error), 1u << 24, 1u << 25);
	check_range(hm2_record_ring_new(2, 0, &ring, &error), 8, 0);
	check_range(hm2_record_ring_new(2, 12, &ring, &error), 8, 12);
	CHECK_EQUAL(hm2_record_ring_new(2, 12, &ring, NULL), HM2_ERR_RANGE);
	CHECK(ring == NULL);
	hm2_record_ring_free(NULL);
}

/* ---- the trace ---- */

static void test_the_slowest_cycles_are_kept(void)
{
	static hm2_histogram histogram;
	hm2_record slowest[HM2_ENGINE_SLOWEST];
	uint32_t out = 0;
	hm2_cyclic_words words = {{0x1000, 1, HM2_TRANSFER_WRITE, &out}, 1};
	CHECK_EQUAL(open_engine(NULL, 0, NULL, 0), HM2_OK);
	add_words(&words);
	CHECK_EQUAL(hm2_engine_slowest(engine, slowest, HM2_ENGINE_SLOWEST), 0);
	CHECK_EQUAL(hm2_engine_start(engine, NULL, NULL), HM2_OK);
	for (int i = 1; i <= 40; i++) {
		mailbox.slow_ns = i <= 20 ? i * 1000 : (41 - i) * 10000;
		(void)step(1);
	}
	CHECK_EQUAL(hm2_engine_slowest(engine, slowest, HM2_ENGINE_SLOWEST), HM2_ENGINE_SLOWEST);
	for (int i = 0; i < HM2_ENGINE_SLOWEST; i++) /* 200 down to 50 us: cycles 20 to 35 */
		CHECK(slowest[i].cycle >= 20 && slowest[i].cycle < 36);
	CHECK_EQUAL(hm2_engine_slowest(engine, slowest, 3), 3);
	mailbox.slow_ns = 6000000000; /* more than a stamp holds */
	(void)step(1);
	hm2_engine_get_histogram(engine, HM2_STAGES, &histogram);
	CHECK_EQUAL(histogram.maximum_ns, UINT32_MAX);
	CHECK_EQUAL(histogram.count, 41);
	hm2_engine_get_histogram(engine, -1, &histogram); /* no such stages: left alone */
	hm2_engine_get_histogram(engine, HM2_STAGES + 2, &histogram);
	CHECK_EQUAL(histogram.count, 41);
	CHECK_EQUAL(histogram.maximum_ns, UINT32_MAX);
	hm2_engine_reset_trace(engine);
	CHECK_EQUAL(hm2_engine_slowest(engine, slowest, HM2_ENGINE_SLOWEST), 0);
	close_engine();
}

int main(void)
{
	test_a_place_holds_what_its_type_can_hold();
	test_a_bit_leaves_its_neighbours_alone();
	test_what_is_too_much_is_refused();
	test_controllers_are_taken_until_there_is_no_room();
	test_no_number_of_a_controller_goes_out();
	test_an_axis_needs_numbers_that_exist();
	test_settings_that_no_cycle_took_are_not_put_over_later_ones();
	test_a_record_holds_as_many_words_as_there_is_room_for();
	test_a_word_that_a_record_could_not_take_in_is_not_fresh();
	test_a_list_that_is_refused_is_not_recorded();
	test_rings_that_cannot_be();
	test_the_slowest_cycles_are_kept();
	return CHECK_RESULT();
}
