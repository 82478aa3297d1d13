/* The firmware's time: main loop passes, and the spans of them in which nothing can change. */
#include "sslbp_state.h"

#define INSTANT_PASSES 4096

static void show_posts(struct hm2_sslbp *s, int64_t until)
{
	unsigned kept = 0;
	for (unsigned i = 0; i < s->post_count; i++) {
		const struct sslbp_post *post = &s->posts[i];
		if (post->at <= until)
			s->shown[post->channel][post->reg] = post->value;
		else
			s->posts[kept++] = *post;
	}
	s->post_count = kept;
}

/* Whole passes that change nothing end at once. */
static void skip_quiet_passes(struct hm2_sslbp *s, int64_t until)
{
	int64_t quiet = until;
	int64_t pass = COST_PASS + sslbp_command_quiet(s);
	if (s->doorbell || pass < COST_PASS)
		return;
	for (int c = 0; c < s->channels && quiet > s->cpu; c++)
		pass += sslbp_channel_quiet(s, c, s->cpu, &quiet);
	if (quiet > s->cpu + pass) {
		s->skipped = (quiet - s->cpu) / pass * pass - pass;
		s->cpu += s->skipped;
	}
}

/* In ticks, as the firmware keeps it; skipped passes are like the one before them. */
static void note_loop_time(struct hm2_sslbp *s)
{
	int64_t pass = s->cpu - s->top - s->skipped;
	s->ram[HM2_SSLBP_LOCAL_LOOP_TIME] =
		(uint8_t)(sslbp_timer_at(s, s->cpu) - sslbp_timer_at(s, s->cpu - (pass > 0 ? pass : 0)));
	s->top = s->cpu;
	s->skipped = 0;
}

static void init(struct hm2_sslbp *s)
{
	s->result = HM2_SSLBP_RESULT_STOPPED_ALL;
	s->place = PLACE_TOP;
	s->cpu += COST_INIT - COST_RESET_DATA + s->channels * COST_INIT_PER_CHANNEL;
	sslbp_global_init(s);
}

/* What follows a reset, up to the main loop. */
static void step_reset(struct hm2_sslbp *s)
{
	switch (s->place) {
	case PLACE_RESET:
		sslbp_ram_reset(s);
		s->place = PLACE_CLEAR;
		s->cpu += COST_RESET_TO_CLEAR;
		break;
	case PLACE_CLEAR:
		s->command = 0;
		s->place = PLACE_FORGET;
		s->cpu += COST_RESET_DOORBELL;
		break;
	case PLACE_FORGET:
		s->doorbell = 0;
		s->place = PLACE_INIT;
		s->cpu += COST_RESET_DATA;
		break;
	case PLACE_INIT:
		init(s);
		break;
	default: /* held */
		break;
	}
}

static void step(struct hm2_sslbp *s)
{
	switch (s->place) {
	case PLACE_TOP:
		note_loop_time(s);
		s->cpu += sslbp_command_complete(s);
		break;
	case PLACE_DOORBELL:
		s->cpu += sslbp_command_begin(s);
		break;
	case PLACE_EXECUTE:
		s->cpu += sslbp_command_execute(s);
		break;
	case PLACE_CHANNEL:
		show_posts(s, NEVER);
		s->cpu += sslbp_channel_turn(s, s->turn);
		if (++s->turn == s->channels) {
			s->place = PLACE_TOP;
			s->cpu += COST_TO_COMPLETE;
		}
		break;
	default:
		step_reset(s);
		break;
	}
}

void sslbp_run(struct hm2_sslbp *s, int64_t until)
{
	while (s->cpu <= until && s->place != PLACE_HELD) {
		if (s->place == PLACE_TOP)
			skip_quiet_passes(s, until);
		step(s);
	}
	show_posts(s, until);
	for (int c = 0; c < s->channels; c++)
		sslbp_uart_run(s, c, until);
	s->now = until;
}

static int settled(const struct hm2_sslbp *s)
{
	return s->place == PLACE_TOP && !s->doorbell && s->command == 0 &&
	       !(s->ram[HM2_SSLBP_LOCAL_STOP_MASK] & sslbp_existing(s));
}

/* Wire off: no time passes. What never ends is given up after so many passes and goes on later. */
void sslbp_run_instantly(struct hm2_sslbp *s)
{
	int turns = INSTANT_PASSES * (s->channels + 1);
	while (turns-- > 0 && s->place != PLACE_HELD && !settled(s))
		step(s);
	show_posts(s, NEVER);
	s->cpu = s->now;
}
