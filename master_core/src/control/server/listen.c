/** The file of the socket, and access to it. */
#define _GNU_SOURCE

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include "control/server/server.h"
#include "plan/try.h"

static fsn_status system_refuses(struct fsn_refusal *refusal, const char *what, const char *path) {
    return fsn_refusal_set(refusal, FSN_E_SYS, "--socket PATH names another place", "%s %.108s: %s",
                           what, path, strerror(errno));
}

/** Makes way for a new socket at `path`: no file, or the socket of an ended process. */
static fsn_status make_way(const struct sockaddr_un *address, struct fsn_refusal *refusal) {
    struct stat found;
    if (lstat(address->sun_path, &found) != 0) {
        return errno == ENOENT ? FSN_OK
                               : system_refuses(refusal, "the control socket", address->sun_path);
    }
    if (!S_ISSOCK(found.st_mode)) {
        return fsn_refusal_set(refusal, FSN_E_ARG, "--socket PATH names another place",
                               "%.108s exists and is not a socket", address->sun_path);
    }
    const int probe = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (probe < 0) {
        return system_refuses(refusal, "socket", address->sun_path);
    }
    const bool dead = connect(probe, (const struct sockaddr *)address, sizeof *address) != 0 &&
                      errno == ECONNREFUSED;
    close(probe);
    if (!dead) {
        return fsn_refusal_set(refusal, FSN_E_STATE,
                               "stop that fsn-master, or give this one another --socket",
                               "another process answers on %.108s", address->sun_path);
    }
    return unlink(address->sun_path) == 0 || errno == ENOENT
               ? FSN_OK
               : system_refuses(refusal, "the socket that a dead process left", address->sun_path);
}

/** The socket at control->path is ours. */
static fsn_status keep(struct fsn_control *control, int listener, const char *path,
                       const struct stat *file) {
    snprintf(control->path, sizeof control->path, "%s", path);
    control->device = file->st_dev;
    control->inode = file->st_ino;
    control->listener = listener;
    return FSN_OK;
}

fsn_status fsn_control_listen(struct fsn_control *control, const char *path,
                              struct fsn_refusal *refusal) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    if (path[0] == 0 || strlen(path) >= sizeof address.sun_path) {
        return fsn_refusal_set(refusal, FSN_E_ARG, "--socket PATH names another place",
                               "the path of a socket has 1 to %d bytes",
                               (int)sizeof address.sun_path - 1);
    }
    memcpy(address.sun_path, path, strlen(path) + 1);
    FSN_TRY(make_way(&address, refusal));
    const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
    if (fd < 0) {
        return system_refuses(refusal, "socket", path);
    }
    /* Other users need the file mode to reach the check of their identity. */
    const bool shared = control->access->users + control->access->groups > 0;
    const mode_t before = umask(shared ? 0111 : 0177);
    const int bound = bind(fd, (const struct sockaddr *)&address, sizeof address);
    const int error = errno;
    umask(before);
    errno = error;
    struct stat found;
    if (bound != 0 || listen(fd, SOMAXCONN) != 0 || lstat(path, &found) != 0) {
        system_refuses(refusal, "the control socket", path);
        close(fd);
        if (bound == 0) {
            unlink(path);
        }
        return FSN_E_SYS;
    }
    return keep(control, fd, path, &found);
}

bool fsn_control_is_at(int listener, const char *path) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    socklen_t size = sizeof address;
    return getsockname(listener, (struct sockaddr *)&address, &size) == 0 &&
           strncmp(address.sun_path, path, sizeof address.sun_path) == 0;
}

fsn_status fsn_control_adopt(struct fsn_control *control, int listener, const char *path,
                             struct fsn_refusal *refusal) {
    struct stat found;
    const bool shared = control->access->users + control->access->groups > 0;
    if (!fsn_control_is_at(listener, path) || lstat(path, &found) != 0 ||
        !S_ISSOCK(found.st_mode) || chmod(path, shared ? 0666 : 0600) != 0) {
        close(listener);
        return fsn_control_listen(control, path, refusal);
    }
    return keep(control, listener, path, &found);
}

int fsn_control_listener(const struct fsn_control *control) {
    return control->listener;
}

void fsn_control_close_socket(struct fsn_control *control) {
    struct stat found;
    if (control->listener < 0) {
        return;
    }
    close(control->listener);
    if (control->path[0] != 0 && lstat(control->path, &found) == 0 &&
        found.st_dev == control->device && found.st_ino == control->inode) {
        unlink(control->path);
    }
}

static enum fsn_role higher(enum fsn_role one, enum fsn_role other) {
    return one > other ? one : other;
}

static enum fsn_role role_of(const struct fsn_control_allowed *allowed, size_t count, uint32_t id) {
    enum fsn_role role = FSN_NO_ROLE;
    for (size_t i = 0; i < count; i++) {
        role = higher(role, allowed[i].id == id ? allowed[i].role : FSN_NO_ROLE);
    }
    return role;
}

enum fsn_role fsn_control_role(const struct fsn_control_access *access, uid_t user,
                               const gid_t *groups, size_t count) {
    if (user == 0 || user == geteuid()) {
        return FSN_MAINTAINER;
    }
    enum fsn_role role = role_of(access->user, access->users, user);
    for (size_t i = 0; i < count; i++) {
        role = higher(role, role_of(access->group, access->groups, groups[i]));
    }
    return role;
}
