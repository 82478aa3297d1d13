/* Names of the status codes. */
#include "hm2.h"

const char *hm2_status_name(int status)
{
	switch (status) {
	case HM2_OK: return "ok";
	case HM2_ERR_IO: return "input/output error";
	case HM2_ERR_TIMEOUT: return "timeout";
	case HM2_ERR_PROTOCOL: return "protocol error";
	case HM2_ERR_RANGE: return "out of range";
	case HM2_ERR_ALIGN: return "unaligned address";
	case HM2_ERR_CLOSED: return "closed";
	case HM2_ERR_BUSY: return "busy";
	case HM2_ERR_NO_MEMORY: return "out of memory";
	case HM2_ERR_READ_ONLY: return "read only";
	case HM2_ERR_FORMAT: return "broken table";
	default: return "unknown status";
	}
}
