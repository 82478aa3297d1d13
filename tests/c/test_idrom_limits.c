/* The IDROM's parsers at the limits of what they are given: too few words, too little room, ends that are not there. */
#include <string.h>

#include "check.h"
#include "hm2.h"

static const hm2_idrom GOOD = {.offset = 0x400, .io_width = 2, .port_width = 2, .io_ports = 1, .pin_offset = 0x200,
                               .module_offset = 0x40, .clock_low = 33333333, .clock_high = 200000000,
                               .instance_stride = {4, 64}, .register_stride = {256, 4}};
static hm2_error error;

static void test_pins_need_their_words_and_their_room(void)
{
	const uint32_t words[2] = {0x03000000, 0x03000000};
	hm2_pin_descriptor pins[2];
	hm2_idrom idrom = GOOD;
	CHECK_EQUAL(hm2_idrom_parse_pins(&idrom, words, 2, pins, 2, &error), HM2_OK);
	CHECK_EQUAL(hm2_idrom_parse_pins(&idrom, words, 1, pins, 2, &error), HM2_ERR_RANGE);
	CHECK_EQUAL(error.expected, 2);
	CHECK_EQUAL(hm2_idrom_parse_pins(&idrom, words, 2, pins, 1, NULL), HM2_ERR_RANGE);
	idrom.port_width = 0;
	CHECK_EQUAL(hm2_idrom_parse_pins(&idrom, words, 2, pins, 2, &error), HM2_ERR_RANGE);
	idrom = GOOD;
	idrom.io_width = 0;
	CHECK_EQUAL(hm2_idrom_check_pin_offset(&idrom, &error), HM2_ERR_FORMAT);
	CHECK_EQUAL(error.detail, HM2_BROKEN_PIN_OFFSET);
}

static void test_a_module_list_needs_an_end(void)
{
	uint32_t words[7] = {0x01010003, 0x00051000, 0x1F, 0x01010002, 0x00030C00, 0, 0};
	hm2_module_descriptor modules[2];
	size_t count = 0;
	CHECK_EQUAL(hm2_idrom_parse_modules(&GOOD, words, 7, modules, 2, &count, &error), HM2_OK); /* the end tag alone fits */
	CHECK_EQUAL(count, 2);
	CHECK_EQUAL(hm2_idrom_parse_modules(&GOOD, words, 6, modules, 2, &count, &error), HM2_ERR_FORMAT);
	CHECK_EQUAL(error.detail, HM2_BROKEN_MODULE_LIST_UNTERMINATED);
	words[6] = 0x01010004;
	CHECK_EQUAL(hm2_idrom_parse_modules(&GOOD, words, 7, modules, 2, &count, &error), HM2_ERR_FORMAT);
	CHECK_EQUAL(error.index, 2);
}

static void test_a_module_beyond_the_register_file(void)
{
	const uint32_t words[6] = {0xFF010005, 0x00FF2000, 0x3FF, 0, 0, 0};
	hm2_module_descriptor modules[2];
	hm2_idrom idrom = GOOD;
	size_t count = 0;
	idrom.register_stride[0] = 0xFFFFFF00; /* more than an address can say */
	CHECK_EQUAL(hm2_idrom_parse_modules(&idrom, words, 6, modules, 2, &count, &error), HM2_ERR_FORMAT);
	CHECK_EQUAL(error.detail, HM2_BROKEN_MODULE_RANGE);
	CHECK_EQUAL(error.received, UINT32_MAX);
	const uint32_t none[6] = {0x00010005, 0x00012000, 0x3FF, 0, 0, 0}; /* no instances: one register at its base */
	CHECK_EQUAL(hm2_idrom_parse_modules(&GOOD, none, 6, modules, 2, &count, &error), HM2_OK);
	CHECK_EQUAL(modules[0].instances, 0);
}

/* Words to read: to the pins, if they come behind, else to the end of the register file, never more than 48 modules. */
static void test_how_many_words_the_modules_have(void)
{
	hm2_idrom idrom = GOOD;
	size_t words = 0;
	CHECK_EQUAL(hm2_idrom_check_module_offset(&idrom, &words, &error), HM2_OK);
	CHECK_EQUAL(words, (0x200 - 0x40) / 4);
	idrom.pin_offset = 0x20; /* before them */
	CHECK_EQUAL(hm2_idrom_check_module_offset(&idrom, &words, &error), HM2_OK);
	CHECK_EQUAL(words, 3 * HM2_IDROM_MODULES_MAX);
	idrom.pin_offset = 0x40000000; /* nowhere: not these words' business */
	CHECK_EQUAL(hm2_idrom_check_module_offset(&idrom, &words, &error), HM2_OK);
	CHECK_EQUAL(words, 3 * HM2_IDROM_MODULES_MAX);
	idrom.module_offset = 0x10000 - 0x400 - 8;
	CHECK_EQUAL(hm2_idrom_check_module_offset(&idrom, &words, &error), HM2_ERR_FORMAT);
}

static void test_a_header_that_cannot_be(void)
{
	uint32_t words[16] = {3, 64, 512, 0x4153454D, 0x54534554, 9, 144, 1, 24, 24, 33333333, 200000000, 4, 64, 256, 4};
	hm2_idrom idrom = {.offset = 0x400};
	CHECK_EQUAL(hm2_idrom_parse_header(words, HM2_IDROM_NONE, HM2_IDROM_NONE, &idrom, &error), HM2_OK);
	words[0] = 4;
	CHECK_EQUAL(hm2_idrom_parse_header(words, HM2_IDROM_NONE, HM2_IDROM_NONE, &idrom, &error), HM2_ERR_FORMAT);
	CHECK_EQUAL(error.detail, HM2_BROKEN_TYPE);
	words[0] = 3;
	words[7] = UINT32_MAX; /* ports times width is more than a word */
	CHECK_EQUAL(hm2_idrom_parse_header(words, HM2_IDROM_NONE, HM2_IDROM_NONE, &idrom, &error), HM2_ERR_FORMAT);
	CHECK_EQUAL(error.detail, HM2_BROKEN_IO_WIDTH);
	CHECK_EQUAL(error.expected, UINT32_MAX);
}

int main(void)
{
	test_pins_need_their_words_and_their_room();
	test_a_module_list_needs_an_end();
	test_a_module_beyond_the_register_file();
	test_how_many_words_the_modules_have();
	test_a_header_that_cannot_be();
	return CHECK_RESULT();
}
