/* What the two IDROM files share. */
#ifndef HM2_IDROM_H
#define HM2_IDROM_H

#include "error.h"
#include "registers.h"

typedef struct hm2_idrom_evidence {
	int32_t index;
	uint32_t expected;
	uint32_t received;
} hm2_idrom_evidence;

/* Fills in the evidence of a broken IDROM and returns HM2_ERR_FORMAT. */
int hm2_idrom_finding(hm2_error *error, int detail, uint32_t address, hm2_idrom_evidence evidence);

#endif
