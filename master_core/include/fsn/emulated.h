/** Emulated bus: the sync manager buffers of the plan's SubDevices, in this process.
 *
 *  The device side may live in another thread than the cycle. Each sync manager has three buffers,
 *  as in an EtherCAT SubDevice controller, so that neither side ever sees an incomplete frame. */
#ifndef FSN_EMULATED_H
#define FSN_EMULATED_H

#include <stdbool.h>

#include "fsn/bus.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fsn_emulated;

/** Returns the backend to pass to fsn_core_create() together with a struct fsn_emulated.
 *  Context: any thread. */
FSN_API const struct fsn_bus_ops *fsn_emulated_ops(void);

/** Creates the SubDevices of a plan, all present, all buffers zero.
 *  @param[in]  plan  held until the bus is freed.
 *  @param[out] bus   to be freed by fsn_emulated_free(); NULL on failure.
 *  @retval FSN_E_ARG  no plan or no place for the bus.   @retval FSN_E_NOMEM  out of memory.
 *  Context: set-up. Allocates. */
FSN_API FSN_MUST_USE fsn_status fsn_emulated_create(const struct fsn_plan *plan,
                                                    struct fsn_emulated **bus);

/** Frees the bus; NULL is allowed. A core that uses it keeps a reference, so both may be freed in
 *  any order. Context: set-up. */
FSN_API void fsn_emulated_free(struct fsn_emulated *bus);

/** Device side: reads the newest outputs sent to a SubDevice.
 *  @param[in]  sm     number of an output sync manager in the plan.
 *  @param[out] buffer size_bytes of the sync manager.
 *  @param[out] fresh  whether they were sent since the last call; may be NULL.
 *  @retval FSN_E_ARG  not an output sync manager, or the buffer is too small.
 *  Context: one device thread per sync manager. */
FSN_API FSN_MUST_USE fsn_status fsn_emulated_read_outputs(struct fsn_emulated *bus, uint32_t sm,
                                                          uint8_t *buffer, size_t len_bytes,
                                                          bool *fresh);

/** Device side: publishes new inputs of a SubDevice, all at once.
 *  @param[in] sm         number of an input sync manager in the plan.
 *  @param[in] buffer     its whole process data.
 *  @param[in] len_bytes  size_bytes of the sync manager.
 *  @retval FSN_E_ARG  not an input sync manager, or a wrong length; nothing was changed.
 *  Context: one device thread per sync manager. */
FSN_API FSN_MUST_USE fsn_status fsn_emulated_write_inputs(struct fsn_emulated *bus, uint32_t sm,
                                                          const uint8_t *buffer, size_t len_bytes);

/** Unplugs a SubDevice or plugs it in again. While it is absent nothing is delivered in either
 *  direction and the working counter is lower.   @retval FSN_E_ARG  unknown SubDevice. Context: any
 *  thread. */
FSN_API FSN_MUST_USE fsn_status fsn_emulated_set_present(struct fsn_emulated *bus,
                                                         uint32_t subdevice, bool present);

#ifdef __cplusplus
}
#endif

#endif
