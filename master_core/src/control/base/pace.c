#include "control/base/pace.h"

bool fsn_pace_allows(uint64_t *due_ns, uint64_t now_ns, unsigned at_once, uint64_t every_ns) {
    if (*due_ns > now_ns + (at_once - 1) * every_ns) {
        return false;
    }
    *due_ns = (*due_ns > now_ns ? *due_ns : now_ns) + every_ns;
    return true;
}
