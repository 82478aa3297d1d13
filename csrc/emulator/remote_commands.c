/* A remote obeys LBP: data access, local registers, RPCs (sserial.md 4.2, 4.3). */
#include "remote_state.h"

#include <string.h>

#define WRONG_COOKIE 0x55
#define LBP_VERSION_OURS 3 /* no sheet gives the number of a real card */
#define RPC_PITCH 8
#define RPC_NUMBER 0x3F

/* Where a command's bytes come from: the frame, and for stored RPCs the table too. */
typedef struct byte_source {
	const uint8_t *bytes;
	size_t left;
} byte_source;

static const uint8_t *take(byte_source *source, size_t count)
{
	const uint8_t *bytes = source->bytes;

	if (source->left < count)
		return NULL;
	source->bytes += count;
	source->left -= count;
	return bytes;
}

void remote_set_status(hm2_remote *remote, int bit)
{
	remote->knob[HM2_REMOTE_STATUS] |= bit;
}

void remote_crc_error(hm2_remote *remote)
{
	remote_set_status(remote, HM2_LBP_STATUS_CRC_ERROR);
	if (remote->knob[HM2_REMOTE_CRC_ERRORS] < UINT8_MAX)
		remote->knob[HM2_REMOTE_CRC_ERRORS]++;
}

static int refuse(hm2_remote *remote)
{
	remote_set_status(remote, HM2_LBP_STATUS_INVALID_ADDRESS);
	return -1;
}

static uint8_t *extend(hm2_remote *remote, remote_answer *answer, size_t count)
{
	uint8_t *end = answer->bytes + answer->length;

	/* One place stays for the CRC. */
	if (count >= sizeof answer->bytes - answer->length) {
		remote_set_status(remote, HM2_LBP_STATUS_BUFFER);
		return NULL;
	}
	answer->length += count;
	return end;
}

static int answer_byte(hm2_remote *remote, remote_answer *answer, int64_t value)
{
	uint8_t *byte = extend(remote, answer, 1);

	if (!byte)
		return -1;
	*byte = (uint8_t)value;
	return 0;
}

static int answer_word(hm2_remote *remote, remote_answer *answer, int64_t value)
{
	return answer_byte(remote, answer, value) || answer_byte(remote, answer, value >> 8) ? -1 : 0;
}

/* ---- data access ------------------------------------------------------------------------- */

static int run_data(hm2_remote *remote, uint8_t header, byte_source *addresses, byte_source *data,
                    remote_answer *answer)
{
	size_t size = LBP_SIZE(header);
	uint8_t *place;

	if (header & LBP_ADDRESS) {
		const uint8_t *address = take(addresses, 2);

		if (!address)
			return refuse(remote);
		remote->pointer = (uint16_t)(address[0] | address[1] << 8);
	}
	if (header & LBP_WRITE) {
		const uint8_t *bytes = take(data, size);

		if (!bytes || remote_write(remote, remote->pointer, bytes, size))
			return refuse(remote);
	} else {
		place = extend(remote, answer, size);
		if (!place || remote_read(remote, remote->pointer, place, size))
			return refuse(remote);
	}
	if (header & LBP_AUTO_INCREMENT)
		remote->pointer = (uint16_t)(remote->pointer + size);
	return 0;
}

/* ---- local registers --------------------------------------------------------------------- */

static int64_t cookie(hm2_remote *remote)
{
	if (remote->knob[HM2_REMOTE_BAD_COOKIES] == 0)
		return remote->knob[HM2_REMOTE_COOKIE];
	remote->knob[HM2_REMOTE_BAD_COOKIES]--;
	return WRONG_COOKIE;
}

static int64_t clear_flag(hm2_remote *remote)
{
	if (remote->knob[HM2_REMOTE_CLEAR_BUSY_READS] == 0)
		return 0;
	remote->knob[HM2_REMOTE_CLEAR_BUSY_READS]--;
	return UINT8_MAX;
}

static int64_t read_local(hm2_remote *remote, int number)
{
	switch (number) {
	case HM2_LBP_LOCAL_STATUS: return remote->knob[HM2_REMOTE_STATUS];
	case HM2_LBP_LOCAL_CRC_ENABLE: return remote->knob[HM2_REMOTE_CRC] ? UINT8_MAX : 0;
	case HM2_LBP_LOCAL_CRC_ERRORS: return remote->knob[HM2_REMOTE_CRC_ERRORS];
	case HM2_LBP_LOCAL_SOFTWARE_MODE: return remote->knob[HM2_REMOTE_SOFTWARE_MODE];
	case HM2_LBP_LOCAL_CLEAR_FAULT: return clear_flag(remote);
	case HM2_LBP_LOCAL_COMMAND_TIMEOUT: return remote->knob[HM2_REMOTE_TIMEOUT_BITS];
	case HM2_LBP_LOCAL_MEMORY_SPACE: return remote->knob[HM2_REMOTE_SPACE];
	case HM2_LBP_LOCAL_NAME_0:
	case HM2_LBP_LOCAL_NAME_1:
	case HM2_LBP_LOCAL_NAME_2:
	case HM2_LBP_LOCAL_NAME_3:
		return remote->knob[HM2_REMOTE_NAME] >> 8 * (number - HM2_LBP_LOCAL_NAME_0);
	case HM2_LBP_LOCAL_CAPABILITY: return remote->knob[HM2_REMOTE_CAPABILITY];
	case HM2_LBP_LOCAL_SOFTWARE_REVISION: return remote->knob[HM2_REMOTE_REVISION];
	case HM2_LBP_LOCAL_HARDWARE_MODE: return remote->knob[HM2_REMOTE_HARDWARE_MODE];
	case HM2_LBP_LOCAL_FAULT: return remote->knob[HM2_REMOTE_FAULT];
	case HM2_LBP_LOCAL_ADDRESS_LOW: return remote->pointer;
	case HM2_LBP_LOCAL_ADDRESS_HIGH: return remote->pointer >> 8;
	case HM2_LBP_LOCAL_VERSION: return LBP_VERSION_OURS;
	case HM2_LBP_LOCAL_RPC_PITCH: return RPC_PITCH;
	case HM2_LBP_LOCAL_RPC_SIZE_LOW: return RPC_TABLE_SIZE & 0xFF;
	case HM2_LBP_LOCAL_RPC_SIZE_HIGH: return RPC_TABLE_SIZE >> 8;
	case HM2_LBP_LOCAL_COOKIE: return cookie(remote);
	default: return remote->locals[number];
	}
}

static int write_local(hm2_remote *remote, int number, uint8_t value)
{
	switch (number) {
	case HM2_LBP_LOCAL_STATUS: remote->knob[HM2_REMOTE_STATUS] = value; break;
	case HM2_LBP_LOCAL_CRC_ENABLE: break; /* CRC checking is always on (7I77 and 8I20 manuals) */
	case HM2_LBP_LOCAL_CRC_ERRORS: remote->knob[HM2_REMOTE_CRC_ERRORS] = value; break;
	case HM2_LBP_LOCAL_SOFTWARE_MODE: remote_select_mode(remote, value); break;
	case HM2_LBP_LOCAL_CLEAR_FAULT:
		if (value)
			remote_clear_faults(remote);
		break;
	case HM2_LBP_LOCAL_COMMAND_TIMEOUT: remote->knob[HM2_REMOTE_TIMEOUT_BITS] = value; break;
	case HM2_LBP_LOCAL_MEMORY_SPACE: remote->knob[HM2_REMOTE_SPACE] = value; break;
	case HM2_LBP_LOCAL_FAULT: remote->knob[HM2_REMOTE_LEDS] = value; break;
	case HM2_LBP_LOCAL_ADDRESS_LOW: remote->pointer = (uint16_t)((remote->pointer & 0xFF00) | value); break;
	case HM2_LBP_LOCAL_ADDRESS_HIGH: remote->pointer = (uint16_t)(value << 8 | (remote->pointer & 0xFF)); break;
	case HM2_LBP_LOCAL_VERSION: remote->pointer = (uint16_t)(remote->pointer + value); break;
	case HM2_LBP_LOCAL_RPC_SIZE_LOW: remote->locals[HM2_LBP_LOCAL_UNIT_ID] = value; break;
	case HM2_LBP_LOCAL_RPC_SIZE_HIGH:
		if (value == HM2_LBP_RESET_KEY) {
			hm2_remote_reset(remote);
			remote_8i20_software_reset(remote);
			return -1; /* a processor in reset does not answer */
		}
		break;
	default: remote->locals[number] = value; break;
	}
	return 0;
}

static int run_local(hm2_remote *remote, uint8_t header, byte_source *data, remote_answer *answer)
{
	int number = header & 0x1F;
	const uint8_t *value;

	if (!(header & LBP_WRITE))
		return answer_byte(remote, answer, read_local(remote, number));
	if (header == HM2_LBP_COMMAND_RESET_PARSER)
		return 0;
	value = take(data, 1);
	return value ? write_local(remote, number, *value) : refuse(remote);
}

/* ---- RPCs -------------------------------------------------------------------------------- */

static int unit_number(hm2_remote *remote, remote_answer *answer)
{
	int64_t address = remote->knob[HM2_REMOTE_UNIT_ADDRESS];
	int64_t unit = remote->knob[HM2_REMOTE_UNIT];

	if (!remote->knob[HM2_REMOTE_ANSWERS_UNIT])
		return -1;
	if (address >= 0) {
		const uint8_t *ram = remote->ram + address;

		unit = ram[0] | ram[1] << 8 | ram[2] << 16 | (int64_t)ram[3] << 24;
	}
	return answer_word(remote, answer, unit) || answer_word(remote, answer, unit >> 16) ? -1 : 0;
}

static int discovery(hm2_remote *remote, remote_answer *answer)
{
	const int64_t *knob = remote->knob;

	if (!knob[HM2_REMOTE_ANSWERS_DISCOVERY])
		return -1;
	if (answer_byte(remote, answer, knob[HM2_REMOTE_RECEIVE_SIZE]) ||
	    answer_byte(remote, answer, knob[HM2_REMOTE_TRANSMIT_SIZE]) ||
	    answer_word(remote, answer, knob[HM2_REMOTE_PTOC]) || answer_word(remote, answer, knob[HM2_REMOTE_GTOC]))
		return -1;
	return 0;
}

static int process_data(hm2_remote *remote, byte_source *data, remote_answer *answer)
{
	const uint8_t *outputs = take(data, (size_t)remote->knob[HM2_REMOTE_TRANSMIT_SIZE]);

	if (!outputs)
		return refuse(remote);
	if ((size_t)remote->knob[HM2_REMOTE_RECEIVE_SIZE] >= sizeof answer->bytes - answer->length) {
		remote_set_status(remote, HM2_LBP_STATUS_BUFFER);
		return -1;
	}
	remote_process(remote, outputs, answer);
	return 0;
}

static byte_source stored_list(const hm2_remote *remote, uint8_t header)
{
	size_t start = (size_t)(header & RPC_NUMBER) * RPC_PITCH;

	return (byte_source){ .bytes = remote->rpc_table + start, .left = RPC_TABLE_SIZE - start };
}

/* Bytes that the stored RPC takes from the frame: data of writes that do not carry their own. */
static size_t streamed_bytes(const hm2_remote *remote, uint8_t header)
{
	byte_source list = stored_list(remote, header);
	size_t streamed = 0;

	for (const uint8_t *step = take(&list, 1); step && LBP_KIND(*step) == HM2_LBP_KIND_DATA; step = take(&list, 1)) {
		size_t data = *step & LBP_WRITE ? LBP_SIZE(*step) : 0;

		streamed += *step & LBP_RPC_DATA ? 0 : data;
		if (!take(&list, (*step & LBP_ADDRESS ? 2u : 0u) + (*step & LBP_RPC_DATA ? data : 0)))
			break;
	}
	return streamed;
}

static int run_stored(hm2_remote *remote, uint8_t header, byte_source *data, remote_answer *answer)
{
	byte_source list = stored_list(remote, header);
	const uint8_t *step = take(&list, 1);

	/* Nothing stored there, or the table is open for writing (7I77 manual: must be clear in operation). */
	if (!step || *step == 0 || remote->locals[HM2_LBP_LOCAL_RPC_MEMORY_ACCESS])
		return refuse(remote);
	for (; step && *step; step = take(&list, 1)) {
		if (LBP_KIND(*step) != HM2_LBP_KIND_DATA)
			return refuse(remote);
		if (run_data(remote, *step, &list, *step & LBP_RPC_DATA ? &list : data, answer))
			return -1;
	}
	return 0;
}

static int run_rpc(hm2_remote *remote, uint8_t header, byte_source *data, remote_answer *answer)
{
	switch (header) {
	case HM2_LBP_RPC_DISCOVERY: return discovery(remote, answer);
	case HM2_LBP_RPC_UNIT_NUMBER: return unit_number(remote, answer);
	case HM2_LBP_RPC_PROCESS_DATA: return process_data(remote, data, answer);
	default: return run_stored(remote, header, data, answer);
	}
}

size_t remote_command_length(const hm2_remote *remote, uint8_t header)
{
	size_t length = hm2_lbp_command_length(header, (size_t)remote->knob[HM2_REMOTE_TRANSMIT_SIZE]);

	if (LBP_KIND(header) == HM2_LBP_KIND_RPC && (header < HM2_LBP_RPC_DISCOVERY || header > HM2_LBP_RPC_PROCESS_DATA))
		length += streamed_bytes(remote, header);
	return length;
}

/* ---- frames ------------------------------------------------------------------------------ */

int remote_obey(hm2_remote *remote, const uint8_t *frame, size_t length, remote_answer *answer)
{
	byte_source source = { .bytes = frame, .left = length };
	const uint8_t *first;

	answer->length = 0;
	answer->broken = 0;
	while ((first = take(&source, 1)) != NULL) {
		uint8_t header = *first;
		int refused;

		switch (LBP_KIND(header)) {
		case HM2_LBP_KIND_DATA: refused = run_data(remote, header, &source, &source, answer); break;
		case HM2_LBP_KIND_RPC: refused = run_rpc(remote, header, &source, answer); break;
		case HM2_LBP_KIND_LOCAL: refused = run_local(remote, header, &source, answer); break;
		default: refused = refuse(remote); break;
		}
		if (refused)
			return -1;
	}
	return 0;
}
