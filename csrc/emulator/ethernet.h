/* The LBP16 engine of an emulated Ethernet card: its state, and what its files offer each other. */
#ifndef HM2_EMULATOR_ETHERNET_H
#define HM2_EMULATOR_ETHERNET_H

#include <pthread.h>

#include "hm2.h"
#include "registers.h"

/* Words of memory space 6. */
enum ethernet_status_word {
	STATUS_ERRORS = HM2_LBP16_CONTROL_ERROR_FLAGS / 2,
	STATUS_PARSE_ERRORS = HM2_LBP16_CONTROL_PARSE_ERRORS / 2,
	STATUS_MEMORY_ERRORS = HM2_LBP16_CONTROL_MEMORY_ERRORS / 2,
	STATUS_WRITE_ERRORS = HM2_LBP16_CONTROL_WRITE_ERRORS / 2,
	STATUS_RX_ALL = HM2_LBP16_CONTROL_RX_PACKETS / 2,
	STATUS_RX_LBP = HM2_LBP16_CONTROL_RX_LBP_PACKETS / 2,
	STATUS_RX_BAD = HM2_LBP16_CONTROL_RX_BAD_PACKETS / 2,
	STATUS_TX_ALL = HM2_LBP16_CONTROL_TX_PACKETS / 2,
	STATUS_TX_LBP = HM2_LBP16_CONTROL_TX_LBP_PACKETS / 2,
	STATUS_TX_BAD = HM2_LBP16_CONTROL_TX_BAD_PACKETS / 2,
	STATUS_LED_MODE = HM2_LBP16_CONTROL_LED_MODE / 2,
	STATUS_LED_POINTER = HM2_LBP16_CONTROL_LED_POINTER / 2,
	STATUS_PACKET_TIME = HM2_LBP16_CONTROL_PACKET_TIME / 2,
	STATUS_KEY = HM2_LBP16_CONTROL_WRITE_KEY / 2,
	STATUS_RESET = HM2_LBP16_CONTROL_RESET / 2,
	STATUS_ICAP = HM2_LBP16_CONTROL_ICAP / 2,
	STATUS_WORDS = HM2_LBP16_CONTROL_SIZE / 2
};

#define ETHERNET_EEPROM_WORDS (HM2_LBP16_EEPROM_SIZE / 2)
#define ETHERNET_REGISTER_FILE 0x10000

enum ethernet_flash_stream { FLASH_IDLE, FLASH_READING, FLASH_PROGRAMMING };

struct ethernet_flash {
	uint8_t *bytes;
	uint32_t size;
	uint32_t address;      /* register 0: advances by 4 with each element of data */
	enum ethernet_flash_stream stream;
	uint32_t page_start;   /* of the program under way */
	uint8_t page[256];     /* what has been clocked in, by place in the page */
	uint8_t loaded[256];
};

/* The FPGA configuration port: remembers the address registers until the reboot command. */
struct ethernet_icap {
	uint16_t previous;
	uint16_t pending;  /* register whose value comes next, 0: none */
	uint16_t low;
	uint16_t high;
	uint8_t synced;
};

struct hm2_ethernet {
	pthread_mutex_t mutex;
	hm2_ethernet_config config;
	hm2_ethernet_card card;
	uint32_t *plain; /* the register file when no card was given */
	uint16_t pointer[8];
	uint16_t info_pointer; /* one for all information areas */
	uint16_t eeprom[ETHERNET_EEPROM_WORDS];
	uint16_t timers[16];
	uint16_t status[STATUS_WORDS];
	uint16_t information[16];
	struct ethernet_flash flash;
	struct ethernet_icap icap;
	int64_t quiet_until_us; /* restarting: frames are lost */
	int image;
	uint8_t reload_requested;
	uint32_t reload_address;
};

int64_t ethernet_now_us(void); /* of the machine and its network */
int64_t ethernet_time_us(const struct hm2_ethernet *ethernet); /* the engine's own */
/* hm2_ethernet_process in two halves, so that the reply need not wait for its own time stamps. */
size_t ethernet_handle(struct hm2_ethernet *ethernet, const uint8_t *request, size_t length, uint8_t *reply);
void ethernet_sent(struct hm2_ethernet *ethernet);
/* The card's lock is let go meanwhile. */
void ethernet_wait_us(struct hm2_ethernet *ethernet, int64_t us);
/* What the card's wait_edge says; -1 from one that has none. */
int64_t ethernet_wait_edge(struct hm2_ethernet *ethernet, int line, uint32_t timeout_us);

/* One element of a memory space: 0, or the error flag (HM2_LBP16_ERROR_*) that it raises. */
int ethernet_space_read(struct hm2_ethernet *ethernet, int space, uint16_t address, uint32_t *value);
int ethernet_space_write(struct hm2_ethernet *ethernet, int space, uint16_t address, uint32_t value);
int ethernet_info_read(struct hm2_ethernet *ethernet, int space, uint16_t address, uint32_t *value);

int ethernet_timer_read(struct hm2_ethernet *ethernet, uint16_t address, uint32_t *value);
int ethernet_timer_write(struct hm2_ethernet *ethernet, uint16_t address, uint32_t value);

int ethernet_status_read(struct hm2_ethernet *ethernet, uint16_t address, uint32_t *value);
int ethernet_status_write(struct hm2_ethernet *ethernet, uint16_t address, uint32_t value);

void ethernet_eeprom_init(struct hm2_ethernet *ethernet);
int ethernet_eeprom_write(struct hm2_ethernet *ethernet, uint16_t address, uint16_t value);

int ethernet_flash_init(struct ethernet_flash *flash, uint8_t id);
void ethernet_flash_idle(struct ethernet_flash *flash);
int ethernet_flash_access_read(struct hm2_ethernet *ethernet, uint16_t address, uint32_t *value);
int ethernet_flash_access_write(struct hm2_ethernet *ethernet, uint16_t address, uint32_t value);
/* Which image a configuration from this flash address ends up in: HM2_ETHERNET_IMAGE_*. */
int ethernet_flash_boot(const struct hm2_ethernet *ethernet, uint32_t address);

void ethernet_icap_write(struct hm2_ethernet *ethernet, uint16_t word);

#endif
