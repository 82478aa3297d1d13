/* A board: words at addresses over any bus, every access checked before the bus sees it. */
#include "board.h"
#include "error.h"

#include <pthread.h>
#include <stdatomic.h>
#include <stdlib.h>
#include <string.h>

#define CHECKED 64 /* transfers: more than a cycle has */

/* An exchange is one thread's from begin to finish: a cycle engine and whoever looks at a register meanwhile take
 * turns, and a real-time thread lends its priority to the one it waits for. */
struct hm2_board {
	hm2_bus bus;
	pthread_mutex_t turn;
	_Atomic int open;
	_Atomic int outstanding; /* a begin without its finish */
	_Atomic int gate_shut;   /* writes are refused */
	_Atomic uint32_t shuttings;
	int read_only;
	int64_t timeout_ns;
	uint64_t reads_begun; /* words of the outstanding list, counted when it has come back */
	uint64_t writes_begun;
	size_t checked_count; /* the last list, if it was good; 0: none is remembered */
	hm2_transfer checked[CHECKED];
	hm2_board_counters counters;
	_Atomic uint64_t given_up; /* exchanges that never got to the bus */
};

int hm2_board_open(const hm2_bus *bus, struct hm2_board **board, hm2_error *error)
{
	struct hm2_board *new_board = calloc(1, sizeof *new_board);
	if (!new_board)
		return hm2_error_set(error, HM2_ERR_NO_MEMORY, "board open");
	pthread_mutexattr_t attributes;
	pthread_mutexattr_init(&attributes);
	pthread_mutexattr_settype(&attributes, PTHREAD_MUTEX_ERRORCHECK);
	pthread_mutexattr_setprotocol(&attributes, PTHREAD_PRIO_INHERIT);
	pthread_mutex_init(&new_board->turn, &attributes);
	pthread_mutexattr_destroy(&attributes);
	new_board->bus = *bus;
	new_board->open = 1;
	new_board->timeout_ns = HM2_BOARD_TIMEOUT_NS;
	*board = new_board;
	return HM2_OK;
}

void hm2_board_close(struct hm2_board *board)
{
	if (!board || !board->open)
		return;
	board->open = 0;
	if (board->outstanding)
		pthread_mutex_unlock(&board->turn);
	board->outstanding = 0;
	board->bus.close(board->bus.self);
}

void hm2_board_free(struct hm2_board *board)
{
	hm2_board_close(board);
	if (board)
		pthread_mutex_destroy(&board->turn);
	free(board);
}

void hm2_board_set_timeout_ns(struct hm2_board *board, int64_t timeout_ns)
{
	board->timeout_ns = timeout_ns;
}

void hm2_board_get_counters(const struct hm2_board *board, hm2_board_counters *counters)
{
	counters->exchanges = __atomic_load_n(&board->counters.exchanges, __ATOMIC_RELAXED);
	counters->failures = __atomic_load_n(&board->counters.failures, __ATOMIC_RELAXED);
	counters->words_read = __atomic_load_n(&board->counters.words_read, __ATOMIC_RELAXED);
	counters->words_written = __atomic_load_n(&board->counters.words_written, __ATOMIC_RELAXED);
}

uint64_t board_failed(const struct hm2_board *board)
{
	return __atomic_load_n(&board->counters.failures, __ATOMIC_RELAXED) + atomic_load(&board->given_up);
}

void board_given_up(struct hm2_board *board)
{
	atomic_fetch_add(&board->given_up, 1);
}

int64_t hm2_board_now_ns(struct hm2_board *board)
{
	return board->open ? board->bus.now_ns(board->bus.self) : 0;
}

void hm2_board_pause_ns(struct hm2_board *board, int64_t ns)
{
	if (board->open)
		board->bus.pause_ns(board->bus.self, ns);
}

uint64_t hm2_board_disturbances(struct hm2_board *board)
{
	return board->open && board->bus.disturbances ? board->bus.disturbances(board->bus.self) : 0;
}

void hm2_board_set_gate(struct hm2_board *board, int shut)
{
	if (atomic_exchange(&board->gate_shut, shut) == 0 && shut)
		atomic_fetch_add(&board->shuttings, 1);
}

uint32_t board_shuttings(const struct hm2_board *board)
{
	return board->shuttings;
}

int hm2_board_gate_is_shut(const struct hm2_board *board)
{
	return board->gate_shut;
}

void hm2_board_set_read_only(struct hm2_board *board)
{
	board->read_only = 1;
}

int hm2_board_takes_writes(const struct hm2_board *board)
{
	return !board->gate_shut && !board->read_only;
}

static int out_of_range(hm2_error *error, uint32_t address, uint32_t expected, uint32_t received)
{
	const int status = hm2_error_set(error, HM2_ERR_RANGE, "board");
	if (error) {
		error->address = address;
		error->expected = expected;
		error->received = received;
	}
	return status;
}

static int check_words(uint32_t address, size_t count, int advances, hm2_error *error)
{
	if (address % 4) {
		const int status = hm2_error_set(error, HM2_ERR_ALIGN, "board");
		if (error)
			error->address = address;
		return status;
	}
	if (address >= HM2_ADDRESS_SPACE)
		return out_of_range(error, address, HM2_ADDRESS_SPACE - 4, address);
	const size_t room = advances ? (HM2_ADDRESS_SPACE - address) / 4 : UINT16_MAX;
	if (count == 0 || count > room)
		return out_of_range(error, address, (uint32_t)room, count > UINT32_MAX ? UINT32_MAX : (uint32_t)count);
	return HM2_OK;
}

static int check_transfer(const hm2_transfer *transfer, hm2_error *error)
{
	if (transfer->flags & ~(HM2_TRANSFER_WRITE | HM2_TRANSFER_SAME_ADDRESS) || !transfer->words)
		return out_of_range(error, transfer->address, HM2_TRANSFER_WRITE | HM2_TRANSFER_SAME_ADDRESS,
		                    transfer->flags);
	return check_words(transfer->address, transfer->count, !(transfer->flags & HM2_TRANSFER_SAME_ADDRESS), error);
}

/* Counted by whose turn it is; others may look. */
static void count_up(uint64_t *counter, uint64_t by)
{
	__atomic_store_n(counter, *counter + by, __ATOMIC_RELAXED);
}

/* A list that was checked already, as it is in all cycles but the first, is only compared. */
static int check_list(struct hm2_board *board, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	if (!count || count != board->checked_count || memcmp(transfers, board->checked, count * sizeof *transfers) != 0) {
		uint64_t words[2] = {0, 0}; /* read, written */
		for (size_t i = 0; i < count; i++) {
			const int status = check_transfer(&transfers[i], error);
			if (status != HM2_OK) {
				if (error)
					error->index = (int32_t)i;
				return status;
			}
			words[transfers[i].flags & HM2_TRANSFER_WRITE] += transfers[i].count;
		}
		board->reads_begun = words[0];
		board->writes_begun = words[1];
		board->checked_count = count <= CHECKED ? count : 0;
		memcpy(board->checked, transfers, board->checked_count * sizeof *transfers);
	}
	if (board->writes_begun && !hm2_board_takes_writes(board))
		return hm2_error_set(error, board->read_only ? HM2_ERR_READ_ONLY : HM2_ERR_GATED, "board");
	return HM2_OK;
}

/* Whose turn it is. */
static int begin(struct hm2_board *board, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	int status = board->open ? check_list(board, transfers, count, error)
	                         : hm2_error_set(error, HM2_ERR_CLOSED, "board");
	if (status != HM2_OK) {
		board_given_up(board);
		return status;
	}
	status = board->bus.begin(board->bus.self, transfers, count, error);
	if (status == HM2_OK)
		board->outstanding = 1;
	else
		count_up(&board->counters.failures, 1);
	return status;
}

int hm2_begin(struct hm2_board *board, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	if (!board->open)
		return hm2_error_set(error, HM2_ERR_CLOSED, "board");
	if (pthread_mutex_lock(&board->turn)) { /* this thread's own exchange is outstanding */
		board_given_up(board);
		return hm2_error_set(error, HM2_ERR_BUSY, "board begin");
	}
	const int status = begin(board, transfers, count, error);
	if (status != HM2_OK)
		pthread_mutex_unlock(&board->turn);
	return status;
}

int hm2_finish(struct hm2_board *board, int64_t deadline_ns, hm2_error *error)
{
	if (!board->open)
		return hm2_error_set(error, HM2_ERR_CLOSED, "board");
	if (!board->outstanding)
		return hm2_error_set(error, HM2_ERR_BUSY, "board finish");
	const int status = board->bus.finish(board->bus.self, deadline_ns, error);
	if (status == HM2_OK) {
		count_up(&board->counters.exchanges, 1);
		count_up(&board->counters.words_read, board->reads_begun);
		count_up(&board->counters.words_written, board->writes_begun);
	} else {
		count_up(&board->counters.failures, 1);
	}
	board->outstanding = 0;
	pthread_mutex_unlock(&board->turn);
	return status;
}

int hm2_exchange(struct hm2_board *board, const hm2_transfer *transfers, size_t count, hm2_error *error)
{
	const int status = hm2_begin(board, transfers, count, error);
	if (status != HM2_OK)
		return status;
	return hm2_finish(board, board->bus.now_ns(board->bus.self) + board->timeout_ns, error);
}

int hm2_read(struct hm2_board *board, uint32_t address, uint32_t *words, size_t count, hm2_error *error)
{
	const int status = check_words(address, count, 1, error);
	if (status != HM2_OK)
		return board->open ? status : hm2_error_set(error, HM2_ERR_CLOSED, "board");
	const hm2_transfer transfer = {address, (uint16_t)count, HM2_TRANSFER_READ, words};
	return hm2_exchange(board, &transfer, 1, error);
}

int hm2_write(struct hm2_board *board, uint32_t address, const uint32_t *words, size_t count, hm2_error *error)
{
	const int status = check_words(address, count, 1, error);
	if (status != HM2_OK)
		return board->open ? status : hm2_error_set(error, HM2_ERR_CLOSED, "board");
	/* a write transfer's words are only read by the bus */
	union { const uint32_t *in; uint32_t *out; } source = {.in = words};
	const hm2_transfer transfer = {address, (uint16_t)count, HM2_TRANSFER_WRITE, source.out};
	return hm2_exchange(board, &transfer, 1, error);
}
