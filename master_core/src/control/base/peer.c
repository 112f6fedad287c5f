#define _GNU_SOURCE

#include "control/base/peer.h"

#include <pwd.h>
#include <stdio.h>
#include <string.h>

static const char *const role_names[FSN_ROLES] = {"none", "observer", "operator", "maintainer"};

const char *fsn_role_name(enum fsn_role role) {
    return role_names[role];
}

enum fsn_role fsn_role_of(const char *name) {
    enum fsn_role role = FSN_MAINTAINER;
    while (role != FSN_NO_ROLE && strcmp(role_names[role], name) != 0) {
        role--;
    }
    return role;
}

/** First line of a file of a process. */
static void read_program(pid_t pid, char *room, size_t room_bytes) {
    char path[40];
    snprintf(path, sizeof path, "/proc/%ld/comm", (long)pid);
    FILE *file = pid > 0 ? fopen(path, "re") : NULL;
    if (file != NULL) {
        const size_t len = fread(room, 1, room_bytes - 1, file);
        room[len] = 0;
        room[strcspn(room, "\n")] = 0;
        fclose(file);
    }
}

static void read_user(uid_t uid, char *room, size_t room_bytes) {
    FILE *file = fopen("/etc/passwd", "re");
    const struct passwd *entry;
    while (file != NULL && (entry = fgetpwent(file)) != NULL) {
        if (entry->pw_uid == uid) {
            snprintf(room, room_bytes, "%s", entry->pw_name);
            break;
        }
    }
    if (file != NULL) {
        fclose(file);
    }
}

void fsn_peer_read(struct fsn_peer *peer, pid_t pid, uid_t uid) {
    *peer = (struct fsn_peer){.pid = pid, .uid = uid};
    read_program(pid, peer->program, sizeof peer->program);
    read_user(uid, peer->user, sizeof peer->user);
}

void fsn_peer_put(const struct fsn_peer *peer, struct fsn_json *json) {
    fsn_json_put_u64(json, "pid", (uint64_t)peer->pid);
    fsn_json_put_u64(json, "uid", peer->uid);
    fsn_json_put_text(json, "user", peer->user[0] != 0 ? peer->user : NULL);
    fsn_json_put_text(json, "program", peer->program[0] != 0 ? peer->program : NULL);
}

const char *fsn_peer_text(const struct fsn_peer *peer, char room[FSN_PEER_TEXT_BYTES]) {
    const char *program = peer->program[0] != 0 ? peer->program : "?";
    const char *user = peer->user[0] != 0 ? peer->user : "?";
    snprintf(room, FSN_PEER_TEXT_BYTES, "pid %ld (%s), uid %ld (%s)", (long)peer->pid, program,
             (long)peer->uid, user);
    return room;
}
