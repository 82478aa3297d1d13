/* The step generator, edge by edge (fact sheet registers.md 2.7, card observed 6).
 *
 * A 48-bit accumulator takes the rate with every master pulse. Bit 31 is looked at one clock late; its
 * fall after an upward, its rise after a downward addition is a step. A step starts the pulse timer and
 * the hold timer; the pulse's end starts the idle time. An addition that would make a step waits while
 * a pulse, the idle time, or the change of direction with its hold and setup times is not over.
 *
 * In spans where timers merely count and additions make no step, everything moves at once. */
#include "stepper.h"

#include "registers.h"

#define HALF (INT64_C(1) << 31)
#define ACCUMULATOR_BITS 48
#define TIMER_TOP 15 /* index and probe integrators */

__extension__ typedef unsigned __int128 wide;

/* Mode bits of the two latching variants. */
enum {
	OLD_LATCH_INDEX = 0x04, OLD_INDEX_RISING = 0x08, OLD_LATCH_PROBE = 0x10, OLD_PROBE_RISING = 0x20,
	OLD_JUST_ONCE = 0x40,
	SWAP = HM2_STEPGEN_MODE_SWAP_MASK,
	C2_LATCH_INDEX = HM2_STEPGEN_MODE_LATCH_ON_INDEX_MASK,
	C2_INDEX_RISING = HM2_STEPGEN_MODE_INDEX_POLARITY_MASK,
	C2_LATCH_PROBE = HM2_STEPGEN_MODE_LATCH_ON_PROBE_MASK,
	C2_PROBE_RISING = HM2_STEPGEN_MODE_PROBE_POLARITY_MASK
};

static int64_t sign_extend(int64_t value)
{
	int shift = 64 - ACCUMULATOR_BITS;
	return (int64_t)((uint64_t)value << shift) >> shift;
}

/* ---- the master pulses ----------------------------------------------------------------------- */

void master_rate_write(struct master_rate *master, int64_t now, uint32_t rate)
{
	if (master->since < now) {
		master->old_rate = master->rate;
		master->old_since = master->since;
	}
	master->rate = rate;
	master->since = now;
}

/* Carries out of 32 bits since the rate was written, up to edge n. */
static int64_t carries(const struct master_rate *master, int64_t n)
{
	return (int64_t)(((wide)master->rate * (wide)(n - master->since)) >> 32);
}

static int top_bit(const struct master_rate *master, int64_t n)
{
	if (n < master->since)
		return n < 0 ? 0 : (int)(((wide)master->old_rate * (wide)(n - master->old_since)) >> 32) & 1;
	return (int)carries(master, n) & 1;
}

static int pulses_at(const struct master_rate *master, int64_t n)
{
	return top_bit(master, n - 2) != top_bit(master, n - 3);
}

/* Pulses in (from, to]; both well behind the last write. */
static int64_t pulses_between(const struct master_rate *master, int64_t from, int64_t to)
{
	return carries(master, to - 2) - carries(master, from - 2);
}

/* The edge of the count-th pulse behind edge n; a long way off if there is none. */
static int64_t pulse_edge(const struct master_rate *master, int64_t n, int64_t count)
{
	if (master->rate == 0)
		return INT64_MAX;
	wide target = (wide)(carries(master, n - 2) + count) << 32;
	wide edges = (target + master->rate - 1) / master->rate;
	return edges > (wide)(INT64_MAX / 2) ? INT64_MAX : master->since + (int64_t)edges + 2;
}

/* ---- one generator --------------------------------------------------------------------------- */

static int half(int64_t accumulator)
{
	return (accumulator & HALF) != 0;
}

static int would_step(const struct stepper *s)
{
	int now = half(s->accumulator);
	int next = half(s->accumulator + s->rate);
	return s->rate < 0 ? !now && next : now && !next;
}

static int direction_changes(const struct stepper *s)
{
	return s->direction != (s->rate < 0);
}

static int must_wait(const struct stepper *s)
{
	int setup = !s->holding && s->direction_timer != 0;
	return setup || s->pulse_timer != 0 || s->pulse_timer_ran || direction_changes(s);
}

static int steps_now(const struct stepper *s)
{
	int now = half(s->accumulator);
	return s->added_down ? now && !s->old_half : !now && s->old_half;
}

static void move_table(struct stepper *s)
{
	if (s->added_down)
		s->table_pointer = s->table_pointer == 0 ? s->table_last : (uint8_t)(s->table_pointer - 1);
	else
		s->table_pointer = s->table_pointer == s->table_last ? 0 : (uint8_t)((s->table_pointer + 1) & 15);
}

static int is_rising(int changed_to, int rising_wanted)
{
	return changed_to == rising_wanted;
}

static void take_latch(struct stepper *s, int input, int level)
{
	int old = s->latches == STEPPER_LATCH_OLD;
	int enable = input == 0 ? (old ? OLD_LATCH_INDEX : C2_LATCH_INDEX) : (old ? OLD_LATCH_PROBE : C2_LATCH_PROBE);
	int rising = input == 0 ? (old ? OLD_INDEX_RISING : C2_INDEX_RISING)
	                        : (old ? OLD_PROBE_RISING : C2_PROBE_RISING);
	if (!(s->mode & enable) || !is_rising(level, (s->mode & rising) != 0))
		return;
	s->latch = (uint32_t)((uint64_t)s->accumulator >> 16);
	if (!old || (s->mode & OLD_JUST_ONCE))
		s->mode &= (uint8_t)~enable;
}

static void filter_inputs(struct stepper *s)
{
	uint8_t before = s->filtered;
	for (int i = 0; i < 2; i++) {
		uint8_t bit = (uint8_t)(1u << i);
		if ((before ^ s->filtered_before) & bit)
			take_latch(s, i, (before & bit) != 0);
		if (s->filter[i] == 0)
			s->filtered &= (uint8_t)~bit;
		if (s->filter[i] == TIMER_TOP)
			s->filtered |= bit;
		if ((s->inputs & bit) && s->filter[i] < TIMER_TOP)
			s->filter[i]++;
		else if (!(s->inputs & bit) && s->filter[i] > 0)
			s->filter[i]--;
	}
	s->filtered_before = before;
}

static int inputs_rest(const struct stepper *s)
{
	if (s->filtered != s->inputs || s->filtered_before != s->filtered)
		return 0;
	for (int i = 0; i < 2; i++)
		if (s->filter[i] != ((s->inputs >> i) & 1 ? TIMER_TOP : 0))
			return 0;
	return 1;
}

static void run_timers(struct stepper *s, int step)
{
	int pulse_ran = s->pulse_timer != 0;
	int hold_running = s->holding && s->direction_timer != 0;
	int changes = direction_changes(s);
	if (pulse_ran)
		s->pulse_timer--;
	if (!pulse_ran && s->pulse_timer_ran && s->pulse) {
		s->pulse_timer = s->idle_time;
		s->pulse = 0;
	}
	if (s->direction_timer != 0)
		s->direction_timer--;
	if (step) {
		s->pulse_timer = s->pulse_time;
		s->pulse = 1;
		s->direction_timer = s->hold_time;
		s->holding = 1;
	} else if (!hold_running && changes) {
		s->direction_timer = s->setup_time;
		s->holding = 0;
		s->direction = s->rate < 0;
	}
	s->pulse_timer_ran = (uint8_t)pulse_ran;
}

static void single_edge(struct stepper *s, int add)
{
	int step = steps_now(s);
	int held = would_step(s) && must_wait(s);
	int now_half = half(s->accumulator);
	if (s->latches)
		filter_inputs(s);
	if (step)
		move_table(s);
	int down = s->rate < 0;
	run_timers(s, step);
	if (add && !held) {
		s->accumulator = sign_extend(s->accumulator + s->rate);
		s->added_down = (uint8_t)down;
	}
	s->old_half = (uint8_t)now_half;
}

/* Additions that surely make no step, from here on. */
static int64_t free_additions(const struct stepper *s)
{
	int64_t low = s->accumulator & (2 * HALF - 1);
	if (s->rate == 0)
		return INT64_MAX / 4;
	if (s->rate > 0) /* up to the last value below the next fall of bit 31 */
		return (2 * HALF - 1 - low) / s->rate;
	int64_t room = low; /* down to the last value above the borrow into bit 31 */
	return room / -(int64_t)s->rate;
}

/* Clocks in which timers only count and the pins stand still; 0: look at the next edge alone. */
static int64_t calm_clocks(const struct stepper *s, const struct master_rate *master)
{
	int64_t clocks = INT64_MAX / 4;
	int running = s->pulse_timer != 0;
	if (s->clock < master->since + 4 || steps_now(s) || s->old_half != half(s->accumulator))
		return 0;
	if (running != s->pulse_timer_ran || (s->latches && !inputs_rest(s)))
		return 0;
	if (direction_changes(s) && !(s->holding && s->direction_timer != 0))
		return 0;
	if (running)
		clocks = s->pulse_timer - 1;
	if (s->direction_timer != 0 && s->direction_timer - 1 < clocks)
		clocks = s->direction_timer - 1;
	if (would_step(s)) { /* held until a timer ends, or free to go with the next pulse */
		if (must_wait(s))
			return clocks;
		int64_t next = pulse_edge(master, s->clock, 1);
		return next - s->clock - 1 < clocks ? next - s->clock - 1 : clocks;
	}
	int64_t additions = free_additions(s);
	int64_t end = pulse_edge(master, s->clock, additions + 1);
	return end != INT64_MAX && end - s->clock - 1 < clocks ? end - s->clock - 1 : clocks;
}

static void skip(struct stepper *s, const struct master_rate *master, int64_t clocks)
{
	int64_t to = s->clock + clocks;
	int64_t additions = would_step(s) ? 0 : pulses_between(master, s->clock, to);
	s->accumulator = sign_extend(s->accumulator + additions * s->rate);
	if (additions > 0)
		s->added_down = s->rate < 0;
	int just_added = additions > 0 && pulses_at(master, to);
	s->old_half = (uint8_t)half(s->accumulator - (just_added ? s->rate : 0));
	if (s->pulse_timer != 0)
		s->pulse_timer = (uint16_t)(s->pulse_timer - clocks);
	if (s->direction_timer != 0)
		s->direction_timer = (uint16_t)(s->direction_timer - clocks);
	s->clock = to;
}

void stepper_advance(struct stepper *s, const struct master_rate *master, int64_t to)
{
	while (s->clock < to) {
		int64_t calm = calm_clocks(s, master);
		if (calm > to - s->clock)
			calm = to - s->clock;
		if (calm > 1) {
			skip(s, master, calm);
			continue;
		}
		single_edge(s, pulses_at(master, s->clock + 1));
		s->clock++;
	}
}

/* The low 16 bits are the hardware's own. */
void stepper_write_accumulator(struct stepper *s, uint32_t value)
{
	s->accumulator = sign_extend((int64_t)((uint64_t)value << 16) | (s->accumulator & 0xFFFF));
}

void stepper_power_up(struct stepper *s)
{
	*s = (struct stepper){.clock = s->clock, .latches = s->latches, .inputs = s->inputs};
}

void stepper_push_table(struct stepper *s, uint32_t word)
{
	for (int i = STEPPER_TABLE - 1; i > 0; i--)
		s->table[i] = s->table[i - 1];
	s->table[0] = word;
}

uint32_t stepper_outputs(const struct stepper *s, int swaps)
{
	static const uint8_t quadrature[4] = {0, 1, 3, 2};
	uint32_t table = s->table[s->table_pointer];
	uint32_t low;
	switch (s->mode & HM2_STEPGEN_MODE_MODE_MASK) {
	case HM2_STEPGEN_MODE_STEP_DIRECTION:
		low = (uint32_t)(s->pulse | s->direction << 1);
		break;
	case HM2_STEPGEN_MODE_UP_DOWN:
		low = s->pulse ? (s->direction ? 2 : 1) : 0;
		break;
	case HM2_STEPGEN_MODE_QUADRATURE:
		low = quadrature[((uint64_t)s->accumulator >> 30) & 3];
		break;
	default:
		low = table & 3;
		break;
	}
	if (swaps && (s->mode & SWAP))
		low = (low >> 1 | low << 1) & 3;
	return (table & ~3u) | low;
}
