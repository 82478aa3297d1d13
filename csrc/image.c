/* A bus over recorded words: reads what was recorded, says so where nothing was, refuses writes. */
#include "clock.h"
#include "error.h"

#include <stdlib.h>
#include <string.h>

#define SPACE_WORDS (HM2_ADDRESS_SPACE / 4)

struct image {
	uint32_t words[SPACE_WORDS];
	uint8_t recorded[SPACE_WORDS];
};

static int fail(hm2_error *error, int status, uint32_t address, size_t index)
{
	hm2_error_set(error, status, "dump");
	if (error) {
		error->address = address;
		error->index = (int32_t)index;
	}
	return status;
}

static int image_begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	const struct image *image = self;
	for (size_t i = 0; i < count; i++) {
		const hm2_transfer *transfer = &transfers[i];
		if (transfer->flags & HM2_TRANSFER_WRITE)
			return fail(error, HM2_ERR_READ_ONLY, transfer->address, i);
		for (size_t n = 0; n < transfer->count; n++) {
			const size_t step = transfer->flags & HM2_TRANSFER_SAME_ADDRESS ? 0 : n;
			const size_t at = transfer->address / 4 + step;
			if (!image->recorded[at])
				return fail(error, HM2_ERR_ABSENT, (uint32_t)at * 4, i);
			transfer->words[n] = image->words[at];
		}
	}
	return HM2_OK;
}

static int image_finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	(void)self;
	(void)deadline_ns;
	(void)error;
	return HM2_OK;
}

static int64_t image_now_ns(void *self)
{
	(void)self;
	return hm2_clock_now_ns();
}

static void image_pause_ns(void *self, int64_t ns)
{
	(void)self;
	hm2_clock_pause_ns(ns);
}

static void image_close(void *self)
{
	free(self);
}

int hm2_image_bus(const uint32_t *addresses, const uint32_t *words, size_t count, hm2_bus *bus, hm2_error *error)
{
	struct image *image = calloc(1, sizeof *image);
	if (!image)
		return hm2_error_set(error, HM2_ERR_NO_MEMORY, "dump");
	for (size_t i = 0; i < count; i++) {
		if (addresses[i] % 4 || addresses[i] >= HM2_ADDRESS_SPACE) {
			free(image);
			return fail(error, addresses[i] % 4 ? HM2_ERR_ALIGN : HM2_ERR_RANGE, addresses[i], i);
		}
		image->words[addresses[i] / 4] = words[i];
		image->recorded[addresses[i] / 4] = 1;
	}
	*bus = (hm2_bus){image, image_begin, image_finish, image_now_ns, image_pause_ns, image_close, NULL};
	return HM2_OK;
}
