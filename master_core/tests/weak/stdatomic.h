/** In place of <stdatomic.h>, with an empty `_Atomic`: atomics of weak memory, see weak.h. */
#ifndef FSN_WEAK_STDATOMIC_H
#define FSN_WEAK_STDATOMIC_H

#include "weak.h"

typedef bool atomic_bool;
typedef unsigned atomic_uint;

#define ATOMIC_BOOL_LOCK_FREE 2
#define ATOMIC_CHAR_LOCK_FREE 2
#define ATOMIC_SHORT_LOCK_FREE 2
#define ATOMIC_INT_LOCK_FREE 2
#define ATOMIC_LLONG_LOCK_FREE 2

#define WEAK_PLACE(at) (at), sizeof *(at), __FILE__, __LINE__

/* The sum has the type of the value, without `const`. */
#define atomic_load_explicit(at, order) ((__typeof__(*(at) + 0))weak_load(WEAK_PLACE(at), order))
#define atomic_store_explicit(at, value, order) weak_store(WEAK_PLACE(at), order, value)
#define atomic_exchange_explicit(at, value, order)                                                 \
    ((__typeof__(*(at) + 0))weak_exchange(WEAK_PLACE(at), order, value))
#define atomic_thread_fence(order) weak_fence(__FILE__, __LINE__, order)
#define atomic_init(at, value) (*(at) = (value))

#define atomic_load(at) atomic_load_explicit(at, memory_order_seq_cst)
#define atomic_store(at, value) atomic_store_explicit(at, value, memory_order_seq_cst)

#endif
