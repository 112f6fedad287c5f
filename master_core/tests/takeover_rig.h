/** Common code of the tests of both sides of a handover. */
#ifndef FSN_TEST_TAKEOVER_RIG_H
#define FSN_TEST_TAKEOVER_RIG_H

#include <stddef.h>

#include "fsn/fsn.h"

/** The e-stop pair. */
struct fsn_plan *takeover_rig_plan(void);

/** A socket like the lock of an interface: of whole messages, with a name that the kernel chose. */
int takeover_rig_listen(void);

/** A connection to it. */
int takeover_rig_connect(int listening);

/** Memory with a descriptor, of zeros. */
int takeover_rig_memory(size_t len_bytes);

#endif
