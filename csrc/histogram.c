/* Log-linear histogram of times: 128 equal buckets in every octave. */
#include <math.h>
#include <string.h>

#include "hm2.h"

#define LINEAR_BITS 7  /* buckets per octave: 2^7 */
#define VALUE_BITS 40
#define BUCKETS ((VALUE_BITS - LINEAR_BITS + 1) << LINEAR_BITS)

_Static_assert(sizeof((hm2_histogram *)0)->buckets == BUCKETS * sizeof(uint64_t), "hm2.h names the number of buckets");

static inline size_t bucket_of(uint64_t value)
{
	if (value >= 1ull << VALUE_BITS)
		return BUCKETS - 1;
	if (value < 1u << LINEAR_BITS)
		return (size_t)value;
	unsigned shift = 63u - (unsigned)__builtin_clzll(value) - LINEAR_BITS;
	return ((size_t)shift << LINEAR_BITS) + (size_t)(value >> shift);
}

int64_t hm2_histogram_bucket_start(size_t index)
{
	if (index > BUCKETS)
		return -1;
	if (index < 2u << LINEAR_BITS)
		return (int64_t)index;
	unsigned shift = (unsigned)(index >> LINEAR_BITS) - 1;
	return (int64_t)(index - ((size_t)shift << LINEAR_BITS)) << shift;
}

/* Others may look meanwhile: each number is stored whole. */
#define STORE(place, value) __atomic_store_n(&(place), (value), __ATOMIC_RELAXED)

void hm2_histogram_record(hm2_histogram *histogram, int64_t ns)
{
	if (ns < 0)
		ns = 0;
	uint64_t *bucket = &histogram->buckets[bucket_of((uint64_t)ns)];
	if (histogram->count == 0 || ns < histogram->minimum_ns)
		STORE(histogram->minimum_ns, ns);
	if (ns > histogram->maximum_ns)
		STORE(histogram->maximum_ns, ns);
	STORE(histogram->sum_ns, histogram->sum_ns + (uint64_t)ns);
	STORE(*bucket, *bucket + 1);
	STORE(histogram->count, histogram->count + 1);
}

void hm2_histogram_copy(hm2_histogram *into, const hm2_histogram *from)
{
	uint64_t count = 0;
	into->sum_ns = __atomic_load_n(&from->sum_ns, __ATOMIC_RELAXED);
	into->minimum_ns = __atomic_load_n(&from->minimum_ns, __ATOMIC_RELAXED);
	into->maximum_ns = __atomic_load_n(&from->maximum_ns, __ATOMIC_RELAXED);
	for (size_t i = 0; i < BUCKETS; i++)
		count += into->buckets[i] = __atomic_load_n(&from->buckets[i], __ATOMIC_RELAXED);
	into->count = count; /* what the percentiles count */
}

void hm2_histogram_record_many(hm2_histogram *histogram, const int64_t *ns, size_t count)
{
	for (size_t i = 0; i < count; i++)
		hm2_histogram_record(histogram, ns[i]);
}

void hm2_histogram_merge(hm2_histogram *into, const hm2_histogram *from)
{
	if (from->count == 0)
		return;
	if (into->count == 0 || from->minimum_ns < into->minimum_ns)
		into->minimum_ns = from->minimum_ns;
	if (from->maximum_ns > into->maximum_ns)
		into->maximum_ns = from->maximum_ns;
	into->sum_ns += from->sum_ns;
	for (size_t i = 0; i < BUCKETS; i++)
		into->buckets[i] += from->buckets[i];
	into->count += from->count;
}

void hm2_histogram_reset(hm2_histogram *histogram)
{
	STORE(histogram->count, 0);
	STORE(histogram->sum_ns, 0);
	STORE(histogram->minimum_ns, 0);
	STORE(histogram->maximum_ns, 0);
	for (size_t i = 0; i < BUCKETS; i++)
		STORE(histogram->buckets[i], 0);
}

int64_t hm2_histogram_percentile(const hm2_histogram *histogram, double percent)
{
	if (histogram->count == 0 || !(percent >= 0.0 && percent <= 100.0))
		return -1;
	double rank = ceil(percent * (double)histogram->count / 100.0);
	if (rank < 1.0)
		return histogram->minimum_ns;
	uint64_t seen = 0;
	for (size_t i = 0; i < BUCKETS - 1; i++) {
		seen += histogram->buckets[i];
		if ((double)seen < rank)
			continue;
		int64_t last = hm2_histogram_bucket_start(i + 1) - 1;
		return last < histogram->maximum_ns ? last : histogram->maximum_ns;
	}
	return histogram->maximum_ns;
}
