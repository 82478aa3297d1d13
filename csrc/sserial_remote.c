/* Local variables of the firmware, and the memory of remotes through setup mode. */
#include "sserial.h"

#define TRIES 3
#define LAST_LOCAL_ADDRESS 0xFFFu
#define LBP_ADDRESSED 0x04u /* header bit: a 16-bit address follows */
#define LBP_WRITE 0x20u
#define SELECT_SPACE (HM2_LBP_COMMAND_WRITE_LOCAL | HM2_LBP_LOCAL_MEMORY_SPACE)

static int check_local(const struct hm2_sserial *port, uint32_t address, size_t count, hm2_error *error)
{
	if (sserial_check_use(port, "sserial local", error) != HM2_OK)
		return HM2_ERR_BUSY;
	if (count && address <= LAST_LOCAL_ADDRESS && count <= LAST_LOCAL_ADDRESS + 1 - address)
		return HM2_OK;
	sserial_fail(error, HM2_ERR_RANGE, "sserial local", 0, -1);
	if (error) {
		error->address = address;
		error->expected = LAST_LOCAL_ADDRESS;
		error->received = address;
	}
	return HM2_ERR_RANGE;
}

int hm2_sserial_read_local(struct hm2_sserial *port, uint32_t address, uint8_t *bytes, size_t count,
                           hm2_error *error)
{
	int status = check_local(port, address, count, error);
	for (size_t i = 0; i < count && status == HM2_OK; i++) {
		uint32_t data = 0;
		status = sserial_command(port, HM2_SSLBP_COMMAND_READ_LOCAL | (address + (uint32_t)i), LIMIT_LOCAL_NS,
		                         "sserial read local", error);
		if (status == HM2_OK)
			status = sserial_read(port, HM2_SSERIAL_DATA, 0, &data, error);
		bytes[i] = (uint8_t)data;
	}
	return status;
}

int hm2_sserial_write_local(struct hm2_sserial *port, uint32_t address, const uint8_t *bytes, size_t count,
                            hm2_error *error)
{
	int status = check_local(port, address, count, error);
	for (size_t i = 0; i < count && status == HM2_OK; i++) {
		uint32_t data = bytes[i], command = HM2_SSLBP_COMMAND_WRITE_LOCAL | (address + (uint32_t)i);
		const hm2_transfer words[] = {sserial_word(port, HM2_SSERIAL_DATA, 0, &data),
		                              sserial_word(port, HM2_SSERIAL_COMMAND, 0, &command)};
		status = sserial_run(port, words, 2, LIMIT_LOCAL_NS, "sserial write local", error);
	}
	return status;
}

static int not_started(hm2_error *error, uint32_t channel)
{
	return sserial_fail(error, HM2_ERR_BUSY, "sserial remote", HM2_SSERIAL_NOT_STARTED, (int)channel);
}

static int silent(struct hm2_sserial *port, uint32_t channel, uint32_t address, hm2_error *error)
{
	uint32_t cs = 0;
	const int status = sserial_read(port, HM2_SSERIAL_CS, channel, &cs, error);
	if (status != HM2_OK)
		return status;
	port->image.cs[channel] = cs;
	sserial_fail(error, HM2_ERR_TIMEOUT, "sserial remote", HM2_SSERIAL_REMOTE_SILENT, (int)channel);
	if (error) {
		error->address = address;
		error->received = cs;
	}
	return HM2_ERR_TIMEOUT;
}

int hm2_sserial_access(struct hm2_sserial *port, uint32_t channel, uint32_t command, uint32_t address,
                       uint64_t *value, hm2_error *error)
{
	uint32_t words[2] = {(uint32_t)*value, (uint32_t)(*value >> 32)};
	uint32_t failed = 0;
	if (sserial_check_use(port, "sserial remote", error) != HM2_OK)
		return HM2_ERR_BUSY;
	if (channel >= port->config.channels || command < 0x40 || command > 0xFF || (command & 0xC0u) == 0x80u ||
	    address > 0xFFFFu)
		return sserial_fail(error, HM2_ERR_RANGE, "sserial remote", 0, (int)channel);
	if (port->mode != HM2_SSERIAL_SETUP || !(port->started & 1u << channel))
		return not_started(error, channel);
	if (command == SELECT_SPACE)
		port->channels[channel].space = SPACE_UNKNOWN; /* whoever asks: its answer may get lost */
	uint32_t cs = command << HM2_SSERIAL_CS_MODE_LSB | address, doit = HM2_SSLBP_COMMAND_DOIT | 1u << channel;
	const hm2_transfer list[] = {sserial_word(port, HM2_SSERIAL_USER0, channel, &words[0]),
	                             sserial_word(port, HM2_SSERIAL_USER1, channel, &words[1]),
	                             sserial_word(port, HM2_SSERIAL_CS, channel, &cs),
	                             sserial_word(port, HM2_SSERIAL_COMMAND, 0, &doit)};
	const size_t first = command & LBP_WRITE ? 0 : 2;
	int status = sserial_run(port, list + first, 4 - first, LIMIT_ACCESS_NS, "sserial remote", error);
	if (status == HM2_OK)
		status = sserial_read(port, HM2_SSERIAL_DATA, 0, &failed, error);
	if (status == HM2_OK && failed & 1u << channel)
		return silent(port, channel, address, error);
	for (uint32_t i = 0; i < 2 && status == HM2_OK && !(command & LBP_WRITE); i++)
		status = sserial_read(port, HM2_SSERIAL_USER0 + i, channel, &words[i], error);
	if (status == HM2_OK)
		*value = words[0] | (uint64_t)words[1] << 32;
	return status;
}

/* After a failed transfer the channel may still be listening, and what it then hears belongs to the
 * transfer before: wait until neither can be before the next try (sserial.md 2.3). */
static int access_again(struct hm2_sserial *port, uint32_t channel, uint32_t command, uint32_t address,
                        uint64_t *value, hm2_error *error)
{
	const uint64_t written = *value;
	int status = HM2_OK;
	for (int i = 0; i < TRIES; i++) {
		*value = written;
		status = hm2_sserial_access(port, channel, command, address, value, error);
		if (status != HM2_ERR_TIMEOUT || !(port->started & 1u << channel))
			return status;
		hm2_board_pause_ns(port->board, SETTLE_ACCESS_NS);
	}
	return status;
}

static int select_space(struct hm2_sserial *port, uint32_t channel, uint32_t space, hm2_error *error)
{
	uint64_t value = space;
	struct sserial_channel *known = &port->channels[channel];
	if (known->space == space)
		return HM2_OK;
	/* its write makes it unknown, until that is confirmed */
	const int status = access_again(port, channel, SELECT_SPACE, 0, &value, error);
	if (status == HM2_OK)
		known->space = space;
	return status;
}

static int size_code(uint32_t size)
{
	switch (size) {
	case 1: return 0;
	case 2: return 1;
	case 4: return 2;
	case 8: return 3;
	default: return -1;
	}
}

/* The access in a memory space; the space is put back to RAM whatever happened. */
static int access_in_space(struct hm2_sserial *port, uint32_t channel, uint32_t space, uint32_t command,
                           uint32_t address, uint64_t *value, hm2_error *error)
{
	int status = select_space(port, channel, space, error);
	if (status == HM2_OK)
		status = access_again(port, channel, command, address, value, error);
	else if (error)
		error->address = address; /* what was asked for */
	if (status != HM2_OK && space == HM2_LBP_SPACE_RAM)
		return status;
	hm2_error why = {0};
	const int restored = select_space(port, channel, HM2_LBP_SPACE_RAM, &why);
	if (status != HM2_OK || restored == HM2_OK)
		return status;
	if (port->started & 1u << channel)
		return select_space(port, channel, HM2_LBP_SPACE_RAM, error);
	if (error) /* it hung, and everything was stopped: not to be kept from whoever asked */
		*error = why;
	return restored;
}

static int check_access(const struct hm2_sserial *port, uint32_t channel, uint32_t space, uint32_t address,
                        uint32_t size, hm2_error *error)
{
	if (channel >= port->config.channels || size_code(size) < 0 || space > 0xFFu || address > 0x10000u - size) {
		sserial_fail(error, HM2_ERR_RANGE, "sserial remote", 0, (int)channel);
		if (error) {
			error->address = address;
			error->received = size;
		}
		return HM2_ERR_RANGE;
	}
	if (port->mode != HM2_SSERIAL_SETUP || !(port->started & 1u << channel))
		return not_started(error, channel);
	return HM2_OK;
}

int hm2_sserial_read_remote(struct hm2_sserial *port, uint32_t channel, uint32_t space, uint32_t address,
                            uint32_t size, uint64_t *value, hm2_error *error)
{
	uint64_t read = 0;
	int status = check_access(port, channel, space, address, size, error);
	if (status != HM2_OK)
		return status;
	status = access_in_space(port, channel, space, HM2_LBP_COMMAND_READ_BYTE | (uint32_t)size_code(size), address,
	                         &read, error);
	/* the firmware leaves what it had before in the bytes above */
	if (status == HM2_OK)
		*value = size < 8 ? read & (((uint64_t)1 << 8 * size) - 1) : read;
	return status;
}

int hm2_sserial_write_remote(struct hm2_sserial *port, uint32_t channel, uint32_t space, uint32_t address,
                             uint32_t size, uint64_t value, hm2_error *error)
{
	const int status = check_access(port, channel, space, address, size, error);
	if (status != HM2_OK)
		return status;
	return access_in_space(port, channel, space, HM2_LBP_COMMAND_WRITE_BYTE | (uint32_t)size_code(size), address,
	                       &value, error);
}

struct remote_memory {
	struct hm2_sserial *port;
	uint32_t channel;
};

static int fetch_remote(void *self, uint32_t address, uint32_t size, uint8_t *bytes, hm2_error *error)
{
	const struct remote_memory *memory = self;
	uint64_t value = 0;
	const int status = hm2_sserial_read_remote(memory->port, memory->channel, HM2_LBP_SPACE_RAM, address, size,
	                                           &value, error);
	for (uint32_t i = 0; i < size; i++)
		bytes[i] = (uint8_t)(value >> 8 * i);
	return status;
}

int hm2_sserial_read_toc(struct hm2_sserial *port, uint32_t channel, uint32_t pointer, int table,
                         const hm2_toc_record *ptoc, size_t ptoc_count, hm2_toc_record *records,
                         size_t capacity, size_t *count, hm2_error *error)
{
	struct remote_memory self = {port, channel};
	const hm2_toc_memory memory = {&self, fetch_remote};
	return hm2_toc_read(&memory, pointer, table, ptoc, ptoc_count, records, capacity, count, error);
}
