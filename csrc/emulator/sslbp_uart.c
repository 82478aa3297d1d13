/* The UARTs of an SSERIAL instance: 16-byte FIFOs, rates by phase accumulator, bytes with times. */
#include "lbp.h"
#include "line.h"
#include "sslbp_state.h"

#include <string.h>

#define ACCUMULATOR_BITS 20
#define STOP_BIT (1 << (BITS_PER_BYTE - 1))

void sslbp_uart_set_rate(struct hm2_sslbp *s, int channel, uint32_t baud)
{
	struct sslbp_uart *uart = &s->uarts[channel];
	uint64_t increment = ((uint64_t)baud << ACCUMULATOR_BITS) / s->clock_hz & ((1u << ACCUMULATOR_BITS) - 1);
	uart->bit_ps = 0;
	uart->awake = 1;
	if (increment == 0)
		return;
	uint64_t byte_cycles = (((uint64_t)BITS_PER_BYTE << ACCUMULATOR_BITS) + increment - 1) / increment;
	uart->bit_ps = (int64_t)(((uint64_t)s->cycle_ps << ACCUMULATOR_BITS) / increment);
	uart->pitch = (int64_t)byte_cycles + COST_TX_GAP - 1;
}

void sslbp_uart_flush(struct hm2_sslbp *s, int channel)
{
	s->uarts[channel].rx_count = 0;
	s->uarts[channel].broken = 0;
}

void sslbp_uart_reset(struct hm2_sslbp *s, int channel)
{
	struct sslbp_uart *uart = &s->uarts[channel];
	sslbp_uart_flush(s, channel);
	uart->tx_count = 0;
	uart->tx_free = uart->tx_emptied = 0;
	uart->bit_ps = 0;
}

/* Before it is awake it shows 0, as one without a clock does; later it rests high. */
int hm2_sslbp_transmit_level(const struct hm2_sslbp *sslbp, int channel, int64_t now_ps)
{
	const struct sslbp_uart *uart = &sslbp->uarts[channel];
	for (unsigned i = 0; i < uart->tx_count; i++) {
		const hm2_line_byte *byte = &uart->tx[(uart->tx_head + i) % TX_RING];
		const int64_t since = now_ps - byte->start_ps;
		if (since >= 0 && since < BITS_PER_BYTE * byte->bit_ps)
			return ((byte->value << 1 | STOP_BIT) >> (since / byte->bit_ps)) & 1;
	}
	return uart->awake;
}

static void record(struct hm2_sslbp *s, const struct sslbp_uart *uart, const hm2_line_byte *byte, int to_remote)
{
	size_t last = (s->record_head + s->record_count) % HM2_LINE_RECORDS_KEPT;
	s->records[last] = (hm2_line_record){*byte, (int32_t)(uart - s->uarts), to_remote};
	if (s->record_count < HM2_LINE_RECORDS_KEPT)
		s->record_count++;
	else
		s->record_head = (s->record_head + 1) % HM2_LINE_RECORDS_KEPT;
}

size_t hm2_sslbp_line_records(struct hm2_sslbp *sslbp, hm2_line_record *records, size_t capacity)
{
	size_t taken = 0;
	for (; taken < capacity && sslbp->record_count; taken++, sslbp->record_count--) {
		records[taken] = sslbp->records[sslbp->record_head];
		sslbp->record_head = (sslbp->record_head + 1) % HM2_LINE_RECORDS_KEPT;
	}
	return taken;
}

static void deliver(struct hm2_sslbp *s, struct sslbp_uart *uart)
{
	hm2_line_byte *byte = &uart->tx[uart->tx_head];
	record(s, uart, byte, 1);
	uart->tx_head = (uart->tx_head + 1) % TX_RING;
	uart->tx_count--;
	if (uart->remote != NULL && uart->transmits)
		hm2_remote_line_receive(uart->remote, byte);
}

static void receive(struct sslbp_uart *uart, const hm2_line_byte *byte)
{
	if (!uart->receives || uart->bit_ps == 0)
		return;
	if (line_misheard(byte, uart->bit_ps))
		uart->broken = 1;
	if (uart->rx_count < FIFO_SIZE)
		uart->rx[uart->rx_count++] = byte->value;
}

void sslbp_uart_run(struct hm2_sslbp *s, int channel, int64_t until)
{
	struct sslbp_uart *uart = &s->uarts[channel];
	int64_t until_ps = until * s->cycle_ps;
	for (;;) {
		hm2_line_byte byte;
		int64_t heard = NEVER, arrived = NEVER;
		if (uart->tx_count)
			heard = line_heard_ps(&uart->tx[uart->tx_head], uart->tx[uart->tx_head].bit_ps);
		if (uart->remote != NULL && hm2_remote_line_peek(uart->remote, &byte))
			arrived = line_heard_ps(&byte, byte.bit_ps);
		if (heard <= arrived && heard <= until_ps) {
			deliver(s, uart);
		} else if (arrived <= until_ps) {
			record(s, uart, &byte, 0);
			receive(uart, &byte);
			hm2_remote_line_pop(uart->remote);
		} else {
			return;
		}
	}
}

int64_t sslbp_uart_next_event(struct hm2_sslbp *s, int channel)
{
	struct sslbp_uart *uart = &s->uarts[channel];
	hm2_line_byte byte;
	int64_t at = NEVER;
	if (uart->tx_count)
		at = line_heard_ps(&uart->tx[uart->tx_head], uart->tx[uart->tx_head].bit_ps);
	if (uart->remote != NULL && hm2_remote_line_peek(uart->remote, &byte)) {
		int64_t arrived = line_heard_ps(&byte, byte.bit_ps);
		if (arrived < at)
			at = arrived;
	}
	return at == NEVER ? NEVER : (at + s->cycle_ps - 1) / s->cycle_ps;
}

/* Wire off: the frame is heard and answered at once. */
static void exchange(struct hm2_sslbp *s, struct sslbp_uart *uart, const uint8_t *frame, size_t length)
{
	uint8_t answer[4 * FIFO_SIZE];
	if (uart->remote == NULL || !uart->transmits)
		return;
	hm2_remote_advance(uart->remote, s->now * s->cycle_ps);
	size_t count = hm2_remote_exchange(uart->remote, frame, length, answer, sizeof answer);
	if (!uart->receives)
		return;
	for (size_t i = 0; i < count && uart->rx_count < FIFO_SIZE; i++)
		uart->rx[uart->rx_count++] = answer[i];
}

static void push(struct hm2_sslbp *s, struct sslbp_uart *uart, uint8_t value, int64_t at)
{
	int64_t start = uart->tx_free > at ? uart->tx_free : at;
	if (uart->tx_count == TX_RING || uart->bit_ps == 0)
		return;
	uart->tx[(uart->tx_head + uart->tx_count++) % TX_RING] =
		(hm2_line_byte){.start_ps = start * s->cycle_ps, .bit_ps = uart->bit_ps, .value = value};
	uart->tx_emptied = start;
	uart->tx_free = start + uart->pitch;
}

int sslbp_uart_send(struct hm2_sslbp *s, int channel, uint8_t *frame, size_t length, int64_t at)
{
	struct sslbp_uart *uart = &s->uarts[channel];
	int64_t waited = uart->tx_emptied > at ? uart->tx_emptied - at : 0;
	if (!sslbp_block(s, channel)[HM2_SSLBP_CHANNEL_DISABLE_CRC]) {
		frame[length] = hm2_lbp_crc8(frame, length);
		length++;
	}
	if (!s->wire) {
		exchange(s, uart, frame, length);
		return 0;
	}
	for (size_t i = 0; i < length; i++)
		push(s, uart, frame[i], at + waited);
	return (int)waited;
}
