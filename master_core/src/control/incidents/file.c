#define _GNU_SOURCE

#include "control/incidents/kept.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <pthread.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <unistd.h>

#include "plan/plan_internal.h"

enum { MOST_BYTES = 32 << 20, MOST_NAMES = 1000 };

/* -- the window ----------------------------------------------------------------------------- */

/** The first cycle at or after `from_ns` that is still available, limited to `most` cycles in
 *  all. */
static uint64_t first_cycle(const struct fsn_core *core, uint64_t last, uint64_t from_ns,
                            uint64_t most) {
    uint64_t first = last + 1;
    while (first > 1 && last - first + 1 < most) {
        struct fsn_cycle cycle;
        if (fsn_core_record(core, first - 1, &cycle, NULL, NULL) != FSN_OK ||
            cycle.now_ns < from_ns) {
            break;
        }
        first--;
    }
    return first;
}

struct fsn_window fsn_window_take(const struct fsn_core *core, uint64_t from_ns) {
    struct fsn_window w = {.image_bytes = fsn_core_image_bytes(core)};
    const uint64_t last = fsn_core_last_cycle(core);
    const uint64_t most = MOST_BYTES / (sizeof *w.cycles + w.image_bytes);
    const uint64_t first = first_cycle(core, last, from_ns, most);
    const size_t count = (size_t)(last - first + 1);
    w.cycles = calloc(count, sizeof *w.cycles);
    w.images = calloc(count, w.image_bytes);
    for (uint64_t c = first; w.cycles != NULL && w.images != NULL && c <= last; c++) {
        /* A cycle that was overwritten in the meantime is omitted: its number is then missing. */
        if (fsn_core_record(core, c, &w.cycles[w.count], NULL,
                            w.images + w.count * w.image_bytes) == FSN_OK) {
            w.count++;
        }
    }
    return w;
}

void fsn_window_free(struct fsn_window *window) {
    free(window->cycles);
    free(window->images);
    *window = (struct fsn_window){0};
}

/* -- the file ------------------------------------------------------------------------------- */

struct fsn_incident_file {
    pthread_t thread;
    atomic_bool done;
    char folder[FSN_INCIDENT_PATH / 2];
    char stem[FSN_INCIDENT_PATH / 4];
    uint64_t most_bytes;
    struct fsn_json head;
    struct fsn_window window;
    struct fsn_incident_result result;
};

/** Bytes of all incident files in a folder, of this and earlier runs. */
static uint64_t bytes_in(const char *folder) {
    uint64_t bytes = 0;
    DIR *rows = opendir(folder);
    const struct dirent *row;
    while (rows != NULL && (row = readdir(rows)) != NULL) {
        const char *suffix = strrchr(row->d_name, '.');
        struct stat found;
        if (suffix != NULL && strcmp(suffix, FSN_INCIDENT_SUFFIX) == 0 &&
            fstatat(dirfd(rows), row->d_name, &found, AT_SYMLINK_NOFOLLOW) == 0 &&
            S_ISREG(found.st_mode)) {
            bytes += (uint64_t)found.st_size;
        }
    }
    if (rows != NULL) {
        closedir(rows);
    }
    return bytes;
}

/** Opens a new file; existing files are not changed. */
static int open_new(struct fsn_incident_file *file) {
    if (bytes_in(file->folder) >= file->most_bytes) {
        file->result.full = true;
        errno = EDQUOT;
        return -1;
    }
    for (int n = 1; n < MOST_NAMES; n++) {
        char number[16] = "";
        if (n > 1) {
            snprintf(number, sizeof number, "-%d", n);
        }
        snprintf(file->result.path, sizeof file->result.path, "%s/%s%s" FSN_INCIDENT_SUFFIX,
                 file->folder, file->stem, number);
        const int fd = open(file->result.path, O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
        if (fd >= 0 || errno != EEXIST) {
            return fd;
        }
    }
    return -1;
}

static void put_hex(FILE *out, const uint8_t *bytes, uint32_t len_bytes) {
    static const char digits[] = "0123456789abcdef";
    for (uint32_t i = 0; i < len_bytes; i++) {
        putc(digits[bytes[i] >> 4], out);
        putc(digits[bytes[i] & 15], out);
    }
}

static void put_number(FILE *out, const char *key, uint64_t value) {
    if (value != 0) {
        fprintf(out, ",\"%s\":%" PRIu64, key, value);
    }
}

/** Writes one line; values that are unchanged or as expected are omitted. */
static void put_cycle(FILE *out, const struct fsn_window *w, uint64_t number) {
    const struct fsn_cycle *c = &w->cycles[number];
    const uint8_t *image = w->images + number * w->image_bytes;
    fprintf(out, "{\"cycle\":%" PRIu64 ",\"t\":%" PRIu64, c->cycle, c->now_ns);
    put_number(out, "late", c->late_ns);
    put_number(out, "work", c->work_ns);
    put_number(out, "round", c->round_trip_ns);
    put_number(out, "lost", c->counts.lost_frames);
    put_number(out, "old", c->counts.old_replies);
    put_number(out, "foreign", c->counts.foreign_frames);
    put_number(out, "overruns", c->overruns);
    if (c->expected_wkc != c->actual_wkc) {
        fprintf(out, ",\"wkc\":[%" PRIu32 ",%" PRIu32 "]", c->expected_wkc, c->actual_wkc);
    }
    if (number == 0 || memcmp(image, image - w->image_bytes, w->image_bytes) != 0) {
        fputs(",\"image\":\"", out);
        put_hex(out, image, w->image_bytes);
        fputc('"', out);
    }
    fputs("}\n", out);
}

/** Writes until it is complete, or the system refuses; then false with errno. */
static bool write_all(struct fsn_incident_file *file, FILE *out) {
    const struct fsn_window *w = &file->window;
    fwrite(file->head.bytes, 1, file->head.len_bytes, out);
    for (uint64_t n = 0; n < w->count; n++) {
        put_cycle(out, w, n);
        if (fflush(out) != 0) {
            return false;
        }
        file->result.cycles = n + 1;
    }
    fprintf(out, "{\"end\":true,\"cycles\":%" PRIu64 "}\n", w->count);
    return fflush(out) == 0 && fsync(fileno(out)) == 0;
}

static void *run(void *context) {
    struct fsn_incident_file *file = context;
    const int fd = open_new(file);
    FILE *out = fd < 0 ? NULL : fdopen(fd, "w");
    if (out == NULL) {
        file->result.error = errno;
        if (fd >= 0) {
            close(fd);
        }
    } else {
        file->result.error =
            write_all(file, out) ? fsn_sha256_file(fileno(out), file->result.sha256) : errno;
        if (fclose(out) != 0 && file->result.error == 0) {
            file->result.error = errno;
        }
    }
    atomic_store(&file->done, true);
    return NULL;
}

static void discard(struct fsn_incident_file *file) {
    fsn_json_free(&file->head);
    fsn_window_free(&file->window);
    free(file);
}

struct fsn_incident_file *fsn_incident_file_begin(const char *folder, const char *stem,
                                                  uint64_t most_bytes, struct fsn_json *head,
                                                  struct fsn_window *window) {
    struct fsn_incident_file *file = calloc(1, sizeof *file);
    if (file == NULL) {
        fsn_json_free(head);
        fsn_window_free(window);
        return NULL;
    }
    file->head = *head;
    file->window = *window;
    *head = (struct fsn_json){0};
    *window = (struct fsn_window){0};
    snprintf(file->folder, sizeof file->folder, "%s", folder);
    snprintf(file->stem, sizeof file->stem, "%s", stem);
    file->most_bytes = most_bytes;
    if (pthread_create(&file->thread, NULL, run, file) != 0) {
        discard(file);
        return NULL;
    }
    return file;
}

void fsn_incident_file_wait(struct fsn_incident_file *file, struct fsn_incident_result *result) {
    pthread_join(file->thread, NULL);
    *result = file->result;
    discard(file);
}

bool fsn_incident_file_done(struct fsn_incident_file *file, struct fsn_incident_result *result) {
    if (!atomic_load(&file->done)) {
        return false;
    }
    fsn_incident_file_wait(file, result);
    return true;
}
