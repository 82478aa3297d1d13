/* CHECK for the C unit tests: a failure is printed and counted, the program goes on and ends with 1. */
#ifndef HM2_TEST_CHECK_H
#define HM2_TEST_CHECK_H

#include <stdio.h>

static int check_failures;

#define CHECK(condition)                                                                     \
	do {                                                                                      \
		if (!(condition)) {                                                                   \
			fprintf(stderr, "%s:%d: %s: not so: %s\n", __FILE__, __LINE__, __func__, #condition); \
			check_failures++;                                                                 \
		}                                                                                     \
	} while (0)

#define CHECK_EQUAL(actual, expected)                                                             \
	do {                                                                                           \
		long long check_actual = (long long)(actual), check_expected = (long long)(expected);      \
		if (check_actual != check_expected) {                                                      \
			fprintf(stderr, "%s:%d: %s: %s is %lld (0x%llX), not %lld (0x%llX)\n", __FILE__, __LINE__, \
			        __func__, #actual, check_actual, (unsigned long long)check_actual,             \
			        check_expected, (unsigned long long)check_expected);                           \
			check_failures++;                                                                      \
		}                                                                                          \
	} while (0)

#define CHECK_RESULT() (check_failures != 0)

#endif
