/* One exchange for everything that takes part in a cycle. Nothing is allocated or looked up here. */
#include "cycle.h"
#include "board.h"
#include "error.h"

#include <stdlib.h>

int hm2_cycle_new(struct hm2_board *board, struct hm2_cycle **cycle, hm2_error *error)
{
	struct hm2_cycle *new_cycle = calloc(1, sizeof *new_cycle);
	if (!new_cycle)
		return hm2_error_set(error, HM2_ERR_NO_MEMORY, "cycle");
	new_cycle->board = board;
	*cycle = new_cycle;
	return HM2_OK;
}

void hm2_cycle_free(struct hm2_cycle *cycle)
{
	free(cycle);
}

static int too_many(hm2_error *error, uint32_t limit)
{
	const int status = hm2_error_set(error, HM2_ERR_RANGE, "cycle");
	if (error)
		error->expected = limit;
	return status;
}

int hm2_cycle_add(struct hm2_cycle *cycle, const hm2_cyclic *part, hm2_error *error)
{
	if (cycle->parts == HM2_CYCLE_PARTS)
		return too_many(error, HM2_CYCLE_PARTS);
	cycle->parts++;
	if (part->reads)
		cycle->reader[cycle->readers++] = (struct cycle_lister){part->self, part->reads};
	if (part->writes)
		cycle->writer[cycle->writers++] = (struct cycle_lister){part->self, part->writes};
	if (part->process)
		cycle->processor[cycle->processors++] = (struct cycle_processor){part->self, part->process};
	return HM2_OK;
}

static int append(struct hm2_cycle *cycle, const struct cycle_lister *part, size_t count, hm2_error *error)
{
	for (; count--; part++) {
		const size_t room = HM2_CYCLE_TRANSFERS - cycle->transfers;
		hm2_transfer *to = &cycle->transfer[cycle->transfers];
		size_t added;
		if (part->list == cyclic_words_list && room) { /* most parts are: not worth a call each */
			const hm2_cyclic_words *words = part->self;
			*to = words->transfer;
			added = words->enabled != 0;
		} else {
			added = part->list(part->self, to, room);
		}
		if (added > room)
			return too_many(error, HM2_CYCLE_TRANSFERS);
		cycle->transfers += added;
	}
	return HM2_OK;
}

int cycle_begin(struct hm2_cycle *cycle, int reads, int writes, hm2_error *error)
{
	int status = HM2_OK;
	if (!hm2_board_takes_writes(cycle->board))
		writes = 0; /* a bite ends the outputs, not the view of the machine */
	cycle->transfers = 0;
	cycle->processes = reads;
	if (reads)
		status = append(cycle, cycle->reader, cycle->readers, error);
	if (writes && status == HM2_OK)
		status = append(cycle, cycle->writer, cycle->writers, error);
	if (status == HM2_OK)
		status = hm2_begin(cycle->board, cycle->transfer, cycle->transfers, error);
	else
		board_given_up(cycle->board); /* parts asked before have listed what will not go out */
	if (status != HM2_OK)
		cycle->counters.failures++;
	return status;
}

int hm2_cycle_begin(struct hm2_cycle *cycle, hm2_error *error)
{
	return cycle_begin(cycle, 1, 1, error);
}

int cycle_await(struct hm2_cycle *cycle, int64_t deadline_ns, hm2_error *error)
{
	const int status = hm2_finish(cycle->board, deadline_ns, error);
	if (status == HM2_OK)
		cycle->counters.cycles++;
	else
		cycle->counters.failures++;
	return status;
}

void cycle_process(struct hm2_cycle *cycle)
{
	if (!cycle->processes || !cycle->processors)
		return;
	const int64_t now_ns = hm2_board_now_ns(cycle->board);
	for (size_t i = 0; i < cycle->processors; i++)
		cycle->processor[i].process(cycle->processor[i].self, now_ns);
}

int hm2_cycle_finish(struct hm2_cycle *cycle, int64_t deadline_ns, hm2_error *error)
{
	const int status = cycle_await(cycle, deadline_ns, error);
	if (status == HM2_OK)
		cycle_process(cycle);
	return status;
}

static int run(struct hm2_cycle *cycle, int reads, int writes, hm2_error *error)
{
	const int status = cycle_begin(cycle, reads, writes, error);
	if (status != HM2_OK)
		return status;
	return hm2_cycle_finish(cycle, hm2_board_now_ns(cycle->board) + HM2_BOARD_TIMEOUT_NS, error);
}

int hm2_cycle_run(struct hm2_cycle *cycle, hm2_error *error)
{
	return run(cycle, 1, 1, error);
}

int hm2_cycle_read(struct hm2_cycle *cycle, hm2_error *error)
{
	return run(cycle, 1, 0, error);
}

int hm2_cycle_write(struct hm2_cycle *cycle, hm2_error *error)
{
	return run(cycle, 0, 1, error);
}

void hm2_cycle_get_counters(const struct hm2_cycle *cycle, hm2_cycle_counters *counters)
{
	*counters = cycle->counters;
}
