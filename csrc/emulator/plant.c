/* Machines coupled to the emulated card: signals, the rotor, and their place in the card's time. */
#include <math.h>
#include <stdlib.h>

#include "plant.h"

#define RATE_ONE 1048576.0 /* encoder rates are in 2^-20 counts per second */
#define TURN (2.0 * 3.14159265358979323846)
#define RAM_SPACE 0
#define MAX_RATE 2e7 /* counts per second: more is no encoder */

struct plant {
	struct hm2_emulator *card;
	void (*step)(struct hm2_emulator *card, void *machine, double seconds);
	void *machine;
	int64_t next_clock;
	int64_t period; /* clocks */
};

static uint32_t raw_value(const hm2_plant_signal *signal)
{
	uint8_t bytes[4] = {0};
	hm2_remote_peek(signal->remote, RAM_SPACE, signal->address, bytes, (size_t)(signal->bits + 7) / 8);
	const uint32_t word =
		(uint32_t)bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
	return signal->bits < 32 ? word & ((1u << signal->bits) - 1u) : word;
}

double plant_read(const hm2_plant_signal *signal)
{
	if (!signal->remote)
		return 0.0;
	const uint32_t raw = raw_value(signal);
	if (signal->bit >= 0)
		return (double)(raw >> signal->bit & 1u);
	if (signal->is_signed && raw >> (signal->bits - 1) & 1u)
		return ((double)raw - ldexp(1.0, signal->bits)) * signal->scale;
	return (double)raw * signal->scale;
}

void plant_write_bit(const hm2_plant_signal *signal, int on)
{
	if (!signal->remote || signal->bit < 0)
		return;
	const uint32_t address = signal->address + (uint32_t)signal->bit / 8;
	const uint8_t mask = (uint8_t)(1u << signal->bit % 8);
	uint8_t byte = 0;
	hm2_remote_peek(signal->remote, RAM_SPACE, address, &byte, 1);
	const uint8_t wanted = (uint8_t)(on ? byte | mask : byte & ~mask);
	if (wanted != byte)
		hm2_remote_poke(signal->remote, RAM_SPACE, address, &wanted, 1);
}

/* Drag holds a resting rotor against less than itself, and brings a moving one to rest, never beyond. */
static double dragged(double speed, double other_torque, const hm2_plant_rotor *rotor, double seconds)
{
	const double change = rotor->drag / rotor->inertia * seconds;
	const double free_speed = speed + other_torque / rotor->inertia * seconds;
	return fabs(free_speed) <= change ? 0.0 : free_speed - copysign(change, free_speed);
}

/* Where the encoder is by now, fractions of a count included. */
static double encoder_position(const struct wave *wave, int64_t now)
{
	if (wave->span.mode != WAVE_RATE)
		return (double)wave_position(wave, now);
	const double moved = (double)wave->span.rate * (double)(now - wave->span.start_ps) + (double)wave->span.fraction;
	return (double)wave->span.position + moved / (RATE_ONE * 1e12);
}

/* Aims at where the rotor is, so that encoder and rotor never drift apart. */
static void drive_encoder(struct hm2_emulator *card, const hm2_plant_rotor *rotor, double seconds)
{
	struct wave *wave = &card->waves[rotor->encoder];
	const double behind = rotor->angle / TURN * rotor->counts_per_turn - encoder_position(wave, card->now_ps);
	const double rate = fmax(-MAX_RATE, fmin(MAX_RATE, behind / seconds));
	const int64_t wanted = llround(rate * RATE_ONE);
	if (wave->span.mode == WAVE_RATE && wave->span.rate == wanted)
		return;
	wave_rate(wave, card->now_ps, wanted);
	wave->plugged = 1;
	card_pins_changed(card);
}

void plant_turn(struct hm2_emulator *card, hm2_plant_rotor *rotor, double torque, double seconds)
{
	rotor->torque = torque;
	rotor->speed = dragged(rotor->speed, torque + rotor->load, rotor, seconds);
	rotor->speed /= 1.0 + rotor->friction / rotor->inertia * seconds; /* implicit: stable however stiff */
	rotor->angle += rotor->speed * seconds;
	if (rotor->encoder >= 0 && rotor->encoder < card->wave_count)
		drive_encoder(card, rotor, seconds);
	if (rotor->low_limit <= rotor->high_limit) {
		plant_write_bit(&rotor->low_switch, rotor->angle / TURN <= rotor->low_limit);
		plant_write_bit(&rotor->high_switch, rotor->angle / TURN >= rotor->high_limit);
	}
}

static int64_t plant_next(void *self)
{
	return ((struct plant *)self)->next_clock;
}

static void plant_fire(void *self)
{
	struct plant *plant = self;
	plant->next_clock += plant->period;
	plant->step(plant->card, plant->machine, (double)(plant->period * plant->card->period_ps) * 1e-12);
}

static const struct card_module_type plant_type = {
	.next_event = plant_next,
	.fire = plant_fire,
	.destroy = free,
};

static int fail(hm2_error *error, int status)
{
	if (error)
		*error = (hm2_error){.status = status, .index = -1, .where = "plant"};
	return status;
}

int plant_add(struct hm2_emulator *card, void (*step)(struct hm2_emulator *card, void *machine, double seconds),
              void *machine, hm2_error *error)
{
	struct plant *plant = calloc(1, sizeof *plant);
	if (!plant)
		return fail(error, HM2_ERR_NO_MEMORY);
	hm2_emulator_sync(card);
	plant->card = card;
	plant->step = step;
	plant->machine = machine;
	plant->period = HM2_PLANT_STEP_PS / card->period_ps;
	plant->next_clock = card->clock + plant->period;
	const int status = card_add_part(card, &plant_type, plant);
	if (status == HM2_OK)
		return HM2_OK;
	free(plant);
	return fail(error, status);
}
