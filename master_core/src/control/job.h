/** Requests that take their time: queued by the control thread, done in the acyclic thread of the
 *  bus, answered later. */
#ifndef FSN_CONTROL_JOB_H
#define FSN_CONTROL_JOB_H

#include <stdatomic.h>

#include "fsn/acyclic.h"
#include "json.h"
#include "refusal.h"

enum { FSN_JOBS = 32 /**< waiting, running and not yet answered together */ };

enum fsn_job_kind {
    FSN_JOB_READ,
    FSN_JOB_WRITE,
    FSN_JOB_SII,
    FSN_JOB_ALIAS,
    FSN_JOB_HISTORY,
    FSN_JOB_SCAN,
    FSN_JOB_FSOE /**< of an incident, no client's */
};

/** How the bytes of an object are read. */
enum fsn_data_kind { FSN_DATA_HEX, FSN_DATA_NUMBER, FSN_DATA_STRING };
struct fsn_data_type {
    enum fsn_data_kind kind;
    struct fsn_symbol_info number; /**< bits and kind; of a number */
};

struct fsn_job {
    struct fsn_job *next; /**< for the queues of the program */
    enum fsn_job_kind kind;
    uint32_t client; /**< whose answer it is */
    uint32_t subdevice;
    uint16_t index, alias;
    uint8_t sub;
    struct fsn_data_type type;
    uint8_t *data; /**< to be written */
    uint32_t data_bytes;
    char *tag;             /**< of the request, or NULL */
    atomic_bool cancelled; /**< nobody waits for the answer any more */
    uint64_t until_ns;     /**< broken off then; set when it begins; 0: never */
    struct fsn_json json;  /**< the line of the answer; FSN_JOB_FSOE: the array alone */
    fsn_status status;
    struct fsn_refusal refusal;
};

/** What a job is done with. All in the acyclic thread. */
struct fsn_job_means {
    struct fsn_core *core; /**< NULL: the bus is stopped by now */
    const struct fsn_bus_ops *ops;
    void *bus;
    const struct fsn_plan *plan;
    const char *interface;
    /** Called between two steps; false breaks it off. */
    bool (*between)(void *self);
    void *self;
};

/** Does it; afterwards json, or status and refusal, are filled in. */
void fsn_job_run(struct fsn_job *job, const struct fsn_job_means *means);

void fsn_job_free(struct fsn_job *job);

/** Reads the name of a type: bool int8 … uint64 real32 real64 string hex. */
bool fsn_data_type_read(const char *text, struct fsn_data_type *type);

/** Bytes of a value, low byte first.
 *  @param[out] bytes  room for the text's length.
 *  @return NULL, or what is wrong with it. */
const char *fsn_data_parse(const struct fsn_data_type *type, const char *text, uint8_t *bytes,
                           uint32_t *size_bytes);

/** Writes "data", "bytes" and, where the type is no plain hex, "value". Null for bytes of another
 *  length than the type has. */
void fsn_data_write(const struct fsn_data_type *type, const uint8_t *bytes, uint32_t size_bytes,
                    struct fsn_json *json);

/** Whether an object may be written, by plan and state of the bus (guard.c).
 *  @return NULL, or why not. */
const char *fsn_guard_write(const struct fsn_plan *plan, uint32_t subdevice, uint16_t index,
                            bool bus_runs);

/** Decodes a message of 0x10F3; false when it is none (history.c). */
bool fsn_history_message(const uint8_t *bytes, uint32_t size_bytes, uint32_t id,
                         struct fsn_json *json);

#endif
