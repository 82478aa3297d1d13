/* The RAM words of an 8I20 that answer to the start sequence of SSLBP (sserial.md 4.4). */
#include "remote_state.h"

enum { ENABLE = 0x0804, FAULT_WORD = 0x0852, CLEAR_FAULT = 0x0854, PID_ON = 0x08FE };

static int touches(uint16_t address, size_t length, uint16_t word)
{
	return address < word + 2u && word < address + length;
}

static void put(hm2_remote *remote, uint16_t address, int64_t value)
{
	remote->ram[address] = (uint8_t)value;
	remote->ram[address + 1] = (uint8_t)(value >> 8);
}

static int counted(int64_t *reads)
{
	if (*reads == 0)
		return 0;
	--*reads;
	return 1;
}

void remote_8i20_show_faults(hm2_remote *remote)
{
	if (remote->knob[HM2_REMOTE_MODEL] == HM2_REMOTE_8I20)
		put(remote, FAULT_WORD, remote->knob[HM2_REMOTE_FAULT_WORD]);
}

void remote_8i20_before_read(hm2_remote *remote, uint16_t address, size_t length)
{
	int64_t *knob = remote->knob;

	if (knob[HM2_REMOTE_MODEL] != HM2_REMOTE_8I20)
		return;
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
	if (touches(address, length, FAULT_WORD)) /* "faults can not be cleared by writing" (8I20 manual) */
		remote_8i20_show_faults(remote);
	if (touches(address, length, ENABLE)) {
		remote->pid_enabled = remote->ram[ENABLE] || remote->ram[ENABLE + 1];
		if (remote->pid_enabled && knob[HM2_REMOTE_FAULT_WORD_ON_ENABLE])
			hm2_remote_set(remote, HM2_REMOTE_FAULT_WORD, knob[HM2_REMOTE_FAULT_WORD_ON_ENABLE]);
	}
}
