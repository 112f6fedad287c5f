/** Atomics of the cyclic path: if one is not lock-free, the compiler calls a library function that
 *  locks. */
#ifndef FSN_ATOMICS_H
#define FSN_ATOMICS_H

#include <stdatomic.h>
#include <stdint.h>

enum { FSN_ALWAYS_LOCK_FREE = 2 }; /* value of the ATOMIC_..._LOCK_FREE macros of C11 */

_Static_assert(ATOMIC_BOOL_LOCK_FREE == FSN_ALWAYS_LOCK_FREE, "atomic_bool is lock-free");
_Static_assert(ATOMIC_CHAR_LOCK_FREE == FSN_ALWAYS_LOCK_FREE, "_Atomic uint8_t is lock-free");
_Static_assert(ATOMIC_SHORT_LOCK_FREE == FSN_ALWAYS_LOCK_FREE, "_Atomic uint16_t is lock-free");
_Static_assert(ATOMIC_INT_LOCK_FREE == FSN_ALWAYS_LOCK_FREE, "_Atomic uint32_t is lock-free");
_Static_assert(ATOMIC_LLONG_LOCK_FREE == FSN_ALWAYS_LOCK_FREE, "_Atomic uint64_t is lock-free");

#endif
