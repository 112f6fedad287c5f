#define _GNU_SOURCE

#include "app/log/intervention_files.h"

#include <dirent.h>
#include <errno.h>
#include <fcntl.h>
#include <inttypes.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>

#include "control/base/clock.h"
#include "control/base/json.h"
#include "control/base/words.h"
#include "plan/plan_internal.h"

enum {
    TAIL_BYTES = 4 * INTERVENTION_LINE_BYTES, /**< of a file, searched for its last entry */
    OWN_BYTES = 1024,                         /**< of an entry about the log itself */
    MOST_BACK = 1000,                         /**< files searched for the last entry */
    COUNT_MS = 100, /**< between two counts of the files in a folder without room */
    LOG_VERSION = 1,
    MODE = 0640,
};

static const char torn_mark[] = " torn\n";
static const char begin_text[] = "{\"number\":";
static const char hash_text[] = ",\"previous\":";
static const char stop_text[] = ",\"event\":\"stop\",";

/** End of a file on disk. */
struct tail {
    uint64_t number; /**< of its last whole entry; 0: none found */
    bool stopped;
    char hash[2 * FSN_SHA256_BYTES + 1];
    char *bytes;          /**< owned */
    size_t len_bytes, at; /**< the bytes at `at` belong to no complete entry */
    bool whole_file;      /**< the file is not longer than `bytes` */
};

void intervention_file_name(uint32_t file, char name[INTERVENTION_NAME_BYTES]) {
    snprintf(name, INTERVENTION_NAME_BYTES, "interventions-%06" PRIu32 ".jsonl", file);
}

void intervention_files_init(struct intervention_files *files, const char *path,
                             uint64_t most_bytes) {
    *files = (struct intervention_files){.folder = -1, .fd = -1, .most_bytes = most_bytes};
    snprintf(files->path, sizeof files->path, "%s", path);
}

static void close_file(struct intervention_files *files) {
    if (files->fd >= 0) {
        close(files->fd);
        files->fd = -1;
    }
}

void intervention_files_close(struct intervention_files *files) {
    close_file(files);
    if (files->folder >= 0) {
        close(files->folder);
        files->folder = -1;
    }
}

/* -- existing files --------------------------------------------------------------------------- */

/** Number of the last file in the folder, 0: none; and the bytes of all. */
static int last_file(const struct intervention_files *files, uint32_t *last, uint64_t *bytes) {
    const int copy = openat(files->folder, ".", O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    DIR *rows = copy < 0 ? NULL : fdopendir(copy);
    const struct dirent *row;
    *last = 0;
    *bytes = 0;
    if (rows == NULL) {
        const int error = errno;
        if (copy >= 0) {
            close(copy);
        }
        return error;
    }
    while ((row = readdir(rows)) != NULL) {
        uint32_t number = 0;
        char name[INTERVENTION_NAME_BYTES];
        if (sscanf(row->d_name, "interventions-%9" SCNu32 ".jsonl", &number) == 1) {
            intervention_file_name(number, name);
            struct stat found;
            const bool is_ours = strcmp(row->d_name, name) == 0 &&
                                 fstatat(files->folder, name, &found, AT_SYMLINK_NOFOLLOW) == 0;
            *last = is_ours && number > *last ? number : *last;
            *bytes += is_ours && S_ISREG(found.st_mode) ? (uint64_t)found.st_size : 0;
        }
    }
    closedir(rows);
    return 0;
}

/** Whether a line, without its newline, is an entry in the form that this program writes. */
static bool read_entry(const char *line, size_t len, struct tail *tail) {
    const size_t begin = sizeof begin_text - 1;
    char *end = NULL;
    if (len < begin + 2 || memcmp(line, begin_text, begin) != 0 || line[begin] < '1' ||
        line[begin] > '9' || line[len - 1] != '}') {
        return false;
    }
    /* The buffer continues after the line, at least with a newline: no digit is read past it. */
    const uint64_t number = strtoull(line + begin, &end, 10);
    if (memmem(line, len, hash_text, sizeof hash_text - 1) == NULL) {
        return false;
    }
    uint8_t digest[FSN_SHA256_BYTES];
    fsn_sha256(line, len, digest);
    fsn_hex_text(digest, sizeof digest, tail->hash);
    tail->number = number;
    tail->stopped = strncmp(end, stop_text, sizeof stop_text - 1) == 0;
    return true;
}

/** Finds the last complete entry in the bytes that were read. */
static void find_entry(struct tail *tail) {
    size_t end = tail->len_bytes;
    tail->at = 0;
    while (end > 0) {
        const char *newline = memrchr(tail->bytes, '\n', end);
        if (newline == NULL) {
            return;
        }
        const size_t stop = (size_t)(newline - tail->bytes);
        const char *before = memrchr(tail->bytes, '\n', stop);
        const size_t start = before == NULL ? 0 : (size_t)(before - tail->bytes) + 1;
        if ((start > 0 || tail->whole_file) &&
            read_entry(tail->bytes + start, stop - start, tail)) {
            tail->at = stop + 1;
            return;
        }
        end = stop;
    }
}

static int read_tail(int fd, uint64_t file_bytes, struct tail *tail) {
    *tail = (struct tail){.whole_file = file_bytes <= TAIL_BYTES};
    const size_t wanted = tail->whole_file ? (size_t)file_bytes : (size_t)TAIL_BYTES;
    tail->bytes = malloc(wanted + 1);
    if (tail->bytes == NULL) {
        return ENOMEM;
    }
    while (tail->len_bytes < wanted) {
        const ssize_t got = pread(fd, tail->bytes + tail->len_bytes, wanted - tail->len_bytes,
                                  (off_t)(file_bytes - wanted + tail->len_bytes));
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got <= 0) {
            return got < 0 ? errno : EIO;
        }
        tail->len_bytes += (size_t)got;
    }
    tail->bytes[wanted] = 0;
    find_entry(tail);
    return 0;
}

/** Opens one of the files; it must be a regular file.   @return 0, or errno. */
static int open_file(const struct intervention_files *files, uint32_t file, int flags, int *fd,
                     struct stat *found) {
    char name[INTERVENTION_NAME_BYTES];
    intervention_file_name(file, name);
    *fd = openat(files->folder, name, flags | O_NOFOLLOW | O_NONBLOCK | O_NOCTTY | O_CLOEXEC, MODE);
    if (*fd < 0) {
        return errno;
    }
    int error = fstat(*fd, found) != 0 ? errno : 0;
    if (error == 0 && !S_ISREG(found->st_mode)) {
        error = EISDIR; /* or a device, a socket, a pipe */
    }
    if (error != 0) {
        close(*fd);
        *fd = -1;
    }
    return error;
}

/* -- writing -------------------------------------------------------------------------------- */

static int write_all(struct intervention_files *files, const char *bytes, size_t len) {
    while (len > 0) {
        const ssize_t wrote = write(files->fd, bytes, len);
        if (wrote < 0 && errno == EINTR) {
            continue;
        }
        if (wrote <= 0) {
            return wrote < 0 ? errno : EIO;
        }
        files->bytes += (uint64_t)wrote;
        bytes += wrote;
        len -= (size_t)wrote;
    }
    return 0;
}

/** Writes an entry at the end of the file.   @param json  a non-empty object. */
static int append(struct intervention_files *files, const char *json, size_t json_bytes) {
    char *line = malloc(json_bytes + 160);
    if (line == NULL) {
        return ENOMEM;
    }
    size_t len = (size_t)sprintf(line, "%s%" PRIu64 ",", begin_text, files->number + 1);
    memcpy(line + len, json + 1, json_bytes - 2);
    len += json_bytes - 2;
    len +=
        (size_t)(files->number == 0 ? sprintf(line + len, "%snull}\n", hash_text)
                                    : sprintf(line + len, "%s\"%s\"}\n", hash_text, files->hash));
    const int error = write_all(files, line, len);
    struct tail written = {.number = 0};
    if (error == 0 && read_entry(line, len - 1, &written)) {
        files->number = written.number;
        files->stopped = written.stopped;
        memcpy(files->hash, written.hash, sizeof files->hash);
    }
    free(line);
    return error;
}

/** Ends an entry about the log itself, and appends it. */
static int append_own(struct intervention_files *files, struct fsn_json *json, const char *level,
                      const char *text) {
    fsn_json_end_event(json, level, text);
    const int error = json->failed != FSN_OK ? ENOMEM : append(files, json->bytes, json->len_bytes);
    fsn_json_free(json);
    return error;
}

/** First entry of a file: contains the entry that it continues from. */
static int append_begin(struct intervention_files *files, uint32_t before) {
    struct fsn_json json = {.limit_bytes = OWN_BYTES};
    char name[INTERVENTION_NAME_BYTES];
    fsn_json_begin_event(&json, "file", fsn_now_ns());
    fsn_json_put_u64(&json, "log", LOG_VERSION);
    fsn_json_put_u64(&json, "file", files->file);
    if (files->number == 0) {
        fsn_json_put_text(&json, "before", NULL);
        return append_own(files, &json, "info", "begins a new log");
    }
    char text[120];
    intervention_file_name(before, name);
    snprintf(text, sizeof text, "continues from entry %" PRIu64 " in %s", files->number,
             before > 0 ? name : "a file that is no longer there");
    fsn_json_put_text(&json, "before", before > 0 ? name : NULL);
    return append_own(files, &json, "info", text);
}

/** Entry about bytes in the file that are not a complete entry. */
static int append_torn(struct intervention_files *files, const struct tail *tail, bool marked) {
    struct fsn_json json = {.limit_bytes = OWN_BYTES};
    struct fsn_sha256_run run;
    uint8_t digest[FSN_SHA256_BYTES];
    const size_t mark = marked ? sizeof torn_mark - 1 : 0;
    fsn_sha256_start(&run);
    fsn_sha256_add(&run, tail->bytes + tail->at, tail->len_bytes - tail->at);
    fsn_sha256_add(&run, torn_mark, mark);
    fsn_sha256_end(&run, digest);
    fsn_json_begin_event(&json, "torn", fsn_now_ns());
    fsn_json_put_u64(&json, "bytes", tail->len_bytes - tail->at + mark);
    fsn_json_put_hex(&json, "sha256", digest, sizeof digest);
    return append_own(files, &json, "warning",
                      "an entry before this one was not written whole: power loss, crash or a full "
                      "disk; its bytes stay as they are");
}

/* -- the end of the chain ------------------------------------------------------------------- */

static int begin_file(struct intervention_files *files, uint32_t file, uint32_t before) {
    struct stat found = {.st_size = 0};
    const bool stopped = files->number == 0 || files->stopped;
    const int error =
        open_file(files, file, O_RDWR | O_APPEND | O_CREAT | O_EXCL, &files->fd, &found);
    if (error != 0) {
        return error;
    }
    files->file = file;
    files->bytes = 0;
    files->device = found.st_dev;
    files->inode = found.st_ino;
    (void)fsync(files->folder); /* best effort: not supported by every file system */
    const int begun = append_begin(files, before);
    files->stopped = stopped;
    return begun;
}

/** The chain continues from the end of a file, unless it is already known. */
static void take_end(struct intervention_files *files, const struct tail *tail) {
    if (!files->known) {
        files->number = tail->number;
        files->stopped = tail->stopped;
        memcpy(files->hash, tail->hash, sizeof files->hash);
    }
}

/** Reads number and hash from the last file below `file` that holds an entry.
 *  @param[out] before  that file; 0: none. */
static int find_before(struct intervention_files *files, uint32_t file, uint32_t *before) {
    for (*before = file - 1; *before > 0 && file - *before <= MOST_BACK; (*before)--) {
        struct tail tail = {.number = 0};
        struct stat found = {.st_size = 0};
        int fd;
        int error = open_file(files, *before, O_RDONLY, &fd, &found);
        if (error == ENOENT) {
            continue;
        }
        if (error == 0) {
            error = read_tail(fd, (uint64_t)found.st_size, &tail);
            close(fd);
            free(tail.bytes);
        }
        if (error != 0) {
            return error;
        }
        if (tail.number > 0) {
            take_end(files, &tail);
            return 0;
        }
    }
    *before = 0;
    return 0;
}

/** Continues in the open file: marks a torn entry at its end. */
static int go_on(struct intervention_files *files, const struct tail *tail) {
    uint32_t before = 0;
    const size_t torn = tail->len_bytes - tail->at;
    const bool marked = torn > 0 && tail->bytes[tail->len_bytes - 1] != '\n';
    int error = 0;
    if (tail->number == 0) {
        error = find_before(files, files->file, &before);
    } else {
        take_end(files, tail);
    }
    if (error == 0 && marked) {
        error = write_all(files, torn_mark, sizeof torn_mark - 1);
    }
    const bool stopped = files->number == 0 || files->stopped;
    if (error == 0 && tail->number == 0) {
        error = append_begin(files, before);
    }
    if (error == 0 && torn > 0) {
        error = append_torn(files, tail, marked);
    }
    files->stopped = stopped && torn == 0;
    return error;
}

/** Removes the current file from the count of the others. */
static void leave_out_own(struct intervention_files *files) {
    files->other_bytes -= files->other_bytes < files->bytes ? files->other_bytes : files->bytes;
}

/** Finds the end of the chain in an open folder. */
static int find_end(struct intervention_files *files) {
    uint32_t last;
    uint32_t before = 0;
    struct tail tail = {.number = 0};
    struct stat found = {.st_size = 0};
    int error = last_file(files, &last, &files->other_bytes);
    if (error != 0 || last == 0 || (files->known && last < files->file)) {
        /* The first file, or the current file is missing. */
        return error != 0 ? error : begin_file(files, files->file + 1, files->file);
    }
    error = open_file(files, last, O_RDWR | O_APPEND, &files->fd, &found);
    error = error != 0 ? error : read_tail(files->fd, (uint64_t)found.st_size, &tail);
    if (error == 0 && tail.number == 0 && !tail.whole_file) {
        /* Too long, without any entry: it stays unchanged, and the next file begins. */
        close_file(files);
        error = find_before(files, last, &before);
        error = error != 0 ? error : begin_file(files, last + 1, before);
    } else if (error == 0) {
        files->file = last;
        files->bytes = (uint64_t)found.st_size;
        leave_out_own(files);
        files->device = found.st_dev;
        files->inode = found.st_ino;
        error = go_on(files, &tail);
    }
    free(tail.bytes);
    return error;
}

/** Whether the current file still has its name in the folder. */
static bool is_there(const struct intervention_files *files) {
    struct stat found = {.st_size = 0};
    char name[INTERVENTION_NAME_BYTES];
    intervention_file_name(files->file, name);
    return fstatat(files->folder, name, &found, AT_SYMLINK_NOFOLLOW) == 0 &&
           found.st_dev == files->device && found.st_ino == files->inode;
}

int intervention_files_open(struct intervention_files *files) {
    if (files->fd >= 0 && is_there(files)) {
        return 0;
    }
    intervention_files_close(files);
    files->folder = open(files->path, O_RDONLY | O_DIRECTORY | O_CLOEXEC);
    int error = files->folder < 0 ? errno : 0;
    if (error == 0 && flock(files->folder, LOCK_EX | LOCK_NB) != 0) {
        error = errno == EWOULDBLOCK ? EBUSY : errno;
    }
    error = error != 0 ? error : find_end(files);
    if (error == 0 && !files->known && !files->stopped) {
        struct fsn_json json = {.limit_bytes = OWN_BYTES};
        fsn_json_begin_event(&json, "unfinished", fsn_now_ns());
        error = append_own(files, &json, "warning",
                           "the run before has no stop entry: power loss, crash, kill, or a disk "
                           "that took none");
    }
    if (error != 0) {
        intervention_files_close(files);
        return error;
    }
    files->known = true;
    return 0;
}

uint64_t intervention_files_limit(const struct intervention_files *files) {
    return INTERVENTION_FILES * files->most_bytes;
}

static bool fits(const struct intervention_files *files, unsigned quarters, size_t len_bytes) {
    return files->bytes + files->other_bytes + len_bytes <=
           intervention_files_limit(files) / INTERVENTION_QUARTERS * quarters;
}

bool intervention_files_have_room(struct intervention_files *files, unsigned quarters,
                                  size_t len_bytes) {
    const uint64_t now_ns = fsn_now_ns();
    uint32_t last;
    uint64_t bytes;
    if (!fits(files, quarters, len_bytes) && files->folder >= 0 &&
        now_ns - files->counted_ns >= COUNT_MS * UINT64_C(1000000)) {
        files->counted_ns = now_ns;
        if (last_file(files, &last, &bytes) == 0) {
            files->other_bytes = bytes;
            leave_out_own(files);
        }
    }
    return fits(files, quarters, len_bytes);
}

int intervention_files_append(struct intervention_files *files, unsigned quarters, const char *json,
                              size_t len_bytes) {
    int error = intervention_files_open(files);
    if (error == 0 && !intervention_files_have_room(files, quarters, len_bytes)) {
        return INTERVENTION_FULL;
    }
    if (error == 0 && files->bytes + len_bytes > files->most_bytes) {
        const uint32_t before = files->file;
        files->other_bytes += files->bytes;
        close_file(files);
        error = begin_file(files, before + 1, before);
    }
    error = error != 0 ? error : append(files, json, len_bytes);
    if (error != 0) {
        intervention_files_close(files);
    }
    return error;
}

int intervention_files_sync(struct intervention_files *files) {
    return files->fd >= 0 && fdatasync(files->fd) != 0 ? errno : 0;
}
