/* An engine over one word that is read and one that is written: what its tests have alike. */
#ifndef HM2_TEST_ENGINE_WORDS_H
#define HM2_TEST_ENGINE_WORDS_H

#include "check.h"
#include "hm2.h"

enum { IN = 0x1000, OUT = 0x1004 };

struct engine_words {
	uint32_t in, out;
	hm2_cyclic_words part[2];
};

/* A cycle of both words; more may be added before the engine is made. */
static inline void engine_words_cycle(struct engine_words *words, struct hm2_board *board, struct hm2_cycle **cycle)
{
	words->part[0] = (hm2_cyclic_words){{IN, 1, HM2_TRANSFER_READ, &words->in}, 1};
	words->part[1] = (hm2_cyclic_words){{OUT, 1, HM2_TRANSFER_WRITE, &words->out}, 1};
	CHECK_EQUAL(hm2_cycle_new(board, cycle, NULL), HM2_OK);
	for (int i = 0; i < 2; i++) {
		hm2_cyclic part;
		hm2_cyclic_words_part(&words->part[i], &part);
		CHECK_EQUAL(hm2_cycle_add(*cycle, &part, NULL), HM2_OK);
	}
}

static inline void engine_words_engine(struct engine_words *words, struct hm2_board *board, struct hm2_cycle *cycle,
                                       const hm2_engine_config *config, struct hm2_engine **engine)
{
	const hm2_signal input = {&words->in, HM2_SIGNAL_U32, -1, 0}, output = {&words->out, HM2_SIGNAL_U32, -1, 0};
	CHECK_EQUAL(hm2_engine_new(board, cycle, config, &input, 1, &output, 1, engine, NULL), HM2_OK);
}

static inline struct hm2_record_ring *engine_words_ring(struct hm2_engine *engine, uint32_t records)
{
	struct hm2_record_ring *ring = NULL;
	CHECK_EQUAL(hm2_record_ring_new(records, hm2_engine_record_size(engine, 8), &ring, NULL), HM2_OK);
	hm2_engine_set_record_ring(engine, ring, 8);
	return ring;
}

/* So many cycles of an engine in virtual time; how it stands then. */
static inline hm2_engine_status engine_steps(struct hm2_engine *engine, int cycles)
{
	hm2_engine_status status;
	for (int i = 0; i < cycles; i++)
		CHECK_EQUAL(hm2_engine_step(engine, NULL), HM2_OK);
	hm2_engine_read(engine, &status, NULL, NULL);
	return status;
}

#endif
