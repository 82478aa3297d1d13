/* Encoders, step generators and controllers where two readings lie at the same moment, where a latch's wishes change
 * under way, and where nothing is limited. */
#include <math.h>

#include "check.h"
#include "hm2.h"
#include "registers.h"

enum {
	ONCE = HM2_ENCODER_CONTROL_JUST_ONCE_MASK,
	INDEX = HM2_ENCODER_CONTROL_LATCH_ON_INDEX_MASK,
	PROBE = HM2_ENCODER_CONTROL_LATCH_ON_PROBE_MASK
};

static const hm2_timebase timebase = {.seconds_per_tick = 1e-6, .ticks = 1000, .valid = 1};

/* At count 100, and armed for this. */
static hm2_encoder armed(int32_t request)
{
	hm2_encoder encoder = {.scale = 1.0, .velocity_timeout = 1.0, .readable = 0xFFFF};
	hm2_encoder_update(&encoder, &timebase, 100, 0);
	encoder.request = request;
	hm2_encoder_update(&encoder, &timebase, 100, 0);
	CHECK_EQUAL(encoder.control_word, ONCE | (request == HM2_ENCODER_PROBE ? PROBE : INDEX));
	CHECK_EQUAL(encoder.write_control, 1);
	return encoder;
}

/* The event comes at 105, and is read with count 110. */
static void read_event(hm2_encoder *encoder)
{
	hm2_encoder_update(encoder, &timebase, 110, ONCE | 105u << HM2_ENCODER_CONTROL_LATCH_LSB);
}

static void test_only_an_index_that_is_to_be_the_zero_becomes_it(void)
{
	static const struct {
		int32_t request;
		double position;
	} cases[] = {{HM2_ENCODER_INDEX, 5.0}, {HM2_ENCODER_LATCH, 10.0}, {HM2_ENCODER_PROBE, 10.0}};
	for (int i = 0; i < 3; i++) {
		hm2_encoder encoder = armed(cases[i].request);
		read_event(&encoder);
		CHECK_EQUAL(encoder.events, 1);
		CHECK_EQUAL(encoder.latched, 105);
		CHECK_EQUAL(encoder.request, HM2_ENCODER_NONE);
		CHECK(encoder.position == cases[i].position);
		CHECK_EQUAL(encoder.control_word, 0);
	}
}

/* What the hardware has caught for the old wish is not taken for the new one, which is armed after a word without. */
static void test_a_wish_that_changes_under_way_is_armed_anew(void)
{
	hm2_encoder encoder = armed(HM2_ENCODER_PROBE);
	encoder.request = HM2_ENCODER_INDEX;
	read_event(&encoder);
	CHECK_EQUAL(encoder.events, 0);
	CHECK_EQUAL(encoder.control_word, 0);
	CHECK_EQUAL(encoder.write_control, 1);
	hm2_encoder_update(&encoder, &timebase, 110, 0);
	CHECK_EQUAL(encoder.control_word, ONCE | INDEX);
	read_event(&encoder);
	CHECK_EQUAL(encoder.events, 1);
	encoder = armed(HM2_ENCODER_INDEX);
	encoder.request = HM2_ENCODER_NONE;
	read_event(&encoder);
	CHECK_EQUAL(encoder.events, 0);
	CHECK_EQUAL(encoder.control_word, 0);
}

/* Two readings at one moment say nothing of the speed. */
static void test_no_time_between_two_readings_leaves_a_velocity(void)
{
	hm2_encoder encoder = {.scale = 1.0, .velocity_timeout = 1.0};
	hm2_timebase now = timebase;
	for (uint32_t count = 0; count < 3; count++, now.ticks += 1000)
		hm2_encoder_update(&encoder, &now, count | (uint32_t)now.ticks << HM2_ENCODER_COUNT_TIMESTAMP_LSB, 0);
	CHECK(fabs(encoder.velocity - 1000.0) < 1e-6);
	now.ticks -= 1000;
	hm2_encoder_update(&encoder, &now, 2u | (uint32_t)now.ticks << HM2_ENCODER_COUNT_TIMESTAMP_LSB, 0);
	CHECK(fabs(encoder.velocity - 1000.0) < 1e-6);
	CHECK(encoder.interpolated == 2.0);
}

/* A count that is read a little after TSCount has its stamp ahead: that is no wait for the next one. */
static void test_a_stamp_that_lies_ahead_leaves_a_velocity(void)
{
	hm2_encoder encoder = {.scale = 1.0, .velocity_timeout = 1.0};
	hm2_timebase now = timebase;
	static const uint32_t counts[] = {0, 1, 2, 12, 12}, stamps[] = {1000, 1000, 2000, 5000, 5000};
	for (int i = 0; i < 5; i++) {
		now.ticks = i < 3 ? 1000 * i : 3000;
		hm2_encoder_update(&encoder, &now, counts[i] | stamps[i] << HM2_ENCODER_COUNT_TIMESTAMP_LSB, 0);
	}
	CHECK(fabs(encoder.velocity - 10 / 3e-3) < 1e-6);
}

static hm2_stepgen stepgen(void)
{
	return (hm2_stepgen){.scale = 1.0, .clock_hz = 1e8, .max_velocity = INFINITY, .max_step_rate = 1e6, .enable = 1};
}

static void test_no_time_between_two_updates_leaves_a_rate(void)
{
	hm2_stepgen generator = stepgen();
	generator.velocity_command = 10.0;
	hm2_stepgen_update(&generator, 0, 0);
	hm2_stepgen_update(&generator, 0, 1000000);
	CHECK(generator.velocity == 10.0);
	generator.velocity_command = 20.0;
	hm2_stepgen_update(&generator, 0, 1000000);
	CHECK(generator.velocity == 10.0);
	hm2_stepgen_update(&generator, 0, 2000000);
	CHECK(generator.velocity == 20.0);
}

/* Half of the error within a period, however fast that is. */
static void test_a_position_is_followed_without_a_limit_of_acceleration(void)
{
	hm2_stepgen generator = stepgen();
	generator.position_control = 1;
	generator.position_command = 1.0;
	hm2_stepgen_update(&generator, 0, 0);
	hm2_stepgen_update(&generator, 0, 1000000);
	CHECK(fabs(generator.velocity - 500.0) < 1e-9);
	generator.max_acceleration = 1000.0; /* and one per second less with one */
	generator.velocity = 0.0;
	hm2_stepgen_update(&generator, 0, 2000000);
	CHECK(fabs(generator.velocity - 1.0) < 1e-9);
}

static void test_no_time_between_two_updates_is_no_slope(void)
{
	hm2_pid pid = {.p = 2.0, .d = 3.0, .ff2 = 5.0};
	CHECK(hm2_pid_update(&pid, 1.0, NAN, 0.0, NAN, 0.001) == 2.0);
	CHECK(hm2_pid_update(&pid, 2.0, NAN, 0.0, NAN, 0.0) == 4.0);
	CHECK(fabs(hm2_pid_update(&pid, 3.0, NAN, 0.0, NAN, 1.0) - (6.0 + 3.0 + 5.0)) < 1e-9);
}

int main(void)
{
	test_only_an_index_that_is_to_be_the_zero_becomes_it();
	test_a_wish_that_changes_under_way_is_armed_anew();
	test_no_time_between_two_readings_leaves_a_velocity();
	test_a_stamp_that_lies_ahead_leaves_a_velocity();
	test_no_time_between_two_updates_leaves_a_rate();
	test_a_position_is_followed_without_a_limit_of_acceleration();
	test_no_time_between_two_updates_is_no_slope();
	return CHECK_RESULT();
}
