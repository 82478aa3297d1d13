/* Packet UARTs (fact sheet registers.md 2.13): frames of bytes, at most 16 waiting each way. What is sent
 * reaches the outside only through a switched pin. Sizes of the FIFOs within what the sheet allows, and
 * that a FIFO without room loses the frame and says so, are ours. */
#include <stdlib.h>
#include <string.h>

#include "card_modules.h"

#define FRAMES 16
#define WORDS 512          /* 2 KiB */
#define FRAME_BYTES 1023
#define SENT_KEPT 64
#define CLEAR (HM2_PKTUART_COMMAND_CLEAR)

struct frame {
	uint16_t bytes;
	uint32_t flags;    /* as in the receiver's frame word */
};

struct unit {
	uint32_t rate;
	uint32_t mode;
	uint32_t fifo[WORDS];
	int words;
	struct frame frames[FRAMES];
	int frame_count;
	int64_t started;   /* transmitter: of the first frame */
	int data_pin;
	uint8_t sent[SENT_KEPT][FRAME_BYTES];
	uint16_t sent_bytes[SENT_KEPT];
	int sent_count;
};

struct pktuart {
	struct hm2_emulator *card;
	int is_receiver;
	int rate_bits;
	uint32_t only_newer; /* bits of the mode that this version does not have */
	int count;
	struct unit units[];
};

static struct pktuart *create(struct hm2_emulator *card, const struct card_descriptor *descriptor, int receiver)
{
	struct pktuart *uart = calloc(1, sizeof *uart + descriptor->instances * sizeof uart->units[0]);
	if (uart == NULL)
		return NULL;
	uart->card = card;
	uart->is_receiver = receiver;
	uart->rate_bits = descriptor->version >= 2 ? 24 : 20;
	if (descriptor->version < 3)
		uart->only_newer = HM2_PKTUART_TX_MODE_TWO_STOP_BITS_MASK | HM2_PKTUART_TX_MODE_INTER_FRAME_X4_MASK;
	uart->count = descriptor->instances;
	for (int i = 0; i < uart->count; i++)
		uart->units[i].data_pin = card_pin_of(card, HM2_GTAG_PKTUART_TX, i, HM2_PKTUART_TX_PIN_DATA);
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

static void destroy(void *self)
{
	free(self);
}

static int64_t bit_clocks(const struct pktuart *uart, const struct unit *unit, int64_t bits)
{
	return unit->rate == 0 ? CARD_NEVER / 4 : ((bits << uart->rate_bits) + unit->rate - 1) / unit->rate;
}

static int words_of(int bytes)
{
	return (bytes + 3) / 4;
}

static void drop_words(struct unit *unit, int words)
{
	words = words < unit->words ? words : unit->words;
	unit->words -= words;
	memmove(unit->fifo, unit->fifo + words, (size_t)unit->words * sizeof unit->fifo[0]);
}

static void drop_frame(struct unit *unit)
{
	unit->frame_count--;
	memmove(unit->frames, unit->frames + 1, (size_t)unit->frame_count * sizeof unit->frames[0]);
}

static void clear(struct unit *unit)
{
	unit->words = unit->frame_count = 0;
}

/* ---- transmitter ------------------------------------------------------------------------------ */

/* Start, eight bits, parity if on, one or two stop bits. */
static int char_bits(const struct unit *unit)
{
	return 10 + ((unit->mode & HM2_PKTUART_TX_MODE_PARITY_MASK) != 0) +
	       ((unit->mode & HM2_PKTUART_TX_MODE_TWO_STOP_BITS_MASK) != 0);
}

/* With the gap behind it. */
static int64_t frame_bits(const struct unit *unit, int bytes)
{
	int64_t gap = (unit->mode & HM2_PKTUART_TX_MODE_INTER_FRAME_MASK) >> HM2_PKTUART_TX_MODE_INTER_FRAME_LSB;
	if (unit->mode & HM2_PKTUART_TX_MODE_INTER_FRAME_X4_MASK)
		gap *= 4;
	return (int64_t)bytes * char_bits(unit) + gap;
}

/* Bit `at` of a character: start, data from the lowest bit, parity, stop. */
static int character_level(const struct unit *unit, uint8_t byte, int at)
{
	if (at == 0)
		return 0;
	if (at <= 8)
		return (byte >> (at - 1)) & 1;
	if (at > 9 || !(unit->mode & HM2_PKTUART_TX_MODE_PARITY_MASK))
		return 1;
	int parity = (unit->mode & HM2_PKTUART_TX_MODE_PARITY_ODD_MASK) != 0;
	for (int i = 0; i < 8; i++)
		parity ^= (byte >> i) & 1;
	return parity;
}

static int line_level(const struct pktuart *uart, const struct unit *unit)
{
	if (unit->frame_count == 0 || uart->card->clock < unit->started)
		return 1;
	int64_t bit = ((uart->card->clock - unit->started) * unit->rate) >> uart->rate_bits;
	int64_t index = bit / char_bits(unit);
	if (index >= unit->frames[0].bytes)
		return 1;
	uint8_t byte = (uint8_t)(unit->fifo[index / 4] >> 8 * (index % 4));
	return character_level(unit, byte, (int)(bit % char_bits(unit)));
}

static void sent(struct pktuart *uart, struct unit *unit)
{
	int bytes = unit->frames[0].bytes;
	int reaches = unit->data_pin < 0 || ioport_is_switched(uart->card->ioport, unit->data_pin, 1);
	if (reaches && unit->sent_count < SENT_KEPT) {
		for (int i = 0; i < bytes; i++)
			unit->sent[unit->sent_count][i] = (uint8_t)(unit->fifo[i / 4] >> 8 * (i % 4));
		unit->sent_bytes[unit->sent_count++] = (uint16_t)bytes;
	}
	drop_words(unit, words_of(bytes));
	drop_frame(unit);
}

static void tx_advance(void *self, int64_t clock)
{
	struct pktuart *uart = self;
	for (int i = 0; i < uart->count; i++) {
		struct unit *unit = &uart->units[i];
		while (unit->frame_count) {
			int64_t end = unit->started + bit_clocks(uart, unit, frame_bits(unit, unit->frames[0].bytes));
			if (clock < end)
				break;
			sent(uart, unit);
			unit->started = end;
		}
	}
}

static void push_frame(struct pktuart *uart, struct unit *unit, uint32_t bytes)
{
	if (unit->frame_count == FRAMES) {
		unit->mode |= HM2_PKTUART_TX_MODE_FRAME_FIFO_ERROR_MASK;
		return;
	}
	if (unit->frame_count == 0)
		unit->started = uart->card->clock + (unit->mode & HM2_PKTUART_TX_MODE_DRIVE_DELAY_MASK);
	unit->frames[unit->frame_count++] = (struct frame){(uint16_t)bytes, 0};
}

static int write_mode(const struct pktuart *uart, struct unit *unit, uint32_t value)
{
	if (value == CLEAR)
		clear(unit);
	else
		unit->mode = value & ~uart->only_newer; /* at the same places in both directions */
	return 1;
}

static int tx_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct pktuart *uart = self;
	int index = (int)(offset >> 2);
	if (index >= uart->count || reg > HM2_PKTUART_TX_MODE)
		return 0;
	struct unit *unit = &uart->units[index];
	if (reg == HM2_PKTUART_TX_MODE)
		return write_mode(uart, unit, value);
	if (reg == HM2_PKTUART_TX_BIT_RATE)
		unit->rate = value & ((UINT32_C(1) << uart->rate_bits) - 1);
	else if (reg == HM2_PKTUART_TX_FRAME_COUNT)
		push_frame(uart, unit, value & HM2_PKTUART_TX_FRAME_COUNT_BYTES_MASK);
	else if (unit->words < WORDS)
		unit->fifo[unit->words++] = value;
	return 1;
}

static uint32_t tx_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	const struct pktuart *uart = self;
	int index = (int)(offset >> 2);
	if (index >= uart->count || (reg != HM2_PKTUART_TX_BIT_RATE && reg != HM2_PKTUART_TX_MODE))
		return 0;
	const struct unit *unit = &uart->units[index];
	const uint32_t stored = UINT32_C(0xFFFF) & ~HM2_PKTUART_TX_MODE_BUSY_MASK;
	if (reg == HM2_PKTUART_TX_BIT_RATE)
		*value = unit->rate;
	else
		*value = (unit->mode & stored) | (unit->frame_count ? HM2_PKTUART_TX_MODE_BUSY_MASK : 0) |
		         (unit->words ? HM2_PKTUART_TX_MODE_HAS_DATA_MASK : 0) |
		         (uint32_t)unit->frame_count << HM2_PKTUART_TX_MODE_FRAMES_WAITING_LSB;
	return CARD_ALL_DRIVEN;
}

static int tx_output(void *self, int unit, int number)
{
	const struct pktuart *uart = self;
	if (unit >= uart->count)
		return 0;
	const struct unit *u = &uart->units[unit];
	int driving = (u->mode & HM2_PKTUART_TX_MODE_DRIVE_ENABLE_MASK) ||
	              ((u->mode & HM2_PKTUART_TX_MODE_DRIVE_AUTO_MASK) && u->frame_count);
	if (number == HM2_PKTUART_TX_PIN_DRIVE_ENABLE)
		return driving;
	if (number == HM2_PKTUART_TX_PIN_NOT_DRIVE_ENABLE)
		return !driving;
	return line_level(uart, u);
}

/* ---- receiver --------------------------------------------------------------------------------- */

static uint32_t pop_frame(struct unit *unit)
{
	if (unit->frame_count == 0) {
		unit->mode |= HM2_PKTUART_RX_MODE_POP_ERROR_MASK;
		return 0;
	}
	uint32_t word = unit->frames[0].bytes | unit->frames[0].flags;
	drop_frame(unit);
	return word;
}

static uint32_t rx_read(void *self, int reg, uint32_t offset, uint32_t *value)
{
	struct pktuart *uart = self;
	int index = (int)(offset >> 2);
	if (index >= uart->count || reg > HM2_PKTUART_RX_MODE)
		return 0;
	struct unit *unit = &uart->units[index];
	const uint32_t only_written = HM2_PKTUART_RX_MODE_FRAMES_WAITING_MASK | HM2_PKTUART_RX_MODE_HAS_DATA_MASK;
	if (reg == HM2_PKTUART_RX_DATA) {
		*value = unit->words ? unit->fifo[0] : 0;
		drop_words(unit, 1);
	} else if (reg == HM2_PKTUART_RX_FRAME_COUNT) {
		*value = pop_frame(unit);
	} else if (reg == HM2_PKTUART_RX_BIT_RATE) {
		*value = unit->rate;
	} else {
		*value = (unit->mode & ~only_written) | (unit->words ? HM2_PKTUART_RX_MODE_HAS_DATA_MASK : 0) |
		         (uint32_t)unit->frame_count << HM2_PKTUART_RX_MODE_FRAMES_WAITING_LSB;
	}
	return CARD_ALL_DRIVEN;
}

static int rx_write(void *self, int reg, uint32_t offset, uint32_t value)
{
	struct pktuart *uart = self;
	int index = (int)(offset >> 2);
	if (index >= uart->count || (reg != HM2_PKTUART_RX_BIT_RATE && reg != HM2_PKTUART_RX_MODE))
		return 0;
	if (reg == HM2_PKTUART_RX_MODE)
		return write_mode(uart, &uart->units[index], value);
	uart->units[index].rate = value;
	return 1;
}

/* ---- the outside ------------------------------------------------------------------------------ */

static struct unit *unit_of(hm2_emulator *card, uint8_t gtag, int unit)
{
	struct pktuart *all = card_instances(card, gtag, unit);
	return all ? &all->units[unit] : NULL;
}

int hm2_emulator_pktuart_send(hm2_emulator *card, int unit, const uint8_t *bytes, size_t count, uint32_t flags)
{
	CARD_HOLD(card);
	struct unit *rx = unit_of(card, HM2_GTAG_PKTUART_RX, unit);
	if (rx == NULL || count == 0 || count > FRAME_BYTES)
		return HM2_ERR_RANGE;
	if (!(rx->mode & HM2_PKTUART_RX_MODE_RECEIVE_ENABLE_MASK))
		return HM2_OK; /* nobody listens */
	if (rx->frame_count == FRAMES || rx->words + words_of((int)count) > WORDS) {
		rx->mode |= HM2_PKTUART_RX_MODE_FRAME_FIFO_ERROR_MASK;
		return HM2_OK;
	}
	for (size_t i = 0; i < count; i += 4) {
		uint32_t word = 0;
		for (size_t k = 0; k < 4 && i + k < count; k++)
			word |= (uint32_t)bytes[i + k] << 8 * k;
		rx->fifo[rx->words++] = word;
	}
	rx->frames[rx->frame_count++] = (struct frame){(uint16_t)count, flags & ~HM2_PKTUART_RX_FRAME_COUNT_BYTES_MASK};
	return HM2_OK;
}

int hm2_emulator_pktuart_received(hm2_emulator *card, int unit, uint8_t *bytes, size_t capacity, size_t *count)
{
	CARD_HOLD(card);
	struct unit *tx = unit_of(card, HM2_GTAG_PKTUART_TX, unit);
	if (tx == NULL || capacity < FRAME_BYTES)
		return HM2_ERR_RANGE;
	if (tx->sent_count == 0)
		return 0;
	*count = tx->sent_bytes[0];
	memcpy(bytes, tx->sent[0], *count);
	tx->sent_count--;
	memmove(tx->sent[0], tx->sent[1], (size_t)tx->sent_count * sizeof tx->sent[0]);
	memmove(tx->sent_bytes, tx->sent_bytes + 1, (size_t)tx->sent_count * sizeof tx->sent_bytes[0]);
	return 1;
}

const struct card_module_type pktuart_tx_type = {
	.create = tx_create,
	.destroy = destroy,
	.read = tx_read,
	.write = tx_write,
	.advance = tx_advance,
	.output = tx_output,
};

const struct card_module_type pktuart_rx_type = {
	.create = rx_create,
	.destroy = destroy,
	.read = rx_read,
	.write = rx_write,
};
