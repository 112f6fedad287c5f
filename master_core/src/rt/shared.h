/** Layout of the memory shared by a real-time client and fsn-master. A change here requires a new
 *  FSN_SHARED_LAYOUT: a client with another one is refused.
 *
 *  The inputs are one file for all clients, sealed so that only the master writes it. The outputs
 *  are a file for each client: whatever it contains, the master reads only the words of the outputs
 *  that the client owns, from offsets that it keeps itself. */
#ifndef FSN_SHARED_H
#define FSN_SHARED_H

#include "rt/atomics.h"

enum {
    FSN_SHARED_MAGIC = 0x736E7366, /**< "fsns" */
    FSN_SHARED_LAYOUT = 2,
    FSN_SHARED_PICTURES = 4, /**< cycles that stay readable: the largest delay of a reader */
    FSN_SHARED_SETS = 2,     /**< sets of outputs that a client fills alternately */
    FSN_SHARED_CLIENTS = 8,  /**< at once */
    FSN_SHARED_ALIGN = 64,
};

/** State of a client's outputs. */
enum fsn_shared_state {
    FSN_SHARED_WAITS, /**< none received: they have their stop values */
    FSN_SHARED_RUNS,
    FSN_SHARED_LATE /**< too many cycles without new outputs: they have their stop values */
};

/** A value of the process image. */
struct fsn_shared_symbol {
    double factor, offset;
    uint64_t stop_value;
    uint32_t name;       /**< its first byte, from the beginning of the file */
    uint32_t bit_offset; /**< in the image */
    uint16_t bits;       /**< 0: no place in the image */
    uint8_t kind;        /**< enum fsn_kind */
    uint8_t output;
    uint32_t subdevice; /**< first byte of its name, from the beginning of the file */
    uint16_t index;     /**< 0: not a whole object */
    uint8_t subindex;
    uint8_t unused[5];
};

/** One cycle; the image follows, in words of 8 bytes. */
struct fsn_shared_cycle {
    uint64_t cycle;      /**< its number */
    uint64_t now_ns;     /**< its start, monotonic */
    uint64_t next_ns;    /**< earliest start of the next one */
    uint64_t dc_time_ns; /**< last reading of the DC reference clock; 0 if there is none */
    uint64_t shown_ns;   /**< time from its start until it was published; 0 if unknown */
    uint64_t overruns;   /**< cycles omitted so far */
    uint32_t expected_wkc, actual_wkc;
};

/** A place for a client; the master writes it. */
struct fsn_shared_client {
    _Atomic uint64_t on_time, late, missed, torn; /**< as in struct fsn_realtime_counts */
    _Atomic uint32_t state;                       /**< enum fsn_shared_state */
    _Atomic uint32_t holder;                      /**< owner of the slot; never reused, 0: none */
};

/** Numbers of sets so far; number n is at n % FSN_SHARED_PICTURES or FSN_SHARED_SETS. */
struct fsn_shared_numbers {
    _Atomic uint32_t begun, whole;
};

/** Head of the inputs. Symbols, names and snapshots follow. */
struct fsn_shared_inputs {
    uint32_t magic, layout;
    uint64_t size_bytes; /**< of the file */
    uint64_t cycle_ns;   /**< bus cycle of the plan */
    uint64_t symbols_at, pictures_at, picture_words;
    uint32_t symbol_count, image_bytes;
    uint8_t plan_sha256[32];
    _Alignas(FSN_SHARED_ALIGN) struct fsn_shared_numbers shown;
    _Atomic uint32_t open; /**< 0: the bus was stopped; no further cycle follows */
    _Alignas(FSN_SHARED_ALIGN) struct fsn_shared_client client[FSN_SHARED_CLIENTS];
};

/** Head of the outputs of a client. The numbers of their symbols follow at `symbols_at`, each set
 *  at `sets_at + n * (1 + count)` words: number of the cycle that it answers, then a word for each
 *  output, of which the low bits are used. */
struct fsn_shared_outputs {
    uint32_t magic, layout;
    uint64_t size_bytes, symbols_at, sets_at;
    uint32_t count;  /**< outputs */
    uint32_t place;  /**< in fsn_shared_inputs.client */
    uint32_t holder; /**< if it is the same there, this client owns the outputs */
    uint32_t misses; /**< permitted consecutive cycles without new outputs */
    _Alignas(FSN_SHARED_ALIGN) struct fsn_shared_numbers sent;
};

#endif
