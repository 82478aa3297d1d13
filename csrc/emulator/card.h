/* The emulated card: a register file with behaviour. Each module of the IDROM is one of these
 * types; a new module is one file with its operations and one row of CARD_MODULE_TYPES in card_modules.h. */
#ifndef HM2_EMULATOR_CARD_H
#define HM2_EMULATOR_CARD_H

#include "hm2.h"
#include "registers.h"
#include "wave.h"

#include <pthread.h>

#define CARD_NEVER INT64_MAX
#define CARD_MAX_MODULES 40
#define CARD_MAX_PINS 144
#define CARD_MAX_PORTS 8
#define CARD_IDROM_WORDS 256
#define CARD_SHARED_UNIT 0x80 /* in a pin's unit: of all instances */
#define CARD_MAX_ENCODERS 128
#define CARD_MUX_DELAY_PS 5000 /* of a daughter card's encoder multiplexer */
#define CARD_ALL_DRIVEN 0xFFFFFFFFu

struct card_descriptor {
	uint8_t gtag;
	uint8_t version;
	uint8_t clock_tag; /* 1 ClockLow, 2 ClockHigh */
	uint8_t instances;
	uint8_t registers;
	uint16_t base;
	uint32_t instance_stride;
	uint32_t multiple; /* bit r: register r exists once per instance */
};

struct card_pin {
	uint8_t tag;
	uint8_t unit; /* bit 7: shared by all units */
	uint8_t number;
};

/* Clocks are counted in rising edges of ClockLow. A module's state after advance(n) is its state
 * just behind edge n; a write acts as taken by the edge last advanced to. */
struct card_module_type {
	void *(*create)(struct hm2_emulator *card, const struct card_descriptor *descriptor);
	void (*destroy)(void *self);
	/* Returns the bits that are driven; the others are left 0 in *value. offset: 0..0xFC */
	uint32_t (*read)(void *self, int reg, uint32_t offset, uint32_t *value);
	/* Returns 0 when nothing decodes it. */
	int (*write)(void *self, int reg, uint32_t offset, uint32_t value);
	/* The rest may be NULL. */
	void (*advance)(void *self, int64_t clock);
	int64_t (*next_event)(void *self); /* clock of the next thing other modules notice */
	void (*fire)(void *self);          /* that clock has come, everybody is up to it */
	int (*output)(void *self, int unit, int number); /* what it presents to the pin's driver */
	/* What hangs on one of its input pins from outside; 0: nothing drives it. */
	int (*outside)(void *self, int unit, int number, int *level);
	void (*pins_changed)(void *self);  /* a pin's driver or an outside level changed */
	/* The FPGA was configured anew: registers as at a power-up. What hangs on the pins stays. */
	void (*power_up)(void *self);
	int extra_registers; /* decoded behind those the descriptor counts */
};

struct card_module {
	const struct card_module_type *type;
	void *self;
	struct card_descriptor descriptor;
	uint64_t advanced; /* the card's epoch in which it was brought up to date */
};

struct card_page {
	uint8_t module; /* 0: nobody, else index + 1 */
	uint8_t reg;
};

struct ioport;

struct hm2_emulator {
	pthread_mutex_t lock; /* recursive: a driver's thread and whoever steers the card take turns */
	int64_t now_ps;
	int64_t clock;
	int64_t settled_ps; /* the time every module has been advanced to */
	uint64_t epoch;     /* counts whatever may make a module that was up to date fall behind */
	int64_t period_ps;
	int64_t high_period_ps;
	int64_t real_origin_ns;
	struct hm2_emulator_options options;
	uint32_t idrom[CARD_IDROM_WORDS];
	uint32_t configured_idrom[CARD_IDROM_WORDS]; /* as the firmware has it */
	int idrom_writable;
	int port_width;
	int ports;
	int pin_count;
	struct card_pin pins[CARD_MAX_PINS];
	int module_count;
	struct card_module modules[CARD_MAX_MODULES];
	struct card_page pages[256];
	struct ioport *ioport;
	uint32_t led_latch;
	int wave_count;
	struct wave waves[CARD_MAX_ENCODERS]; /* what the encoders put on their lines */
	int64_t mux_delay_ps;
};

/* card_types.c */
const struct card_module_type *card_module_type(uint8_t gtag);

/* card_time.c */
/* The card is this thread's until the end of the block. */
pthread_mutex_t *card_lock(const struct hm2_emulator *card);
void card_unlock(pthread_mutex_t **lock);
#define CARD_HOLD(card) __attribute__((cleanup(card_unlock), unused)) pthread_mutex_t *held = card_lock(card)

int64_t card_edge_ps(const struct hm2_emulator *card, int64_t clock);
int64_t card_clock_at(const struct hm2_emulator *card, int64_t ps);
void card_advance_to(struct hm2_emulator *card, int64_t ps);
int64_t card_time_ps(struct hm2_emulator *card); /* what the time is; nothing catches up */
void card_touch(struct hm2_emulator *card); /* an access: a real clock catches up */
void card_sleep_ns(int64_t ns);
void card_settle(struct hm2_emulator *card); /* every module up to card->clock */
void card_pins_changed(struct hm2_emulator *card);

/* card_identity.c: ID block, IDROM, LED; the pages that no descriptor names */
int card_identity_load(struct hm2_emulator *card, const uint32_t *idrom, size_t words, hm2_error *error);
uint32_t card_identity_read(struct hm2_emulator *card, uint32_t address, uint32_t *value);
int card_identity_write(struct hm2_emulator *card, uint32_t address, uint32_t value);
uint32_t card_idrom_field(const struct hm2_emulator *card, uint32_t offset);
void card_identity_power_up(struct hm2_emulator *card);

/* card.c */
/* A part without registers that lives in the card's time: only advance, next_event, fire and destroy. */
int card_add_part(struct hm2_emulator *card, const struct card_module_type *type, void *self);
int card_has(const struct hm2_emulator *card, uint8_t gtag); /* a descriptor names it */
int card_samples_by_timer(const struct hm2_emulator *card);  /* counters can be latched at a DPLL timer */
/* Words at the time last touched: what a list of transfers does is done at one time. */
int card_read_words(struct hm2_emulator *card, uint32_t address, uint32_t *words, size_t count, hm2_error *error);
int card_write_words(struct hm2_emulator *card, uint32_t address, const uint32_t *words, size_t count,
                     hm2_error *error);
struct card_module *card_find(struct hm2_emulator *card, uint8_t gtag);
/* The FPGA is configured anew. */
void card_power_up(struct hm2_emulator *card);

#endif
