/** Asks a running fsn-master, with nothing but POSIX: ask SOCKET REQUEST…
 *
 *      cc -std=c11 -o ask ask.c
 *      ./ask /run/fsn-master-eth1.sock "set drive_1.0x6040:00=6" "get drive_1.0x6041:00"
 *
 * Prints each reply, a line of JSON. What it has set falls back when it ends: the connection is
 * the lease. Exit code 0 all was done, 1 a request was refused, 2 usage, 3 nobody answers.
 * Part of the black channel: no safety function.
 */
#define _POSIX_C_SOURCE 200809L

#include <errno.h>
#include <poll.h>
#include <signal.h>
#include <stdbool.h>
#include <stdio.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

enum { WAIT_MS = 5000, ROOM_BYTES = 1 << 16 };

/** Bytes that came and have not been used. */
struct received {
    char bytes[ROOM_BYTES];
    size_t count;
};

static int connect_to(const char *path) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    const size_t length = strlen(path);
    if (length >= sizeof address.sun_path) {
        errno = ENAMETOOLONG;
        return -1;
    }
    memcpy(address.sun_path, path, length + 1);
    const int fd = socket(AF_UNIX, SOCK_STREAM, 0);
    if (fd >= 0 && connect(fd, (const struct sockaddr *)&address, sizeof address) != 0) {
        const int why = errno;
        close(fd);
        errno = why;
        return -1;
    }
    return fd;
}

static bool send_all(int fd, const char *text, size_t bytes) {
    while (bytes > 0) {
        const ssize_t sent = write(fd, text, bytes);
        if (sent < 0 && errno == EINTR) {
            continue;
        }
        if (sent < 0) {
            return false;
        }
        text += sent;
        bytes -= (size_t)sent;
    }
    return true;
}

/** Waits for a whole line at the front of what came; returns its length with the newline, 0 for
 *  none. A line longer than the room is passed on in parts. */
static size_t next_line(int fd, struct received *received) {
    for (;;) {
        const char *end = memchr(received->bytes, '\n', received->count);
        if (end != NULL) {
            return (size_t)(end - received->bytes) + 1;
        }
        if (received->count == ROOM_BYTES) {
            return ROOM_BYTES;
        }
        struct pollfd wanted = {.fd = fd, .events = POLLIN};
        const int ready = poll(&wanted, 1, WAIT_MS);
        if (ready < 0 && errno == EINTR) {
            continue;
        }
        if (ready == 0) {
            errno = ETIMEDOUT;
        }
        if (ready <= 0) {
            return 0;
        }
        const ssize_t got =
            read(fd, received->bytes + received->count, ROOM_BYTES - received->count);
        if (got < 0 && errno == EINTR) {
            continue;
        }
        if (got == 0) {
            errno = ECONNRESET;
        }
        if (got <= 0) {
            return 0;
        }
        received->count += (size_t)got;
    }
}

static bool begins(const struct received *received, const char *text) {
    const size_t length = strlen(text);
    return received->count >= length && memcmp(received->bytes, text, length) == 0;
}

/** Sends one request and prints its reply; events before it are left out.
 *  Returns 1 when it was done, 0 when it was refused, -1 when nobody answers. */
static int ask(int fd, struct received *received, const char *request) {
    if (!send_all(fd, request, strlen(request)) || !send_all(fd, "\n", 1)) {
        return -1;
    }
    /* A reply begins with "ok"; that is its first key. An event has none. */
    int done = -1;
    for (bool whole = true, first = true; first || !whole || done < 0; first = false) {
        const size_t bytes = next_line(fd, received);
        if (bytes == 0) {
            return -1;
        }
        if (whole && begins(received, "{\"ok\":")) {
            done = begins(received, "{\"ok\":true");
        }
        whole = received->bytes[bytes - 1] == '\n';
        if (done >= 0) {
            fwrite(received->bytes, 1, bytes, stdout);
        }
        received->count -= bytes;
        memmove(received->bytes, received->bytes + bytes, received->count);
    }
    return done;
}

int main(int argc, char **argv) {
    static struct received received;
    int code = 0;
    if (argc < 3) {
        fprintf(stderr, "usage: ask SOCKET REQUEST...\n");
        return 2;
    }
    signal(SIGPIPE, SIG_IGN); /* a server that has gone is told by write */
    const int fd = connect_to(argv[1]);
    if (fd < 0) {
        fprintf(stderr, "%s: %s; is fsn-master running?\n", argv[1], strerror(errno));
        return 3;
    }
    for (int i = 2; i < argc && code != 3; i++) {
        const int done = ask(fd, &received, argv[i]);
        if (done < 0) {
            fprintf(stderr, "%s: %s\n", argv[1], strerror(errno));
            code = 3;
        } else if (done == 0) {
            code = 1;
        }
    }
    close(fd);
    return code;
}
