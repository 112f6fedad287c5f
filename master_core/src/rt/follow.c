/** The passive monitor of one connection, equivalent to fsoe_net/self_test/monitor.py line by line;
 *  a test compares them. */
#include "fsn/monitor.h"

#include <string.h>

#include "rt/bytes.h"

enum { NOBODY = 2 };

static uint16_t advance(uint16_t sequence) {
    return sequence == 0xFFFF ? 1 : (uint16_t)(sequence + 1);
}

/** The end that lags decides: a connection is in Data if both ends are. */
static enum fsn_observed observed_state(uint8_t to_sub, uint8_t to_main) {
    if (to_sub == 0 || to_main == 0) {
        return FSN_OBSERVED_SILENT;
    }
    static const uint8_t order[] = {FSN_CMD_RESET, FSN_CMD_SESSION, FSN_CMD_CONNECTION,
                                    FSN_CMD_PARAMETER};
    static const enum fsn_observed state[] = {FSN_OBSERVED_RESET, FSN_OBSERVED_SESSION,
                                              FSN_OBSERVED_CONNECTION, FSN_OBSERVED_PARAMETER};
    /* The lower of both states counts: a connection is as far as its slower end. */
    for (unsigned i = 0; i < sizeof order; i++) {
        if (to_sub == order[i] || to_main == order[i]) {
            return state[i];
        }
    }
    if (to_sub == FSN_CMD_PROCESS_DATA && to_main == FSN_CMD_PROCESS_DATA) {
        return FSN_OBSERVED_DATA_PROCESS;
    }
    const bool data = (to_sub == FSN_CMD_PROCESS_DATA || to_sub == FSN_CMD_FAILSAFE_DATA) &&
                      (to_main == FSN_CMD_PROCESS_DATA || to_main == FSN_CMD_FAILSAFE_DATA);
    return data ? FSN_OBSERVED_DATA_FAILSAFE : FSN_OBSERVED_UNKNOWN;
}

static void count_interval(struct fsn_direction *d, uint64_t interval_ns) {
    d->interval_last_ns = interval_ns;
    d->interval_sum_ns += interval_ns;
    if (d->intervals == 0 || interval_ns < d->interval_min_ns) {
        d->interval_min_ns = interval_ns;
    }
    if (interval_ns > d->interval_max_ns) {
        d->interval_max_ns = interval_ns;
    }
    d->intervals++;
}

/** Counts a new frame in its direction. */
static void count_frame(struct fsn_direction *d, const uint8_t *frame, uint32_t size_bytes,
                        uint64_t now_ns) {
    const bool was_data = d->command == FSN_CMD_PROCESS_DATA || d->command == FSN_CMD_FAILSAFE_DATA;
    const bool is_data = frame[0] == FSN_CMD_PROCESS_DATA || frame[0] == FSN_CMD_FAILSAFE_DATA;
    if (was_data && is_data) {
        count_interval(d, now_ns - d->last_new_ns);
    }
    d->frames++;
    d->last_new_ns = now_ns;
    d->connection_id = fsn_fsoe_connection_id(frame, size_bytes);
    d->process_data += frame[0] == FSN_CMD_PROCESS_DATA;
    d->failsafe_data += frame[0] == FSN_CMD_FAILSAFE_DATA;
    if (frame[0] == FSN_CMD_RESET) {
        /* One Reset may be several consecutive frames; only the first one counts. A direction that
         * begins with a Reset has just started: no connection has dropped. */
        d->resets += d->frames > 1 && d->command != FSN_CMD_RESET;
        d->reset_code = frame[1];
    }
    d->command = frame[0];
}

/** §3: at every Reset, correct or not, and when the main starts a session. */
static void clear_chain(struct fsn_monitor *m) {
    for (unsigned way = 0; way < 2; way++) {
        m->followed[way].has_own = false;
        m->followed[way].sequence = 1;
        m->followed[way].guess = 0; /* mutants: the number is known */
    }
    m->last_crc = 0;
    m->last_way = NOBODY;
    m->lost = false;
}

static void remember(struct fsn_monitor *m, unsigned way, uint16_t crc) {
    struct fsn_followed *f = &m->followed[way];
    f->own = crc;
    f->has_own = true;
    m->last_crc = crc;
    m->last_way = (uint8_t)way;
}

/** Checks all CRCs with the known number (§3) and continues the chain. */
static bool fits(struct fsn_monitor *m, unsigned way, const uint8_t *frame) {
    struct fsn_followed *f = &m->followed[way];
    uint16_t sequence = f->sequence;
    const uint16_t crc = fsn_fsoe_expected_crc0(frame, f->size_bytes, m->last_crc, sequence);
    if (f->has_own && crc == f->own) { /* collision rule */
        sequence = advance(sequence);
    }
    if (!fsn_fsoe_check(frame, f->size_bytes, m->last_crc, sequence)) {
        return false;
    }
    remember(m, way, fsn_fsoe_crc0(frame, f->size_bytes));
    f->sequence = advance(sequence);
    return true;
}

/** Discards the numbers; the search begins with the next frame of the other direction. */
static void lose(struct fsn_monitor *m, unsigned way, const uint8_t *frame) {
    m->lost |= m->followed[0].sequence != 0 || m->followed[1].sequence != 0;
    for (unsigned i = 0; i < 2; i++) {
        /* mutants: with the number found again there is an own CRC again */
        m->followed[i].has_own = false;
        m->followed[i].sequence = 0;
        m->followed[i].guess = 0;
    }
    remember(m, way, fsn_fsoe_crc0(frame, m->followed[way].size_bytes));
}

/** The main's first Session frame restarts the chain at any time (§6 row 9). A frame that does not
 *  match leaves a known chain unchanged: a main also ignores the reply to an abandoned session (§5
 *  row 11). */
static enum fsn_verdict take_session(struct fsn_monitor *m, unsigned way, const uint8_t *frame) {
    struct fsn_followed *f = &m->followed[way];
    if (f->sequence != 0 && fits(m, way, frame)) {
        return FSN_VERDICT_RIGHT;
    }
    if (way == FSN_TO_SUB && fsn_fsoe_check(frame, f->size_bytes, 0, 1)) {
        clear_chain(m);
        remember(m, way, fsn_fsoe_crc0(frame, f->size_bytes));
        f->sequence = 2;
        return FSN_VERDICT_RIGHT;
    }
    if (f->sequence != 0) {
        return FSN_VERDICT_WRONG;
    }
    m->last_crc = fsn_fsoe_crc0(frame, f->size_bytes);
    m->last_way = (uint8_t)way;
    return FSN_VERDICT_UNCHECKED;
}

static bool continues(const struct fsn_monitor *m, const struct fsn_followed *f,
                      const uint8_t *frame, uint16_t sequence) {
    if (sequence == f->guess || f->guess == 0) {
        return f->guess != 0;
    }
    const uint16_t crc = fsn_fsoe_expected_crc0(frame, f->size_bytes, m->last_crc, f->guess);
    return crc == f->own && sequence == advance(f->guess);
}

/** Calculates the number; a consecutive second one confirms it. */
static enum fsn_verdict search(struct fsn_monitor *m, unsigned way, const uint8_t *frame) {
    struct fsn_followed *f = &m->followed[way];
    const uint16_t sequence =
        m->last_way == NOBODY ? 0 : fsn_fsoe_solve_sequence(frame, f->size_bytes, m->last_crc);
    const bool whole = sequence == 0 || fsn_fsoe_check(frame, f->size_bytes, m->last_crc, sequence);
    const bool found = whole && sequence != 0 && continues(m, f, frame, sequence);
    remember(m, way, fsn_fsoe_crc0(frame, f->size_bytes));
    f->guess = whole && sequence != 0 ? advance(sequence) : 0;
    if (!whole) {
        return FSN_VERDICT_WRONG; /* the blocks do not match each other, whatever the chain is */
    }
    if (!found) {
        return FSN_VERDICT_UNCHECKED;
    }
    f->sequence = f->guess;
    f->guess = 0; /* mutants: it is not read while the number is known */
    m->status.gaps += m->lost;
    m->lost = false;
    return FSN_VERDICT_RIGHT;
}

static enum fsn_verdict judge(struct fsn_monitor *m, unsigned way, const uint8_t *frame) {
    const uint32_t size_bytes = m->followed[way].size_bytes;
    if (frame[0] == FSN_CMD_RESET) {
        clear_chain(m);
        const bool right = fsn_fsoe_connection_id(frame, size_bytes) == 0 &&
                           fsn_fsoe_check(frame, size_bytes, 0, 1);
        return right ? FSN_VERDICT_RIGHT : FSN_VERDICT_WRONG;
    }
    if (frame[0] == FSN_CMD_SESSION) {
        return take_session(m, way, frame);
    }
    if (m->last_way == way) { /* the answer was not observed */
        lose(m, way, frame);
        return FSN_VERDICT_UNCHECKED;
    }
    if (m->followed[way].sequence == 0) {
        return search(m, way, frame);
    }
    if (fits(m, way, frame)) {
        return FSN_VERDICT_RIGHT;
    }
    lose(m, way, frame);
    return FSN_VERDICT_WRONG;
}

/** Safe data of a frame, bytes (§1). */
static uint32_t safe_bytes(uint32_t size_bytes) {
    return size_bytes == FSN_MIN_FRAME_BYTES ? 1 : (size_bytes - 3) / 2;
}

/** Takes one byte of a list; bytes after its end are padding. */
static void take_byte(struct fsn_sent_list *list, uint8_t byte) {
    const uint32_t at = list->count++;
    if (at < sizeof list->head) {
        list->head[at] = byte;
    } else if (at - sizeof list->head < fsn_get16(list->head + 4)) {
        list->crc = fsn_crc32_step(list->crc, byte);
    }
}

static bool is_whole(const struct fsn_sent_list *list) {
    if (list->command == FSN_CMD_CONNECTION) {
        return list->count >= 4;
    }
    return list->count >= sizeof list->head &&
           list->count - sizeof list->head >= fsn_get16(list->head + 4);
}

/** Stores a complete list: ConnID and address, or 2, watchdog, length, application data (§4). */
static void show_list(const struct fsn_sent_list *list, struct fsn_parameters *parameters) {
    if (!is_whole(list)) {
        return;
    }
    if (list->command == FSN_CMD_CONNECTION) {
        parameters->connection_id = fsn_get16(list->head);
        parameters->address = fsn_get16(list->head + 2);
        parameters->known = FSN_STATED_CONNECTION_ID | FSN_STATED_ADDRESS;
    } else if (fsn_get16(list->head) == 2) {
        parameters->watchdog_ms = fsn_get16(list->head + 2);
        parameters->app_bytes = fsn_get16(list->head + 4);
        parameters->app_crc = ~list->crc;
        parameters->known |= FSN_STATED_WATCHDOG | FSN_STATED_APP;
    }
}

/** Whether the next frame of the start-up belongs to the same list or begins the next one. */
static bool is_next(const struct fsn_sent_list *list, uint8_t command) {
    if (list->command == command) {
        return true;
    }
    return command == FSN_CMD_CONNECTION ? list->command == FSN_CMD_SESSION
                                         : list->command == FSN_CMD_CONNECTION && is_whole(list);
}

static void take_chunk(struct fsn_monitor *m, const uint8_t *frame) {
    const uint32_t there = safe_bytes(m->followed[FSN_TO_SUB].size_bytes);
    const uint32_t back = safe_bytes(m->followed[FSN_TO_MAIN].size_bytes);
    for (uint32_t i = 0; i < there && i < back; i++) {
        take_byte(&m->sent, frame[1 + i / 2 * 4 + i % 2]);
    }
    show_list(&m->sent, &m->status.parameters);
}

/** Collects the parameters that the main sends in Connection and Parameter. */
static void follow_parameters(struct fsn_monitor *m, const uint8_t *frame, bool right) {
    struct fsn_sent_list *list = &m->sent;
    struct fsn_parameters *parameters = &m->status.parameters;
    const uint8_t command = frame[0];
    if (command == FSN_CMD_RESET) {
        list->command = 0;
        return;
    }
    if (command == FSN_CMD_SESSION) {
        memset(parameters, 0, sizeof *parameters);
        list->command = right ? command : 0;
        return;
    }
    if (command == FSN_CMD_CONNECTION || command == FSN_CMD_PARAMETER) {
        if (right && is_next(list, command)) {
            if (list->command != command) {
                *list = (struct fsn_sent_list){.command = command, .crc = UINT32_MAX};
            }
            take_chunk(m, frame);
            return;
        }
    } else if (list->command == FSN_CMD_PARAMETER || list->command == FSN_CMD_PROCESS_DATA) {
        list->command = FSN_CMD_PROCESS_DATA; /* Data, whichever frame follows */
        return;
    }
    list->command = 0;
    memset(parameters, 0, sizeof *parameters);
}

fsn_status fsn_monitor_init(struct fsn_monitor *monitor, uint32_t to_sub_bytes,
                            uint32_t to_main_bytes) {
    if (monitor == NULL || !fsn_fsoe_is_frame_length(to_sub_bytes) ||
        !fsn_fsoe_is_frame_length(to_main_bytes)) {
        return FSN_E_ARG;
    }
    memset(monitor, 0, sizeof *monitor);
    monitor->followed[FSN_TO_SUB].size_bytes = to_sub_bytes;
    monitor->followed[FSN_TO_MAIN].size_bytes = to_main_bytes;
    monitor->last_way = NOBODY;
    return FSN_OK;
}

enum fsn_verdict fsn_monitor_frame(struct fsn_monitor *monitor, enum fsn_way way,
                                   const uint8_t *frame, uint64_t now_ns) {
    struct fsn_followed *f = &monitor->followed[way];
    if (memcmp(frame, f->last, f->size_bytes) == 0) {
        return FSN_VERDICT_SAME;
    }
    memcpy(f->last, frame, f->size_bytes);
    struct fsn_direction *d = &monitor->status.direction[way];
    count_frame(d, frame, f->size_bytes, now_ns);
    const enum fsn_verdict verdict = judge(monitor, way, frame);
    d->right += verdict == FSN_VERDICT_RIGHT;
    d->wrong += verdict == FSN_VERDICT_WRONG;
    d->unchecked += verdict == FSN_VERDICT_UNCHECKED;
    if (way == FSN_TO_SUB) {
        follow_parameters(monitor, frame, verdict == FSN_VERDICT_RIGHT);
    }
    monitor->status.observed = observed_state(monitor->status.direction[FSN_TO_SUB].command,
                                              monitor->status.direction[FSN_TO_MAIN].command);
    return verdict;
}

/** Verdict of the monitor on a frame. */
static enum fsn_verdict try_frame(const struct fsn_monitor *monitor, enum fsn_way way,
                                  const uint8_t *frame) {
    struct fsn_monitor trial = *monitor;
    return fsn_monitor_frame(&trial, way, frame, 0);
}

bool fsn_monitor_sub_first(const struct fsn_monitor *monitor, const uint8_t *to_sub,
                           const uint8_t *to_main) {
    const struct fsn_followed *f = monitor->followed;
    if (memcmp(to_sub, f[FSN_TO_SUB].last, f[FSN_TO_SUB].size_bytes) == 0 ||
        memcmp(to_main, f[FSN_TO_MAIN].last, f[FSN_TO_MAIN].size_bytes) == 0) {
        return false;
    }
    if (to_main[0] == FSN_CMD_RESET) {
        /* Correct at any time: most likely the acknowledgement of a Reset of the main, which starts
         * a session only after that. */
        const uint8_t before = monitor->status.direction[FSN_TO_SUB].command;
        return to_sub[0] == FSN_CMD_SESSION && (before == FSN_CMD_RESET || before == 0);
    }
    /* A restart is valid at any time, so it does not show the order; other frames of the main
     * do. */
    const bool restart = to_sub[0] == FSN_CMD_RESET || to_sub[0] == FSN_CMD_SESSION;
    return (restart || try_frame(monitor, FSN_TO_SUB, to_sub) != FSN_VERDICT_RIGHT) &&
           try_frame(monitor, FSN_TO_MAIN, to_main) == FSN_VERDICT_RIGHT;
}
