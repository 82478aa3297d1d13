/* How a remote's answer leaves it: checksum, and whatever is to go wrong with it. */
#include "remote_state.h"

#include <string.h>

#define EXTRA_BYTE 0xE0

static int counted(int64_t *knob)
{
	if (*knob == 0)
		return 0;
	--*knob;
	return 1;
}

/* A fault due at this answer, in the terms of the injections. */
static const hm2_fault *take_fault(hm2_remote *remote)
{
	const hm2_fault *fault = fault_step(&remote->faults);
	int64_t *knob = remote->knob;

	switch (fault ? fault->kind : HM2_FAULT_NONE) {
	case HM2_FAULT_LOST: knob[HM2_REMOTE_INJECT_SKIP]++; break;
	case HM2_FAULT_CORRUPT: knob[HM2_REMOTE_INJECT_BAD_CRC]++; break;
	case HM2_FAULT_SHORT: knob[HM2_REMOTE_INJECT_TRUNCATE] = fault->value; break;
	case HM2_FAULT_LONG: knob[HM2_REMOTE_INJECT_EXTRA] = fault->value; break;
	case HM2_FAULT_BREAK: knob[HM2_REMOTE_INJECT_BREAK]++; break;
	default: break;
	}
	return fault;
}

static void say_twice(remote_answer *answer)
{
	const size_t length = answer->length;

	for (size_t i = 0; i < length && answer->length < sizeof answer->bytes; i++)
		answer->bytes[answer->length++] = answer->bytes[i];
}

int remote_finish_answer(hm2_remote *remote, remote_answer *answer)
{
	int64_t *knob = remote->knob;
	const int speaks = answer->length || knob[HM2_REMOTE_CRC];
	const hm2_fault *fault = speaks ? take_fault(remote) : NULL;
	size_t missing = (size_t)knob[HM2_REMOTE_INJECT_TRUNCATE];
	size_t extra = (size_t)knob[HM2_REMOTE_INJECT_EXTRA];

	answer->late_ps = fault && fault->kind == HM2_FAULT_LATE ? fault->value * 1000 : 0;
	if (knob[HM2_REMOTE_CRC]) {
		uint8_t crc = hm2_lbp_crc8(answer->bytes, answer->length);

		answer->bytes[answer->length++] = counted(&knob[HM2_REMOTE_INJECT_BAD_CRC]) ? (uint8_t)~crc : crc;
	}
	if (!speaks || !remote_alive(remote) || counted(&knob[HM2_REMOTE_INJECT_SKIP]))
		return 0;
	if (fault && fault->kind == HM2_FAULT_TWICE)
		say_twice(answer);
	knob[HM2_REMOTE_INJECT_TRUNCATE] = knob[HM2_REMOTE_INJECT_EXTRA] = 0;
	answer->length -= missing < answer->length ? missing : answer->length;
	for (size_t i = 0; i < extra && answer->length < sizeof answer->bytes; i++)
		answer->bytes[answer->length++] = (uint8_t)(EXTRA_BYTE + i);
	answer->broken = answer->length && counted(&knob[HM2_REMOTE_INJECT_BREAK]);
	return answer->length != 0;
}

void hm2_remote_set_faults(hm2_remote *remote, const hm2_fault *faults, size_t count)
{
	fault_plan_set(&remote->faults, faults, count);
}

uint64_t hm2_remote_answers(const hm2_remote *remote, uint64_t *fired)
{
	if (fired)
		*fired = remote->faults.fired;
	return remote->faults.steps;
}

size_t hm2_remote_exchange(hm2_remote *remote, const uint8_t *frame, size_t length, uint8_t *answer,
                           size_t capacity)
{
	remote_answer reply;

	if (!remote_alive(remote) || length == 0 || length > FRAME_MAX)
		return 0;
	if (remote->knob[HM2_REMOTE_CRC]) {
		if (hm2_lbp_crc8(frame, length)) {
			remote_crc_error(remote);
			return 0;
		}
		length--;
	}
	if (length == 0 || remote_obey(remote, frame, length, &reply) || !remote_finish_answer(remote, &reply))
		return 0;
	reply.length -= reply.broken;
	if (reply.length > capacity)
		return 0;
	memcpy(answer, reply.bytes, reply.length);
	return reply.length;
}
