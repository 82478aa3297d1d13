/* The SSLBP processor's memory as its programs and the local commands see it (sserial.md 2.7). */
#include "sslbp_state.h"

#include <string.h>

#define DEFAULT_BAUD 2500000u
#define CLEARED_AT_RESET 0x100 /* channels 3.. keep their blocks */

static const uint8_t constants[] = {0x12, 8, 1, 43, CHANNEL_BLOCKS, CHANNEL_STRIDE, 0xD8, 0,
                                    '8',  'I', '2', '0', '7', 'I', '6', '4'};

uint32_t sslbp_get32(const uint8_t *bytes)
{
	return bytes[0] | (uint32_t)bytes[1] << 8 | (uint32_t)bytes[2] << 16 | (uint32_t)bytes[3] << 24;
}

void sslbp_put32(uint8_t *bytes, uint32_t value)
{
	for (int i = 0; i < 4; i++)
		bytes[i] = (uint8_t)(value >> 8 * i);
}

void sslbp_ram_reset(struct hm2_sslbp *s)
{
	memset(s->ram, 0, CLEARED_AT_RESET);
	memcpy(s->ram, constants, sizeof constants);
	s->ram[HM2_SSLBP_LOCAL_CHANNELS] = (uint8_t)s->channels;
	for (int c = 0; c < s->channels; c++)
		sslbp_put32(sslbp_block(s, c) + HM2_SSLBP_CHANNEL_BAUD_RATE, DEFAULT_BAUD);
}

uint8_t sslbp_ram_read(struct hm2_sslbp *s, unsigned address)
{
	if (address < RAM_SIZE)
		return s->ram[address];
	if (address >= HM2_SSLBP_LOCAL_CLOCK_HZ && address < HM2_SSLBP_LOCAL_CLOCK_HZ + 4)
		return (uint8_t)(s->clock_hz >> 8 * (address - HM2_SSLBP_LOCAL_CLOCK_HZ));
	if (address == HM2_SSLBP_LOCAL_HARDWARE_CHANNELS)
		return (uint8_t)s->channels;
	if (address == HM2_SSLBP_LOCAL_DATA)
		return (uint8_t)s->argument;
	if (address >= HM2_SSLBP_LOCAL_UART_DATA && address < HM2_SSLBP_LOCAL_UART_DATA + (unsigned)s->channels) {
		struct sslbp_uart *uart = &s->uarts[address - HM2_SSLBP_LOCAL_UART_DATA];
		uint8_t value = uart->rx[0];
		if (uart->rx_count)
			memmove(uart->rx, uart->rx + 1, --uart->rx_count);
		return value;
	}
	return 0;
}

void sslbp_ram_write(struct hm2_sslbp *s, unsigned address, uint8_t value)
{
	if (address < RAM_SIZE)
		s->ram[address] = value;
}

void sslbp_show(struct hm2_sslbp *s, int channel, int reg, uint32_t value, int64_t at)
{
	if (!s->wire)
		s->shown[channel][reg] = value;
	else if (s->post_count < POSTS)
		s->posts[s->post_count++] = (struct sslbp_post){at, value, (uint8_t)channel, (uint8_t)reg};
}
