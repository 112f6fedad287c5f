/** Several buses of one core: each has its own cycle, and frames cross between them.
 *
 *  The first bus leads: its cycle is that of the core, and every copy from one bus to another is
 *  made in it. Each further bus has a thread with its own cycle time. That thread also makes the
 *  copies between its own SubDevices, so that these are as fast as on a single bus. Two cycles
 *  exchange whole images and never wait: a frame that crosses arrives with the next cycle of the
 *  other side, whole; until then the old one stays. If a bus is lost, only the connections over it
 *  are lost. */
#ifndef FSN_SEVERAL_H
#define FSN_SEVERAL_H

#include "fsn/core.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fsn_several;

/** One bus: a backend and its own context, which must outlive the core. */
struct fsn_several_member {
    const struct fsn_bus_ops *ops; /**< the same for all */
    void *bus;
    const struct fsn_plan *part; /**< plan from fsn_plan_part(), if the bus was created from it;
                                  * NULL: it is created */
};

/** Combines the buses of a plan.
 *  @param[in]  plan     held until the result is freed.
 *  @param[in]  members  fsn_plan_bus_count() of them, in the order of the plan.
 *  @param[in]  thread   options of the threads of the further buses, except that each bus has its
 *                       own cycle; NULL: without threads, in the leading cycle whenever theirs is
 *                       due, as an emulated bus needs it.
 *  @param[out] several  to be freed by fsn_several_free(), after the core; NULL on failure.
 *  @retval FSN_E_ARG    no plan or members.   @retval FSN_E_NOMEM  out of memory.
 *  Context: set-up. Allocates. */
FSN_API FSN_MUST_USE fsn_status fsn_several_create(const struct fsn_plan *plan,
                                                   const struct fsn_several_member *members,
                                                   const struct fsn_thread_options *thread,
                                                   struct fsn_several **several);

/** Frees it, not the members; NULL is allowed. Context: set-up. */
FSN_API void fsn_several_free(struct fsn_several *several);

/** The backend to pass to fsn_core_create() together with it: it reports the data of its members.
 *  Context: any thread. */
FSN_API const struct fsn_bus_ops *fsn_several_ops(struct fsn_several *several);

#ifdef __cplusplus
}
#endif

#endif
