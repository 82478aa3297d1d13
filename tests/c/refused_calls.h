/* Calls of the operating system that are refused on request, and files counted while they are open. A test that
 * includes this carries the line
 *   link: -Wl,--wrap=open -Wl,--wrap=close -Wl,--wrap=fstat ... for all that are named here */
#ifndef HM2_TEST_REFUSED_CALLS_H
#define HM2_TEST_REFUSED_CALLS_H

#include <errno.h>
#include <pthread.h>
#include <semaphore.h>
#include <stdarg.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <time.h>

enum call {
	NOTHING, OPEN, FSTAT, MMAP, SOCKET, CONNECT, BIND, GETSOCKNAME, SEND, RECV, SENDTO, GETRANDOM, EVENTFD,
	PTHREAD_CREATE, SEM_WAIT, CLOCK_NANOSLEEP, MLOCKALL
};

static enum call refused_call; /* fails */
static int refused_errno;      /* with this */
static int refused_times;      /* so often */
static int asked;              /* how often it was called since */
static int files_open;         /* that the core has opened */

static void refuse(enum call call, int code, int times)
{
	refused_call = call;
	refused_errno = code;
	refused_times = times;
	asked = 0;
}

static int is_refused(enum call call)
{
	asked += call == refused_call;
	if (call != refused_call || refused_times == 0)
		return 0;
	refused_times--;
	errno = refused_errno;
	return 1;
}

static int opened(int file)
{
	files_open += file >= 0;
	return file;
}

#define WRAP(type, name, parameters, call, arguments, failure)                    \
	type __real_##name parameters;                                                \
	type __wrap_##name parameters;                                                \
	type __wrap_##name parameters                                                 \
	{                                                                             \
		return is_refused(call) ? (failure) : __real_##name arguments;            \
	}

WRAP(int, fstat, (int file, struct stat *facts), FSTAT, (file, facts), -1)
WRAP(void *, mmap, (void *at, size_t size, int protection, int flags, int file, off_t offset), MMAP,
     (at, size, protection, flags, file, offset), MAP_FAILED)
WRAP(int, connect, (int file, const struct sockaddr *address, socklen_t size), CONNECT, (file, address, size), -1)
WRAP(int, bind, (int file, const struct sockaddr *address, socklen_t size), BIND, (file, address, size), -1)
WRAP(int, getsockname, (int file, struct sockaddr *address, socklen_t *size), GETSOCKNAME, (file, address, size), -1)
WRAP(ssize_t, send, (int file, const void *bytes, size_t size, int flags), SEND, (file, bytes, size, flags), -1)
WRAP(ssize_t, recv, (int file, void *bytes, size_t size, int flags), RECV, (file, bytes, size, flags), -1)
WRAP(ssize_t, sendto,
     (int file, const void *bytes, size_t size, int flags, const struct sockaddr *to, socklen_t to_size), SENDTO,
     (file, bytes, size, flags, to, to_size), -1)
WRAP(ssize_t, getrandom, (void *bytes, size_t size, unsigned flags), GETRANDOM, (bytes, size, flags), -1)
WRAP(int, pthread_create, (pthread_t *thread, const pthread_attr_t *attributes, void *(*run)(void *), void *argument),
     PTHREAD_CREATE, (thread, attributes, run, argument), refused_errno)
WRAP(int, sem_wait, (sem_t *semaphore), SEM_WAIT, (semaphore), -1)
WRAP(int, clock_nanosleep, (clockid_t clock, int flags, const struct timespec *time, struct timespec *left),
     CLOCK_NANOSLEEP, (clock, flags, time, left), refused_errno)
WRAP(int, mlockall, (int flags), MLOCKALL, (flags), -1)

int __real_open(const char *path, int flags, ...);
int __wrap_open(const char *path, int flags, ...);
int __real_close(int file);
int __wrap_close(int file);
int __real_socket(int domain, int type, int protocol);
int __wrap_socket(int domain, int type, int protocol);
int __real_eventfd(unsigned value, int flags);
int __wrap_eventfd(unsigned value, int flags);

int __wrap_open(const char *path, int flags, ...)
{
	return is_refused(OPEN) ? -1 : opened(__real_open(path, flags));
}

int __wrap_close(int file)
{
	files_open--;
	return __real_close(file);
}

int __wrap_socket(int domain, int type, int protocol)
{
	return is_refused(SOCKET) ? -1 : opened(__real_socket(domain, type, protocol));
}

int __wrap_eventfd(unsigned value, int flags)
{
	return is_refused(EVENTFD) ? -1 : opened(__real_eventfd(value, flags));
}

#endif
