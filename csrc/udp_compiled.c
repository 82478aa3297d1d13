/* A cycle's datagram: made once, then refilled. */
#include "udp.h"

#include <string.h>

/* One command's words; HM2_ERR_RANGE: it would take more than one. */
static int add(struct udp_compiled *compiled, const hm2_transfer *transfer, size_t at)
{
	if (transfer->count > HM2_LBP16_MAX_COUNT)
		return HM2_ERR_RANGE;
	for (uint32_t i = 0; i < transfer->count; i++) {
		if (transfer->flags & HM2_TRANSFER_WRITE) {
			compiled->write[compiled->writes] = transfer->words + i;
			compiled->write_at[compiled->writes++] = (uint16_t)(at + 4 * i);
		} else {
			compiled->read[compiled->reads++] = transfer->words + i;
		}
	}
	return HM2_OK;
}

void udp_compile(struct udp_compiled *compiled, const struct udp_datagram *datagram, const struct udp_list *list)
{
	size_t at = 4; /* behind the read of the last number */

	compiled->count = compiled->reads = compiled->writes = 0;
	if (list->count > UDP_COMPILED || list->at.transfer < list->count)
		return;
	for (size_t i = 0; i < list->count; i++) {
		const hm2_transfer *transfer = &list->transfers[i];

		if (add(compiled, transfer, at + 4) != HM2_OK)
			return;
		compiled->transfers[i] = *transfer;
		at += transfer->flags & HM2_TRANSFER_WRITE ? 4 + 4 * (size_t)transfer->count : 4;
	}
	compiled->end = datagram->end;
	compiled->count = list->count;
}

int udp_compiled_same(const struct udp_compiled *compiled, const struct udp_list *list)
{
	/* the structure has no padding: equal lists are equal bytes */
	return compiled->count && compiled->count == list->count &&
	       memcmp(compiled->transfers, list->transfers, list->count * sizeof *list->transfers) == 0;
}

void udp_compiled_refill(const struct udp_compiled *compiled, struct udp_datagram *datagram)
{
	for (size_t i = 0; i < compiled->writes; i++)
		udp_put32(datagram->bytes + compiled->write_at[i], *compiled->write[i]);
	datagram->answered = 0;
}

void udp_compiled_unpack(const struct udp_compiled *compiled, const uint8_t *reply)
{
	reply += 4;
	for (size_t i = 0; i < compiled->reads; i++, reply += 4)
		*compiled->read[i] = udp_get32(reply);
}
