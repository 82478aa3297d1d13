/* The LBP16 packet engine: one datagram in, at most one out. Fact sheet lbp16.md 3. */
#include "ethernet.h"
#include "inheriting_mutex.h"

#include <stdlib.h>
#include <string.h>
#include <time.h>

int64_t ethernet_now_us(void)
{
	struct timespec now;

	clock_gettime(CLOCK_MONOTONIC, &now);
	return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

int64_t ethernet_time_us(const struct hm2_ethernet *ethernet)
{
	return ethernet->card.now_us ? ethernet->card.now_us(ethernet->card.self) : ethernet_now_us();
}

static void enter(struct hm2_ethernet *ethernet)
{
	if (ethernet->card.enter)
		ethernet->card.enter(ethernet->card.self);
}

static void leave(struct hm2_ethernet *ethernet)
{
	if (ethernet->card.leave)
		ethernet->card.leave(ethernet->card.self);
}

void ethernet_wait_us(struct hm2_ethernet *ethernet, int64_t us)
{
	const struct timespec time = {.tv_sec = us / 1000000, .tv_nsec = us % 1000000 * 1000};

	leave(ethernet);
	if (ethernet->card.pause_us)
		ethernet->card.pause_us(ethernet->card.self, us);
	else
		clock_nanosleep(CLOCK_MONOTONIC, 0, &time, NULL);
	enter(ethernet);
}

int64_t ethernet_wait_edge(struct hm2_ethernet *ethernet, int line, uint32_t timeout_us)
{
	int64_t waited = -1;

	if (!ethernet->card.wait_edge) {
		if (timeout_us)
			ethernet_wait_us(ethernet, timeout_us);
		return waited;
	}
	leave(ethernet);
	waited = ethernet->card.wait_edge(ethernet->card.self, line, timeout_us);
	enter(ethernet);
	return waited;
}

static void plain_read(void *self, uint32_t address, uint32_t *words, size_t count)
{
	struct hm2_ethernet *ethernet = self;

	memcpy(words, &ethernet->plain[address / 4], 4 * count);
}

static void plain_write(void *self, uint32_t address, const uint32_t *words, size_t count)
{
	struct hm2_ethernet *ethernet = self;

	memcpy(&ethernet->plain[address / 4], words, 4 * count);
}

/* Everything that lives in RAM; the EEPROM is read again. FPGA registers are not touched. */
static void restart(struct hm2_ethernet *ethernet)
{
	memset(ethernet->pointer, 0, sizeof ethernet->pointer);
	ethernet->info_pointer = 0;
	memset(ethernet->timers, 0, sizeof ethernet->timers);
	memset(ethernet->status, 0, sizeof ethernet->status);
	memset(ethernet->information, 0, sizeof ethernet->information);
	memset(&ethernet->icap, 0, sizeof ethernet->icap);
	ethernet_flash_idle(&ethernet->flash);
	memcpy(ethernet->information, &ethernet->eeprom[HM2_LBP16_EEPROM_CARD_NAME / 2], 16); /* card name */
	ethernet->information[HM2_LBP16_BOARD_LBP16_VERSION / 2] = ethernet->config.lbp_version;
	ethernet->information[HM2_LBP16_BOARD_FIRMWARE_VERSION / 2] = ethernet->config.firmware_version;
	ethernet->information[HM2_LBP16_BOARD_JUMPERS / 2] = ethernet->config.jumpers;
	ethernet->status[STATUS_LED_MODE] = ethernet->eeprom[HM2_LBP16_EEPROM_LED_MODE / 2];
	ethernet->status[STATUS_LED_POINTER] = HM2_LBP16_CONTROL_RX_PACKETS;
	ethernet->reload_requested = 0;
}

struct hm2_ethernet *hm2_ethernet_new(const hm2_ethernet_config *config, const hm2_ethernet_card *card)
{
	struct hm2_ethernet *ethernet = calloc(1, sizeof *ethernet);

	if (!ethernet)
		return NULL;
	ethernet->config = *config;
	if (card) {
		ethernet->card = *card;
	} else {
		ethernet->plain = calloc(ETHERNET_REGISTER_FILE / 4, sizeof *ethernet->plain);
		ethernet->card = (hm2_ethernet_card){.self = ethernet, .read = plain_read, .write = plain_write};
	}
	if ((!card && !ethernet->plain) || !ethernet_flash_init(&ethernet->flash, config->flash_id)) {
		free(ethernet->plain);
		free(ethernet);
		return NULL;
	}
	inheriting_mutex_init(&ethernet->mutex);
	ethernet_eeprom_init(ethernet);
	restart(ethernet);
	return ethernet;
}

void hm2_ethernet_free(struct hm2_ethernet *ethernet)
{
	if (!ethernet)
		return;
	pthread_mutex_destroy(&ethernet->mutex);
	free(ethernet->flash.bytes);
	free(ethernet->plain);
	free(ethernet);
}

void hm2_ethernet_hold(struct hm2_ethernet *ethernet)
{
	pthread_mutex_lock(&ethernet->mutex);
}

void hm2_ethernet_release(struct hm2_ethernet *ethernet)
{
	pthread_mutex_unlock(&ethernet->mutex);
}

static void configure_fpga(struct hm2_ethernet *ethernet, uint32_t address)
{
	ethernet->image = ethernet_flash_boot(ethernet, address);
	if (ethernet->plain)
		memset(ethernet->plain, 0, ETHERNET_REGISTER_FILE);
	if (ethernet->card.reload)
		ethernet->card.reload(ethernet->card.self);
	restart(ethernet);
}

void hm2_ethernet_power_up(struct hm2_ethernet *ethernet)
{
	pthread_mutex_lock(&ethernet->mutex);
	configure_fpga(ethernet, ethernet->config.efinix ? ethernet->flash.size / 2 : 0);
	ethernet->quiet_until_us = 0;
	pthread_mutex_unlock(&ethernet->mutex);
}

static inline void put_element(uint8_t *to, uint32_t value, unsigned size)
{
	for (unsigned i = 0; i < size; i++)
		to[i] = (uint8_t)(value >> 8 * i);
}

static inline uint32_t get_element(const uint8_t *from, unsigned size)
{
	uint32_t value = 0;

	for (unsigned i = 0; i < size; i++)
		value |= (uint32_t)from[i] << 8 * i;
	return value;
}

/* Spaces 0 and 3 are 32 bits wide, all others and all information areas 16; there is no space 5. */
static int width_allowed(const hm2_lbp16_command *command)
{
	if (command->space == 5)
		return 0;
	if (!command->info && (command->space == 0 || command->space == 3))
		return command->element_size == 4;
	return command->element_size == 2;
}

static int element(struct hm2_ethernet *ethernet, const hm2_lbp16_command *command, uint16_t address, uint32_t *value)
{
	if (command->info && command->write)
		return HM2_LBP16_ERROR_WRITE;
	if (command->info)
		return ethernet_info_read(ethernet, command->space, address, value);
	if (command->write)
		return ethernet_space_write(ethernet, command->space, address, *value);
	return ethernet_space_read(ethernet, command->space, address, value);
}

/* Reply bytes are counted past the buffer's end: the size check comes when the packet is done. */
static void reply_element(uint8_t *reply, size_t *length, uint32_t value, unsigned size)
{
	if (*length + size <= HM2_LBP16_MAX_PAYLOAD)
		put_element(reply + *length, value, size);
	*length += size;
}

static void reply_words(uint8_t *reply, size_t *length, const uint32_t *words, uint32_t count)
{
	uint8_t *to = reply + *length;

	*length += 4 * (size_t)count;
	if (*length > HM2_LBP16_MAX_PAYLOAD)
		return; /* the whole reply is lost */
	for (uint32_t i = 0; i < count; i++, to += 4)
		put_element(to, words[i], 4);
}

/* Words of the register file up to its end, or one when the address stays. */
static uint32_t registers_at_once(const hm2_lbp16_command *command, uint32_t address, uint32_t left)
{
	const uint32_t room = (ETHERNET_REGISTER_FILE - address) / 4;

	if (!command->increment)
		return 1;
	return left < room ? left : room;
}

/* Space 0, in runs of words: this is what a cycle is made of. */
static void run_registers(struct hm2_ethernet *ethernet, const hm2_lbp16_command *command, const uint8_t *data,
                          uint8_t *reply, size_t *reply_length)
{
	const hm2_ethernet_card *card = &ethernet->card;
	uint32_t words[HM2_LBP16_MAX_COUNT];
	uint32_t left = command->count;

	while (left) {
		const uint32_t address = ethernet->pointer[0] & 0xFFFCu;
		const uint32_t count = registers_at_once(command, address, left);

		if (command->write) {
			for (uint32_t i = 0; i < count; i++, data += 4)
				words[i] = get_element(data, 4);
			card->write(card->self, address, words, count);
		} else {
			card->read(card->self, address, words, count);
			reply_words(reply, reply_length, words, count);
		}
		if (command->increment)
			ethernet->pointer[0] = (uint16_t)(ethernet->pointer[0] + 4 * count);
		left -= count;
	}
}

static int run(struct hm2_ethernet *ethernet, const hm2_lbp16_command *command, const uint8_t *data, uint8_t *reply,
               size_t *reply_length)
{
	uint16_t *pointer = command->info ? &ethernet->info_pointer : &ethernet->pointer[command->space];
	const unsigned size = command->element_size;
	/* the firmware's step through space 3's information area is 3, though it reads the right words */
	const unsigned step = command->info && command->space == 3 ? 3 : size;
	const int advances = command->increment && (command->info || command->space != 3);
	uint16_t address;

	if (command->has_address)
		*pointer = command->address;
	if (!command->info && command->space == 0) {
		run_registers(ethernet, command, data, reply, reply_length);
		return 0;
	}
	address = *pointer;
	for (unsigned i = 0; i < command->count && !ethernet->reload_requested; i++) {
		uint32_t value = command->write ? get_element(data + i * size, size) : 0;
		const int fault = element(ethernet, command, address, &value);

		if (fault)
			return fault;
		if (!command->write)
			reply_element(reply, reply_length, value, size);
		if (advances) {
			address = (uint16_t)(address + size);
			*pointer = (uint16_t)(*pointer + step);
		}
	}
	return 0;
}

/* All commands in order until the first error, or until the FPGA reloads: 0, or the error's bit. */
static int run_packet(struct hm2_ethernet *ethernet, const uint8_t *request, size_t length, uint8_t *reply,
                      size_t *reply_length)
{
	hm2_lbp16_command command;
	const uint8_t *data;
	size_t offset = 0;

	while (offset < length && !ethernet->reload_requested) {
		const int status = hm2_lbp16_next(request, length, &offset, &command, &data);
		int fault;

		if (status == HM2_ERR_FORMAT || !width_allowed(&command))
			return HM2_LBP16_ERROR_PARSE;
		if (status != HM2_OK)
			return HM2_LBP16_ERROR_MEMORY; /* hardware would write stale buffer bytes */
		fault = run(ethernet, &command, data, reply, reply_length);
		if (fault)
			return fault;
	}
	return 0;
}

static void count_error(struct hm2_ethernet *ethernet, int fault)
{
	const int word = fault == HM2_LBP16_ERROR_PARSE    ? STATUS_PARSE_ERRORS
	                 : fault == HM2_LBP16_ERROR_MEMORY ? STATUS_MEMORY_ERRORS
	                                                  : STATUS_WRITE_ERRORS;

	ethernet->status[STATUS_ERRORS] |= (uint16_t)fault;
	if (ethernet->status[word] != 0xFFFF)
		ethernet->status[word]++;
}

/* What happens between two packets: the key is gone, a reset or reload asked for takes place. */
static void end_packet(struct hm2_ethernet *ethernet)
{
	ethernet->status[STATUS_KEY] = 0;
	if (ethernet->reload_requested) {
		configure_fpga(ethernet, ethernet->reload_address);
		ethernet->quiet_until_us = ethernet_time_us(ethernet) + ethernet->config.reload_us;
	} else if (ethernet->status[STATUS_RESET]) {
		restart(ethernet);
		ethernet->quiet_until_us = ethernet_time_us(ethernet) + ethernet->config.restart_us;
	}
}

static size_t packet(struct hm2_ethernet *ethernet, const uint8_t *request, size_t length, uint8_t *reply, int64_t start)
{
	size_t reply_length = 0;
	int fault;

	ethernet->status[STATUS_RX_ALL]++;
	ethernet->information[HM2_LBP16_BOARD_RX_START / 2] = ethernet->information[HM2_LBP16_BOARD_RX_END / 2] = (uint16_t)start;
	fault = run_packet(ethernet, request, length & ~(size_t)1, reply, &reply_length);
	if (fault)
		count_error(ethernet, fault);
	if (fault || ethernet->reload_requested)
		return 0;
	ethernet->status[STATUS_RX_LBP]++;
	if (reply_length > HM2_LBP16_MAX_PAYLOAD) {
		ethernet->status[STATUS_ERRORS] |= HM2_LBP16_ERROR_TX_SIZE;
		ethernet->status[STATUS_TX_BAD]++;
		return 0;
	}
	if (reply_length) {
		ethernet->status[STATUS_TX_ALL]++;
		ethernet->status[STATUS_TX_LBP]++;
	}
	return reply_length;
}

void ethernet_sent(struct hm2_ethernet *ethernet)
{
	const uint16_t now = (uint16_t)ethernet_time_us(ethernet);
	uint16_t *information = ethernet->information;

	pthread_mutex_lock(&ethernet->mutex);
	information[HM2_LBP16_BOARD_TX_START / 2] = information[HM2_LBP16_BOARD_TX_END / 2] = now;
	ethernet->status[STATUS_PACKET_TIME] = (uint16_t)(now - information[HM2_LBP16_BOARD_RX_START / 2]);
	pthread_mutex_unlock(&ethernet->mutex);
}

size_t ethernet_handle(struct hm2_ethernet *ethernet, const uint8_t *request, size_t length, uint8_t *reply)
{
	const int64_t start = ethernet_time_us(ethernet);
	size_t reply_length = 0;

	pthread_mutex_lock(&ethernet->mutex);
	if (start >= ethernet->quiet_until_us && ethernet->image != HM2_ETHERNET_IMAGE_NONE) {
		if (length > HM2_LBP16_MAX_PAYLOAD) {
			ethernet->status[STATUS_RX_ALL]++;
			ethernet->status[STATUS_RX_BAD]++;
			ethernet->status[STATUS_ERRORS] |= HM2_LBP16_ERROR_RX_FRAME;
		} else {
			enter(ethernet);
			reply_length = packet(ethernet, request, length, reply, start);
			end_packet(ethernet);
			leave(ethernet);
		}
	}
	pthread_mutex_unlock(&ethernet->mutex);
	return reply_length;
}

size_t hm2_ethernet_process(struct hm2_ethernet *ethernet, const uint8_t *request, size_t length, uint8_t *reply)
{
	const size_t reply_length = ethernet_handle(ethernet, request, length, reply);

	if (reply_length)
		ethernet_sent(ethernet);
	return reply_length;
}
