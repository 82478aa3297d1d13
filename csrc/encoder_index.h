/* Latching at index or probe without trusting any single reply. */
#ifndef HM2_ENCODER_INDEX_H
#define HM2_ENCODER_INDEX_H

#include "hm2.h"

/* previous: the encoder's raw_count before this reading; latched counts are extended from there. */
void hm2_encoder_index_update(hm2_encoder *encoder, int64_t previous, uint32_t control);

#endif
