#ifndef HM2_EMULATOR_INHERITING_MUTEX_H
#define HM2_EMULATOR_INHERITING_MUTEX_H

#include <pthread.h>

/* Recursive: who holds the card may still look into a part of it. With inheritance: whoever holds it runs with the
 * priority of a real-time thread that waits for it, or the card would answer as late as the least of its observers
 * gets a processor. To be destroyed by pthread_mutex_destroy. */
void inheriting_mutex_init(pthread_mutex_t *mutex);

#endif
