/* The memory spaces and their information areas. Fact sheet lbp16.md 4, 5. */
#include "ethernet.h"

#include <string.h>

struct space {
	char name[9];
	uint16_t sizes;  /* writable, type, allowed widths */
	uint16_t ranges; /* erase block, page, address bits */
	uint16_t limit;  /* first byte address past the end; 0: the space checks for itself */
};

static const struct space spaces[8] = {
	{"HostMot2", 0x8104, 0x0010, 0},
	{"KSZ8851", 0x8102, 0x0008, 0x100},
	{"EtherEEP", 0x8E02, 0x0007, HM2_LBP16_EEPROM_SIZE},
	{"FPGAFlsh", 0x8F04, 0x8200, 0},
	{"Timers", 0x8202, 0x0004, HM2_LBP16_TIMER_SIZE},
	{"", 0, 0, 0},
	{"LBP16RW", 0x8202, 0x0004, HM2_LBP16_CONTROL_SIZE},
	{"LBP16RO", 0x0202, 0x0004, HM2_LBP16_BOARD_SIZE},
};

static int out_of_range(int space, uint16_t address)
{
	return spaces[space].limit && address >= spaces[space].limit;
}

/* Space 0 never comes here: see run_registers. */
int ethernet_space_read(struct hm2_ethernet *ethernet, int space, uint16_t address, uint32_t *value)
{
	if (out_of_range(space, address))
		return HM2_LBP16_ERROR_MEMORY;
	*value = 0;
	switch (space) {
	case 1: return 0; /* the network chip's own registers */
	case 2: *value = ethernet->eeprom[address / 2]; return 0;
	case 3: return ethernet_flash_access_read(ethernet, address, value);
	case 4: return ethernet_timer_read(ethernet, address, value);
	case 6: return ethernet_status_read(ethernet, address, value);
	case 7: *value = ethernet->information[address / 2]; return 0;
	default: return HM2_LBP16_ERROR_PARSE;
	}
}

int ethernet_space_write(struct hm2_ethernet *ethernet, int space, uint16_t address, uint32_t value)
{
	if (space == 7)
		return HM2_LBP16_ERROR_WRITE;
	if (out_of_range(space, address))
		return HM2_LBP16_ERROR_MEMORY;
	switch (space) {
	case 1: return 0;
	case 2: return ethernet_eeprom_write(ethernet, address, (uint16_t)value);
	case 3: return ethernet_flash_access_write(ethernet, address, value);
	case 4: return ethernet_timer_write(ethernet, address, value);
	case 6: return ethernet_status_write(ethernet, address, value);
	default: return HM2_LBP16_ERROR_PARSE;
	}
}

int ethernet_info_read(struct hm2_ethernet *ethernet, int space, uint16_t address, uint32_t *value)
{
	const struct space *facts = &spaces[space];
	char name[8] = {0};

	if (address >= HM2_LBP16_INFO_SIZE)
		return HM2_LBP16_ERROR_MEMORY;
	switch (address / 2) {
	case 0: *value = 0x5A00u + (unsigned)space; return 0;
	case 1: *value = facts->sizes; return 0;
	case 2:
		/* the signature counts bits, so the range does too */
		*value = facts->ranges | (space == 3 ? ethernet->config.flash_id + 4u : 0u);
		return 0;
	case 3: *value = ethernet->pointer[space]; return 0;
	default:
		memcpy(name, facts->name, strnlen(facts->name, sizeof name));
		address = (uint16_t)((address & ~1u) - 8);
		*value = (uint32_t)((uint8_t)name[address] | (uint8_t)name[address + 1] << 8);
		return 0;
	}
}

static uint16_t *word(struct hm2_ethernet *ethernet, int space, uint32_t address)
{
	if (space < 0 || space > 7 || !spaces[space].limit || address >= spaces[space].limit)
		return NULL;
	switch (space) {
	case 2: return &ethernet->eeprom[address / 2];
	case 4: return &ethernet->timers[address / 2];
	case 6: return &ethernet->status[address / 2];
	case 7: return &ethernet->information[address / 2];
	default: return NULL;
	}
}

uint16_t hm2_ethernet_peek(struct hm2_ethernet *ethernet, int space, uint32_t address)
{
	const uint16_t *place = word(ethernet, space, address);
	uint16_t value;

	pthread_mutex_lock(&ethernet->mutex);
	value = place ? *place : 0;
	pthread_mutex_unlock(&ethernet->mutex);
	return value;
}

void hm2_ethernet_poke(struct hm2_ethernet *ethernet, int space, uint32_t address, uint16_t value)
{
	uint16_t *place = word(ethernet, space, address);

	pthread_mutex_lock(&ethernet->mutex);
	if (place)
		*place = value;
	pthread_mutex_unlock(&ethernet->mutex);
}
