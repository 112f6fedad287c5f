/** Backends that drive real EtherCAT: how to open them, for every stack.
 *
 *  Each is a library of its own (fsn_soem, fsn_igh), present if its stack was found when this was
 *  built. Their licences differ from that of libfsn: see `about`. */
#ifndef FSN_LIVE_H
#define FSN_LIVE_H

#include "fsn/bus.h"

#ifdef __cplusplus
extern "C" {
#endif

/** Options of a live bus, set before it is opened. Zero is a valid value for every field except the
 *  interface. */
struct fsn_live_options {
    const char *interface; /**< network interface (soem) or number of the master (igh) */
    const char *redundant; /**< second interface at the other end of the ring; NULL: none */
    bool xdp; /**< the cycle uses AF_XDP on each interface, and leaves all other packets as they are
               */
    uint64_t cycle_ns;        /**< bus cycle, for SYNC0 and timeouts; 0: that of the plan */
    uint64_t receive_wait_ns; /**< how long receive() waits for the replies; 0 reads only those that
                               * have arrived, as required for a timed cycle */
    uint32_t dc_every;        /**< DC reference time is distributed every n cycles; 0: each, where
                                   the plan has a SubDevice with SYNC0, else never */
    bool dc_host; /**< this machine sets the reference clock; false: its cycle follows the clock of
                     the first SubDevice with a clock */
    uint64_t dc_shift_ns;  /**< as in fsn_thread_options, for the report of clocks() */
    uint64_t dc_window_ns; /**< permitted difference from the reference clock; 0: 1000 ns */
    /** Data from describe() of the process that drives the bus. Then open() changes nothing on the
     *  bus, compares it with the plan, and rejects a difference; close() leaves the bus unchanged
     *  as long as no cycle was sent. Needed until open() has returned. NULL: start the bus.
     */
    const struct fsn_bus_attachment *attach;
};

/** One backend. */
struct fsn_backend {
    const char *name;
    const char *about; /**< stack, version, licence and trademark terms, in lines of text */
    const struct fsn_bus_ops *ops;
    bool needs_interface; /**< fsn_live_options.interface is required */
    bool takes_xdp;       /**< fsn_live_options.xdp */
    bool takes_redundant; /**< it can drive a ring from both ends: fsn_live_options.redundant */
    /** Creates the context for `ops`; nothing is sent before ops->open().
     *  @param[in]  options  copied, including its strings.
     *  @param[out] bus      to be given to `free`; NULL on refusal.
     *  @retval FSN_E_ARG    no interface, or a value that is not allowed.
     *  @retval FSN_E_NOMEM  out of memory.   Context: set-up. Allocates. */
    fsn_status (*create)(const struct fsn_live_options *options, void **bus,
                         struct fsn_fault *fault);
    /** Connects to the process that drives a bus of this interface, through its lock.
     *  @param[out] fd  to be closed by the caller; a socket of whole messages.
     *  @retval FSN_E_BUS_SILENT  no such process, or it accepts no successor.
     *  NULL: no bus of this backend can be handed over.   Context: set-up. */
    fsn_status (*reach)(const char *interface, int *fd, struct fsn_fault *fault);
    /** Frees the context, after the core that uses it; NULL is allowed. Context: set-up. */
    void (*free)(void *bus);
};

/** SOEM, with its own cyclic wire. In library fsn_soem. Context: any thread. */
FSN_API const struct fsn_backend *fsn_backend_soem(void);

/** IgH EtherCAT Master through ecrt.h. In library fsn_igh. Context: any thread. */
FSN_API const struct fsn_backend *fsn_backend_igh(void);

#ifdef __cplusplus
}
#endif

#endif
