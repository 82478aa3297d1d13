/* Who looks at a served card comes between two packets: whatever reaches its registers or the memory of a remote that
 * hangs on it, from a packet or from an observer, has the card's own lock meanwhile. */
/* link: -Wl,--wrap=card_lock -Wl,--wrap=card_read_words -Wl,--wrap=card_write_words -Wl,--wrap=hm2_remote_peek -Wl,--wrap=hm2_remote_poke */
#include <pthread.h>
#include <string.h>

#include "check.h"
#include "emulator/card.h"
#include "hm2.h"

static hm2_emulator *card;
static int locks, reads, writes, peeks, pokes;

pthread_mutex_t *__real_card_lock(const struct hm2_emulator *self);
pthread_mutex_t *__wrap_card_lock(const struct hm2_emulator *self);
pthread_mutex_t *__wrap_card_lock(const struct hm2_emulator *self)
{
	locks++;
	return __real_card_lock(self);
}

static void *try_lock(void *argument)
{
	int *taken = argument;

	*taken = pthread_mutex_trylock(&card->lock) == 0;
	if (*taken)
		pthread_mutex_unlock(&card->lock);
	return NULL;
}

/* Whether another thread could have the card now: the lock is recursive, this thread always could. */
static int others_may(void)
{
	pthread_t thread;
	int taken = 0;

	CHECK_EQUAL(pthread_create(&thread, NULL, try_lock, &taken), 0);
	pthread_join(thread, NULL);
	return taken;
}

int __real_card_read_words(struct hm2_emulator *self, uint32_t address, uint32_t *words, size_t count, hm2_error *error);
int __wrap_card_read_words(struct hm2_emulator *self, uint32_t address, uint32_t *words, size_t count, hm2_error *error);
int __wrap_card_read_words(struct hm2_emulator *self, uint32_t address, uint32_t *words, size_t count, hm2_error *error)
{
	reads++;
	CHECK(!others_may());
	return __real_card_read_words(self, address, words, count, error);
}

int __real_card_write_words(struct hm2_emulator *self, uint32_t address, const uint32_t *words, size_t count,
                            hm2_error *error);
int __wrap_card_write_words(struct hm2_emulator *self, uint32_t address, const uint32_t *words, size_t count,
                            hm2_error *error);
int __wrap_card_write_words(struct hm2_emulator *self, uint32_t address, const uint32_t *words, size_t count,
                            hm2_error *error)
{
	writes++;
	CHECK(!others_may());
	return __real_card_write_words(self, address, words, count, error);
}

int __real_hm2_remote_peek(hm2_remote *remote, int space, uint32_t address, uint8_t *bytes, size_t length);
int __wrap_hm2_remote_peek(hm2_remote *remote, int space, uint32_t address, uint8_t *bytes, size_t length);
int __wrap_hm2_remote_peek(hm2_remote *remote, int space, uint32_t address, uint8_t *bytes, size_t length)
{
	peeks++;
	CHECK(!others_may());
	return __real_hm2_remote_peek(remote, space, address, bytes, length);
}

int __real_hm2_remote_poke(hm2_remote *remote, int space, uint32_t address, const uint8_t *bytes, size_t length);
int __wrap_hm2_remote_poke(hm2_remote *remote, int space, uint32_t address, const uint8_t *bytes, size_t length);
int __wrap_hm2_remote_poke(hm2_remote *remote, int space, uint32_t address, const uint8_t *bytes, size_t length)
{
	pokes++;
	CHECK(!others_may());
	return __real_hm2_remote_poke(remote, space, address, bytes, length);
}

static void open_card(void)
{
	uint32_t idrom[44] = {3, 64, 80, 0x4153454D, 0x54534554, 9, 24, 1, 24, 24, 33333333, 200000000, 4, 64, 256, 256,
	                      0x01010003, 0x00051000, 0x1F};
	const hm2_emulator_options options = {.clock = HM2_CLOCK_VIRTUAL, .leds = 2};
	hm2_error error;

	for (int pin = 0; pin < 24; pin++)
		idrom[20 + pin] = (uint32_t)HM2_GTAG_IOPORT << 24;
	CHECK_EQUAL(hm2_emulator_new(idrom, sizeof idrom / sizeof *idrom, &options, &card, &error), HM2_OK);
}

static void test_a_packet_has_the_card_for_all_of_its_accesses(void)
{
	const hm2_ethernet_config config = {.name = "7I92", .flash_id = 0x13, .lbp_version = 3, .firmware_version = 15};
	const uint8_t packet[] = {0x01, 0xC2, 0x00, 0x10, 0x34, 0x12, 0, 0, 0x01, 0x42, 0x00, 0x01};
	uint8_t reply[HM2_LBP16_MAX_PAYLOAD];
	hm2_ethernet_card face;

	open_card();
	hm2_ethernet_emulator(card, &face);
	struct hm2_ethernet *ethernet = hm2_ethernet_new(&config, &face);
	CHECK(ethernet != NULL);
	reads = writes = 0;
	CHECK_EQUAL(hm2_ethernet_process(ethernet, packet, sizeof packet, reply), 4);
	CHECK_EQUAL(writes, 1);
	CHECK_EQUAL(reads, 1);
	CHECK(others_may()); /* it was given back */
	hm2_ethernet_free(ethernet);
	hm2_emulator_free(card);
}

static void test_an_observer_of_a_remote_has_the_card(void)
{
	const uint8_t written[2] = {0x12, 0x34};
	uint8_t bytes[2] = {0};
	hm2_remote *remote = hm2_remote_new();

	open_card();
	peeks = pokes = 0;
	CHECK_EQUAL(hm2_emulator_poke_remote(card, remote, HM2_LBP_SPACE_RAM, 0x200, written, 2), HM2_OK);
	CHECK_EQUAL(hm2_emulator_peek_remote(card, remote, HM2_LBP_SPACE_RAM, 0x200, bytes, 2), HM2_OK);
	CHECK_EQUAL(memcmp(bytes, written, 2), 0);
	CHECK_EQUAL(pokes, 1);
	CHECK_EQUAL(peeks, 1);
	CHECK(others_may());
	hm2_emulator_free(card);
	hm2_remote_free(remote);
}

static void test_a_look_at_the_leds_takes_the_card(void)
{
	open_card();
	locks = 0;
	CHECK_EQUAL(hm2_emulator_leds(card), 0);
	CHECK_EQUAL(locks, 1);
	CHECK(others_may());
	hm2_emulator_free(card);
}

int main(void)
{
	test_a_packet_has_the_card_for_all_of_its_accesses();
	test_an_observer_of_a_remote_has_the_card();
	test_a_look_at_the_leds_takes_the_card();
	return CHECK_RESULT();
}
