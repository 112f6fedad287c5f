/** The files of the intervention log: appended lines, each with the hash of the previous one.
 *
 *  A folder holds interventions-000001.jsonl, interventions-000002.jsonl and so on; no file is ever
 *  renamed, shortened or removed. Format: docs/reference/intervention-log.md. */
#ifndef FSN_APP_INTERVENTION_FILES_H
#define FSN_APP_INTERVENTION_FILES_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/types.h>

#include "fsn/plan.h"

enum {
    INTERVENTION_LINE_BYTES = 1 << 20, /**< maximum bytes of a line */
    INTERVENTION_PATH_BYTES = 512,
    INTERVENTION_NAME_BYTES = 40, /**< of a file in the folder, with its zero */
    INTERVENTION_FILES = 64,      /**< limit of the folder, as a multiple of the limit of a file */
    INTERVENTION_FULL = -1,       /**< with errno: the limit was reached */
    INTERVENTION_QUARTERS = 4,    /**< of the limit, see intervention_files_append() */
};

struct intervention_files {
    char path[INTERVENTION_PATH_BYTES]; /**< of the folder */
    uint64_t most_bytes;                /**< of a file, before the next one begins */
    int folder, fd;                     /**< -1: not open */
    uint32_t file;                      /**< number of the current file */
    uint64_t bytes;                     /**< its length */
    uint64_t other_bytes;               /**< of all other files in the folder, */
    uint64_t counted_ns;                /**< when they were counted because the queue was full */
    dev_t device;                       /**< of that file, to notice that it was moved away */
    ino_t inode;
    bool known;      /**< number and hash belong to the chain and need not be read again */
    bool stopped;    /**< the last entry is a stop */
    uint64_t number; /**< of the last whole entry; 0: none */
    char hash[2 * FSN_SHA256_BYTES + 1]; /**< of its line; empty: none */
};

/** Prepares it; nothing is opened. A `path` that is too long is truncated and not found. */
void intervention_files_init(struct intervention_files *files, const char *path,
                             uint64_t most_bytes);

/** Opens the folder, locks it, finds the end of the chain and marks a torn entry there. Does
 *  nothing while the folder is open and the file is still there.
 *  @return 0, or errno: EBUSY for a folder that another program has locked. */
int intervention_files_open(struct intervention_files *files);

/** Appends one entry: the object `json` with number and hash added. After an error the files are
 *  closed, and intervention_files_open() must be called again.
 *  @param[in] quarters  share of the limit of the folder that the entry may use.
 *  @return 0, errno, or INTERVENTION_FULL: these quarters are full, until files are moved away. */
int intervention_files_append(struct intervention_files *files, unsigned quarters, const char *json,
                              size_t len_bytes);

/** Whether this number of quarters of the limit has room for an entry. Files may be moved away, so
 *  they are counted again if there is none. */
bool intervention_files_have_room(struct intervention_files *files, unsigned quarters,
                                  size_t len_bytes);

/** Maximum bytes of all files in the folder. */
uint64_t intervention_files_limit(const struct intervention_files *files);

/** Waits until all appended entries are on the disk.   @return 0, or errno. */
int intervention_files_sync(struct intervention_files *files);

void intervention_files_close(struct intervention_files *files);

/** Name of a file in the folder. */
void intervention_file_name(uint32_t file, char name[INTERVENTION_NAME_BYTES]);

#endif
