/* Any host and any remotes at the emulated firmware: registers written and read at any time, remotes that answer
 * wrongly, late or not at all. Nothing is read outside its memory, every span of time ends, and a reset answers as
 * always. Input: the kind of card, then operations of four bytes each. */
#include <stdlib.h>

#include "emulator/sslbp.h"
#include "hm2.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length);

#define MICROSECOND 1000000ll
#define OPERATIONS 300 /* a busy millisecond is much work */
#define REMOTES 8

static void require(int condition)
{
	if (!condition)
		abort();
}

struct bench {
	struct hm2_sslbp *sslbp;
	hm2_remote *remotes[REMOTES];
	int channels;
	int64_t now;
};

static void make(struct bench *bench, uint8_t kind)
{
	bench->channels = 1 + (kind & 7);
	bench->now = 0;
	bench->sslbp = hm2_sslbp_new(bench->channels, kind & 8 ? 7 : 3, kind & 16 ? 50000000 : 100000000);
	require(bench->sslbp != NULL);
	hm2_sslbp_set_wire(bench->sslbp, !(kind & 32));
	for (int c = 0; c < bench->channels; c++) {
		bench->remotes[c] = hm2_remote_new();
		require(bench->remotes[c] != NULL);
		hm2_remote_set(bench->remotes[c], HM2_REMOTE_MODEL, (kind >> 6) % 3);
		hm2_sslbp_attach(bench->sslbp, c, bench->remotes[c]);
	}
}

static void pass(struct bench *bench, int64_t us)
{
	bench->now += us * MICROSECOND;
	hm2_sslbp_advance(bench->sslbp, bench->now);
}

static void operate(struct bench *bench, const uint8_t *op)
{
	const int channel = op[0] >> 5;
	const uint32_t value = (uint32_t)(op[2] | op[3] << 8);
	hm2_remote *remote = bench->remotes[channel % bench->channels];

	switch (op[0] & 7) {
	case 0: pass(bench, value % 4000); break;
	case 1: hm2_sslbp_write(bench->sslbp, 0, 0, value); break;
	case 2: hm2_sslbp_write(bench->sslbp, op[1] % 12, channel, value << 16 | value); break;
	case 3: hm2_sslbp_write(bench->sslbp, 2, channel, (uint32_t)op[1] << 24 | value); break;
	case 4: hm2_sslbp_read(bench->sslbp, op[1] % 12, channel); break;
	case 5: hm2_remote_set(remote, op[1] % (HM2_REMOTE_PROGRAM_PS + 1), value); break;
	case 6: hm2_sslbp_connect(bench->sslbp, channel % bench->channels, op[1] & 1, op[1] & 2); break;
	default: hm2_sslbp_attach(bench->sslbp, channel % bench->channels, op[1] & 1 ? remote : NULL); break;
	}
	pass(bench, op[1] >> 4);
}

static void ends_well(struct bench *bench)
{
	hm2_line_record records[16];

	for (int c = 0; c < bench->channels; c++)
		hm2_sslbp_attach(bench->sslbp, c, NULL);
	hm2_sslbp_line_records(bench->sslbp, records, 16);
	hm2_sslbp_write(bench->sslbp, 0, 0, 0x4000);
	pass(bench, 5);
	hm2_sslbp_write(bench->sslbp, 0, 0, 0x0001);
	pass(bench, 2000);
	require(hm2_sslbp_read(bench->sslbp, 0, 0) == 0);
	require(hm2_sslbp_read(bench->sslbp, 1, 0) == 0xAA);
}

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
	struct bench bench;

	if (length == 0)
		return 0;
	make(&bench, bytes[0]);
	for (size_t i = 1; i + 4 <= length && i < 1 + 4 * OPERATIONS; i += 4)
		operate(&bench, bytes + i);
	ends_well(&bench);
	hm2_sslbp_free(bench.sslbp);
	for (int c = 0; c < bench.channels; c++)
		hm2_remote_free(bench.remotes[c]);
	return 0;
}
