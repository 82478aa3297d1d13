/* Any bytes as an LBP16 packet: what is accepted lies inside the packet and encodes to the same bytes. */
#include <stdlib.h>
#include <string.h>

#include "hm2.h"

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length);

int LLVMFuzzerTestOneInput(const uint8_t *bytes, size_t length)
{
	hm2_lbp16_command command;
	const uint8_t *data;
	uint8_t again[4 + HM2_LBP16_MAX_COUNT * 8];
	size_t offset = 0;
	size_t start = 0;
	size_t size;

	hm2_lbp16_reply_size(bytes, length, &size);
	while (hm2_lbp16_next(bytes, length, &offset, &command, &data) == HM2_OK) {
		size_t used = 0;

		if (offset <= start || offset > length)
			abort();
		if (hm2_lbp16_put(again, sizeof again, &used, &command, data) != HM2_OK)
			abort();
		if (used != offset - start || memcmp(again, bytes + start, used) != 0)
			abort();
		start = offset;
	}
	return 0;
}
