#define _GNU_SOURCE

#include "app/base/holder.h"

#include <dirent.h>
#include <stdbool.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

#include "control/base/clock.h"
#include "control/base/peer.h"

enum {
    MOST_HOLDERS = 2,  /**< the owner and its successor */
    UNCONNECTED = 1,   /**< its state; connections to it also have its name */
    LINKED_BYTES = 40, /**< "socket:[1234]" */
};

/** Inode of a socket with a name; 0 if there is none. */
static unsigned long inode_of(const char *expected) {
    FILE *rows = fopen("/proc/net/unix", "re");
    char line[256];
    unsigned long found = 0;
    while (rows != NULL && found == 0 && fgets(line, sizeof line, rows) != NULL) {
        unsigned state;
        unsigned long inode;
        char name[128];
        if (sscanf(line, "%*s %*s %*s %*s %*s %x %lu %127s", &state, &inode, name) == 3 &&
            state == UNCONNECTED && strcmp(name, expected) == 0) {
            found = inode;
        }
    }
    if (rows != NULL) {
        fclose(rows);
    }
    return found;
}

/** Whether a process has a descriptor of a socket. */
static bool has_socket(const char *pid, const char *linked) {
    char path[300];
    snprintf(path, sizeof path, "/proc/%.16s/fd", pid);
    DIR *rows = opendir(path);
    const struct dirent *row;
    bool found = false;
    while (rows != NULL && !found && (row = readdir(rows)) != NULL) {
        char target[LINKED_BYTES] = "";
        (void)readlinkat(dirfd(rows), row->d_name, target, sizeof target - 1);
        found = strcmp(target, linked) == 0;
    }
    if (rows != NULL) {
        closedir(rows);
    }
    return found;
}

/** Returns the monotonic start time of a process, and whether it is stopped. */
static uint64_t read_stat(const char *pid, bool *stopped) {
    char path[64];
    char line[1024] = "";
    char state = '?';
    unsigned long long ticks = 0;
    struct timespec boot = {0};
    snprintf(path, sizeof path, "/proc/%.16s/stat", pid);
    FILE *file = fopen(path, "re");
    if (file != NULL) {
        (void)fread(line, 1, sizeof line - 1, file);
        fclose(file);
    }
    const char *after = strrchr(line, ')'); /* the preceding name may contain any characters */
    if (after != NULL) {
        (void)sscanf(after + 1,
                     " %c %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s %*s "
                     "%llu",
                     &state, &ticks);
    }
    *stopped = state == 'T' || state == 't';
    clock_gettime(CLOCK_BOOTTIME, &boot);
    const uint64_t boot_ns = (uint64_t)boot.tv_sec * 1000000000u + (uint64_t)boot.tv_nsec;
    const uint64_t begin_ns = ticks * (1000000000u / (uint64_t)sysconf(_SC_CLK_TCK));
    return fsn_now_ns() - (boot_ns - begin_ns);
}

static void put_holder(const char *pid, char *room) {
    char path[64];
    char who[FSN_PEER_TEXT_BYTES];
    char utc[32];
    struct stat owner = {.st_uid = 0};
    struct fsn_peer peer;
    bool stopped;
    snprintf(path, sizeof path, "/proc/%.16s", pid);
    if (stat(path, &owner) != 0) {
        return; /* it has ended */
    }
    fsn_peer_read(&peer, (pid_t)strtol(pid, NULL, 10), owner.st_uid);
    fsn_utc_text(read_stat(pid, &stopped), utc);
    const size_t used = strlen(room);
    snprintf(room + used, HOLDER_TEXT_BYTES - used, "%s%s since %s%s", used > 0 ? ", " : "held by ",
             fsn_peer_text(&peer, who), utc,
             stopped ? ", stopped: secure the machine, then end it with SIGKILL" : "");
}

const char *holder_text(const char *name, char room[HOLDER_TEXT_BYTES]) {
    char linked[LINKED_BYTES];
    const unsigned long inode = inode_of(name);
    DIR *rows = inode != 0 ? opendir("/proc") : NULL;
    const struct dirent *row;
    int holders = 0;
    room[0] = 0;
    snprintf(linked, sizeof linked, "socket:[%lu]", inode);
    while (rows != NULL && holders < MOST_HOLDERS && (row = readdir(rows)) != NULL) {
        if (row->d_name[0] >= '1' && row->d_name[0] <= '9' && has_socket(row->d_name, linked)) {
            holders++;
            put_holder(row->d_name, room);
        }
    }
    if (rows != NULL) {
        closedir(rows);
    }
    if (inode != 0 && room[0] == 0) {
        snprintf(room, HOLDER_TEXT_BYTES,
                 "held by a process that this user may not look at: sudo ss -xap names it in the "
                 "line of %.107s",
                 name);
    }
    return room;
}
