/* Parsing the ID block, the IDROM header and its descriptors: pure, bounded, and never trusting a word. */
#include "idrom.h"

#include <string.h>

#define HEADER_BYTES (HM2_IDROM_HEADER_WORDS * 4u)
#define CLOCK_MIN_HZ 1000000u

int hm2_idrom_finding(hm2_error *error, int detail, uint32_t address, hm2_idrom_evidence evidence)
{
	const int status = hm2_error_set(error, HM2_ERR_FORMAT, "idrom");
	if (error) {
		error->detail = detail;
		error->index = evidence.index;
		error->address = address;
		error->expected = evidence.expected;
		error->received = evidence.received;
	}
	return status;
}

static int finding(hm2_error *error, int detail, uint32_t address, uint32_t expected, uint32_t received)
{
	return hm2_idrom_finding(error, detail, address, (hm2_idrom_evidence){-1, expected, received});
}

/* Words carry text least significant character first. */
static void unpack_name(char *name, uint32_t low, uint32_t high)
{
	for (int i = 0; i < 4; i++) {
		name[i] = (char)(low >> 8 * i & 0x7F);
		name[4 + i] = (char)(high >> 8 * i & 0x7F);
	}
	memset(name + 8, 0, 4);
}

int hm2_idrom_parse_id(const uint32_t words[4], hm2_idrom *idrom, hm2_error *error)
{
	memset(idrom, 0, sizeof *idrom);
	if (words[0] != HM2_ID_WORD_COOKIE)
		return finding(error, HM2_BROKEN_COOKIE, HM2_ID_ADDRESS, HM2_ID_WORD_COOKIE, words[0]);
	if (words[1] != HM2_ID_WORD_CONFIG_NAME_LOW)
		return finding(error, HM2_BROKEN_CONFIG_NAME, HM2_ID_ADDRESS + 4, HM2_ID_WORD_CONFIG_NAME_LOW, words[1]);
	if (words[2] != HM2_ID_WORD_CONFIG_NAME_HIGH)
		return finding(error, HM2_BROKEN_CONFIG_NAME, HM2_ID_ADDRESS + 8, HM2_ID_WORD_CONFIG_NAME_HIGH, words[2]);
	const uint32_t offset = words[3] & 0xFFFF; /* the upper half is not driven by every firmware */
	const uint32_t highest = HM2_ADDRESS_SPACE - HEADER_BYTES;
	if (offset % 4 || offset > highest)
		return finding(error, HM2_BROKEN_OFFSET, HM2_ID_ADDRESS + 12, highest, words[3]);
	idrom->offset = offset;
	unpack_name(idrom->config_name, words[1], words[2]);
	return HM2_OK;
}

int hm2_idrom_check_type(const hm2_idrom *idrom, uint32_t type, hm2_error *error)
{
	if (type != 2 && type != 3)
		return finding(error, HM2_BROKEN_TYPE, idrom->offset, 3, type);
	return HM2_OK;
}

static void unpack_header(const uint32_t words[16], hm2_idrom *idrom)
{
	idrom->type = words[HM2_IDROM_TYPE / 4];
	idrom->module_offset = words[HM2_IDROM_MODULE_OFFSET / 4];
	idrom->pin_offset = words[HM2_IDROM_PIN_OFFSET / 4];
	unpack_name(idrom->board_name, words[HM2_IDROM_BOARD_NAME_LOW / 4], words[HM2_IDROM_BOARD_NAME_HIGH / 4]);
	idrom->fpga_size = words[HM2_IDROM_FPGA_SIZE / 4];
	idrom->fpga_pins = words[HM2_IDROM_FPGA_PINS / 4];
	idrom->io_ports = words[HM2_IDROM_IO_PORTS / 4];
	idrom->io_width = words[HM2_IDROM_IO_WIDTH / 4];
	idrom->port_width = words[HM2_IDROM_PORT_WIDTH / 4];
	idrom->clock_low = words[HM2_IDROM_CLOCK_LOW / 4];
	idrom->clock_high = words[HM2_IDROM_CLOCK_HIGH / 4];
	for (int i = 0; i < 2; i++) {
		idrom->instance_stride[i] = words[HM2_IDROM_INSTANCE_STRIDE_0 / 4 + i];
		idrom->register_stride[i] = words[HM2_IDROM_REGISTER_STRIDE_0 / 4 + i];
	}
}

static int check_ports(const hm2_idrom *idrom, uint32_t expected_width, uint32_t expected_ports, hm2_error *error)
{
	const uint32_t at = idrom->offset, width = idrom->port_width, ports = idrom->io_ports;
	if (expected_width != HM2_IDROM_NONE ? width != expected_width : width < 1 || width > 32)
		return finding(error, HM2_BROKEN_PORT_WIDTH, at + HM2_IDROM_PORT_WIDTH,
		               expected_width != HM2_IDROM_NONE ? expected_width : 32, width);
	if (ports == 0)
		return finding(error, HM2_BROKEN_IO_PORTS, at + HM2_IDROM_IO_PORTS,
		               expected_ports != HM2_IDROM_NONE ? expected_ports : 1, ports);
	const uint64_t product = (uint64_t)ports * width;
	if (idrom->io_width != product)
		return finding(error, HM2_BROKEN_IO_WIDTH, at + HM2_IDROM_IO_WIDTH,
		               product > UINT32_MAX ? UINT32_MAX : (uint32_t)product, idrom->io_width);
	if (expected_ports != HM2_IDROM_NONE && ports != expected_ports)
		return finding(error, HM2_BROKEN_IO_PORTS, at + HM2_IDROM_IO_PORTS, expected_ports, ports);
	if (idrom->io_width > HM2_IDROM_PINS_MAX)
		return finding(error, HM2_BROKEN_IO_WIDTH_LIMIT, at + HM2_IDROM_IO_WIDTH, HM2_IDROM_PINS_MAX, idrom->io_width);
	return HM2_OK;
}

int hm2_idrom_parse_header(const uint32_t words[16], uint32_t expected_port_width, uint32_t expected_io_ports,
                           hm2_idrom *idrom, hm2_error *error)
{
	unpack_header(words, idrom);
	int status = hm2_idrom_check_type(idrom, idrom->type, error);
	if (status == HM2_OK)
		status = check_ports(idrom, expected_port_width, expected_io_ports, error);
	if (status != HM2_OK)
		return status;
	if (idrom->clock_low < CLOCK_MIN_HZ)
		return finding(error, HM2_BROKEN_CLOCK_LOW, idrom->offset + HM2_IDROM_CLOCK_LOW, CLOCK_MIN_HZ, idrom->clock_low);
	if (idrom->clock_high < CLOCK_MIN_HZ)
		return finding(error, HM2_BROKEN_CLOCK_HIGH, idrom->offset + HM2_IDROM_CLOCK_HIGH, CLOCK_MIN_HZ, idrom->clock_high);
	return HM2_OK;
}

/* Bytes between a descriptor table and the end of the register file; 0 when the table cannot lie there. */
static uint32_t table_room(const hm2_idrom *idrom, uint32_t table_offset)
{
	if (table_offset % 4 || table_offset < HEADER_BYTES || table_offset >= HM2_ADDRESS_SPACE - idrom->offset)
		return 0;
	return HM2_ADDRESS_SPACE - idrom->offset - table_offset;
}

int hm2_idrom_check_pin_offset(const hm2_idrom *idrom, hm2_error *error)
{
	if (table_room(idrom, idrom->pin_offset) / 4 >= idrom->io_width && idrom->io_width > 0)
		return HM2_OK;
	return finding(error, HM2_BROKEN_PIN_OFFSET, idrom->offset + HM2_IDROM_PIN_OFFSET,
	               HM2_ADDRESS_SPACE - idrom->offset - idrom->io_width * 4, idrom->pin_offset);
}

int hm2_idrom_parse_pins(const hm2_idrom *idrom, const uint32_t *words, size_t word_count,
                         hm2_pin_descriptor *pins, size_t capacity, hm2_error *error)
{
	if (idrom->io_width > word_count || idrom->io_width > capacity || idrom->port_width == 0) {
		const int status = hm2_error_set(error, HM2_ERR_RANGE, "idrom pins");
		if (error)
			error->expected = idrom->io_width;
		return status;
	}
	for (uint32_t i = 0; i < idrom->io_width; i++) {
		const uint32_t word = words[i], at = idrom->offset + idrom->pin_offset + 4 * i;
		const uint32_t bit = i % idrom->port_width;
		pins[i] = (hm2_pin_descriptor){(uint8_t)word, (uint8_t)(word >> 8), (uint8_t)(word >> 16),
		                               (uint8_t)(word >> 24)};
		if (pins[i].primary_tag == 0)
			return hm2_idrom_finding(error, HM2_BROKEN_PIN_LIST_SHORT, at,
			                         (hm2_idrom_evidence){(int32_t)i, idrom->io_width, word});
		if (pins[i].primary_tag != HM2_GTAG_IOPORT)
			return hm2_idrom_finding(error, HM2_BROKEN_PIN_PRIMARY_TAG, at,
			                         (hm2_idrom_evidence){(int32_t)i, HM2_GTAG_IOPORT,
			                                              pins[i].primary_tag});
		if (bit > 31)
			return hm2_idrom_finding(error, HM2_BROKEN_PIN_RANGE, at,
			                         (hm2_idrom_evidence){(int32_t)i, 31, bit});
	}
	return HM2_OK;
}

int hm2_idrom_check_module_offset(const hm2_idrom *idrom, size_t *words, hm2_error *error)
{
	uint32_t room = table_room(idrom, idrom->module_offset);
	if (room < 4 * HM2_IDROM_MODULE_WORDS)
		return finding(error, HM2_BROKEN_MODULE_OFFSET, idrom->offset + HM2_IDROM_MODULE_OFFSET,
		               HM2_ADDRESS_SPACE - idrom->offset - 4 * HM2_IDROM_MODULE_WORDS, idrom->module_offset);
	if (idrom->pin_offset > idrom->module_offset && idrom->pin_offset - idrom->module_offset < room)
		room = idrom->pin_offset - idrom->module_offset;
	*words = room / 4;
	if (*words > HM2_IDROM_MODULES_MAX * HM2_IDROM_MODULE_WORDS)
		*words = HM2_IDROM_MODULES_MAX * HM2_IDROM_MODULE_WORDS;
	return HM2_OK;
}

/* The strides a module selects must be able to tell its registers and instances apart. */
static int check_strides(const hm2_idrom *idrom, const hm2_module_descriptor *module, int32_t index, hm2_error *error)
{
	const uint32_t header = idrom->offset;
	const uint32_t instance = module->stride_selects >> 4, reg = module->stride_selects & 15;
	if (module->registers > 1 && module->register_stride == 0)
		return hm2_idrom_finding(error, HM2_BROKEN_MODULE_STRIDE_ZERO, header + HM2_IDROM_REGISTER_STRIDE_0 + 4 * reg,
		                         (hm2_idrom_evidence){index, 4, 0});
	if (module->instances > 1 && module->multiple && module->instance_stride == 0)
		return hm2_idrom_finding(error, HM2_BROKEN_MODULE_STRIDE_ZERO, header + HM2_IDROM_INSTANCE_STRIDE_0 + 4 * instance,
		                         (hm2_idrom_evidence){index, 4, 0});
	return HM2_OK;
}

/* Every register of every instance must be a word. */
static int check_alignment(const hm2_module_descriptor *module, int32_t index, hm2_error *error)
{
	const uint32_t places[] = {module->base, module->register_stride, module->instance_stride};
	for (size_t i = 0; i < sizeof places / sizeof *places; i++)
		if (places[i] % 4)
			return hm2_idrom_finding(error, HM2_BROKEN_MODULE_ALIGNMENT, module->address,
			                         (hm2_idrom_evidence){index, 4, places[i]});
	return HM2_OK;
}

static int check_range(const hm2_module_descriptor *module, int32_t index, hm2_error *error)
{
	if (module->registers == 0)
		return HM2_OK; /* a presence marker */
	uint64_t highest = module->base + (uint64_t)(module->registers - 1) * module->register_stride;
	if (module->multiple && module->instances)
		highest += (uint64_t)(module->instances - 1) * module->instance_stride;
	if (highest <= HM2_ADDRESS_SPACE - 4)
		return check_alignment(module, index, error);
	const uint32_t received = highest > UINT32_MAX ? UINT32_MAX : (uint32_t)highest;
	return hm2_idrom_finding(error, HM2_BROKEN_MODULE_RANGE, module->address,
	                         (hm2_idrom_evidence){index, HM2_ADDRESS_SPACE - 4, received});
}

static int parse_module(const hm2_idrom *idrom, const uint32_t words[3], hm2_module_descriptor *module,
                        int32_t index, hm2_error *error)
{
	const uint8_t selects = (uint8_t)(words[1] >> 24);
	const uint8_t clock_tag = (uint8_t)(words[0] >> 16);
	*module = (hm2_module_descriptor){
		.address = idrom->offset + idrom->module_offset + (uint32_t)index * 4 * HM2_IDROM_MODULE_WORDS,
		.gtag = (uint8_t)words[0],
		.version = (uint8_t)(words[0] >> 8),
		.clock_tag = clock_tag,
		.instances = (uint8_t)(words[0] >> 24),
		.base = (uint16_t)words[1],
		.registers = (uint8_t)(words[1] >> 16),
		.stride_selects = selects,
		.multiple = words[2],
	};
	if (clock_tag != 1 && clock_tag != 2)
		return hm2_idrom_finding(error, HM2_BROKEN_MODULE_CLOCK_TAG, module->address,
		                         (hm2_idrom_evidence){index, 1, clock_tag});
	if (selects & 0xEE)
		return hm2_idrom_finding(error, HM2_BROKEN_MODULE_STRIDE_SELECT, module->address + 4,
		                         (hm2_idrom_evidence){index, 0x11, selects});
	module->clock = clock_tag == 1 ? idrom->clock_low : idrom->clock_high;
	module->register_stride = idrom->register_stride[selects & 15];
	module->instance_stride = idrom->instance_stride[selects >> 4];
	const int status = check_strides(idrom, module, index, error);
	return status == HM2_OK ? check_range(module, index, error) : status;
}

int hm2_idrom_parse_modules(const hm2_idrom *idrom, const uint32_t *words, size_t word_count,
                            hm2_module_descriptor *modules, size_t capacity, size_t *count, hm2_error *error)
{
	const size_t limit = capacity < HM2_IDROM_MODULES_MAX ? capacity : HM2_IDROM_MODULES_MAX;
	size_t index = 0;
	*count = 0;
	for (; index < limit && (index + 1) * HM2_IDROM_MODULE_WORDS <= word_count; index++) {
		const uint32_t *descriptor = words + index * HM2_IDROM_MODULE_WORDS;
		if ((descriptor[0] & 0xFF) == 0)
			return HM2_OK;
		const int status = parse_module(idrom, descriptor, &modules[index], (int32_t)index, error);
		if (status != HM2_OK)
			return status;
		*count = index + 1;
	}
	/* the end tag alone may be all that fits before the pins */
	if (index * HM2_IDROM_MODULE_WORDS < word_count && (words[index * HM2_IDROM_MODULE_WORDS] & 0xFF) == 0)
		return HM2_OK;
	return hm2_idrom_finding(error, HM2_BROKEN_MODULE_LIST_UNTERMINATED,
	                         idrom->offset + idrom->module_offset + (uint32_t)index * 12,
	                         (hm2_idrom_evidence){(int32_t)index, 0, 0});
}
