/** SubDevices on the bus, as one JSON document: for `fsn-master --scan` and the request `scan`. */
#ifndef FSN_CONTROL_SURVEY_H
#define FSN_CONTROL_SURVEY_H

#include "control/base/json.h"
#include "fsn/acyclic.h"

enum { FSN_SURVEY_FORMAT = 1, FSN_SURVEY_BYTES = 16 << 20 /**< longest document */ };

/** A bus to be surveyed; it is open or visited. */
struct fsn_survey {
    const struct fsn_bus_ops *ops;
    void *bus;
    const struct fsn_plan *plan; /**< names of planned SubDevices; may be NULL */
    const char *interface;       /**< may be NULL */
    bool states_changed;
    /** Called between two steps; may be NULL; false aborts it. */
    bool (*between)(void *self);
    void *self;
};

/** Writes the keys of the document into an open object. A SubDevice that answers only partly gets
 *  `problems`.
 *  @retval FSN_E_ABSENT  this bus cannot be surveyed.   @retval FSN_E_STATE  aborted.
 *  Context: the acyclic thread of the bus; takes seconds. */
fsn_status fsn_survey_write(const struct fsn_survey *survey, struct fsn_json *json);

/** Writes an array: FSoE addresses and connections reported by each planned SubDevice that answers.
 *  Returns and context as above. */
fsn_status fsn_survey_planned_fsoe(const struct fsn_survey *survey, struct fsn_json *json);

#endif
