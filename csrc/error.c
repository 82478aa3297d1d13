/* Names of the status codes, and the blank evidence they come with. */
#include "error.h"

#include <string.h>

int hm2_error_set(hm2_error *error, int status, const char *where)
{
	if (!error)
		return status;
	memset(error, 0, sizeof *error);
	error->status = status;
	error->index = -1;
	for (size_t i = 0; i + 1 < sizeof error->where && where[i]; i++)
		error->where[i] = where[i];
	return status;
}

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
	case HM2_ERR_GATED: return "writes held back after a watchdog bite";
	case HM2_ERR_ABSENT: return "not recorded";
	case HM2_ERR_LINK: return "link given up";
	default: return "unknown status";
	}
}
