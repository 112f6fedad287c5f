/** Users that may connect, and the states of the socket's file. The users and groups of this
 *  program are its own, whatever machine it runs on; the sockets are real. */
#define _GNU_SOURCE

#include <errno.h>
#include <fcntl.h>
#include <grp.h>
#include <poll.h>
#include <string.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/un.h>
#include <sys/wait.h>
#include <unistd.h>

#include "control_host.h"
#include "emulated_rig.h"

/* -- users and groups ------------------------------------------------------------------------ */

enum { OURS = 4000, ANN = 4001, BOB = 4002, STRANGER = 4999 };

static uid_t runs_as = OURS;

uid_t geteuid(void) {
    return runs_as;
}

/* -- a system that refuses --------------------------------------------------------------------- */

/** Number of these calls that fails with EMFILE, from now on; 0: none. */
static struct {
    int socket, listen, lstat, unlink, getsockopt;
} fails_in;

static bool fails(int *in) {
    errno = EMFILE;
    return *in > 0 && --*in == 0;
}

/** A socket of the test's own. */
static int own_socket(void) {
    return (int)syscall(SYS_socket, AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
}

int socket(int domain, int type, int protocol) {
    CHECK(type == (SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK));
    return fails(&fails_in.socket) ? -1 : (int)syscall(SYS_socket, domain, type, protocol);
}

int listen(int fd, int backlog) {
    return fails(&fails_in.listen) ? -1 : (int)syscall(SYS_listen, fd, backlog);
}

int lstat(const char *path, struct stat *found) {
    return fails(&fails_in.lstat) ? -1 : fstatat(AT_FDCWD, path, found, AT_SYMLINK_NOFOLLOW);
}

int unlink(const char *path) {
    return fails(&fails_in.unlink) ? -1 : unlinkat(AT_FDCWD, path, 0);
}

static uid_t connects_as; /**< user of who connects; 0: the real one */

int getsockopt(int fd, int level, int name, void *value, socklen_t *size) {
    if (connects_as != 0 && name == SO_PEERGROUPS) {
        *size = 0;
        return 0;
    }
    if (connects_as != 0) {
        CHECK(level == SOL_SOCKET && name == SO_PEERCRED && *size == sizeof(struct ucred));
        *(struct ucred *)value = (struct ucred){.pid = 77, .uid = connects_as, .gid = 99};
        return 0;
    }
    return fails(&fails_in.getsockopt) ? -1
                                       : (int)syscall(SYS_getsockopt, fd, level, name, value, size);
}

static void who_may_request_what(void) {
    static const struct fsn_control_access closed = {0};
    static const struct fsn_control_access ann = {.user = {{1, FSN_OPERATOR}, {ANN, FSN_OBSERVER}},
                                                  .users = 2};
    static const struct fsn_control_access team = {
        .group = {{6000, FSN_OBSERVER}, {7002, FSN_OPERATOR}}, .groups = 2};
    static const struct fsn_control_access first = {
        .group = {{7001, FSN_MAINTAINER}, {7002, FSN_MAINTAINER}}, .groups = 1};
    static const struct fsn_control_access both = {
        .user = {{ANN, FSN_OPERATOR}},
        .users = 1,
        .group = {{7001, FSN_OBSERVER}, {7002, FSN_MAINTAINER}},
        .groups = 2};
    static const struct {
        const struct fsn_control_access *access;
        uid_t user;
        gid_t groups[3];
        size_t count;
        enum fsn_role role;
    } table[] = {
        {&closed, 0, {0}, 1, FSN_MAINTAINER},
        {&closed, 0, {99}, 1, FSN_MAINTAINER},
        {&closed, OURS, {99}, 1, FSN_MAINTAINER},
        {&closed, ANN, {0}, 1, FSN_NO_ROLE},
        {&closed, BOB, {BOB}, 1, FSN_NO_ROLE},
        {&ann, ANN, {99}, 1, FSN_OBSERVER},
        {&ann, 1, {99}, 1, FSN_OPERATOR},
        {&ann, BOB, {99}, 1, FSN_NO_ROLE},
        {&ann, 2, {ANN}, 1, FSN_NO_ROLE},
        {&team, ANN, {6000}, 1, FSN_OBSERVER},
        {&team, ANN, {7002}, 1, FSN_OPERATOR},
        {&team, ANN, {7001}, 1, FSN_NO_ROLE},
        {&team, BOB, {99, 7001, 7002}, 3, FSN_OPERATOR}, /* by a supplementary group */
        {&team, BOB, {99, 7001, 7002}, 2, FSN_NO_ROLE},
        {&first, BOB, {99, 7001}, 2, FSN_MAINTAINER},
        {&first, ANN, {99, 7002}, 2, FSN_NO_ROLE},
        {&both, ANN, {7001}, 1, FSN_OPERATOR}, /* the highest of all */
        {&both, ANN, {7001, 7002}, 2, FSN_MAINTAINER},
        {&both, BOB, {7001}, 1, FSN_OBSERVER},
    };
    for (size_t i = 0; i < sizeof table / sizeof table[0]; i++) {
        if (fsn_control_role(table[i].access, table[i].user, table[i].groups, table[i].count) !=
            table[i].role) {
            fprintf(stderr, "row %zu\n", i);
            exit(1);
        }
    }
}

static void roles_have_words(void) {
    static const char *const words[] = {"none", "observer", "operator", "maintainer"};
    for (enum fsn_role role = FSN_NO_ROLE; role < FSN_ROLES; role++) {
        CHECK(strcmp(fsn_role_name(role), words[role]) == 0 && fsn_role_of(words[role]) == role);
    }
    CHECK(fsn_role_of("Operator") == FSN_NO_ROLE && fsn_role_of("") == FSN_NO_ROLE);
}

/* -- the socket ------------------------------------------------------------------------------ */

static struct rig {
    struct emulated_rig on;
    struct fsn_control *control;
    struct fsn_control_access access;
    char folder[32], path[64];
    struct fsn_refusal refusal;
} rig;

static struct fsn_control_host host;
static char turned_away[512]; /**< the last event about a user that may not connect */
static unsigned turned_away_events;

static void note_turned_away(void *self, enum fsn_log_level level, enum fsn_role account,
                             const char *text, const char *json, size_t json_bytes) {
    static const char begin[] = "{\"event\":\"turned_away\",";
    (void)account;
    (void)self;
    if (strncmp(json, begin, sizeof begin - 1) == 0) {
        CHECK(level == FSN_LOG_WARNING && strstr(text, "may not connect") != NULL);
        turned_away_events++;
        snprintf(turned_away, sizeof turned_away, "%.*s", (int)json_bytes, json);
    }
}

static struct fsn_control *new_control(void) {
    struct fsn_control *control = fsn_control_create(rig.on.plan, &host, &rig.access);
    CHECK(control != NULL);
    return control;
}

static void set_up(void) {
    size_t len;
    uint8_t *bytes = build_full(&len);
    rig = (struct rig){.on = emulated_rig_load(bytes, len), .folder = "/tmp/fsn-listen-XXXXXX"};
    CHECK(mkdtemp(rig.folder) != NULL && chmod(rig.folder, 0755) == 0);
    snprintf(rig.path, sizeof rig.path, "%s/s", rig.folder);
    host = test_host(NULL);
    host.log = note_turned_away;
    rig.control = new_control();
}

static void tear_down(void) {
    fsn_control_free(rig.control);
    emulated_rig_end(&rig.on);
    CHECK(rmdir(rig.folder) == 0); /* nothing is left in it */
}

static void refused(const char *path, fsn_status status, const char *text, const char *hint) {
    struct fsn_control *control = new_control();
    memset(&rig.refusal, 0, sizeof rig.refusal);
    CHECK(fsn_control_listen(control, path, &rig.refusal) == status);
    if (strcmp(rig.refusal.text, text) != 0 || rig.refusal.status != status) {
        fprintf(stderr, "%s\n%s\n", rig.refusal.text, text);
    }
    CHECK(strcmp(rig.refusal.text, text) == 0 && rig.refusal.status == status);
    CHECK(rig.refusal.hint != NULL && strcmp(rig.refusal.hint, hint) == 0);
    CHECK(control->listener == -1);
    fsn_control_free(control);
}

static void paths_are_refused(void) {
    static const char another[] = "--socket PATH names another place";
    char path[200];
    char text[300];
    set_up();
    refused("", FSN_E_ARG, "the path of a socket has 1 to 107 bytes", another);
    memset(path, 'x', 108);
    path[108] = 0;
    refused(path, FSN_E_ARG, "the path of a socket has 1 to 107 bytes", another);
    snprintf(path, sizeof path, "%s/none/s", rig.folder);
    snprintf(text, sizeof text, "the control socket %s: No such file or directory", path);
    refused(path, FSN_E_SYS, text, another);
    snprintf(path, sizeof path, "%s/file", rig.folder);
    const int file = open(path, O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
    CHECK(file >= 0 && close(file) == 0);
    snprintf(text, sizeof text, "%s exists and is not a socket", path);
    refused(path, FSN_E_ARG, text, another);
    snprintf(path, sizeof path, "%s/file/s", rig.folder);
    snprintf(text, sizeof text, "the control socket %s: Not a directory", path);
    refused(path, FSN_E_SYS, text, another);
    snprintf(path, sizeof path, "%s/file", rig.folder);
    CHECK(unlink(path) == 0);
    CHECK(fsn_control_listen(rig.control, rig.path, &rig.refusal) == FSN_OK);
    snprintf(text, sizeof text, "another process answers on %s", rig.path);
    refused(rig.path, FSN_E_STATE, text, "stop that fsn-master, or give this one another --socket");
    tear_down();
}

static void leave_dead_socket(void) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    snprintf(address.sun_path, sizeof address.sun_path, "%s", rig.path);
    const int dead = own_socket();
    CHECK(bind(dead, (const struct sockaddr *)&address, sizeof address) == 0 && close(dead) == 0);
}

/** Every refusal of the system is reported, and no file of ours stays. */
static void a_system_that_refuses_is_reported(void) {
    static const char another[] = "--socket PATH names another place";
    static const struct {
        int *call, in;
        bool dead; /**< another process left a socket */
        const char *what;
    } rows[] = {
        {&fails_in.socket, 1, false, "socket"},
        {&fails_in.listen, 1, false, "the control socket"},
        {&fails_in.lstat, 1, false, "the control socket"},
        {&fails_in.lstat, 2, false, "the control socket"},
        {&fails_in.socket, 1, true, "socket"},
        {&fails_in.socket, 2, true, "socket"},
        {&fails_in.unlink, 1, true, "the socket that a dead process left"},
    };
    for (size_t i = 0; i < sizeof rows / sizeof rows[0]; i++) {
        char text[200];
        set_up();
        if (rows[i].dead) {
            leave_dead_socket();
        }
        snprintf(text, sizeof text, "%s %s: Too many open files", rows[i].what, rig.path);
        *rows[i].call = rows[i].in;
        refused(rig.path, FSN_E_SYS, text, another);
        CHECK(*rows[i].call == 0);
        CHECK(fsn_control_listen(rig.control, rig.path, &rig.refusal) == FSN_OK);
        tear_down();
    }
    /* A file that has disappeared is not removed, nor one that cannot be examined. */
    set_up();
    CHECK(fsn_control_listen(rig.control, rig.path, &rig.refusal) == FSN_OK);
    fails_in.lstat = 1;
    fsn_control_free(rig.control);
    rig.control = new_control();
    CHECK(unlink(rig.path) == 0);
    tear_down();
}

static mode_t mode_of(const char *path) {
    struct stat found;
    CHECK(lstat(path, &found) == 0 && S_ISSOCK(found.st_mode));
    return found.st_mode & 0777;
}

/** Only its owner reaches it, unless others may connect at all; the umask is unchanged. */
static void the_file_is_for_those_who_may(void) {
    const mode_t before = umask(0027);
    for (int kind = 0; kind < 3; kind++) {
        set_up();
        rig.access.users = kind == 1;
        rig.access.groups = kind == 2;
        CHECK(fsn_control_listen(rig.control, rig.path, &rig.refusal) == FSN_OK);
        CHECK(mode_of(rig.path) == (kind == 0 ? 0600 : 0666));
        CHECK(umask(0027) == 0027);
        tear_down();
    }
    umask(before);
}

/** The socket of an ended process is replaced; that of a new one is left unchanged. */
static void dead_sockets_make_way(void) {
    set_up();
    leave_dead_socket();
    CHECK(fsn_control_listen(rig.control, rig.path, &rig.refusal) == FSN_OK);
    CHECK(mode_of(rig.path) == 0600);
    CHECK(unlink(rig.path) == 0);
    const int file = open(rig.path, O_CREAT | O_WRONLY | O_CLOEXEC, 0600);
    CHECK(file >= 0 && close(file) == 0);
    fsn_control_free(rig.control);
    rig.control = NULL;
    CHECK(access(rig.path, F_OK) == 0 && unlink(rig.path) == 0);
    rig.control = new_control(); /* never listened: nothing to remove */
    tear_down();
}

/** Connects as a user and sends hello; returns the first word of the answer after "ok". */
static void as_user(uid_t user, gid_t group, gid_t other, const char *expected) {
    int pipe_ends[2];
    CHECK(pipe(pipe_ends) == 0);
    const pid_t child = fork();
    CHECK(child >= 0);
    if (child == 0) {
        struct sockaddr_un address = {.sun_family = AF_UNIX};
        snprintf(address.sun_path, sizeof address.sun_path, "%s", rig.path);
        const int fd = own_socket();
        CHECK(setgroups(other != 0, &other) == 0 && setgid(group) == 0 && setuid(user) == 0);
        CHECK(connect(fd, (const struct sockaddr *)&address, sizeof address) == 0);
        (void)!send(fd, "hello\n", 6, MSG_NOSIGNAL);
        char answer[4096];
        const ssize_t got = recv(fd, answer, sizeof answer, 0);
        CHECK(got > 0 && write(pipe_ends[1], answer, (size_t)got) == got);
        _exit(0);
    }
    close(pipe_ends[1]);
    struct pollfd fds[FSN_CONTROL_FDS + 1];
    int status = 0;
    bool done = false;
    while (!done) { /* until the child has gone */
        uint64_t wait_ns;
        const size_t count = fsn_control_prepare(rig.control, fds, &wait_ns);
        fds[count] = (struct pollfd){.fd = pipe_ends[0], .events = POLLIN};
        CHECK(poll(fds, count + 1, (int)(wait_ns / 1000000) + 1) >= 0);
        done = fds[count].revents != 0;
        fsn_control_serve(rig.control, fds, count);
    }
    CHECK(waitpid(child, &status, 0) == child && status == 0);
    char answer[4096];
    const ssize_t got = read(pipe_ends[0], answer, sizeof answer - 1);
    CHECK(got > 0);
    answer[got] = 0;
    if (strncmp(answer, expected, strlen(expected)) != 0) {
        fprintf(stderr, "%s%s\n", answer, expected);
    }
    CHECK(strncmp(answer, expected, strlen(expected)) == 0);
    close(pipe_ends[0]);
}

/** The kernel identifies the peer. */
static void strangers_are_turned_away(void) {
    if (getuid() != 0) {
        fprintf(stderr, "test_listen: becoming another user takes root: that part is left out\n");
        return;
    }
    static const char no[] =
        "{\"ok\":false,\"error\":\"FSN_E_CLOSED\",\"text\":\"this user may not connect\","
        "\"hint\":\"start fsn-master with --allow-user or --allow-group\"}\n";
    set_up();
    rig.access = (struct fsn_control_access){
        .user = {{ANN, FSN_OBSERVER}}, .users = 1, .group = {{7002, FSN_OPERATOR}}, .groups = 1};
    CHECK(fsn_control_listen(rig.control, rig.path, &rig.refusal) == FSN_OK);
    as_user(ANN, 99, 0, "{\"ok\":true");
    as_user(BOB, 99, 7002, "{\"ok\":true"); /* by a supplementary group */
    as_user(STRANGER, 7002, 0, "{\"ok\":true");
    as_user(OURS, 99, 0, "{\"ok\":true");
    CHECK(turned_away[0] == 0);
    as_user(STRANGER, 7001, 0, no);
    CHECK(strstr(turned_away, "\"user\":null") != NULL);
    char expected[64];
    snprintf(expected, sizeof expected, "\"program\":\"%s\",\"times\":1,", program_name());
    CHECK(strstr(turned_away, expected) != NULL);
    for (unsigned i = 1; i < FSN_QUOTA_AT_ONCE + 2; i++) {
        as_user(4005 + i, 7001, 0, no);
        CHECK(strstr(turned_away, "\"times\":1,") != NULL);
    }
    CHECK(turned_away_events == FSN_QUOTA_AT_ONCE); /* of all of them together */
    as_user(0, 99, 0, "{\"ok\":true");
    fails_in.getsockopt = 1; /* an unknown peer has no name */
    as_user(0, 99, 0, no);
    tear_down();
}

/* -- a full house ---------------------------------------------------------------------------- */

static char heard[512];

static void turn(void) {
    struct pollfd fds[FSN_CONTROL_FDS];
    uint64_t wait_ns;
    const size_t count = fsn_control_prepare(rig.control, fds, &wait_ns);
    CHECK(poll(fds, count, 0) >= 0);
    fsn_control_serve(rig.control, fds, count);
}

static int taken = -1; /**< a descriptor that the next client of the server shall have */

static int connect_as(uid_t user) {
    struct sockaddr_un address = {.sun_family = AF_UNIX};
    snprintf(address.sun_path, sizeof address.sun_path, "%s", rig.path);
    const int fd = own_socket();
    CHECK(connect(fd, (const struct sockaddr *)&address, sizeof address) == 0);
    if (taken >= 0) {
        close(taken);
        taken = -1;
    }
    connects_as = user;
    turn();
    connects_as = 0;
    return fd;
}

/** Unread data of a peer, and its end. */
static const char *last_words(int fd) {
    size_t len = 0;
    ssize_t got = 1;
    while (got > 0) {
        got = recv(fd, heard + len, sizeof heard - 1 - len, MSG_DONTWAIT);
        len += got > 0 ? (size_t)got : 0;
    }
    heard[len] = 0;
    CHECK(got == 0 && close(fd) == 0);
    return heard;
}

#define FULL                                                                                       \
    "{\"ok\":false,\"error\":\"FSN_E_BUSY\",\"text\":\"too many clients\","                        \
    "\"hint\":\"close one of them\"}\n"
#define MADE_ROOM                                                                                  \
    "{\"ok\":false,\"error\":\"FSN_E_BUSY\",\"text\":\"dropped: silent, and its place "            \
    "was needed for another client\",\"hint\":\"connect again when there is something to ask\"}\n"

/** A client without activity for five seconds makes room, the longest idle one first; for our user
 *  at once. A client that waits for an answer, or writes, is not idle. */
static void who_is_idle_makes_room(void) {
    enum { LEAST = 5000, RECENT = 9 };
    static const unsigned order[] = {2, 4, 1, 0}; /* the message of the fifth is sent by then */
    int peer[FSN_CONTROL_CLIENTS];
    static struct fsn_job job;
    set_up();
    rig.access = (struct fsn_control_access){.user = {{ANN, FSN_OBSERVER}}, .users = 1};
    taken = open("/dev/null", O_RDONLY | O_CLOEXEC);
    CHECK(fsn_control_listen(rig.control, rig.path, &rig.refusal) == FSN_OK && taken == 0);
    struct fsn_client *client = rig.control->client;
    for (unsigned i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        const uid_t user = i < FSN_CONTROL_SHARED ? ANN : OURS;
        if (i == FSN_CONTROL_SHARED) { /* the other places are not for her */
            CHECK(strcmp(last_words(connect_as(ANN)), FULL) == 0);
        }
        peer[i] = connect_as(user);
        CHECK(client[i].fd >= 0 && client[i].number == i + 1);
        CHECK((fcntl(client[i].fd, F_GETFL) & O_NONBLOCK) != 0);
        CHECK(fcntl(client[i].fd, F_GETFD) == FD_CLOEXEC);
        CHECK(client[i].peer.pid == 77 && client[i].peer.uid == user &&
              client[i].lease_ms == FSN_LEASE_MS);
        CHECK(client[i].request_ns == client[i].heard_ns && client[i].heard_ns > 0);
        CHECK(client[i].moved_ns >= client[i].heard_ns);
    }
    CHECK(strcmp(last_words(connect_as(ANN)), FULL) == 0);
    for (unsigned i = 0; i < RECENT; i++) { /* the later, the longer idle */
        client[i].request_ns = client[0].heard_ns - (LEAST + i) * UINT64_C(1000000);
    }
    client[8].events = true;
    client[7].stream.every = 1;
    client[6].job = &job;
    client[5].in_bytes = 1;
    client[4].sent = 1;
    struct fsn_wanted wanted = {.symbol = 0, .raw = 1};
    fsn_outputs_write(rig.control->services.view.outputs, client[3].number, &wanted, 1);
    for (unsigned i = 0; i < sizeof order / sizeof order[0]; i++) {
        const int late = peer[order[i]];
        peer[order[i]] = connect_as(ANN);
        CHECK(client[order[i]].number == FSN_CONTROL_CLIENTS + 1 + i);
        CHECK(strcmp(last_words(late), MADE_ROOM) == 0);
    }
    CHECK(strcmp(last_words(connect_as(ANN)), FULL) == 0);
    const int late = peer[RECENT];
    peer[RECENT] = connect_as(OURS);
    CHECK(strcmp(last_words(late), MADE_ROOM) == 0);
    client[6].job = NULL;
    for (unsigned i = 0; i < FSN_CONTROL_CLIENTS; i++) {
        close(peer[i]);
    }
    tear_down();
}

/** One user holds all places, and works: others still get their share, place by place. */
static void no_user_holds_all_places(void) {
    static const char surplus[] =
        "{\"ok\":false,\"error\":\"FSN_E_BUSY\",\"text\":\"dropped: this user has the most places, "
        "and another user needed one\",\"hint\":\"close clients of this user\"}\n";
    int ann[FSN_CONTROL_SHARED], bob[FSN_CONTROL_SHARED / 2];
    set_up();
    rig.access =
        (struct fsn_control_access){.user = {{ANN, FSN_OBSERVER}, {BOB, FSN_OBSERVER}}, .users = 2};
    taken = open("/dev/null", O_RDONLY | O_CLOEXEC);
    CHECK(fsn_control_listen(rig.control, rig.path, &rig.refusal) == FSN_OK && taken == 0);
    struct fsn_client *client = rig.control->client;
    for (unsigned i = 0; i < FSN_CONTROL_SHARED; i++) {
        ann[i] = connect_as(ANN);
        client[i].in_bytes = 1; /* begins a request */
    }
    CHECK(strcmp(last_words(connect_as(ANN)), FULL) == 0); /* not at the cost of her own */
    for (unsigned i = 1; i <= FSN_CONTROL_SHARED / 2; i++) {
        struct fsn_client *place = &client[FSN_CONTROL_SHARED - i]; /* of her newest */
        bob[i - 1] = connect_as(BOB);
        CHECK(place->peer.uid == BOB &&
              strcmp(last_words(ann[FSN_CONTROL_SHARED - i]), surplus) == 0);
        place->in_bytes = 1;
    }
    CHECK(strcmp(last_words(connect_as(BOB)), FULL) == 0);
    CHECK(strcmp(last_words(connect_as(ANN)), FULL) == 0);
    for (unsigned i = 0; i < FSN_CONTROL_SHARED / 2; i++) {
        close(ann[i]);
        close(bob[i]);
    }
    tear_down();
}

/** Lines that have come so far. */
static unsigned lines_at(int fd) {
    char bytes[65536];
    unsigned lines = 0;
    ssize_t got;
    while ((got = recv(fd, bytes, sizeof bytes, MSG_DONTWAIT)) > 0) {
        for (ssize_t i = 0; i < got; i++) {
            lines += bytes[i] == '\n';
        }
    }
    return lines;
}

/** However much observers request, ours is answered in the same turn; and they in later ones. */
static void observers_share_a_turn(void) {
    enum { OBSERVERS = 3, LINES = 8, AT_MOST = 2, TURNS = 200 };
    static const char request[] = "lease 0\nlease 0\nlease 0\nlease 0\n";
    int peer[OBSERVERS + 1];
    unsigned got[OBSERVERS] = {0};
    set_up();
    rig.access = (struct fsn_control_access){.user = {{ANN, FSN_OBSERVER}}, .users = 1};
    taken = open("/dev/null", O_RDONLY | O_CLOEXEC);
    CHECK(fsn_control_listen(rig.control, rig.path, &rig.refusal) == FSN_OK);
    for (unsigned i = 0; i <= OBSERVERS; i++) { /* ours is the last to come */
        peer[i] = connect_as(i < OBSERVERS ? ANN : OURS);
    }
    for (unsigned i = 0; i <= OBSERVERS; i++) {
        for (unsigned n = 0; n < LINES; n += 4) {
            CHECK(send(peer[i], request, sizeof request - 1, 0) == (ssize_t)sizeof request - 1);
        }
    }
    turn();
    CHECK(lines_at(peer[OBSERVERS]) == LINES);
    unsigned answered = 0;
    for (unsigned turns = 0; answered < OBSERVERS * LINES; turns++) {
        CHECK(turns < TURNS);
        for (unsigned i = 0; i < OBSERVERS; i++) {
            const unsigned more = lines_at(peer[i]);
            CHECK(more <= AT_MOST);
            got[i] += more;
            answered += more;
        }
        turn();
    }
    for (unsigned i = 0; i < OBSERVERS; i++) {
        CHECK(got[i] == LINES);
        close(peer[i]);
    }
    close(peer[OBSERVERS]);
    tear_down();
}

int main(void) {
    close(STDIN_FILENO); /* 0 is a descriptor like any other */
    const int open_before = open_files();
    who_may_request_what();
    roles_have_words();
    paths_are_refused();
    a_system_that_refuses_is_reported();
    the_file_is_for_those_who_may();
    dead_sockets_make_way();
    strangers_are_turned_away();
    who_is_idle_makes_room();
    no_user_holds_all_places();
    observers_share_a_turn();
    CHECK(open_files() == open_before);
    return 0;
}
