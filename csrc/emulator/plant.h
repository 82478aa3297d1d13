/* Machines coupled to the emulated card: what all of them share. */
#ifndef HM2_EMULATOR_PLANT_H
#define HM2_EMULATOR_PLANT_H

#include "card.h"

double plant_read(const hm2_plant_signal *signal);
void plant_write_bit(const hm2_plant_signal *signal, int on);
/* One step of the rotor under `torque`, and what the card then sees of it. */
void plant_turn(struct hm2_emulator *card, hm2_plant_rotor *rotor, double torque, double seconds);

/* A machine's place in the card's time. */
int plant_add(struct hm2_emulator *card, void (*step)(struct hm2_emulator *card, void *machine, double seconds),
              void *machine, hm2_error *error);

#endif
