/* A remote's process data: images, elements in RAM, software modes, faults and watchdog. */
#include "remote_state.h"

#include <string.h>

#define STATUS_7I64 3      /* byte of the 7I64's answer, and of what it is sent */
#define WATCHDOG_7I64 0x08 /* bit in both */

/* ---- elements between an image and RAM --------------------------------------------------- */

static size_t ram_bytes(const remote_element *element)
{
	return (size_t)(element->bits + 7) / 8;
}

static void move_bits(uint8_t *to, unsigned to_bit, const uint8_t *from, unsigned from_bit, unsigned bits)
{
	for (unsigned i = 0; i < bits; i++, to_bit++, from_bit++) {
		uint8_t mask = (uint8_t)(1u << (to_bit & 7));

		if (from[from_bit >> 3] >> (from_bit & 7) & 1)
			to[to_bit >> 3] |= mask;
		else
			to[to_bit >> 3] &= (uint8_t)~mask;
	}
}

static const remote_element *element_at(const hm2_remote *remote, size_t index)
{
	return &remote->elements[remote->mode->first + index];
}

/* The host's values become visible in RAM only when somebody looks: the cycle stays short. */
void remote_images_to_ram(hm2_remote *remote)
{
	if (!remote->outputs_stale || !remote->mode)
		return;
	remote->outputs_stale = 0;
	for (size_t i = 0; i < remote->mode->count; i++) {
		const remote_element *element = element_at(remote, i);

		if (!element->address || element->direction == HM2_DATA_DIRECTION_IN)
			continue;
		memset(remote->ram + element->address, 0, ram_bytes(element));
		move_bits(remote->ram + element->address, 0, remote->output_image, element->output_bit, element->bits);
		if (element->direction == HM2_DATA_DIRECTION_BIDIRECTIONAL)
			remote->inputs_stale = 1;
	}
}

/* RAM address..+length changed: outputs follow at once, inputs before they are next sent. */
void remote_ram_to_images(hm2_remote *remote, uint32_t address, size_t length)
{
	remote->inputs_stale = 1;
	if (!remote->mode || remote_gated(remote))
		return;
	for (size_t i = 0; i < remote->mode->count; i++) {
		const remote_element *element = element_at(remote, i);

		if (!element->address || element->direction == HM2_DATA_DIRECTION_IN)
			continue;
		if (address < element->address + ram_bytes(element) && element->address < address + length)
			move_bits(remote->output_image, element->output_bit, remote->ram + element->address, 0, element->bits);
	}
}

void remote_refresh_inputs(hm2_remote *remote)
{
	if (remote->mode && remote->mode->both_ways)
		remote_images_to_ram(remote);
	if (!remote->inputs_stale)
		return;
	remote->inputs_stale = 0;
	for (size_t i = 0; remote->mode && i < remote->mode->count; i++) {
		const remote_element *element = element_at(remote, i);

		if (element->address && element->direction != HM2_DATA_DIRECTION_OUT)
			move_bits(remote->input_image, element->input_bit, remote->ram + element->address, 0, element->bits);
	}
}

void remote_inputs_to_ram(hm2_remote *remote)
{
	for (size_t i = 0; remote->mode && i < remote->mode->count; i++) {
		const remote_element *element = element_at(remote, i);

		if (!element->address || element->direction == HM2_DATA_DIRECTION_OUT)
			continue;
		memset(remote->ram + element->address, 0, ram_bytes(element));
		move_bits(remote->ram + element->address, 0, remote->input_image, element->input_bit, element->bits);
	}
}

/* ---- software modes ---------------------------------------------------------------------- */

int hm2_remote_add_mode(hm2_remote *remote, uint8_t mode, uint8_t receive_size, uint8_t transmit_size,
                        uint16_t ptoc, uint16_t gtoc)
{
	if (remote->mode_count == MODES_MAX || receive_size == 0)
		return HM2_ERR_RANGE;
	remote->modes[remote->mode_count++] = (remote_mode){
		.index = mode,
		.receive_size = receive_size,
		.transmit_size = transmit_size,
		.ptoc = ptoc,
		.gtoc = gtoc,
		.first = (uint16_t)remote->element_count,
	};
	remote_select_mode(remote, (uint8_t)remote->knob[HM2_REMOTE_SOFTWARE_MODE]);
	return HM2_OK;
}

int hm2_remote_add_element(hm2_remote *remote, uint8_t mode, uint8_t bits, uint8_t direction, uint16_t address)
{
	remote_mode *last = remote->mode_count ? &remote->modes[remote->mode_count - 1] : NULL;
	remote_element element = { .address = address, .bits = bits, .direction = direction };

	if (!last || last->index != mode || remote->element_count == ELEMENTS_MAX || bits == 0)
		return HM2_ERR_RANGE;
	if (address + ram_bytes(&element) > RAM_SIZE)
		return HM2_ERR_RANGE;
	element.input_bit = last->input_bits;
	element.output_bit = last->output_bits;
	const int input_bits = last->input_bits + (direction != HM2_DATA_DIRECTION_OUT ? bits : 0);
	const int output_bits = last->output_bits + (direction != HM2_DATA_DIRECTION_IN ? bits : 0);
	if (input_bits > 8 * HM2_REMOTE_DATA_MAX || output_bits > 8 * HM2_REMOTE_DATA_MAX)
		return HM2_ERR_RANGE;
	last->input_bits = (uint16_t)input_bits;
	last->output_bits = (uint16_t)output_bits;
	last->both_ways |= direction == HM2_DATA_DIRECTION_BIDIRECTIONAL;
	remote->elements[remote->element_count++] = element;
	last->count++;
	remote->inputs_stale = 1;
	return HM2_OK;
}

static void adopt_mode(hm2_remote *remote, const remote_mode *mode)
{
	remote->mode = mode;
	remote->knob[HM2_REMOTE_RECEIVE_SIZE] = mode->receive_size;
	remote->knob[HM2_REMOTE_TRANSMIT_SIZE] = mode->transmit_size;
	remote->knob[HM2_REMOTE_PTOC] = mode->ptoc;
	remote->knob[HM2_REMOTE_GTOC] = mode->gtoc;
	if (remote->illegal_mode)
		*remote_faults(remote) &= ~(int64_t)HM2_REMOTE_FAULT_ILLEGAL_MODE;
	remote->illegal_mode = 0;
	remote_show_faults(remote);
	memset(remote->input_image, 0, sizeof remote->input_image);
	memset(remote->output_image, 0, sizeof remote->output_image);
	remote->inputs_stale = 1;
}

void remote_select_mode(hm2_remote *remote, uint8_t mode)
{
	remote_images_to_ram(remote);
	remote->knob[HM2_REMOTE_SOFTWARE_MODE] = mode;
	if (remote->mode_count == 0)
		return;
	for (size_t i = 0; i < remote->mode_count; i++) {
		if (remote->modes[i].index == mode) {
			adopt_mode(remote, &remote->modes[i]);
			return;
		}
	}
	/* The last legal layout stays: the sizes of a frame must always be defined. */
	remote->illegal_mode = 1;
	*remote_faults(remote) |= HM2_REMOTE_FAULT_ILLEGAL_MODE;
	remote_show_faults(remote);
}

/* ---- faults and watchdog ----------------------------------------------------------------- */

int64_t *remote_faults(hm2_remote *remote)
{
	int word = remote->knob[HM2_REMOTE_MODEL] == HM2_REMOTE_8I20;

	return &remote->knob[word ? HM2_REMOTE_FAULT_WORD : HM2_REMOTE_FAULT];
}

int remote_gated(hm2_remote *remote)
{
	if (remote->knob[HM2_REMOTE_MODEL] == HM2_REMOTE_8I20)
		return remote->knob[HM2_REMOTE_FAULT_GATES] && remote_8i20_unmasked(remote);
	return remote->knob[HM2_REMOTE_FAULT_GATES] && *remote_faults(remote);
}

void remote_outputs_off(hm2_remote *remote)
{
	memset(remote->output_image, 0, sizeof remote->output_image);
	remote->outputs_stale = 1;
}

void remote_show_faults(hm2_remote *remote)
{
	int64_t address = remote->knob[HM2_REMOTE_FAULT_ADDRESS];

	if (remote_gated(remote))
		remote_outputs_off(remote);
	if (address >= 0) {
		remote->ram[address] = (uint8_t)remote->knob[HM2_REMOTE_FAULT];
		remote->ram[address + 1] = 0;
	}
	remote_8i20_show_faults(remote);
	remote->inputs_stale = 1;
}

void remote_clear_faults(hm2_remote *remote)
{
	if (!remote->knob[HM2_REMOTE_FAULT_CLEARS])
		return;
	*remote_faults(remote) = remote->illegal_mode ? HM2_REMOTE_FAULT_ILLEGAL_MODE : 0;
	remote_show_faults(remote);
	remote_feed_watchdog(remote);
	remote_8i20_supervise(remote); /* what is still so is a fault again */
}

void remote_feed_watchdog(hm2_remote *remote)
{
	remote->fed_ps = remote->now_ps;
}

static int64_t watchdog_ps(const hm2_remote *remote)
{
	int64_t address = remote->knob[HM2_REMOTE_WATCHDOG_ADDRESS];

	if (address < 0)
		return remote->knob[HM2_REMOTE_WATCHDOG_PS];
	return (remote->ram[address] | remote->ram[address + 1] << 8) * remote->knob[HM2_REMOTE_WATCHDOG_UNIT_PS];
}

void remote_check_watchdog(hm2_remote *remote)
{
	int64_t period = watchdog_ps(remote);

	if (remote->knob[HM2_REMOTE_MODEL] == HM2_REMOTE_8I20)
		remote_8i20_supervise(remote);
	if (period == 0 || remote->now_ps - remote->fed_ps <= period || *remote_faults(remote) & HM2_REMOTE_FAULT_WATCHDOG)
		return;
	*remote_faults(remote) |= HM2_REMOTE_FAULT_WATCHDOG;
	remote_set_status(remote, HM2_LBP_STATUS_WATCHDOG);
	remote_show_faults(remote);
}

/* ---- the process data RPC ---------------------------------------------------------------- */

/* A 7I64 is told to clear its watchdog, and tells that it has bitten, in one byte each way. */
static void process_7i64(hm2_remote *remote, const uint8_t *outputs, size_t sent)
{
	uint8_t *status = &remote->input_image[STATUS_7I64];

	if (sent > STATUS_7I64 && outputs[STATUS_7I64] & WATCHDOG_7I64 && remote->knob[HM2_REMOTE_FAULT_CLEARS]) {
		remote_clear_faults(remote);
		*status &= (uint8_t)~WATCHDOG_7I64;
	}
	remote_refresh_inputs(remote);
	if (remote->knob[HM2_REMOTE_FAULT] & HM2_REMOTE_FAULT_WATCHDOG)
		*status |= WATCHDOG_7I64;
}

void remote_process(hm2_remote *remote, const uint8_t *outputs, remote_answer *answer)
{
	size_t sent = (size_t)remote->knob[HM2_REMOTE_TRANSMIT_SIZE];
	size_t size = (size_t)remote->knob[HM2_REMOTE_RECEIVE_SIZE];

	remote_feed_watchdog(remote);
	if (remote->knob[HM2_REMOTE_MODEL] == HM2_REMOTE_7I64)
		process_7i64(remote, outputs, sent);
	if (!remote_gated(remote)) {
		memcpy(remote->output_image, outputs, sent);
		remote->outputs_stale = 1;
	}
	remote_8i20_supervise(remote);
	remote_refresh_inputs(remote);
	if (remote->knob[HM2_REMOTE_MODEL] == HM2_REMOTE_GENERIC) {
		answer->bytes[answer->length++] = (uint8_t)remote->knob[HM2_REMOTE_FAULT];
		size--;
	}
	memcpy(answer->bytes + answer->length, remote->input_image, size);
	answer->length += size;
}

static size_t input_size(const hm2_remote *remote)
{
	size_t size = (size_t)remote->knob[HM2_REMOTE_RECEIVE_SIZE];

	return remote->knob[HM2_REMOTE_MODEL] == HM2_REMOTE_GENERIC ? size - 1 : size;
}

int hm2_remote_set_inputs(hm2_remote *remote, const uint8_t *bytes, size_t length)
{
	if (length > HM2_REMOTE_DATA_MAX)
		return HM2_ERR_RANGE;
	memset(remote->input_image, 0, sizeof remote->input_image);
	memcpy(remote->input_image, bytes, length);
	remote->inputs_stale = 0;
	remote_inputs_to_ram(remote);
	return HM2_OK;
}

static size_t copy_out(uint8_t *bytes, size_t capacity, const uint8_t *image, size_t size)
{
	memcpy(bytes, image, size < capacity ? size : capacity);
	return size;
}

size_t hm2_remote_inputs(hm2_remote *remote, uint8_t *bytes, size_t capacity)
{
	remote_refresh_inputs(remote);
	return copy_out(bytes, capacity, remote->input_image, input_size(remote));
}

size_t hm2_remote_outputs(hm2_remote *remote, uint8_t *bytes, size_t capacity)
{
	return copy_out(bytes, capacity, remote->output_image, (size_t)remote->knob[HM2_REMOTE_TRANSMIT_SIZE]);
}
