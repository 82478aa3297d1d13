/* UARTs, transmitters and receivers as separate modules (fact sheet registers.md 2.12). Bytes take ten
 * bit times; what is sent reaches the outside only through a switched pin. The bits of the modes beyond
 * the drive enable, and that entries of several bytes go out low byte first, are ours. */
#include <stdlib.h>
#include <string.h>

#include "card_modules.h"

#define ENTRIES 16
#define FIFO 16           /* bytes of a receiver */
#define LINE_KEPT 4096    /* bytes from and to the outside */
#define BITS 10
#define DDS_BITS 20
#define INSTANCE_LSB 4    /* instances are 16 bytes apart */

struct entry {
	uint8_t bytes[4];
	int count;
};

struct transmitter {
	uint32_t rate;
	uint32_t mode;
	struct entry fifo[ENTRIES];
	int entries;
	int byte;           /* of the first entry, in the shift register */
	int64_t started;    /* its start bit; CARD_NEVER: idle */
	int data_pin;
	uint8_t sent[LINE_KEPT];
	size_t sent_count;
};

struct receiver {
	uint32_t rate;
	uint32_t mode;
	uint8_t fifo[FIFO];
	int count;
	uint8_t coming[LINE_KEPT];
	size_t coming_count;
	int64_t started;    /* of the first byte to come */
};

struct uart {
	struct hm2_emulator *card;
	int is_receiver;
	int count;
	struct transmitter *transmitters;
	struct receiver *receivers;
};

static void uart_destroy(void *self)
{
	struct uart *uart = self;
	free(uart->transmitters);
	free(uart->receivers);
	free(uart);
}

static struct uart *create(struct hm2_emulator *card, const struct card_descriptor *descriptor, int is_receiver)
{
	struct uart *uart = calloc(1, sizeof *uart);
	if (uart == NULL)
		return NULL;
	uart->card = card;
	uart->is_receiver = is_receiver;
	uart->count = descriptor->instances;
	uart->transmitters = calloc((size_t)uart->count + 1, sizeof *uart->transmitters);
	uart->receivers = calloc((size_t)uart->count + 1, sizeof *uart->receivers);
	if (uart->transmitters == NULL || uart->receivers == NULL) {
		uart_destroy(uart);
		return NULL;
	}
	for (int i = 0; i < uart->count; i++) {
		uart->transmitters[i].started = CARD_NEVER;
		uart->transmitters[i].data_pin = card_pin_of(card, HM2_GTAG_UART_TX, i, HM2_UART_TX_PIN_DATA);
	}
	return uart;
}

static void *tx_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	return create(card, descriptor, 0);
}

static void *rx_create(struct hm2_emulator *card, const struct card_descriptor *descriptor)
{
	return create(card, descriptor, 1);
}

/* Clocks of `count` bits; a rate of 0 never ends. */
static int64_t bit_clocks(uint32_t rate, int64_t count)
{
	return rate == 0 ? CARD_NEVER / 4 : ((count << DDS_BITS) + rate - 1) / rate;
}

/* ---- transmitter ------------------------------------------------------------------------------ */

static void sent(struct uart *uart, struct transmitter *tx)
{
	struct entry *entry = &tx->fifo[0];
	int reaches = tx->data_pin < 0 || ioport_is_switched(uart->card->ioport, tx->data_pin, 1);
	if (reaches && tx->sent_count < LINE_KEPT)
		tx->sent[tx->sent_count++] = entry->bytes[tx->byte];
	if (++tx->byte < entry->count)
		return;
	tx->byte = 0;
	tx->entries--;
	memmove(&tx->fifo[0], &tx->fifo[1], (size_t)tx->entries * sizeof tx->fifo[0]);
}

static void tx_advance(void *self, int64_t clock)
{
	struct uart *uart = self;
	for (int i = 0; i < uart->count; i++) {
		struct transmitter *tx = &uart->transmitters[i];
		while (tx->entries && clock >= tx->started + bit_clocks(tx->rate, BITS)) {
			int64_t end = tx->started + bit_clocks(tx->rate, BITS);
			sent(uart, tx);
			tx->started = tx->entries ? end : CARD_NEVER;
		}
	}
}

static void push(struct uart *uart, struct transmitter *tx, uint32_t value, int count)
{
	if (tx->entries == ENTRIES) {
		tx->mode |= HM2_UART_TX_MODE_FIFO_ERROR_MASK;
		return;
	}
	struct entry *entry = &tx->fifo[tx->entries];
	for (int i = 0; i < 4; i++)
		entry->bytes[i] = (uint8_t)(value >> 8 * i);
	entry->count = count;
	if (tx->entries++ == 0)
		tx->started = uart->card->clock + (tx->mode & HM2_UART_TX_MODE_DRIVE_DELAY_MASK);
}

static uint32_t tx_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct uart *uart = self;
	int index = (int)(offset >> INSTANCE_LSB);
	if (index >= uart->count || reg == HM2_UART_TX_DATA || reg > HM2_UART_TX_MODE)
		return 0;
	const struct transmitter *tx = &uart->transmitters[index];
	*value = reg == HM2_UART_TX_COUNT ? (uint32_t)tx->entries : reg == HM2_UART_TX_MODE ? tx->mode : tx->rate;
	return CARD_ALL_DRIVEN;
}

static int tx_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct uart *uart = self;
	int index = (int)(offset >> INSTANCE_LSB);
	if (index >= uart->count || reg > HM2_UART_TX_MODE)
		return 0;
	struct transmitter *tx = &uart->transmitters[index];
	if (reg == HM2_UART_TX_DATA) {
		push(uart, tx, value, (int)(offset >> 2 & 3) + 1);
	} else if (reg == HM2_UART_TX_COUNT) {
		tx->entries = tx->byte = 0;
		tx->started = CARD_NEVER;
	} else if (reg == HM2_UART_TX_BIT_RATE) {
		tx->rate = value & HM2_UART_TX_BIT_RATE_RATE_MASK;
	} else {
		tx->mode = value & (HM2_UART_TX_MODE_DRIVE_DELAY_MASK | HM2_UART_TX_MODE_FIFO_ERROR_MASK |
		                    HM2_UART_TX_MODE_DRIVE_AUTO_MASK | HM2_UART_TX_MODE_DRIVE_ENABLE_MASK);
	}
	return 1;
}

static int tx_output(void *self, int unit, int number)
{
	const struct uart *uart = self;
	if (unit >= uart->count)
		return 0;
	const struct transmitter *tx = &uart->transmitters[unit];
	if (number == HM2_UART_TX_PIN_DRIVE_ENABLE)
		return (tx->mode & HM2_UART_TX_MODE_DRIVE_ENABLE_MASK) != 0 ||
		       ((tx->mode & HM2_UART_TX_MODE_DRIVE_AUTO_MASK) && tx->entries);
	if (tx->entries == 0 || uart->card->clock < tx->started)
		return 1;
	int64_t bit = ((uart->card->clock - tx->started) * tx->rate) >> DDS_BITS;
	uint32_t frame = (uint32_t)tx->fifo[0].bytes[tx->byte] << 1 | 1u << 9;
	return bit > 9 || ((frame >> bit) & 1);
}

/* ---- receiver --------------------------------------------------------------------------------- */

static void rx_advance(void *self, int64_t clock)
{
	struct uart *uart = self;
	for (int i = 0; i < uart->count; i++) {
		struct receiver *rx = &uart->receivers[i];
		size_t taken = 0;
		while (taken < rx->coming_count && clock >= rx->started + bit_clocks(rx->rate, BITS)) {
			if (rx->count < FIFO)
				rx->fifo[rx->count++] = rx->coming[taken];
			else
				rx->mode |= HM2_UART_RX_MODE_FIFO_ERROR_MASK | HM2_UART_RX_MODE_LOST_DATA_MASK;
			taken++;
			rx->started += bit_clocks(rx->rate, BITS);
		}
		if (taken)
			memmove(rx->coming, rx->coming + taken, rx->coming_count - taken);
		rx->coming_count -= taken;
	}
}

static uint32_t pop(struct receiver *rx, int wanted)
{
	uint32_t value = 0;
	int count = wanted < rx->count ? wanted : rx->count;
	for (int i = 0; i < count; i++)
		value |= (uint32_t)rx->fifo[i] << 8 * i;
	rx->count -= count;
	memmove(rx->fifo, rx->fifo + count, (size_t)rx->count);
	return value;
}

static uint32_t rx_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	struct uart *uart = self;
	int index = (int)(offset >> INSTANCE_LSB);
	if (index >= uart->count || reg > HM2_UART_RX_MODE)
		return 0;
	struct receiver *rx = &uart->receivers[index];
	if (reg == HM2_UART_RX_DATA)
		*value = pop(rx, (int)(offset >> 2 & 3) + 1);
	else if (reg == HM2_UART_RX_COUNT)
		*value = (uint32_t)rx->count;
	else if (reg == HM2_UART_RX_BIT_RATE)
		*value = rx->rate;
	else
		*value = rx->mode | (rx->count ? HM2_UART_RX_MODE_HAS_DATA_MASK : 0);
	return CARD_ALL_DRIVEN;
}

static int rx_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct uart *uart = self;
	int index = (int)(offset >> INSTANCE_LSB);
	if (index >= uart->count || reg > HM2_UART_RX_MODE || reg == HM2_UART_RX_DATA)
		return 0;
	struct receiver *rx = &uart->receivers[index];
	if (reg == HM2_UART_RX_COUNT)
		rx->count = 0;
	else if (reg == HM2_UART_RX_BIT_RATE)
		rx->rate = value & HM2_UART_RX_BIT_RATE_RATE_MASK;
	else
		rx->mode = value & ~HM2_UART_RX_MODE_HAS_DATA_MASK;
	return 1;
}

/* ---- the outside ------------------------------------------------------------------------------ */

int hm2_emulator_uart_send(hm2_emulator *card, int unit, const uint8_t *bytes, size_t count)
{
	CARD_HOLD(card);
	struct uart *all = card_instances(card, HM2_GTAG_UART_RX, unit);
	if (all == NULL)
		return HM2_ERR_RANGE;
	struct receiver *rx = &all->receivers[unit];
	if (count > LINE_KEPT - rx->coming_count)
		return HM2_ERR_RANGE;
	if (rx->coming_count == 0)
		rx->started = card->clock;
	if (count)
		memcpy(rx->coming + rx->coming_count, bytes, count);
	rx->coming_count += count;
	return HM2_OK;
}

int hm2_emulator_uart_received(hm2_emulator *card, int unit, uint8_t *bytes, size_t capacity, size_t *count)
{
	CARD_HOLD(card);
	struct uart *all = card_instances(card, HM2_GTAG_UART_TX, unit);
	if (all == NULL)
		return HM2_ERR_RANGE;
	struct transmitter *tx = &all->transmitters[unit];
	*count = tx->sent_count < capacity ? tx->sent_count : capacity;
	if (*count)
		memcpy(bytes, tx->sent, *count);
	tx->sent_count = 0;
	return HM2_OK;
}

const struct card_module_type uart_tx_type = {
	.create = tx_create,
	.destroy = uart_destroy,
	.read = tx_read,
	.write = tx_write,
	.advance = tx_advance,
	.output = tx_output,
};

const struct card_module_type uart_rx_type = {
	.create = rx_create,
	.destroy = uart_destroy,
	.read = rx_read,
	.write = rx_write,
	.advance = rx_advance,
};
