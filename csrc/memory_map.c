/* A bus over a mapped file: the BAR of a PCI card, a plain file, or memory shared with another process. */
#include "clock.h"
#include "error.h"

#include <endian.h>
#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

struct memory_map {
	volatile uint32_t *words;
};

/* The fences cost nothing on x86; elsewhere they keep the order for memory shared with another process. */
static uint32_t load(const volatile uint32_t *word)
{
	const uint32_t value = le32toh(*word);
	atomic_thread_fence(memory_order_acquire);
	return value;
}

static void store(volatile uint32_t *word, uint32_t value)
{
	atomic_thread_fence(memory_order_release);
	*word = htole32(value);
}

/* Everything happens here: a read stalls until the card answers, so there is nothing to wait for later. */
static int map_begin(void *self, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	const struct memory_map *map = self;
	(void)error;
	for (size_t i = 0; i < count; i++) {
		const hm2_transfer *transfer = &transfers[i];
		volatile uint32_t *word = map->words + transfer->address / 4;
		const int step = transfer->flags & HM2_TRANSFER_SAME_ADDRESS ? 0 : 1;
		for (unsigned n = 0; n < transfer->count; n++, word += step) {
			if (transfer->flags & HM2_TRANSFER_WRITE)
				store(word, transfer->words[n]);
			else
				transfer->words[n] = load(word);
		}
	}
	return HM2_OK;
}

static int map_finish(void *self, int64_t deadline_ns, hm2_error *error)
{
	(void)self;
	(void)deadline_ns;
	(void)error;
	return HM2_OK;
}

static int64_t map_now_ns(void *self)
{
	(void)self;
	return hm2_clock_now_ns();
}

static void map_pause_ns(void *self, int64_t ns)
{
	(void)self;
	hm2_clock_pause_ns(ns);
}

static void map_close(void *self)
{
	struct memory_map *map = self;
	union { volatile uint32_t *words; void *start; } mapping = {.words = map->words};
	munmap(mapping.start, HM2_ADDRESS_SPACE);
	free(map);
}

static int refused(hm2_error *error, const char *where, int os_errno, int detail)
{
	const int status = hm2_error_set(error, HM2_ERR_IO, where);
	if (error) {
		error->os_errno = os_errno;
		error->detail = detail;
	}
	return status;
}

static int open_file(const char *path, int *fd, hm2_error *error)
{
	*fd = open(path, O_RDWR | O_SYNC | O_CLOEXEC);
	if (*fd >= 0)
		return HM2_OK;
	const int why = errno;
	int detail = HM2_MEMORY_MAP_OTHER;
	if (why == ENOENT || why == ENOTDIR)
		detail = HM2_MEMORY_MAP_NOT_FOUND;
	else if (why == EACCES || why == EPERM || why == EROFS)
		detail = HM2_MEMORY_MAP_PERMISSION;
	return refused(error, "memory map open", why, detail);
}

static int check_size(int fd, hm2_error *error)
{
	struct stat facts;
	if (fstat(fd, &facts) < 0)
		return refused(error, "memory map size", errno, HM2_MEMORY_MAP_OTHER);
	if (!S_ISREG(facts.st_mode) || facts.st_size >= (off_t)HM2_ADDRESS_SPACE)
		return HM2_OK; /* a device has no size of its own */
	const int status = refused(error, "memory map size", 0, HM2_MEMORY_MAP_TOO_SMALL);
	if (error) {
		error->expected = HM2_ADDRESS_SPACE;
		error->received = (uint32_t)facts.st_size;
	}
	return status;
}

static int map_file(int fd, struct memory_map *map, hm2_error *error)
{
	void *start = mmap(NULL, HM2_ADDRESS_SPACE, PROT_READ | PROT_WRITE, MAP_SHARED, fd, 0);
	if (start == MAP_FAILED) {
		/* the file is ours to read and write, so a refusal here is the kernel's policy */
		const int why = errno;
		return refused(error, "memory map", why,
		               why == EPERM || why == EACCES ? HM2_MEMORY_MAP_LOCKDOWN : HM2_MEMORY_MAP_OTHER);
	}
	map->words = start;
	return HM2_OK;
}

int hm2_memory_map_bus(const char *path, hm2_bus *bus, hm2_error *error)
{
	int fd = -1;
	struct memory_map *map = malloc(sizeof *map);
	if (!map)
		return hm2_error_set(error, HM2_ERR_NO_MEMORY, "memory map");
	int status = open_file(path, &fd, error);
	if (status == HM2_OK)
		status = check_size(fd, error);
	if (status == HM2_OK)
		status = map_file(fd, map, error);
	if (fd >= 0)
		close(fd); /* the mapping stays */
	if (status != HM2_OK) {
		free(map);
		return status;
	}
	*bus = (hm2_bus){map, map_begin, map_finish, map_now_ns, map_pause_ns, map_close, NULL};
	return HM2_OK;
}
