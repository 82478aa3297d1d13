/* Latching at index or probe without trusting any single reply.
 *
 * The hardware clears the latch-enable bit when the event comes, so "cleared" alone could also mean
 * that the arming write was lost. JustOnce is written together with it and never cleared by hardware:
 * JustOnce set and enable clear is an event, JustOnce clear is a lost write, which is repeated.
 * A new arming waits until the disarmed word has been read back: polarity changes made at the same
 * time would make an index event of their own, and an old event could be taken for a new one. */
#include "encoder_index.h"
#include "registers.h"

enum { DISARMED = 0, ARMING, DISARMING };

#define LATCH_BITS (HM2_ENCODER_CONTROL_LATCH_ON_INDEX_MASK | HM2_ENCODER_CONTROL_LATCH_ON_PROBE_MASK)
#define LIVE_BITS                                                                                  \
	(HM2_ENCODER_CONTROL_INPUT_A_MASK | HM2_ENCODER_CONTROL_INPUT_B_MASK |                     \
	 HM2_ENCODER_CONTROL_INPUT_INDEX_MASK | HM2_ENCODER_CONTROL_QUAD_ERROR_MASK)

static uint32_t enable_bit(int32_t request)
{
	return request == HM2_ENCODER_PROBE ? HM2_ENCODER_CONTROL_LATCH_ON_PROBE_MASK
	                                    : HM2_ENCODER_CONTROL_LATCH_ON_INDEX_MASK;
}

/* Whether the written part of CCR reads back as `word`. */
static int reads_back(const hm2_encoder *encoder, uint32_t control, uint32_t word)
{
	const uint32_t compared = 0xFFFFu & ~LIVE_BITS & encoder->readable;
	return ((control ^ word) & compared) == 0;
}

static void event(hm2_encoder *encoder, int64_t previous, uint32_t control)
{
	const uint16_t latch = (uint16_t)(control >> HM2_ENCODER_CONTROL_LATCH_LSB);
	encoder->latched = previous + (int16_t)(uint16_t)(latch - (uint16_t)previous);
	encoder->events++;
	if (encoder->request == HM2_ENCODER_INDEX)
		encoder->zero = encoder->latched;
	encoder->request = HM2_ENCODER_NONE;
}

static void watch_armed(hm2_encoder *encoder, int64_t previous, uint32_t control)
{
	const uint32_t enable = enable_bit(encoder->request);
	if (encoder->request == HM2_ENCODER_NONE || !(encoder->control_word & enable)) {
		encoder->index_state = DISARMING; /* withdrawn or changed by the user */
		return;
	}
	if ((control & HM2_ENCODER_CONTROL_JUST_ONCE_MASK) && !(control & enable)) {
		event(encoder, previous, control);
		encoder->index_state = DISARMING;
	}
}

void hm2_encoder_index_update(hm2_encoder *encoder, int64_t previous, uint32_t control)
{
	const uint32_t disarmed =
		encoder->settings & ~(LATCH_BITS | LIVE_BITS | HM2_ENCODER_CONTROL_JUST_ONCE_MASK);
	if (encoder->index_state == ARMING)
		watch_armed(encoder, previous, control);
	if (encoder->index_state != ARMING && reads_back(encoder, control, disarmed))
		encoder->index_state = encoder->request == HM2_ENCODER_NONE ? DISARMED : ARMING;
	encoder->control_word = disarmed;
	if (encoder->index_state == ARMING)
		encoder->control_word |= enable_bit(encoder->request) | HM2_ENCODER_CONTROL_JUST_ONCE_MASK;
	encoder->write_control = !reads_back(encoder, control, encoder->control_word);
}
