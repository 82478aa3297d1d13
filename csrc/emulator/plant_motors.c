/* Motors for the emulated card. */
#include <math.h>

#include "plant.h"

#define TURN (2.0 * 3.14159265358979323846)

/* Armature current by the exact solution over the step at constant speed: no step is too long for a small
 * inductance. An amplifier that is off carries no current. */
static void step_dc_motor(struct hm2_emulator *card, void *machine, double seconds)
{
	hm2_dc_motor *motor = machine;
	if (plant_read(&motor->enable) == 0.0) {
		motor->current = 0.0;
	} else {
		const double volts =
			plant_read(&motor->command) * motor->gain - motor->constant * motor->rotor.speed;
		const double settled = volts / motor->resistance;
		const double decay = exp(-seconds * motor->resistance / motor->inductance);
		motor->current = settled + (motor->current - settled) * decay;
	}
	plant_turn(card, &motor->rotor, motor->constant * motor->current, seconds);
}

/* Torque follows the current and the cosine of the error of the electrical angle. */
static void step_pm_motor(struct hm2_emulator *card, void *machine, double seconds)
{
	hm2_pm_motor *motor = machine;
	double torque = 0.0;
	if (plant_read(&motor->enable) != 0.0) {
		const double electrical = motor->rotor.angle / TURN * motor->pole_pairs;
		const double error = plant_read(&motor->angle) - electrical;
		torque = motor->constant * plant_read(&motor->current) * cos(TURN * error);
	}
	plant_turn(card, &motor->rotor, torque, seconds);
}

int hm2_emulator_add_dc_motor(hm2_emulator *card, hm2_dc_motor *motor, hm2_error *error)
{
	CARD_HOLD(card);
	return plant_add(card, step_dc_motor, motor, error);
}

int hm2_emulator_add_pm_motor(hm2_emulator *card, hm2_pm_motor *motor, hm2_error *error)
{
	CARD_HOLD(card);
	return plant_add(card, step_pm_motor, motor, error);
}
