/* A block of 64-bit words that one thread writes whole and any number read whole, without locks: a reader that met a
 * write tries again, the writer never waits. */
#ifndef HM2_SHARED_WORDS_H
#define HM2_SHARED_WORDS_H

#include <stdatomic.h>
#include <stddef.h>
#include <stdint.h>

/* The count is odd during a write. Each word is released and acquired, so whoever sees a new word sees the odd count,
 * too: that needs no fence, and thread sanitizers follow it. */
typedef struct shared_words {
	_Atomic uint64_t writes;
	_Atomic uint64_t *words;
	size_t count;
} shared_words;

static inline void shared_words_begin(shared_words *shared)
{
	const uint64_t writes = atomic_load_explicit(&shared->writes, memory_order_relaxed);
	atomic_store_explicit(&shared->writes, writes + 1, memory_order_relaxed);
}

static inline void shared_words_put(shared_words *shared, size_t at, const uint64_t *words, size_t count)
{
	for (size_t i = 0; i < count; i++)
		atomic_store_explicit(&shared->words[at + i], words[i], memory_order_release);
}

static inline void shared_words_end(shared_words *shared)
{
	const uint64_t writes = atomic_load_explicit(&shared->writes, memory_order_relaxed);
	atomic_store_explicit(&shared->writes, writes + 1, memory_order_release);
}

/* Where the writer is gone for ever, perhaps in the middle of a write. */
static inline void shared_words_abandon(shared_words *shared)
{
	atomic_fetch_add(&shared->writes, atomic_load(&shared->writes) & 1);
}

/* 1: `words` are those of one moment. 0: a write came in between. */
static inline int shared_words_try(const shared_words *shared, size_t at, uint64_t *words, size_t count)
{
	const uint64_t before = atomic_load_explicit(&shared->writes, memory_order_acquire);
	for (size_t i = 0; i < count; i++)
		words[i] = atomic_load_explicit(&shared->words[at + i], memory_order_acquire);
	return !(before & 1) && before == atomic_load_explicit(&shared->writes, memory_order_relaxed);
}

#endif
