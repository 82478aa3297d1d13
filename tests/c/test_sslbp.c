/* The firmware model under random hosts and broken remotes: no read outside its memory, no endless
 * loop, and after the way out of everything (reset or power-up) it starts and runs as new. */
#include "check.h"
#include "emulator/sslbp.h"

#include <stdlib.h>

#define RUNS 60
#define ACCESSES 400
#define MICROSECOND 1000000ll

static uint32_t seed = 1;

static uint32_t any(uint32_t below)
{
	seed = seed * 1664525u + 1013904223u;
	return (uint32_t)((uint64_t)(seed >> 4) * below >> 28);
}

struct bench {
	struct hm2_sslbp *sslbp;
	hm2_remote *remotes[8];
	int channels;
	int64_t now;
};

static struct bench make(int channels, int registers, uint32_t clock_hz, int wire)
{
	struct bench bench = {.channels = channels};
	bench.sslbp = hm2_sslbp_new(channels, registers, clock_hz);
	for (int c = 0; c < channels; c++) {
		bench.remotes[c] = hm2_remote_new();
		hm2_remote_set(bench.remotes[c], HM2_REMOTE_RECEIVE_SIZE, 1 + any(20));
		hm2_remote_set(bench.remotes[c], HM2_REMOTE_TRANSMIT_SIZE, any(20));
		hm2_remote_set(bench.remotes[c], HM2_REMOTE_MODEL, any(3));
		hm2_sslbp_attach(bench.sslbp, c, any(8) ? bench.remotes[c] : NULL);
	}
	hm2_sslbp_set_wire(bench.sslbp, wire);
	return bench;
}

static void discard(struct bench *bench)
{
	hm2_sslbp_free(bench->sslbp);
	for (int c = 0; c < bench->channels; c++)
		hm2_remote_free(bench->remotes[c]);
}

static void pass(struct bench *bench, int64_t us)
{
	bench->now += us * MICROSECOND;
	hm2_sslbp_advance(bench->sslbp, bench->now);
}

static void disturb(struct bench *bench)
{
	static const int knobs[] = {HM2_REMOTE_INJECT_BAD_CRC, HM2_REMOTE_INJECT_TRUNCATE, HM2_REMOTE_INJECT_EXTRA,
	                            HM2_REMOTE_INJECT_BREAK,   HM2_REMOTE_INJECT_SKIP,     HM2_REMOTE_FAULT,
	                            HM2_REMOTE_ALIVE,          HM2_REMOTE_CRC,             HM2_REMOTE_COOKIE};
	hm2_remote *remote = bench->remotes[any((uint32_t)bench->channels)];
	hm2_remote_set(remote, knobs[any(sizeof knobs / sizeof knobs[0])], any(3));
	if (any(2))
		hm2_remote_set(remote, HM2_REMOTE_TURNAROUND_PS, any(200) * MICROSECOND);
}

static uint32_t any_command(void)
{
	static const uint32_t commands[] = {0x0800, 0x0900, 0x0F00, 0x1000, 0x1000, 0x1000, 0x2000, 0xA000, 0x4000, 0x0000};
	uint32_t command = commands[any(sizeof commands / sizeof commands[0])];
	uint32_t reach = command == 0x2000 || command == 0xA000 ? 0x1000 : command ? 0x100 : 0x10000;
	return command | any(reach);
}

static void host(struct bench *bench)
{
	int channel = (int)any(9) - 0;
	switch (any(8)) {
	case 0:
		disturb(bench);
		break;
	case 1:
		hm2_sslbp_write(bench->sslbp, 1, 0, any(0x10000));
		break;
	case 2:
		hm2_sslbp_write(bench->sslbp, 2 + (int)any(8), channel, any(0x10000) << 16 | any(0x10000));
		break;
	case 3:
		hm2_sslbp_connect(bench->sslbp, (int)any((uint32_t)bench->channels), any(4) != 0, any(4) != 0);
		break;
	case 4:
		hm2_sslbp_read(bench->sslbp, (int)any(12), channel);
		for (int c = 0; c < bench->channels; c++)
			CHECK((unsigned)hm2_sslbp_transmit_level(bench->sslbp, c, bench->now) <= 1);
		break;
	default:
		if (any(4) || hm2_sslbp_read(bench->sslbp, 0, 0) == 0)
			hm2_sslbp_write(bench->sslbp, 0, 0, any_command());
		break;
	}
	pass(bench, any(3) ? any(100) : any(30000));
}

static void ends_well(struct bench *bench, int channels)
{
	for (int c = 0; c < channels; c++) {
		hm2_remote_reset(bench->remotes[c]);
		hm2_remote_set(bench->remotes[c], HM2_REMOTE_ALIVE, 0);
		hm2_remote_set(bench->remotes[c], HM2_REMOTE_ALIVE, 1);
		hm2_sslbp_attach(bench->sslbp, c, NULL);
		hm2_sslbp_connect(bench->sslbp, c, 1, 1);
	}
	hm2_remote *fresh = hm2_remote_new();
	hm2_remote_set(fresh, HM2_REMOTE_RECEIVE_SIZE, 5);
	hm2_remote_set(fresh, HM2_REMOTE_TRANSMIT_SIZE, 2);
	hm2_sslbp_attach(bench->sslbp, 0, fresh);
	if (any(2)) {
		hm2_sslbp_write(bench->sslbp, 0, 0, 0x4000);
		pass(bench, 5);
		hm2_sslbp_write(bench->sslbp, 0, 0, 0x0001);
	} else {
		hm2_sslbp_power_up(bench->sslbp);
	}
	pass(bench, 1000);
	CHECK_EQUAL(hm2_sslbp_read(bench->sslbp, 0, 0), 0);
	CHECK_EQUAL(hm2_sslbp_read(bench->sslbp, 1, 0), 0xAA);
	CHECK_EQUAL(hm2_sslbp_read(bench->sslbp, 2, 0), 0xC100);
	hm2_sslbp_write(bench->sslbp, 0, 0, 0x0901);
	pass(bench, 5000);
	CHECK_EQUAL(hm2_sslbp_read(bench->sslbp, 0, 0), 0);
	CHECK_EQUAL(hm2_sslbp_read(bench->sslbp, 1, 0), 0);
	for (int i = 0; i < 3; i++) {
		hm2_sslbp_write(bench->sslbp, 0, 0, 0x1001);
		pass(bench, 1000);
		CHECK_EQUAL(hm2_sslbp_read(bench->sslbp, 0, 0), 0);
		CHECK_EQUAL(hm2_sslbp_read(bench->sslbp, 1, 0), 0);
		CHECK_EQUAL(hm2_sslbp_read(bench->sslbp, 2, 0), 0x00420000);
	}
	hm2_sslbp_attach(bench->sslbp, 0, NULL);
	hm2_remote_free(fresh);
}

int main(void)
{
	static const uint32_t clocks[] = {100000000, 50000000, 72000000};
	CHECK(hm2_sslbp_new(0, 3, clocks[0]) == NULL);
	CHECK(hm2_sslbp_new(9, 3, clocks[0]) == NULL);
	CHECK(hm2_sslbp_new(4, 8, clocks[0]) == NULL);
	CHECK(hm2_sslbp_new(4, 3, 0) == NULL);
	for (int run = 0; run < RUNS; run++) {
		struct bench bench =
			make(1 + (int)any(8), any(4) ? 3 : 7, clocks[any(3)], any(3) != 0);
		for (int i = 0; i < ACCESSES; i++)
			host(&bench);
		ends_well(&bench, bench.channels);
		discard(&bench);
	}
	return CHECK_RESULT();
}
