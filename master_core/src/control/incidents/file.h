/** The file of one incident, written by a separate thread. */
#ifndef FSN_CONTROL_INCIDENT_FILE_H
#define FSN_CONTROL_INCIDENT_FILE_H

#include "control/base/json.h"
#include "fsn/core.h"

enum { FSN_INCIDENT_PATH = 512 };

#define FSN_INCIDENT_SUFFIX ".fsnincident"

/** Cycles copied from the recorder, one after another. */
struct fsn_window {
    uint64_t count;
    uint32_t image_bytes;
    struct fsn_cycle *cycles; /**< owned; NULL: none */
    uint8_t *images;          /**< owned; count times image_bytes */
};

/** Copies the cycles since `from_ns` from the recorder; older ones are omitted if they would need
 *  more than 32 MiB. Empty without a recorder or memory. */
struct fsn_window fsn_window_take(const struct fsn_core *core, uint64_t from_ns);
void fsn_window_free(struct fsn_window *window);

struct fsn_incident_file;

/** Starts writing; takes ownership of head and window, even if it fails.
 *  @param[in] folder, stem  the file is `folder/stem.fsnincident`, or with a number after the stem.
 *  @param[in] most_bytes    limit for all incident files of the folder together; then no further
 *      one is written.
 *  @return NULL  no thread, or no memory. */
struct fsn_incident_file *fsn_incident_file_begin(const char *folder, const char *stem,
                                                  uint64_t most_bytes, struct fsn_json *head,
                                                  struct fsn_window *window);

/** Result. */
struct fsn_incident_result {
    char path[FSN_INCIDENT_PATH];
    uint8_t sha256[FSN_SHA256_BYTES]; /**< of a complete file */
    uint64_t cycles;                  /**< number written */
    int error;                        /**< 0, or errno: the file ends early */
    bool full; /**< it was not begun: the files in the folder have reached their limit */
};

/** Whether the thread is done; if so, it is freed. */
bool fsn_incident_file_done(struct fsn_incident_file *file, struct fsn_incident_result *result);

/** Waits for the thread and frees it. */
void fsn_incident_file_wait(struct fsn_incident_file *file, struct fsn_incident_result *result);

#endif
