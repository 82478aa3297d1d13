/* A remote's memory: RAM, EEPROM, the RPC table, and what the line may touch of them. */
#include "remote_state.h"

#include <string.h>

#define STAND_IN_EEPROM 0x400 /* where a stand-in without an EEPROM shows space 1 */

/* The bytes address..address+length-1 of a space, NULL if any of them does not exist. */
static uint8_t *locate(hm2_remote *remote, int space, uint32_t address, size_t length)
{
	uint8_t *base = remote->ram;
	size_t size = RAM_SIZE;

	if (space == HM2_LBP_SPACE_EEPROM && remote->eeprom_size) {
		base = remote->eeprom;
		size = remote->eeprom_size;
	} else if (space == HM2_LBP_SPACE_EEPROM) {
		base += STAND_IN_EEPROM;
		size -= STAND_IN_EEPROM;
	} else if (space == HM2_LBP_SPACE_FLASH && remote->flash.bytes) {
		base = remote->flash.bytes;
		size = remote->flash.size;
	} else if (space != HM2_LBP_SPACE_RAM) {
		return NULL;
	}
	return address > size || length > size - address ? NULL : base + address;
}

static int allowed(const hm2_remote *remote, int space, uint16_t address, size_t length, int write)
{
	int limited = 0;

	for (size_t i = 0; i < remote->range_count; i++) {
		const remote_range *range = &remote->ranges[i];

		if (range->space != space)
			continue;
		limited = 1;
		if (address >= range->first && address + length - 1 <= range->last && (range->writable || !write))
			return 1;
	}
	return !limited;
}

static uint8_t *reachable(hm2_remote *remote, uint16_t address, size_t length, int write)
{
	int space = (int)remote->knob[HM2_REMOTE_SPACE];

	if (remote->locals[HM2_LBP_LOCAL_RPC_MEMORY_ACCESS])
		return address + length > RPC_TABLE_SIZE ? NULL : remote->rpc_table + address;
	return allowed(remote, space, address, length, write) ? locate(remote, space, address, length) : NULL;
}

static int in_flash_window(const hm2_remote *remote)
{
	return remote->knob[HM2_REMOTE_SPACE] == HM2_LBP_SPACE_FLASH && !remote->locals[HM2_LBP_LOCAL_RPC_MEMORY_ACCESS];
}

int remote_read(hm2_remote *remote, uint16_t address, uint8_t *bytes, size_t length)
{
	const uint8_t *memory;

	if (in_flash_window(remote))
		return remote_flash_read(remote, address, bytes, length);
	memory = reachable(remote, address, length, 0);
	if (!memory)
		return -1;
	if (remote->knob[HM2_REMOTE_SPACE] == HM2_LBP_SPACE_RAM) {
		remote_images_to_ram(remote);
		remote_8i20_before_read(remote, address, length);
	}
	memcpy(bytes, memory, length);
	return 0;
}

static void log_write(hm2_remote *remote, uint16_t address, const uint8_t *bytes, size_t length)
{
	hm2_remote_write *entry = &remote->writes[remote->write_count++ % HM2_REMOTE_WRITES_KEPT];

	*entry = (hm2_remote_write){
		.time_ps = remote->now_ps,
		.address = address,
		.space = (uint8_t)remote->knob[HM2_REMOTE_SPACE],
		.size = (uint8_t)length,
	};
	memcpy(entry->data, bytes, length);
}

/* Where the fault byte can be seen in RAM it can be written there, but for an illegal mode. */
static void take_faults(hm2_remote *remote, uint16_t address, size_t length)
{
	int64_t place = remote->knob[HM2_REMOTE_FAULT_ADDRESS];

	if (place < address || place >= (int64_t)(address + length))
		return;
	if (remote->knob[HM2_REMOTE_FAULT_CLEARS])
		remote->knob[HM2_REMOTE_FAULT] = remote->ram[place];
	if (remote->illegal_mode)
		remote->knob[HM2_REMOTE_FAULT] |= HM2_REMOTE_FAULT_ILLEGAL_MODE;
	remote_show_faults(remote);
}

int remote_write(hm2_remote *remote, uint16_t address, const uint8_t *bytes, size_t length)
{
	uint8_t *memory;

	if (in_flash_window(remote)) {
		if (remote_flash_write(remote, address, bytes, length))
			return -1;
		log_write(remote, address, bytes, length);
		return 0;
	}
	memory = reachable(remote, address, length, 1);
	if (!memory)
		return -1;
	log_write(remote, address, bytes, length);
	if (remote->knob[HM2_REMOTE_SPACE] == HM2_LBP_SPACE_RAM && !remote->locals[HM2_LBP_LOCAL_RPC_MEMORY_ACCESS]) {
		remote_images_to_ram(remote);
		memcpy(memory, bytes, length);
		remote_ram_to_images(remote, address, length);
		take_faults(remote, address, length);
		remote_8i20_after_write(remote, address, length);
	} else {
		memcpy(memory, bytes, length);
	}
	return 0;
}

int hm2_remote_peek(hm2_remote *remote, int space, uint32_t address, uint8_t *bytes, size_t length)
{
	const uint8_t *memory = locate(remote, space, address, length);

	if (!memory)
		return HM2_ERR_RANGE;
	if (space == HM2_LBP_SPACE_RAM)
		remote_images_to_ram(remote);
	memcpy(bytes, memory, length);
	return HM2_OK;
}

int hm2_remote_poke(hm2_remote *remote, int space, uint32_t address, const uint8_t *bytes, size_t length)
{
	uint8_t *memory = locate(remote, space, address, length);

	if (!memory)
		return HM2_ERR_RANGE;
	if (space == HM2_LBP_SPACE_RAM)
		remote_images_to_ram(remote);
	memcpy(memory, bytes, length);
	if (space == HM2_LBP_SPACE_RAM) {
		remote_ram_to_images(remote, address, length);
		remote_8i20_supervise(remote);
	}
	return HM2_OK;
}

int hm2_remote_load(hm2_remote *remote, uint32_t address, const uint8_t *bytes, size_t length)
{
	int status = hm2_remote_poke(remote, HM2_LBP_SPACE_RAM, address, bytes, length);

	if (status == HM2_OK)
		memcpy(remote->power_on_ram + address, bytes, length);
	return status;
}

int hm2_remote_allow(hm2_remote *remote, int space, uint16_t first, uint16_t last, int writable)
{
	if (remote->range_count == RANGES_MAX || first > last || space < 0 || space > UINT8_MAX)
		return HM2_ERR_RANGE;
	remote->ranges[remote->range_count++] = (remote_range){
		.first = first, .last = last, .space = (uint8_t)space, .writable = writable != 0
	};
	return HM2_OK;
}

int hm2_remote_add_eeprom(hm2_remote *remote, size_t size)
{
	if (size == 0 || size > HM2_REMOTE_EEPROM_MAX)
		return HM2_ERR_RANGE;
	remote->eeprom_size = size;
	return HM2_OK;
}

int hm2_remote_add_copy(hm2_remote *remote, uint16_t eeprom_address, uint16_t ram_address, uint16_t size)
{
	if (remote->copy_count == COPIES_MAX)
		return HM2_ERR_RANGE;
	if (eeprom_address + size > remote->eeprom_size || ram_address + size > RAM_SIZE)
		return HM2_ERR_RANGE;
	remote->copies[remote->copy_count++] =
		(remote_copy){ .from = eeprom_address, .to = ram_address, .size = size };
	return HM2_OK;
}
