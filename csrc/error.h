/* Filling in the caller's evidence. Every helper returns the status, so that callers can return it. */
#ifndef HM2_ERROR_H
#define HM2_ERROR_H

#include "hm2.h"

/* All evidence empty but status and where; error may be NULL. `where` is cut to the field's size. */
int hm2_error_set(hm2_error *error, int status, const char *where);

#endif
