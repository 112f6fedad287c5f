/** Changes of the bus, as lines of the log and as events: whole texts, each reported once and at
 *  its level. The bus is a script, the test sets the clock. */
#define _GNU_SOURCE

#include <string.h>
#include <time.h>

#include "control_host.h"
#include "core/core_internal.h"
#include "emulated_rig.h"

enum { SUBS = 2, SM_BYTES = 8, IMAGE = 4 * SM_BYTES };

#define MS UINT64_C(1000000)

int clock_gettime(clockid_t clock, struct timespec *now) {
    *now = (struct timespec){.tv_sec = clock == CLOCK_REALTIME ? 1700000000 : 1000};
    return 0;
}

/* -- the bus --------------------------------------------------------------------------------- */

static struct {
    struct fsn_plan *plan;
    struct fsn_core *core;
    struct fsn_control *control;
    uint8_t image[IMAGE];
    uint32_t base[2 * SUBS], begin[1];
    struct fsn_bus_input input;
    struct fsn_wkc wkc;
    struct fsn_bus_subdevice seen[SUBS];
    bool stateless;
    uint64_t now_ns;
    char logged[8192]; /**< level and text of each line */
    char json[8192];
} on;

static fsn_status bus_open(void *bus, const struct fsn_plan *plan, struct fsn_bus_layout *layout,
                           struct fsn_fault *fault) {
    (void)bus;
    (void)plan;
    (void)fault;
    *layout = (struct fsn_bus_layout){.image = on.image,
                                      .image_bytes = IMAGE,
                                      .sm_base = on.base,
                                      .datagram_begin = on.begin,
                                      .datagram_count = 1};
    return FSN_OK;
}

static void bus_receive(void *bus, struct fsn_bus_input *input) {
    (void)bus;
    struct fsn_wkc *wkc = input->wkc;
    uint8_t *stale = input->sm_stale;
    *input = on.input;
    input->wkc = wkc;
    input->sm_stale = stale;
    wkc[0] = on.wkc;
}

static void bus_send(void *bus) {
    (void)bus;
}

static fsn_status bus_state(void *bus, uint32_t subdevice, struct fsn_bus_subdevice *seen) {
    (void)bus;
    if (on.stateless) {
        return FSN_E_STATE;
    }
    *seen = on.seen[subdevice];
    return FSN_OK;
}

static bool bus_poll(void *bus, uint8_t al_state, uint64_t now_ns) {
    (void)bus;
    (void)al_state;
    (void)now_ns;
    return true;
}

static const struct fsn_bus_ops ops = {.name = "script",
                                       .open = bus_open,
                                       .receive = bus_receive,
                                       .send = bus_send,
                                       .poll = bus_poll,
                                       .state = bus_state};

/* -- reports ----------------------------------------------------------------------------------- */

static void add(char *to, size_t room, const char *text, size_t len) {
    const size_t used = strlen(to);
    CHECK(used + len + 2 < room);
    memcpy(to + used, text, len);
    memcpy(to + used + len, "\n", 2);
}

static void keep(void *self, enum fsn_log_level level, enum fsn_role account, const char *text,
                 const char *json, size_t json_bytes) {
    (void)account;
    (void)self;
    char line[700];
    snprintf(line, sizeof line, "%c %s", "diwe"[level], text);
    add(on.logged, sizeof on.logged, line, strlen(line));
    add(on.json, sizeof on.json, json, json_bytes);
}

static struct fsn_control_host host;

static void set_up(void) {
    static const struct build_sm sm[SUBS][2] = {{{1, SM_BYTES}, {2, SM_BYTES}},
                                                {{1, SM_BYTES}, {2, SM_BYTES}}};
    static const struct build_copy copies[] = {{0, 0, 1, 0, 6}, {1, 0, 0, 0, 6}};
    static const struct build_symbol symbols[] = {{.sm = 0, .bit_offset = 48, .bits = 8},
                                                  {.sm = 2, .bit_offset = 48, .bits = 8}};
    const struct build build = {.subdevices = SUBS,
                                .sm = sm,
                                .copies = copies,
                                .pairs = 1,
                                .cycle_ns = 1000000,
                                .symbols = symbols,
                                .symbol_count = 2};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    memset(&on, 0, sizeof on);
    CHECK(fsn_plan_load(bytes, len, &on.plan, NULL) == FSN_OK);
    free(bytes);
    for (uint32_t i = 0; i < 2 * SUBS; i++) {
        on.base[i] = i * SM_BYTES;
    }
    on.wkc = (struct fsn_wkc){6, 6};
    for (uint32_t i = 0; i < SUBS; i++) {
        on.seen[i] = (struct fsn_bus_subdevice){
            .al_status = FSN_AL_OP, .found = FSN_FOUND_RIGHT, .link = {1, 1}};
    }
    host = test_host(NULL);
    host.log = keep;
    CHECK(fsn_core_create(on.plan, &ops, &on, &on.core, NULL) == FSN_OK);
    on.control = fsn_control_create(on.plan, &host, &nobody);
    CHECK(on.control != NULL);
    fsn_control_attach(on.control, on.core);
    on.now_ns = 100000 * MS;
}

static void tear_down(void) {
    fsn_control_free(on.control);
    fsn_core_free(on.core);
    fsn_plan_free(on.plan);
}

/** One cycle, this much later, and one check of it. */
static void look_after(uint64_t later_ns) {
    on.now_ns += later_ns;
    CHECK(fsn_core_cycle(on.core, on.now_ns) == FSN_OK);
    fsn_changes_poll(&on.control->changes, on.control->services.incidents, on.now_ns);
}

static void same_text(const char *logged, const char *expected, int line) {
    if (strcmp(logged, expected) != 0) {
        fprintf(stderr, "%s:%d: logged\n%sexpected\n%s", __FILE__, line, logged, expected);
        exit(1);
    }
    on.logged[0] = 0;
    on.json[0] = 0;
}

#define TOLD(text) same_text(on.logged, text, __LINE__)
#define JSON(text) same_text(on.json, text, __LINE__)

static void begin(void) {
    set_up();
    look_after(MS);
    TOLD("i SubDevice t: none -> OP, links at ports 0 1\n"
         "i SubDevice t: none -> OP, links at ports 0 1\n");
}

/* -- SubDevices ------------------------------------------------------------------------------ */

static void subdevices_are_told_once(void) {
    begin();
    look_after(20 * MS);
    TOLD("");
    on.seen[1].al_status = FSN_AL_SAFEOP | FSN_AL_ERROR;
    on.seen[1].al_code = 0x001B;
    look_after(19 * MS);
    TOLD(""); /* too soon after the last check */
    look_after(MS);
    TOLD("w SubDevice t: OP -> SAFEOP+ERROR, AL status code 0x001b sync manager watchdog: "
         "no outputs came in time\n");
    look_after(20 * MS);
    TOLD("");
    on.seen[1].al_status = FSN_AL_SAFEOP;
    look_after(20 * MS);
    JSON("{\"event\":\"subdevice\",\"utc\":\"2023-11-14T21:58:20.081000Z\",\"now_ns\":100081000000,"
         "\"subdevice\":\"t\",\"before\":\"SAFEOP+ERROR\",\"after\":\"SAFEOP\",\"al_code\":27,"
         "\"found_code\":2,\"found\":\"the SubDevice of the "
         "plan\",\"fsoe_address\":0,\"detail\":\"\","
         "\"returns\":0,"
         "\"link\":[1,1,0,0],\"level\":\"detail\",\"text\":\"SubDevice t: SAFEOP+ERROR -> "
         "SAFEOP\"}\n");
    on.seen[1].al_status = FSN_AL_OP;
    on.seen[1].returns = 1;
    look_after(20 * MS);
    TOLD("i SubDevice t: SAFEOP -> OP\n");
    on.seen[0].link[1] = 0;
    look_after(20 * MS);
    TOLD("d SubDevice t: OP, links at ports 0\n");
    on.seen[0].link[0] = 0;
    look_after(20 * MS);
    TOLD("d SubDevice t: OP, no link at any port\n");
    on.seen[0].link[2] = on.seen[0].link[3] = 1;
    look_after(20 * MS);
    TOLD("d SubDevice t: OP, links at ports 2 3\n");
    on.seen[0].found = FSN_FOUND_IDENTITY;
    snprintf(on.seen[0].detail, FSN_DETAIL_BYTES, "vendor 0x00000003");
    look_after(20 * MS);
    TOLD("w SubDevice t: OP, another device: vendor 0x00000003\n");
    on.seen[0].found = FSN_FOUND_RIGHT;
    look_after(20 * MS);
    TOLD("d SubDevice t: OP: vendor 0x00000003\n"); /* the same detail is not reported again */
    snprintf(on.seen[0].detail, FSN_DETAIL_BYTES, "no answer to an SDO");
    look_after(20 * MS);
    TOLD("w SubDevice t: OP: no answer to an SDO\n");
    on.seen[0].al_code = 5;
    on.seen[0].detail[0] = 0;
    look_after(20 * MS);
    TOLD("d SubDevice t: OP\n");
    on.seen[0].al_status = FSN_AL_NONE;
    look_after(20 * MS);
    TOLD("w SubDevice t: OP -> none\n");
    tear_down();
}

/** A bus may fill the room for a detail: it still ends there. */
static void a_detail_has_an_end(void) {
    char expected[600], detail[FSN_DETAIL_BYTES];
    memset(detail, 'x', sizeof detail);
    detail[FSN_DETAIL_BYTES - 1] = 0;
    begin();
    for (int i = 0; i < 2; i++) {
        on.seen[i].al_status = FSN_AL_NONE;
        memset(on.seen[i].detail, 'x', FSN_DETAIL_BYTES);
    }
    look_after(20 * MS);
    snprintf(expected, sizeof expected,
             "w the bus is lost: none of 2 SubDevices answers: %.150s\n"
             "d SubDevice t: OP -> none: %.150s\n"
             "d SubDevice t: OP -> none: %.150s\n",
             detail, detail, detail);
    TOLD(expected);
    on.seen[0].al_status = FSN_AL_OP;
    look_after(20 * MS);
    snprintf(expected, sizeof expected, "\"detail\":\"%s\",", detail);
    CHECK(strstr(on.json, expected) != NULL);
    CHECK(strcmp(on.control->services.view.subdevice[0].detail, detail) == 0);
    CHECK(strcmp(on.control->services.view.subdevice[1].detail, detail) == 0);
    tear_down();
}

/** A bus that is lost or back as a whole is one line; its SubDevices are details then. */
static void a_bus_is_told_as_a_whole(void) {
    begin();
    for (int i = 0; i < 2; i++) {
        on.seen[i].al_status = FSN_AL_NONE;
        snprintf(on.seen[i].detail, FSN_DETAIL_BYTES, "cable %d", i);
    }
    look_after(20 * MS);
    TOLD("w the bus is lost: none of 2 SubDevices answers: cable 1\n"
         "d SubDevice t: OP -> none: cable 0\n"
         "d SubDevice t: OP -> none: cable 1\n");
    for (int i = 0; i < 2; i++) {
        on.seen[i].al_status = FSN_AL_OP;
        on.seen[i].detail[0] = 0;
    }
    look_after(20 * MS);
    TOLD("i the bus is back: all 2 SubDevices answer\n"
         "d SubDevice t: none -> OP\n"
         "d SubDevice t: none -> OP\n");
    for (int i = 0; i < 2; i++) {
        on.seen[i].al_status = FSN_AL_NONE;
    }
    look_after(20 * MS);
    static const char lost[] =
        "{\"event\":\"bus\",\"utc\":\"2023-11-14T21:58:20.061000Z\",\"now_ns\":100061000000,"
        "\"lost\":true,\"level\":\"warning\",\"text\":\"the bus is lost: none of 2 SubDevices "
        "answers\"}\n";
    on.json[sizeof lost - 1] = 0; /* the SubDevices follow */
    JSON(lost);
    on.seen[0].al_status = FSN_AL_INIT;
    look_after(20 * MS);
    TOLD("d SubDevice t: none -> INIT\n"); /* one of two is not a bus */
    on.seen[1].al_status = FSN_AL_INIT;
    look_after(20 * MS);
    TOLD("d SubDevice t: none -> INIT\n");
    tear_down();
}

/** At the start no state was read yet, and that is not a loss; after a new core neither. */
static void the_start_is_no_loss(void) {
    set_up();
    for (int i = 0; i < 2; i++) {
        on.seen[i] = (struct fsn_bus_subdevice){0};
    }
    look_after(MS);
    TOLD("d SubDevice t: its AL state is not read yet\n"
         "d SubDevice t: its AL state is not read yet\n");
    on.seen[0].found = FSN_FOUND_NOTHING;
    on.seen[1].found = FSN_FOUND_RIGHT;
    look_after(20 * MS);
    TOLD("w SubDevice t: none, does not answer\n"
         "d SubDevice t: its AL state is not read yet\n");
    fsn_control_attach(on.control, NULL);
    fsn_changes_poll(&on.control->changes, on.control->services.incidents, on.now_ns + 100 * MS);
    TOLD("");
    fsn_control_attach(on.control, on.core);
    on.seen[0].al_status = on.seen[1].al_status = FSN_AL_OP;
    look_after(20 * MS);
    TOLD("w SubDevice t: none -> OP, does not answer\n"
         "i SubDevice t: none -> OP\n");
    on.stateless = true;
    on.seen[0].al_status = FSN_AL_NONE;
    look_after(20 * MS);
    TOLD("");
    tear_down();
}

/* -- the working counter --------------------------------------------------------------------- */

static void single_losses_are_told_together(void) {
    begin();
    on.wkc.actual = 3;
    on.input.counts.lost_frames = 1;
    look_after(MS);
    TOLD("w working counter 3 of 6; since the last line 1 incomplete cycle, 1 frame not back in "
         "time\n");
    on.input.counts.old_replies = 1;
    look_after(MS); /* still incomplete, and the last line is young */
    TOLD("");
    on.wkc.actual = 6;
    on.input = (struct fsn_bus_input){.counts.unsent_frames = 2, .send_errno = 105};
    look_after(MS); /* it has turned: at once, but as a detail */
    JSON("{\"event\":\"wkc\",\"utc\":\"2023-11-14T21:58:20.004000Z\",\"now_ns\":100004000000,"
         "\"complete\":true,\"expected\":6,\"actual\":6,\"wkc_errors\":2,\"lost_frames\":2,"
         "\"level\":\"detail\",\"text\":\"working counter 6 of 6; since the last line 1 incomplete "
         "cycle, 1 frame not back in time, 1 reply late: the cycle is short for this bus, 2 frames "
         "not sent: No buffer space available\"}\n");
    on.input = (struct fsn_bus_input){.counts.old_replies = 1, .send_errno = 105};
    look_after(997 * MS);
    TOLD(""); /* one line per second */
    on.input = (struct fsn_bus_input){.send_errno = 105};
    look_after(MS);
    TOLD("w working counter 6 of 6; since the last line 1 incomplete cycle, 1 frame not back in "
         "time, 2 replies late: the cycle is short for this bus, 2 frames not sent: No buffer "
         "space available\n");
    look_after(5000 * MS);
    TOLD(""); /* nothing more was lost */
    on.input.counts.lost_frames = 2;
    look_after(MS);
    TOLD("w working counter 6 of 6; since the last line 0 incomplete cycles, 2 frames not back in "
         "time\n");
    tear_down();
}

/** No answer: reported once, until a SubDevice answers. */
static void a_lost_bus_is_told_once(void) {
    begin();
    on.wkc.actual = 0;
    on.input.counts.lost_frames = 1;
    look_after(MS);
    TOLD("w working counter 0 of 6; since the last line 1 incomplete cycle, 1 frame not back in "
         "time\n");
    look_after(5000 * MS);
    look_after(5000 * MS);
    TOLD("");
    on.wkc.actual = 5;
    look_after(MS);
    TOLD("w working counter 5 of 6; since the last line 3 incomplete cycles, 3 frames not back in "
         "time\n");
    on.wkc.actual = 0;
    look_after(5000 * MS); /* another loss */
    TOLD("w working counter 0 of 6; since the last line 1 incomplete cycle, 1 frame not back in "
         "time\n");
    on.wkc.actual = 6;
    on.input.counts.lost_frames = 0;
    look_after(5000 * MS);
    TOLD("w working counter 6 of 6; since the last line 0 incomplete cycles, 0 frames not back in "
         "time\n");
    fsn_changes_poll(&on.control->changes, on.control->services.incidents,
                     on.now_ns + 50 * MS); /* no new cycle: nothing to check */
    TOLD("");
    tear_down();
}

/* -- connections ----------------------------------------------------------------------------- */

/** Both ends show a command: the frames are in the inputs of main and sub. */
static void show(uint8_t to_sub, uint8_t to_main, uint8_t code) {
    static uint8_t fresh;
    uint8_t *inputs[2] = {on.image + on.base[1], on.image + on.base[3]};
    fresh++;
    for (int i = 0; i < 2; i++) {
        const uint8_t command = i == 0 ? to_sub : to_main;
        const uint8_t data = command == FSN_CMD_RESET ? (i == 1 ? code : 0) : fresh;
        const uint8_t frame[6] = {command, data, fresh, 0, 1, 0};
        memcpy(inputs[i], frame, sizeof frame);
    }
}

static void connections_are_told_at_their_level(void) {
    begin();
    show(FSN_CMD_RESET, FSN_CMD_RESET, 0);
    look_after(MS);
    TOLD("i connection t: silent -> reset, by the main: local reset or acknowledgement\n");
    show(FSN_CMD_SESSION, FSN_CMD_SESSION, 0);
    look_after(MS);
    TOLD("d connection t: reset -> session\n");
    show(FSN_CMD_RESET, FSN_CMD_RESET, 3);
    look_after(4997 * MS);
    TOLD("d connection t: session -> reset, by the sub: wrong connection ID\n");
    show(FSN_CMD_SESSION, FSN_CMD_SESSION, 0);
    look_after(MS);
    show(FSN_CMD_RESET, FSN_CMD_RESET, 3);
    on.logged[0] = 0;
    look_after(MS); /* five seconds after the first line */
    TOLD("w connection t: session -> reset, by the sub: wrong connection ID\n");
    show(FSN_CMD_PROCESS_DATA, FSN_CMD_PROCESS_DATA, 0);
    look_after(MS);
    TOLD("i connection t: reset -> process data\n");
    show(FSN_CMD_PROCESS_DATA, FSN_CMD_FAILSAFE_DATA, 0);
    look_after(MS);
    TOLD("i connection t: process data -> failsafe data\n");
    show(FSN_CMD_RESET, FSN_CMD_RESET, 4);
    look_after(MS);
    JSON("{\"event\":\"connection\",\"utc\":\"2023-11-14T21:58:25.005000Z\","
         "\"now_ns\":105005000000,\"connection\":\"t\",\"before\":\"failsafe data\","
         "\"after\":\"reset\",\"reset_by\":\"sub\",\"reset_code\":4,\"reset_text\":\"wrong "
         "CRC\",\"level\":\"warning\",\"text\":\"connection t: failsafe data -> reset, by the "
         "sub: wrong CRC\"}\n");
    show(FSN_CMD_SESSION, FSN_CMD_SESSION, 0);
    look_after(MS);
    show(FSN_CMD_RESET, FSN_CMD_RESET, 4);
    on.logged[0] = 0;
    look_after(MS); /* so soon after it has left Data */
    TOLD("d connection t: session -> reset, by the sub: wrong CRC\n");
    look_after(1001 * MS); /* both ends are still: nothing new within a second */
    TOLD("d connection t: reset -> silent\n");
    tear_down();
}

/* -- parameters ------------------------------------------------------------------------------ */

/** The monitor has put these together; the plan states connection ID 2002, address 14, 400 ms. */
static void observe(uint32_t known, uint16_t connection_id, uint16_t address,
                    uint16_t watchdog_ms) {
    on.core->rt.monitors[0].status.parameters =
        (struct fsn_parameters){.known = known,
                                .connection_id = connection_id,
                                .address = address,
                                .watchdog_ms = watchdog_ms};
    show(FSN_CMD_RESET, FSN_CMD_RESET, 0); /* leaves them unchanged */
    look_after(MS);
}

static void host_is_strict(void *self, struct fsn_control_status *status) {
    (void)self;
    *status = (struct fsn_control_status){.state = FSN_PROGRAM_RUNNING, .require_observed = true};
}

static void other_parameters_are_told_once(void) {
    begin();
    static const uint8_t stated[] = {0xD2, 0x07, 14, 0, 0x90, 1, 7, 0};
    memcpy(on.plan->bytes + on.plan->offset[FSN_SEC_CONNECTION] + FSN_AT(connection, connection_id),
           stated, sizeof stated);
    on.core->rt.watches[0].planned = (struct fsn_parameters){
        .known = 7, .connection_id = 2002, .address = 14, .watchdog_ms = 400};
    observe(7, 2002, 14, 400);
    TOLD("i connection t: silent -> reset, by the main: local reset or acknowledgement\n");
    observe(0, 1, 1, 1); /* a start-up that is not seen to its end */
    observe(3, 2002, 14, 9);
    TOLD("");
    CHECK(!fsn_control_differed(on.control));
    observe(3, 2099, 14, 0);
    TOLD("w connection t runs with other parameters than the plan: connection ID 2099, 2002 in the "
         "plan\n");
    observe(7, 2099, 15, 4000);
    JSON("{\"event\":\"parameters\",\"utc\":\"2023-11-14T21:58:20.006000Z\",\"now_ns\":"
         "100006000000,\"connection\":\"t\",\"configured\":{\"connection_id\":2002,\"address\":14,"
         "\"watchdog_ms\":400,\"app_bytes\":null,\"app_crc\":null},\"observed\":{\"connection_id\":"
         "2099,\"address\":15,\"watchdog_ms\":4000,\"app_bytes\":null,\"app_crc\":null},"
         "\"differs\":[\"connection_id\",\"address\",\"watchdog_ms\"],\"alarm\":false,\"level\":"
         "\"warning\",\"text\":\"connection t runs with other parameters than the plan: connection "
         "ID 2099, 2002 in the plan; FSoE address 15, 14 in the plan; watchdog 4000 ms, 400 ms in "
         "the plan\"}\n");
    observe(7, 2099, 15, 4000);
    TOLD("");
    observe(7, 2002, 15, 400);
    TOLD("w connection t runs with other parameters than the plan: FSoE address 15, 14 in the "
         "plan\n");
    observe(7, 2002, 14, 400);
    JSON("{\"event\":\"parameters\",\"utc\":\"2023-11-14T21:58:20.009000Z\",\"now_ns\":"
         "100009000000,\"connection\":\"t\",\"configured\":{\"connection_id\":2002,\"address\":14,"
         "\"watchdog_ms\":400,\"app_bytes\":null,\"app_crc\":null},\"observed\":{\"connection_id\":"
         "2002,\"address\":14,\"watchdog_ms\":400,\"app_bytes\":null,\"app_crc\":null},\"differs\":"
         "[],\"alarm\":false,\"level\":\"info\",\"text\":\"connection t: its parameters are those "
         "of the plan again\"}\n");
    CHECK(fsn_control_differed(on.control));
    ((struct fsn_control_host *)on.control->services.view.host)->status = host_is_strict;
    observe(7, 2002, 14, 65535);
    JSON("{\"event\":\"parameters\",\"utc\":\"2023-11-14T21:58:20.010000Z\",\"now_ns\":"
         "100010000000,\"connection\":\"t\",\"configured\":{\"connection_id\":2002,\"address\":14,"
         "\"watchdog_ms\":400,\"app_bytes\":null,\"app_crc\":null},\"observed\":{\"connection_id\":"
         "2002,\"address\":14,\"watchdog_ms\":65535,\"app_bytes\":null,\"app_crc\":null},"
         "\"differs\":[\"watchdog_ms\"],\"alarm\":true,\"level\":\"error\",\"text\":\"connection t "
         "runs with other parameters than the plan: watchdog 65535 ms, 400 ms in the plan\"}\n");
    fsn_control_attach(on.control, NULL);
    CHECK(fsn_control_differed(on.control)); /* of the whole program, not of one start */
    tear_down();
}

int main(void) {
    subdevices_are_told_once();
    a_detail_has_an_end();
    a_bus_is_told_as_a_whole();
    the_start_is_no_loss();
    single_losses_are_told_together();
    a_lost_bus_is_told_once();
    connections_are_told_at_their_level();
    other_parameters_are_told_once();
    return 0;
}
