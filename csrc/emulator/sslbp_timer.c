/* The tick counter of the SSLBP processor: 16 bits, free running, divided down from its clock. */
#include "sslbp_state.h"

static void settle(const struct hm2_sslbp *s, int64_t cycle, int64_t *origin, uint32_t *count, uint32_t *period)
{
	const struct sslbp_timer *timer = &s->timer;
	*origin = timer->origin;
	*count = timer->count;
	*period = timer->period;
	if (cycle < timer->next_origin)
		return;
	*count += (uint32_t)((timer->next_origin - timer->origin) / timer->period);
	*origin = timer->next_origin;
	*period = timer->next_period;
}

uint16_t sslbp_timer_at(const struct hm2_sslbp *s, int64_t cycle)
{
	int64_t origin;
	uint32_t count, period;
	settle(s, cycle, &origin, &count, &period);
	return (uint16_t)(count + (uint32_t)((cycle - origin) / period));
}

int64_t sslbp_timer_reaches(const struct hm2_sslbp *s, int64_t from, uint8_t start, uint8_t ticks)
{
	int64_t origin;
	uint32_t count, period;
	uint8_t elapsed = (uint8_t)(sslbp_timer_at(s, from) - start);
	if (elapsed >= ticks)
		return from;
	settle(s, from, &origin, &count, &period);
	int64_t at = origin + ((from - origin) / period + ticks - elapsed) * period;
	/* A divider that is still to change: look again when it has. */
	if (from < s->timer.next_origin && at > s->timer.next_origin)
		return s->timer.next_origin;
	return at;
}

void sslbp_timer_set_period(struct hm2_sslbp *s, int64_t cycle, uint32_t period)
{
	struct sslbp_timer *timer = &s->timer;
	int64_t origin;
	uint32_t count, old;
	settle(s, cycle, &origin, &count, &old);
	timer->origin = origin;
	timer->count = count;
	timer->period = old;
	timer->next_origin = origin + ((cycle - origin) / old + 1) * old;
	timer->next_period = period;
}
