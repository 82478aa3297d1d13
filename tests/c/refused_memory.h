/* Memory that is refused on request, and counted while it is out. A test that includes this carries the line
 *   link: -Wl,--wrap=malloc -Wl,--wrap=calloc -Wl,--wrap=aligned_alloc -Wl,--wrap=free
 * Beside the sanitizers: they have an allocator of their own, which is what is asked in the end. */
#ifndef HM2_TEST_REFUSED_MEMORY_H
#define HM2_TEST_REFUSED_MEMORY_H

#include <stddef.h>

static long memory_asked; /* since memory_refuse */
static long memory_refuse_at; /* which is refused; 0: none */
static long memory_out; /* blocks that are not free again */

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_aligned_alloc(size_t alignment, size_t size);
void __real_free(void *block);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_aligned_alloc(size_t alignment, size_t size);
void __wrap_free(void *block);

/* The number-th request from now on gets nothing; 0: all get what they ask for. */
static void memory_refuse(long number)
{
	memory_asked = 0;
	memory_refuse_at = number;
}

static int memory_granted(void)
{
	if (++memory_asked == memory_refuse_at)
		return 0;
	memory_out++;
	return 1;
}

void *__wrap_malloc(size_t size)
{
	return memory_granted() ? __real_malloc(size) : NULL;
}

void *__wrap_calloc(size_t count, size_t size)
{
	return memory_granted() ? __real_calloc(count, size) : NULL;
}

void *__wrap_aligned_alloc(size_t alignment, size_t size)
{
	return memory_granted() ? __real_aligned_alloc(alignment, size) : NULL;
}

void __wrap_free(void *block)
{
	memory_out -= block != NULL;
	__real_free(block);
}

#endif
