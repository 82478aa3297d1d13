/* An emulated remote's life: birth, reset, settings. */
#include "remote_state.h"

#include <stdlib.h>
#include <string.h>

#define U8_MAX 0xFF
#define U16_MAX 0xFFFF
#define U32_MAX 0xFFFFFFFFLL
#define MANY 0x7FFFFFFFFFFFFFFFLL
#define PS_PER_SECOND 1000000000000LL
#define MILLISECOND_PS (PS_PER_SECOND / 1000)
#define SETUP_BAUD 115200
#define SETUP_TIMEOUT_BITS 255 /* 25.5 characters (7I77 manual, framing) */

typedef struct knob_range {
	int64_t initial, lowest, highest;
} knob_range;

static const knob_range ranges[HM2_REMOTE_KNOBS] = {
	[HM2_REMOTE_NAME] = { 0, 0, U32_MAX },
	[HM2_REMOTE_UNIT] = { 0, 0, U32_MAX },
	[HM2_REMOTE_MODEL] = { HM2_REMOTE_GENERIC, HM2_REMOTE_GENERIC, HM2_REMOTE_7I64 },
	[HM2_REMOTE_RECEIVE_SIZE] = { 1, 1, U8_MAX },
	[HM2_REMOTE_TRANSMIT_SIZE] = { 0, 0, U8_MAX },
	[HM2_REMOTE_PTOC] = { 0, 0, U16_MAX },
	[HM2_REMOTE_GTOC] = { 0, 0, U16_MAX },
	[HM2_REMOTE_SOFTWARE_MODE] = { 0, 0, U8_MAX },
	[HM2_REMOTE_HARDWARE_MODE] = { 0, 0, U8_MAX },
	[HM2_REMOTE_REVISION] = { 0, 0, U8_MAX },
	[HM2_REMOTE_CAPABILITY] = { 1, 0, U8_MAX },
	[HM2_REMOTE_ALIVE] = { 1, 0, 1 },
	[HM2_REMOTE_FAULT] = { 0, 0, U8_MAX },
	[HM2_REMOTE_FAULT_CLEARS] = { 1, 0, 1 },
	[HM2_REMOTE_FAULT_GATES] = { 0, 0, 1 },
	[HM2_REMOTE_FAULT_AT_RESET] = { 0, 0, U8_MAX },
	[HM2_REMOTE_FAULT_ADDRESS] = { -1, -1, U16_MAX - 1 },
	[HM2_REMOTE_CLEAR_BUSY_READS] = { 0, 0, MANY },
	[HM2_REMOTE_WATCHDOG_PS] = { 0, 0, MANY / 2 },
	[HM2_REMOTE_WATCHDOG_ADDRESS] = { -1, -1, U16_MAX - 1 },
	[HM2_REMOTE_WATCHDOG_UNIT_PS] = { PS_PER_SECOND / 1000, 1, PS_PER_SECOND },
	[HM2_REMOTE_UNIT_ADDRESS] = { -1, -1, U16_MAX - 3 },
	[HM2_REMOTE_TURNAROUND_PS] = { 3000000, 0, 1000 * PS_PER_SECOND },
	[HM2_REMOTE_BAUD] = { 2500000, 300, 100000000 },
	[HM2_REMOTE_BAUD_ADDRESS] = { -1, -1, HM2_REMOTE_EEPROM_MAX - 2 },
	[HM2_REMOTE_CRC_ADDRESS] = { -1, -1, HM2_REMOTE_EEPROM_MAX - 2 },
	[HM2_REMOTE_PWM_ADDRESS] = { -1, -1, HM2_REMOTE_EEPROM_MAX - 2 },
	[HM2_REMOTE_SETUP_MODE] = { 0, 0, 1 },
	[HM2_REMOTE_TIMEOUT_BITS] = { 40, 0, U8_MAX },
	[HM2_REMOTE_CRC] = { 1, 0, 1 },
	[HM2_REMOTE_COOKIE] = { 0x5A, 0, U8_MAX },
	[HM2_REMOTE_BAD_COOKIES] = { 0, 0, MANY },
	[HM2_REMOTE_ANSWERS_UNIT] = { 1, 0, 1 },
	[HM2_REMOTE_ANSWERS_DISCOVERY] = { 1, 0, 1 },
	[HM2_REMOTE_FAULT_WORD] = { 0, 0, U16_MAX },
	[HM2_REMOTE_FAULT_WORD_ON_ENABLE] = { 0, 0, U16_MAX },
	[HM2_REMOTE_PID_OFF_READS] = { 0, 0, MANY },
	[HM2_REMOTE_SUPERVISED] = { 0, 0, 1 },
	[HM2_REMOTE_ENABLE_INPUT] = { 1, 0, 1 },
	[HM2_REMOTE_FAULT_OUTPUT] = { 1, 0, 1 },
	[HM2_REMOTE_INJECT_BAD_CRC] = { 0, 0, MANY },
	[HM2_REMOTE_INJECT_TRUNCATE] = { 0, 0, HM2_REMOTE_DATA_MAX },
	[HM2_REMOTE_INJECT_EXTRA] = { 0, 0, 32 },
	[HM2_REMOTE_INJECT_BREAK] = { 0, 0, MANY },
	[HM2_REMOTE_INJECT_SKIP] = { 0, 0, MANY },
	[HM2_REMOTE_STATUS] = { 0, 0, U8_MAX },
	[HM2_REMOTE_CRC_ERRORS] = { 0, 0, U8_MAX },
	[HM2_REMOTE_SPACE] = { 0, 0, U8_MAX },
	[HM2_REMOTE_LEDS] = { 0, 0, U8_MAX },
	[HM2_REMOTE_ERASE_PS] = { 20 * MILLISECOND_PS, 0, PS_PER_SECOND },
	[HM2_REMOTE_PROGRAM_PS] = { 3 * MILLISECOND_PS, 0, PS_PER_SECOND },
};

hm2_remote *hm2_remote_new(void)
{
	hm2_remote *remote = calloc(1, sizeof *remote);

	if (!remote)
		return NULL;
	for (int knob = 0; knob < HM2_REMOTE_KNOBS; knob++)
		remote->knob[knob] = ranges[knob].initial;
	remote->bit_ps = PS_PER_SECOND / remote->knob[HM2_REMOTE_BAUD];
	return remote;
}

void hm2_remote_free(hm2_remote *remote)
{
	if (remote)
		free(remote->flash.bytes);
	free(remote);
}

static void silence(hm2_remote *remote)
{
	remote->rx.length = remote->rx.boundary = remote->rx.need = 0;
	remote->rx.crc = remote->rx.discarding = 0;
	remote->tx.count = 0;
}

/* What a setting means beyond its number. */
static void apply(hm2_remote *remote, int knob, int64_t value)
{
	switch (knob) {
	case HM2_REMOTE_BAUD:
		remote->bit_ps = (PS_PER_SECOND + value / 2) / value;
		break;
	case HM2_REMOTE_ALIVE:
		silence(remote);
		break;
	case HM2_REMOTE_SOFTWARE_MODE:
		remote_select_mode(remote, (uint8_t)value);
		break;
	case HM2_REMOTE_FAULT:
	case HM2_REMOTE_FAULT_WORD:
		remote_show_faults(remote);
		remote_8i20_supervise(remote);
		break;
	case HM2_REMOTE_ENABLE_INPUT:
		remote_8i20_supervise(remote);
		break;
	default:
		break;
	}
}

int hm2_remote_set(hm2_remote *remote, int knob, int64_t value)
{
	if (knob < 0 || knob >= HM2_REMOTE_KNOBS)
		return HM2_ERR_RANGE;
	if (value < ranges[knob].lowest || value > ranges[knob].highest)
		return HM2_ERR_RANGE;
	remote->knob[knob] = value;
	apply(remote, knob, value);
	return HM2_OK;
}

int64_t hm2_remote_get(const hm2_remote *remote, int knob)
{
	return knob < 0 || knob >= HM2_REMOTE_KNOBS ? -1 : remote->knob[knob];
}

/* The EEPROM word a knob points to; -1: none. */
static int stored(const hm2_remote *remote, int knob)
{
	int64_t address = remote->knob[knob];

	return address < 0 ? -1 : remote->eeprom[address] | remote->eeprom[address + 1] << 8;
}

/* The line as the jumper and the EEPROM want it (7I77 and 8I20 manuals: operate mode baud rate). */
static void reset_line(hm2_remote *remote)
{
	static const int32_t bauds[] = { 9600,   19200,  38400,   57600,   115200,  230400,
		                         460800, 921600, 1250000, 2500000, 5000000, 10000000 };
	int index = stored(remote, HM2_REMOTE_BAUD_ADDRESS), pwm = stored(remote, HM2_REMOTE_PWM_ADDRESS);

	if (remote->knob[HM2_REMOTE_SETUP_MODE])
		hm2_remote_set(remote, HM2_REMOTE_BAUD, SETUP_BAUD);
	else if (index >= 0 && index < (int)(sizeof bauds / sizeof *bauds))
		hm2_remote_set(remote, HM2_REMOTE_BAUD, bauds[index]);
	if (stored(remote, HM2_REMOTE_CRC_ADDRESS) >= 0)
		remote->knob[HM2_REMOTE_CRC] = stored(remote, HM2_REMOTE_CRC_ADDRESS) != 0;
	if (pwm > 0)
		remote->knob[HM2_REMOTE_WATCHDOG_UNIT_PS] = PS_PER_SECOND / pwm;
	remote->knob[HM2_REMOTE_TIMEOUT_BITS] =
		remote->knob[HM2_REMOTE_SETUP_MODE] ? SETUP_TIMEOUT_BITS : ranges[HM2_REMOTE_TIMEOUT_BITS].initial;
}

/* Working parameters: as at the first power-up, then what the EEPROM says. */
static void reset_memory(hm2_remote *remote)
{
	memcpy(remote->ram, remote->power_on_ram, sizeof remote->ram);
	for (size_t i = 0; i < remote->copy_count; i++) {
		const remote_copy *copy = &remote->copies[i];

		memcpy(remote->ram + copy->to, remote->eeprom + copy->from, copy->size);
	}
	memset(remote->rpc_table, 0, sizeof remote->rpc_table);
	remote->inputs_stale = 1;
}

void hm2_remote_reset(hm2_remote *remote)
{
	static const int forgotten[] = { HM2_REMOTE_STATUS, HM2_REMOTE_CRC_ERRORS, HM2_REMOTE_SPACE, HM2_REMOTE_LEDS };

	silence(remote);
	memset(remote->locals, 0, sizeof remote->locals);
	for (size_t i = 0; i < sizeof forgotten / sizeof *forgotten; i++)
		remote->knob[forgotten[i]] = ranges[forgotten[i]].initial;
	remote->pointer = 0;
	remote->pid_enabled = 0;
	remote->busy_ps = 0;
	remote->flash.offset = 0;
	reset_line(remote);
	remote_outputs_off(remote);
	remote_select_mode(remote, 0);
	reset_memory(remote);
	*remote_faults(remote) = remote->knob[HM2_REMOTE_FAULT_AT_RESET];
	remote_show_faults(remote);
	remote_feed_watchdog(remote);
	remote_8i20_supervise(remote);
}

uint64_t hm2_remote_writes(const hm2_remote *remote, hm2_remote_write *writes, size_t capacity, size_t *count)
{
	uint64_t kept = remote->write_count < HM2_REMOTE_WRITES_KEPT ? remote->write_count : HM2_REMOTE_WRITES_KEPT;
	uint64_t first = remote->write_count - kept;

	if (kept > capacity) {
		first += kept - capacity;
		kept = capacity;
	}
	for (uint64_t i = 0; i < kept; i++)
		writes[i] = remote->writes[(first + i) % HM2_REMOTE_WRITES_KEPT];
	*count = (size_t)kept;
	return remote->write_count;
}

void hm2_remote_clear_writes(hm2_remote *remote)
{
	remote->write_count = 0;
}
