/* A remote's flash behind memory space 2 (sserial.md 7.4, lbp_serial.md 7): a window of one write block, the
 * offset it goes to, and a commit code. */
#include "remote_state.h"

#include <stdlib.h>
#include <string.h>

enum {
	WINDOW_OFFSET = 0x8000, /* long: place in the flash */
	WINDOW_ERASE = 0x8004,  /* byte: log2 of the erase block */
	WINDOW_WRITE = 0x8005,  /* byte: log2 of the write block */
	WINDOW_COMMIT = 0x8007,
	COMMIT_WRITE = 0xFD,
	COMMIT_ERASE = 0xFE,
	ERASED = 0xFF
};

#define LOG2_WRITE_MAX 12
#define LOG2_ERASE_MAX 20

int hm2_remote_add_flash(hm2_remote *remote, size_t size, int log2_erase, int log2_write)
{
	remote_flash *flash = &remote->flash;

	if (log2_write < 0 || log2_write > LOG2_WRITE_MAX || log2_erase < log2_write || log2_erase > LOG2_ERASE_MAX)
		return HM2_ERR_RANGE;
	if (size == 0 || size > HM2_REMOTE_FLASH_MAX || size & (((size_t)1 << log2_erase) - 1) || flash->bytes)
		return HM2_ERR_RANGE;
	flash->bytes = malloc(size);
	if (!flash->bytes)
		return HM2_ERR_NO_MEMORY;
	memset(flash->bytes, ERASED, size);
	flash->size = size;
	flash->log2_erase = (uint8_t)log2_erase;
	flash->log2_write = (uint8_t)log2_write;
	return HM2_OK;
}

static size_t write_size(const remote_flash *flash)
{
	return (size_t)1 << flash->log2_write;
}

int remote_flash_read(hm2_remote *remote, uint16_t address, uint8_t *bytes, size_t length)
{
	const remote_flash *flash = &remote->flash;
	const uint8_t registers[] = { (uint8_t)flash->offset,         (uint8_t)(flash->offset >> 8),
		                          (uint8_t)(flash->offset >> 16), (uint8_t)(flash->offset >> 24),
		                          flash->log2_erase,              flash->log2_write,
		                          0,                              0 };

	if (!flash->bytes)
		return -1;
	if (address >= WINDOW_OFFSET && address + length <= WINDOW_OFFSET + sizeof registers)
		memcpy(bytes, registers + (address - WINDOW_OFFSET), length);
	else if (address + length <= write_size(flash))
		memcpy(bytes, flash->buffer + address, length);
	else
		return -1;
	return 0;
}

/* The block of 1 << log2_size bytes that the offset lies in. */
static uint8_t *block(remote_flash *flash, uint8_t log2_size)
{
	size_t start = flash->offset & ~(((size_t)1 << log2_size) - 1);

	return flash->offset < flash->size ? flash->bytes + start : NULL;
}

static int commit(hm2_remote *remote, uint8_t code)
{
	remote_flash *flash = &remote->flash;
	uint8_t *place = block(flash, code == COMMIT_ERASE ? flash->log2_erase : flash->log2_write);

	if (!place || (code != COMMIT_ERASE && code != COMMIT_WRITE))
		return -1;
	if (code == COMMIT_ERASE) {
		memset(place, ERASED, (size_t)1 << flash->log2_erase);
		remote->busy_ps = remote->now_ps + remote->knob[HM2_REMOTE_ERASE_PS];
		return 0;
	}
	for (size_t i = 0; i < write_size(flash); i++)
		place[i] &= flash->buffer[i]; /* programming only clears bits */
	remote->busy_ps = remote->now_ps + remote->knob[HM2_REMOTE_PROGRAM_PS];
	return 0;
}

int remote_flash_write(hm2_remote *remote, uint16_t address, const uint8_t *bytes, size_t length)
{
	remote_flash *flash = &remote->flash;

	if (!flash->bytes)
		return -1;
	if (address == WINDOW_COMMIT && length == 1)
		return commit(remote, *bytes);
	if (address == WINDOW_OFFSET && length == 4)
		flash->offset = bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
	else if (address + length <= write_size(flash))
		memcpy(flash->buffer + address, bytes, length);
	else
		return -1;
	return 0;
}
