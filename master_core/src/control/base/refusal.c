#include "control/base/refusal.h"

#include <stdarg.h>
#include <stdio.h>

fsn_status fsn_refusal_set(struct fsn_refusal *refusal, fsn_status status, const char *hint,
                           const char *format, ...) {
    va_list arguments;
    va_start(arguments, format);
    vsnprintf(refusal->text, sizeof refusal->text, format, arguments);
    va_end(arguments);
    refusal->status = status;
    refusal->hint = hint;
    return status;
}
