/* The FPGA's configuration flash behind space 3: a NOR part on a serial bus whose page program is
 * only started by the next access to something else. Fact sheet lbp16.md 5, 6. */
#include "ethernet.h"

#include <stdlib.h>
#include <string.h>

#define SECTOR 0x10000u
#define PAGE 0x100u
#define ERASE_LIMIT_US 3000000u /* so long the engine asks the part whether it is done */
#define SYNC_SEARCH 64 /* a configuration stream's sync word comes within its first bytes */

int ethernet_flash_init(struct ethernet_flash *flash, uint8_t id)
{
	if (id < 0x10 || id > 0x18)
		return 0;
	flash->size = 1u << (id + 1); /* the signature is log2 of the size in bits, less 4 */
	flash->bytes = malloc(flash->size);
	if (!flash->bytes)
		return 0;
	memset(flash->bytes, 0xFF, flash->size);
	return 1;
}

void ethernet_flash_idle(struct ethernet_flash *flash)
{
	flash->address = 0;
	flash->stream = FLASH_IDLE;
}

/* Chip select goes up: a program that was clocked in happens now. Programming only clears bits. */
static void finish_stream(struct ethernet_flash *flash)
{
	if (flash->stream == FLASH_PROGRAMMING) {
		for (unsigned i = 0; i < PAGE; i++) {
			if (flash->loaded[i])
				flash->bytes[flash->page_start + i] &= flash->page[i];
		}
	}
	flash->stream = FLASH_IDLE;
}

static void start_program(struct ethernet_flash *flash)
{
	finish_stream(flash);
	memset(flash->loaded, 0, sizeof flash->loaded);
	flash->page_start = flash->address & (flash->size - 1) & ~(PAGE - 1);
	flash->stream = FLASH_PROGRAMMING;
}

/* The four bytes go to the page in order and wrap at its end, as the part's buffer does. */
static void program(struct ethernet_flash *flash, uint32_t value)
{
	if (flash->stream != FLASH_PROGRAMMING)
		start_program(flash);
	for (unsigned i = 0; i < 4; i++) {
		const unsigned place = (flash->address + i) & (PAGE - 1);

		flash->page[place] = (uint8_t)(value >> 8 * i);
		flash->loaded[place] = 1;
	}
	flash->address = (flash->address + 4) & 0xFFFFFF;
}

static uint32_t stream_read(struct ethernet_flash *flash)
{
	uint32_t value = 0;

	if (flash->stream == FLASH_PROGRAMMING)
		return 0xFFFFFFFF; /* the part is listening, not talking */
	flash->stream = FLASH_READING;
	for (unsigned i = 0; i < 4; i++)
		value |= (uint32_t)flash->bytes[(flash->address + i) & (flash->size - 1)] << 8 * i;
	flash->address = (flash->address + 4) & 0xFFFFFF;
	return value;
}

static int erase(struct hm2_ethernet *ethernet)
{
	const uint32_t time_us = ethernet->config.erase_us;
	struct ethernet_flash *flash = &ethernet->flash;

	finish_stream(flash);
	memset(flash->bytes + (flash->address & (flash->size - 1) & ~(SECTOR - 1)), 0xFF, SECTOR);
	if (time_us)
		ethernet_wait_us(ethernet, time_us < ERASE_LIMIT_US ? time_us : ERASE_LIMIT_US);
	return time_us > ERASE_LIMIT_US ? HM2_LBP16_ERROR_WRITE : 0;
}

int ethernet_flash_access_read(struct hm2_ethernet *ethernet, uint16_t address, uint32_t *value)
{
	struct ethernet_flash *flash = &ethernet->flash;

	switch (address) {
	case HM2_LBP16_FLASH_ADDRESS:
		finish_stream(flash);
		*value = flash->address;
		return 0;
	case HM2_LBP16_FLASH_DATA:
		*value = stream_read(flash);
		return 0;
	case HM2_LBP16_FLASH_ID:
		finish_stream(flash);
		*value = ethernet->config.flash_id;
		return 0;
	default:
		return HM2_LBP16_ERROR_MEMORY;
	}
}

int ethernet_flash_access_write(struct hm2_ethernet *ethernet, uint16_t address, uint32_t value)
{
	struct ethernet_flash *flash = &ethernet->flash;
	const int unlocked = ethernet->status[STATUS_KEY] == HM2_LBP16_KEY_FLASH;

	switch (address) {
	case HM2_LBP16_FLASH_ADDRESS:
		finish_stream(flash);
		flash->address = value & 0xFFFFFF;
		return 0;
	case HM2_LBP16_FLASH_DATA:
	case HM2_LBP16_FLASH_ERASE:
		if (!unlocked)
			return HM2_LBP16_ERROR_WRITE;
		if (address == HM2_LBP16_FLASH_ERASE)
			return erase(ethernet);
		program(flash, value);
		return 0;
	case HM2_LBP16_FLASH_ID:
		return HM2_LBP16_ERROR_WRITE;
	default:
		return HM2_LBP16_ERROR_MEMORY;
	}
}

static uint32_t big_endian16(const uint8_t *bytes)
{
	return (uint32_t)(bytes[0] << 8 | bytes[1]);
}

static int has_image(const struct hm2_ethernet *ethernet, uint32_t address)
{
	static const uint8_t sync[4] = {0xAA, 0x99, 0x55, 0x66};
	const struct ethernet_flash *flash = &ethernet->flash;

	if (address > flash->size - SYNC_SEARCH)
		return 0;
	if (ethernet->config.efinix)
		return flash->bytes[address] != 0xFF;
	for (uint32_t i = 0; i + sizeof sync <= SYNC_SEARCH; i++) {
		if (memcmp(flash->bytes + address + i, sync, sizeof sync) == 0)
			return 1;
	}
	return 0;
}

/* The value a boot block writes to a configuration register, or -1. */
static int64_t boot_register(const struct ethernet_flash *flash, uint32_t header)
{
	for (uint32_t i = 14; i + 4 <= SYNC_SEARCH; i += 4) {
		if (big_endian16(flash->bytes + i) == header)
			return big_endian16(flash->bytes + i + 2);
	}
	return -1;
}

int ethernet_flash_boot(const struct hm2_ethernet *ethernet, uint32_t address)
{
	const struct ethernet_flash *flash = &ethernet->flash;
	const int64_t high = boot_register(flash, 0x3281);
	const int64_t low = boot_register(flash, 0x3261);

	if (ethernet->config.efinix) {
		if (address && has_image(ethernet, flash->size / 2))
			return HM2_ETHERNET_IMAGE_USER;
		return has_image(ethernet, 0) ? HM2_ETHERNET_IMAGE_FALLBACK : HM2_ETHERNET_IMAGE_NONE;
	}
	if (address == 0 && high >= 0 && low >= 0 && has_image(ethernet, 0)) {
		if (has_image(ethernet, (uint32_t)(high & 0xFF) << 16 | (uint32_t)low))
			return HM2_ETHERNET_IMAGE_USER;
		address = SECTOR;
	}
	if (address == 0 || !has_image(ethernet, address))
		return HM2_ETHERNET_IMAGE_NONE;
	return address == SECTOR ? HM2_ETHERNET_IMAGE_FALLBACK : HM2_ETHERNET_IMAGE_USER;
}

uint32_t hm2_ethernet_flash_size(struct hm2_ethernet *ethernet)
{
	return ethernet->flash.size;
}

static int flash_span(const struct hm2_ethernet *ethernet, uint32_t address, size_t count)
{
	return address <= ethernet->flash.size && count <= ethernet->flash.size - address;
}

int hm2_ethernet_flash_read(struct hm2_ethernet *ethernet, uint32_t address, uint8_t *bytes, size_t count)
{
	if (!flash_span(ethernet, address, count))
		return HM2_ERR_RANGE;
	pthread_mutex_lock(&ethernet->mutex);
	memcpy(bytes, ethernet->flash.bytes + address, count);
	pthread_mutex_unlock(&ethernet->mutex);
	return HM2_OK;
}

int hm2_ethernet_flash_write(struct hm2_ethernet *ethernet, uint32_t address, const uint8_t *bytes, size_t count)
{
	if (!flash_span(ethernet, address, count))
		return HM2_ERR_RANGE;
	pthread_mutex_lock(&ethernet->mutex);
	memcpy(ethernet->flash.bytes + address, bytes, count);
	pthread_mutex_unlock(&ethernet->mutex);
	return HM2_OK;
}

int hm2_ethernet_image(struct hm2_ethernet *ethernet)
{
	int image;

	pthread_mutex_lock(&ethernet->mutex);
	image = ethernet->image;
	pthread_mutex_unlock(&ethernet->mutex);
	return image;
}
