/* Checks between descriptors: known forms, one IOPort, nothing twice, pins that belong to what exists. */
#include "idrom.h"

#define ANY_INSTANCE 0x80 /* secondary unit: shared by all instances */
#define OUTPUT 0x80       /* secondary pin */

/* A form of a module that the driver can work with. */
typedef struct module_form {
	uint8_t gtag;
	uint8_t version;
	uint8_t registers;
	uint8_t instance_stride;
	uint32_t multiple;
} module_form;

#define FORM(gtag, version, registers, instance_stride, multiple) {gtag, version, registers, instance_stride, multiple},
static const module_form forms[] = {HM2_ACCEPTED_MODULES(FORM)};
#define FORM_COUNT (sizeof forms / sizeof *forms)

/* Modules without a form of their own that may still be there only once. */
static const uint8_t single_gtags[] = {HM2_GTAG_INMUX, HM2_GTAG_INM, HM2_GTAG_RCPWM, HM2_GTAG_OUTM, HM2_GTAG_SSR};

/* The form of exactly this version, else the newest the driver knows, else NULL. */
static const module_form *form_of(uint8_t gtag, uint8_t version)
{
	const module_form *newest = NULL;
	for (size_t i = 0; i < FORM_COUNT; i++) {
		if (forms[i].gtag != gtag)
			continue;
		if (forms[i].version == version)
			return &forms[i];
		newest = &forms[i];
	}
	return newest;
}

static int is_single(uint8_t gtag)
{
	for (size_t i = 0; i < sizeof single_gtags; i++)
		if (single_gtags[i] == gtag)
			return 1;
	return form_of(gtag, 0) != NULL;
}

int hm2_idrom_check_form(const hm2_module_descriptor *modules, size_t index, hm2_error *error)
{
	const hm2_module_descriptor *module = &modules[index];
	const module_form *form = form_of(module->gtag, module->version);
	if (!form)
		return HM2_OK;
	const struct {
		int detail;
		uint32_t offset, expected, received;
	} rows[] = {
		{HM2_BROKEN_MODULE_VERSION, 0, form->version, module->version},
		{HM2_BROKEN_MODULE_REGISTERS, 4, form->registers, module->registers},
		{HM2_BROKEN_MODULE_INSTANCE_STRIDE, 4, form->instance_stride, module->instance_stride},
		{HM2_BROKEN_MODULE_MULTIPLE, 8, form->multiple, module->multiple},
	};
	for (size_t i = 0; i < sizeof rows / sizeof *rows; i++)
		if (rows[i].expected != rows[i].received)
			return hm2_idrom_finding(error, rows[i].detail, module->address + rows[i].offset,
			                         (hm2_idrom_evidence){(int32_t)index, rows[i].expected,
			                                              rows[i].received});
	return HM2_OK;
}

static size_t find(const hm2_module_descriptor *modules, size_t count, uint8_t gtag)
{
	size_t i = 0;
	while (i < count && modules[i].gtag != gtag)
		i++;
	return i;
}

/* Before everything else: without the IOPort no pin can be switched to a safe state. */
static int check_ioport(const hm2_idrom *idrom, const hm2_module_descriptor *modules, size_t count, hm2_error *error)
{
	const size_t index = find(modules, count, HM2_GTAG_IOPORT);
	if (index == count)
		return hm2_idrom_finding(error, HM2_BROKEN_IOPORT_MISSING, idrom->offset + idrom->module_offset,
		                         (hm2_idrom_evidence){(int32_t)count, HM2_GTAG_IOPORT, 0});
	const int status = hm2_idrom_check_form(modules, index, error);
	if (status != HM2_OK)
		return status;
	if (modules[index].instances != idrom->io_ports)
		return hm2_idrom_finding(error, HM2_BROKEN_IOPORT_COUNT, modules[index].address,
		                         (hm2_idrom_evidence){(int32_t)index, idrom->io_ports,
		                                              modules[index].instances});
	return HM2_OK;
}

int hm2_idrom_check_modules(const hm2_idrom *idrom, const hm2_module_descriptor *modules, size_t count,
                            hm2_error *error)
{
	const int status = check_ioport(idrom, modules, count, error);
	if (status != HM2_OK)
		return status;
	for (size_t i = 0; i < count; i++) {
		const size_t first = find(modules, i, modules[i].gtag);
		if (first < i && is_single(modules[i].gtag))
			return hm2_idrom_finding(error, HM2_BROKEN_MODULE_DUPLICATE, modules[i].address,
			                         (hm2_idrom_evidence){(int32_t)i, (uint32_t)first, modules[i].gtag});
	}
	return HM2_OK;
}

/* Instances a pin's unit may name. Select pins of muxed encoders count in encoders: the second 7I77's
 * select is unit 6 of a module that has one instance. */
static int unit_limit(const hm2_module_descriptor *modules, size_t count, uint8_t gtag)
{
	const uint8_t counted = gtag == HM2_GTAG_MUXED_ENCODER_SELECT ? HM2_GTAG_MUXED_ENCODER : gtag;
	const size_t index = find(modules, count, counted);
	return index < count ? modules[index].instances : -1;
}

static int check_unit(const hm2_idrom *idrom, const hm2_module_descriptor *modules, size_t module_count,
                      const hm2_pin_descriptor *pin, size_t index, hm2_error *error)
{
	if (pin->secondary_tag == 0 || pin->secondary_unit & ANY_INSTANCE)
		return HM2_OK;
	const int limit = unit_limit(modules, module_count, pin->secondary_tag);
	if (limit < 0 || pin->secondary_unit < limit)
		return HM2_OK; /* a module that is not there leaves its pins plain GPIO */
	return hm2_idrom_finding(error, HM2_BROKEN_PIN_UNIT,
	                         idrom->offset + idrom->pin_offset + 4 * (uint32_t)index,
	                         (hm2_idrom_evidence){(int32_t)index, (uint32_t)limit, pin->secondary_unit});
}

static int is_same_output(const hm2_pin_descriptor *a, const hm2_pin_descriptor *b)
{
	return a->secondary_tag == b->secondary_tag && a->secondary_unit == b->secondary_unit &&
	       a->secondary_pin == b->secondary_pin;
}

static int check_output(const hm2_idrom *idrom, const hm2_pin_descriptor *pins, size_t index, hm2_error *error)
{
	const hm2_pin_descriptor *pin = &pins[index];
	if (pin->secondary_tag == 0 || !(pin->secondary_pin & OUTPUT) || pin->secondary_unit & ANY_INSTANCE)
		return HM2_OK;
	for (size_t i = 0; i < index; i++) {
		if (!is_same_output(&pins[i], pin))
			continue;
		const uint32_t word = (uint32_t)pin->primary_tag << 24 | (uint32_t)pin->secondary_unit << 16 |
		                      (uint32_t)pin->secondary_tag << 8 | pin->secondary_pin;
		return hm2_idrom_finding(error, HM2_BROKEN_PIN_DUPLICATE_OUTPUT,
		                         idrom->offset + idrom->pin_offset + 4 * (uint32_t)index,
		                         (hm2_idrom_evidence){(int32_t)index, (uint32_t)i, word});
	}
	return HM2_OK;
}

int hm2_idrom_check_pins(const hm2_idrom *idrom, const hm2_module_descriptor *modules, size_t module_count,
                         const hm2_pin_descriptor *pins, size_t pin_count, size_t first, hm2_error *error)
{
	for (size_t i = first; i < pin_count; i++) {
		int status = check_unit(idrom, modules, module_count, &pins[i], i, error);
		if (status == HM2_OK)
			status = check_output(idrom, pins, i, error);
		if (status != HM2_OK)
			return status;
	}
	return HM2_OK;
}
