/* Timers and scratch words (space 4), control and status words (space 6), the configuration port. */
#include "ethernet.h"

/* Stall until the line's edge; what a read returns is how long that took. */
static uint16_t wait_line(struct hm2_ethernet *ethernet, uint16_t address)
{
	const uint32_t timeout_us = ethernet->timers[HM2_LBP16_TIMER_WAIT_LIMIT / 2];
	const int line = (address - HM2_LBP16_TIMER_WAIT_REFERENCE) / 2; /* 0 reference, 1..4 */
	int64_t waited = ethernet_wait_edge(ethernet, line, timeout_us);

	if (waited < 0) {
		ethernet->status[STATUS_ERRORS] |= HM2_LBP16_ERROR_WAIT_TIMEOUT;
		waited = timeout_us;
	}
	ethernet->timers[address / 2] = (uint16_t)waited;
	return (uint16_t)waited;
}

int ethernet_timer_read(struct hm2_ethernet *ethernet, uint16_t address, uint32_t *value)
{
	address &= 0x1E;
	if (address == HM2_LBP16_TIMER_TIMESTAMP)
		*value = (uint16_t)ethernet_time_us(ethernet);
	else if (address >= HM2_LBP16_TIMER_WAIT_REFERENCE && address <= HM2_LBP16_TIMER_WAIT_TIMER_4)
		*value = wait_line(ethernet, address);
	else
		*value = ethernet->timers[address / 2];
	return 0;
}

int ethernet_timer_write(struct hm2_ethernet *ethernet, uint16_t address, uint32_t value)
{
	address &= 0x1E;
	if (address == HM2_LBP16_TIMER_TIMESTAMP)
		return 0;
	if (address >= HM2_LBP16_TIMER_WAIT_REFERENCE && address <= HM2_LBP16_TIMER_WAIT_TIMER_4) {
		wait_line(ethernet, address);
		return 0;
	}
	ethernet->timers[address / 2] = (uint16_t)value;
	if (address == HM2_LBP16_TIMER_WAIT)
		ethernet_wait_us(ethernet, (uint16_t)value);
	return 0;
}

int ethernet_status_read(struct hm2_ethernet *ethernet, uint16_t address, uint32_t *value)
{
	*value = ethernet->status[address / 2];
	return 0;
}

int ethernet_status_write(struct hm2_ethernet *ethernet, uint16_t address, uint32_t value)
{
	const unsigned word = address / 2;

	ethernet->status[word] = (uint16_t)value;
	if (word == STATUS_ICAP && ethernet->config.firmware_version >= 15)
		ethernet_icap_write(ethernet, (uint16_t)value);
	return 0;
}

static void request_reload(struct hm2_ethernet *ethernet, uint32_t address)
{
	ethernet->reload_requested = 1;
	ethernet->reload_address = address;
}

/* Efinix: select an image (4 or 5), then start it (0xC or 0xD). The address is that of the image. */
static void efinix_write(struct hm2_ethernet *ethernet, uint16_t word)
{
	struct ethernet_icap *icap = &ethernet->icap;

	if (icap->previous == 0x0005 && word == 0x000D)
		request_reload(ethernet, ethernet->flash.size / 2);
	else if (icap->previous == 0x0004 && word == 0x000C)
		request_reload(ethernet, 0);
	icap->previous = word;
}

/* Spartan-6: after the sync word, writes of one value to a register; IPROG in the command register boots. */
static void xilinx_write(struct hm2_ethernet *ethernet, uint16_t word)
{
	enum { GENERAL1 = 0x3261, GENERAL2 = 0x3281, COMMAND = 0x30A1, IPROG = 0x000E };
	struct ethernet_icap *icap = &ethernet->icap;

	if (!icap->synced) {
		icap->synced = icap->previous == 0xAA99 && word == 0x5566;
	} else if (icap->pending) {
		if (icap->pending == GENERAL1)
			icap->low = word;
		else if (icap->pending == GENERAL2)
			icap->high = word;
		else if (icap->pending == COMMAND && word == IPROG)
			request_reload(ethernet, (uint32_t)(icap->high & 0xFF) << 16 | icap->low);
		icap->pending = 0;
	} else if ((word & 0xF81F) == 0x3001) { /* write one word to a register */
		icap->pending = word;
	}
	icap->previous = word;
}

void ethernet_icap_write(struct hm2_ethernet *ethernet, uint16_t word)
{
	if (ethernet->config.efinix)
		efinix_write(ethernet, word);
	else
		xilinx_write(ethernet, word);
}
