/* Counts allocations. A test that includes this carries the line
 *   link: -Wl,--wrap=malloc -Wl,--wrap=calloc -Wl,--wrap=realloc
 * and the one about no sanitizers, because those have an allocator of their own. */
#ifndef HM2_TEST_COUNTED_MALLOC_H
#define HM2_TEST_COUNTED_MALLOC_H

#include <stddef.h>

static unsigned long allocations;

void *__real_malloc(size_t size);
void *__real_calloc(size_t count, size_t size);
void *__real_realloc(void *old, size_t size);
void *__wrap_malloc(size_t size);
void *__wrap_calloc(size_t count, size_t size);
void *__wrap_realloc(void *old, size_t size);

void *__wrap_malloc(size_t size)
{
	allocations++;
	return __real_malloc(size);
}

void *__wrap_calloc(size_t count, size_t size)
{
	allocations++;
	return __real_calloc(count, size);
}

void *__wrap_realloc(void *old, size_t size)
{
	allocations++;
	return __real_realloc(old, size);
}

#endif
