/* The 8I20: RAM words that answer to the start sequence of SSLBP (sserial.md 4.4), and the drive's own supervision
 * (8I20 manual: motor brake, fault conditions, fault mask, status register; lbp_serial.md 6).
 *
 * A stand-in has the first only: its words are what the test wrote. Ours, because no source tells: the scales
 * of the measured currents (10 mA), the law of the temperature limit, the hysteresis of the bus under voltage. */
#include "remote_state.h"

enum {
	ENABLE = 0x0804,
	IU = 0x0822,
	BUS_VOLTAGE = 0x0828,
	TEMPERATURE = 0x082C,
	ID = 0x0846,
	IQ = 0x0848,
	LIMIT_MULTIPLIER = 0x0850,
	FAULT_WORD = 0x0852,
	CLEAR_FAULT = 0x0854,
	FAULT_MASK = 0x0858,
	Q_SETPOINT = 0x0860,
	D_SETPOINT = 0x0862,
	BUS_UNDER_MIN = 0x0864,
	BUS_UNDER_MAX = 0x0866,
	BUS_OVER = 0x0868,
	BRAKE_ON = 0x086A,
	BRAKE_OFF = 0x086C,
	STATUS_WORD = 0x086E,
	LIMIT_TEMPERATURE = 0x08E2,
	LIMIT_SLOPE = 0x08E4,
	MAX_CURRENT = 0x08E8,
	PID_ON = 0x08FE
};

/* Fixed thresholds, as the words have them: 10 mV and 0.01 degC (8I20 manual). */
#define BRAKE_ALWAYS_ON 38500
#define BUS_MAXIMUM 40000
#define OVER_TEMPERATURE 8500
#define LOOP_CURRENT_PERCENT 125

enum {
	FAULT_NO_ENABLE = 1 << 1,
	FAULT_OVER_TEMPERATURE = 1 << 2,
	FAULT_PHASE_U = 1 << 5,
	FAULT_BUS_LOW = 1 << 8,
	FAULT_BUS_HIGH = 1 << 9,
	FAULT_BUS_MAXIMUM = 1 << 10,
	MASKABLE = FAULT_BUS_LOW
};

enum {
	STATUS_LIMITED = 1 << 0,
	STATUS_BRAKE = 1 << 1,
	STATUS_BRAKE_WAS_ON = 1 << 2,
	STATUS_BUS_LOW = 1 << 3,
	STATUS_SOFTWARE_RESET = 1 << 5,
	STATUS_NO_ENABLE = 1 << 8,
	STATUS_PID_ON = 1 << 9
};

static int touches(uint16_t address, size_t length, uint16_t word)
{
	return address < word + 2u && word < address + length;
}

static int64_t get(const hm2_remote *remote, uint16_t address)
{
	return remote->ram[address] | remote->ram[address + 1] << 8;
}

static int64_t get_signed(const hm2_remote *remote, uint16_t address)
{
	return (int16_t)get(remote, address);
}

/* The process data reply is made from RAM: it is stale when a word changes. */
static void put(hm2_remote *remote, uint16_t address, int64_t value)
{
	if (get(remote, address) == (value & 0xFFFF))
		return;
	remote->ram[address] = (uint8_t)value;
	remote->ram[address + 1] = (uint8_t)(value >> 8);
	remote->inputs_stale = 1;
}

static int counted(int64_t *reads)
{
	if (*reads == 0)
		return 0;
	--*reads;
	return 1;
}

static int is_drive(const hm2_remote *remote)
{
	return remote->knob[HM2_REMOTE_MODEL] == HM2_REMOTE_8I20 && remote->knob[HM2_REMOTE_SUPERVISED];
}

int64_t remote_8i20_unmasked(const hm2_remote *remote)
{
	int64_t faults = remote->knob[HM2_REMOTE_FAULT_WORD];

	return is_drive(remote) ? faults & (get(remote, FAULT_MASK) | ~(int64_t)MASKABLE) : faults;
}

void remote_8i20_show_faults(hm2_remote *remote)
{
	if (remote->knob[HM2_REMOTE_MODEL] != HM2_REMOTE_8I20)
		return;
	put(remote, FAULT_WORD, remote->knob[HM2_REMOTE_FAULT_WORD]);
	remote->knob[HM2_REMOTE_FAULT_OUTPUT] = remote_8i20_unmasked(remote) == 0;
}

static int64_t switched(int64_t status, int64_t bit, int on)
{
	return on ? status | bit : status & ~bit;
}

static int64_t bus_status(const hm2_remote *remote, int64_t status)
{
	int64_t volts = get(remote, BUS_VOLTAGE);
	int brake = status & STATUS_BRAKE ? volts > get(remote, BRAKE_OFF) : volts >= get(remote, BRAKE_ON);
	int64_t low_until = status & STATUS_BUS_LOW ? get(remote, BUS_UNDER_MAX) : get(remote, BUS_UNDER_MIN);

	status = switched(status, STATUS_BRAKE, brake || volts >= BRAKE_ALWAYS_ON);
	if (status & STATUS_BRAKE)
		status |= STATUS_BRAKE_WAS_ON;
	return switched(status, STATUS_BUS_LOW, volts < low_until);
}

static int64_t faults_now(const hm2_remote *remote, int64_t status)
{
	int64_t volts = get(remote, BUS_VOLTAGE), limit = get(remote, MAX_CURRENT) * LOOP_CURRENT_PERCENT;
	int64_t faults = 0;

	if (!remote->knob[HM2_REMOTE_ENABLE_INPUT])
		faults |= FAULT_NO_ENABLE;
	if (get(remote, TEMPERATURE) > OVER_TEMPERATURE)
		faults |= FAULT_OVER_TEMPERATURE;
	for (int phase = 0; phase < 3; phase++) {
		int64_t current = get_signed(remote, (uint16_t)(IU + 2 * phase));

		if ((current < 0 ? -current : current) * 100 > limit)
			faults |= (int64_t)FAULT_PHASE_U << phase;
	}
	if (status & STATUS_BUS_LOW)
		faults |= FAULT_BUS_LOW;
	if (volts > get(remote, BUS_OVER))
		faults |= FAULT_BUS_HIGH;
	if (volts > BUS_MAXIMUM)
		faults |= FAULT_BUS_MAXIMUM;
	return faults;
}

static int64_t limit_multiplier(const hm2_remote *remote)
{
	int64_t above = get(remote, TEMPERATURE) - get(remote, LIMIT_TEMPERATURE);
	int64_t less = above > 0 ? above * get(remote, LIMIT_SLOPE) : 0;

	return less < UINT16_MAX ? UINT16_MAX - less : 0;
}

/* Amperes of a setpoint: full scale is MAXCURRENT, less what the temperature takes (8I20 manual, MAXCURRENT). */
static int64_t current(const hm2_remote *remote, uint16_t setpoint)
{
	int64_t full = get(remote, MAX_CURRENT) * get(remote, LIMIT_MULTIPLIER) / UINT16_MAX;

	return get_signed(remote, setpoint) * full / INT16_MAX;
}

void remote_8i20_supervise(hm2_remote *remote)
{
	int64_t *faults = &remote->knob[HM2_REMOTE_FAULT_WORD], status, appeared;
	int runs;

	if (!is_drive(remote))
		return;
	remote_images_to_ram(remote);
	put(remote, LIMIT_MULTIPLIER, limit_multiplier(remote));
	status = bus_status(remote, get(remote, STATUS_WORD));
	appeared = faults_now(remote, status) & ~*faults;
	if (appeared) {
		*faults |= appeared;
		remote_show_faults(remote);
	}
	if (remote_8i20_unmasked(remote) || remote->knob[HM2_REMOTE_SETUP_MODE])
		remote->pid_enabled = 0; /* a fault ends the control loop; set-up mode has no drive at all */
	runs = remote->pid_enabled;
	put(remote, PID_ON, runs ? 0xFFFF : 0);
	put(remote, IQ, runs ? current(remote, Q_SETPOINT) : 0);
	put(remote, ID, runs ? current(remote, D_SETPOINT) : 0);
	status = switched(status, STATUS_PID_ON, runs);
	status = switched(status, STATUS_NO_ENABLE, !remote->knob[HM2_REMOTE_ENABLE_INPUT]);
	put(remote, STATUS_WORD, switched(status, STATUS_LIMITED, get(remote, LIMIT_MULTIPLIER) < UINT16_MAX));
}

void remote_8i20_software_reset(hm2_remote *remote)
{
	if (is_drive(remote))
		put(remote, STATUS_WORD, get(remote, STATUS_WORD) | STATUS_SOFTWARE_RESET);
}

void remote_8i20_before_read(hm2_remote *remote, uint16_t address, size_t length)
{
	int64_t *knob = remote->knob;

	if (knob[HM2_REMOTE_MODEL] != HM2_REMOTE_8I20)
		return;
	remote_8i20_supervise(remote);
	if (touches(address, length, CLEAR_FAULT))
		put(remote, CLEAR_FAULT, counted(&knob[HM2_REMOTE_CLEAR_BUSY_READS]) ? 0xFFFF : 0);
	if (touches(address, length, PID_ON))
		put(remote, PID_ON, !counted(&knob[HM2_REMOTE_PID_OFF_READS]) && remote->pid_enabled ? 0xFFFF : 0);
}

void remote_8i20_after_write(hm2_remote *remote, uint16_t address, size_t length)
{
	int64_t *knob = remote->knob;

	if (knob[HM2_REMOTE_MODEL] != HM2_REMOTE_8I20)
		return;
	if (touches(address, length, CLEAR_FAULT))
		remote_clear_faults(remote);
	if (touches(address, length, FAULT_WORD) || touches(address, length, FAULT_MASK))
		remote_8i20_show_faults(remote); /* "faults can not be cleared by writing" (8I20 manual) */
	if (touches(address, length, ENABLE)) {
		remote->pid_enabled = remote->ram[ENABLE] || remote->ram[ENABLE + 1];
		if (remote->pid_enabled && knob[HM2_REMOTE_FAULT_WORD_ON_ENABLE])
			hm2_remote_set(remote, HM2_REMOTE_FAULT_WORD, knob[HM2_REMOTE_FAULT_WORD_ON_ENABLE]);
	}
	remote_8i20_supervise(remote);
}
