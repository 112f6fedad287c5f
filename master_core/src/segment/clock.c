/** The distributed clock of an emulated controller: local time, system time, SYNC0. */
#include "segment/esc.h"

enum {
    BILLION = 1000000000,
    LOOP_NS = 1000000, /**< the control loop corrects at most the amount for this time */
    MOST_PPB = 500000, /**< fastest correction of the rate */
    FILTER = 16,       /**< readings in the mean difference */
    FEATURES = 0x0008,
    FEATURE_CLOCK = 0x04, /**< a distributed clock */
    FEATURE_WIDE = 0x08,  /**< of 64 bits */
    SYNC_ACTIVE = 0x03,   /**< of REG_DC_ACTIVATION: cyclic operation, SYNC0 */
    LATE_OF_64 = 48, /**< an error if this many of the last 64 output frames are near a pulse */
};

/** Without the reference time for this duration, a device with SYNC0 reports an error. */
static const uint64_t served_most_ns = BILLION;

static int64_t bounded(int64_t value, int64_t most) {
    const int64_t raised = value > -most ? value : -most;
    return raised < most ? raised : most;
}

/** Drift for a rate and a time; both may be large. */
static int64_t drifted(uint64_t time_ns, int64_t ppb) {
    return (int64_t)(time_ns / BILLION) * ppb + (int64_t)(time_ns % BILLION) * ppb / BILLION;
}

/** Time since then; 0 if a frame on its way is newer. */
static uint64_t since(const struct esc *esc, uint64_t at_ns) {
    return esc->now_ns > at_ns ? esc->now_ns - at_ns : 0;
}

uint64_t esc_local_time(const struct esc *esc, uint64_t at_ns) {
    return at_ns + esc->clock.offset_ns + (uint64_t)drifted(at_ns, esc->clock.drift_ppb);
}

/** Correction of the local clock by its control loop. */
static int64_t correction(const struct esc *esc) {
    const struct esc_clock *c = &esc->clock;
    return c->phase_ns + drifted(since(esc, c->compared_ns), c->rate_ppb);
}

static uint64_t corrected_time(const struct esc *esc, int64_t correction_ns) {
    return esc_local_time(esc, esc->now_ns) + fsn_get64(esc->memory + REG_DC_OFFSET) +
           (uint64_t)correction_ns;
}

uint64_t esc_system_time(const struct esc *esc) {
    return corrected_time(esc, correction(esc));
}

void esc_clock_show(struct esc *esc, uint16_t address, uint64_t time_ns) {
    fsn_put64(esc->memory + address, esc->clock.narrow ? (uint32_t)time_ns : time_ns);
}

void esc_clock_limit(struct esc *esc) {
    static const uint16_t times[] = {REG_DC_TIME, REG_DC_EPU_TIME, REG_DC_OFFSET, REG_SYNC0_START};
    const struct esc_clock *c = &esc->clock;
    esc->memory[FEATURES] = 0;
    if (!c->absent) {
        esc->memory[FEATURES] = c->narrow ? FEATURE_CLOCK : FEATURE_CLOCK | FEATURE_WIDE;
    }
    for (size_t i = 0; i < sizeof times / sizeof times[0]; i++) {
        esc_clock_show(esc, times[i], fsn_get64(esc->memory + times[i]));
    }
}

static void show_difference(struct esc *esc) {
    const int64_t mean = esc->clock.difference_ns;
    const uint32_t size = (uint32_t)bounded(mean < 0 ? -mean : mean, INT32_MAX);
    fsn_put32(esc->memory + REG_DC_DIFFERENCE, size | (mean < 0 ? 0x80000000u : 0));
}

void esc_clock_reset(struct esc *esc, bool power_on) {
    struct esc_clock *c = &esc->clock;
    c->difference_ns = 0;
    c->served = false;
    if (power_on) {
        esc_clock_limit(esc);
        fsn_put16(esc->memory + REG_DC_LOOP, 0x1000);
        c->phase_ns = c->rate_ppb = 0;
        c->compared_ns = esc->now_ns;
        c->near = 0;
        c->fires = false;
        c->pulse_ns = UINT64_MAX;
    }
    show_difference(esc);
}

void esc_clock_served(struct esc *esc) {
    esc->clock.served = true;
    esc->clock.served_ns = esc->now_ns;
}

void esc_clock_compare(struct esc *esc, const uint8_t *time, uint16_t size_bytes) {
    struct esc_clock *c = &esc->clock;
    if (size_bytes < 4) {
        return;
    }
    const uint32_t theirs = fsn_get32(time) + fsn_get32(esc->memory + REG_DC_DELAY);
    const int64_t before_ns = correction(esc);
    const int64_t apart = (int32_t)((uint32_t)corrected_time(esc, before_ns) - theirs);
    const uint64_t passed_ns = since(esc, c->compared_ns);
    int64_t loop_ns = 0;
    if (!c->deaf) {
        loop_ns = passed_ns < LOOP_NS ? (int64_t)passed_ns : LOOP_NS;
    }
    c->compared_ns = esc->now_ns;
    esc_clock_served(esc);
    const int64_t step = bounded(apart / 8, loop_ns / 10);
    c->phase_ns = before_ns - step;
    if (step == apart / 8 && loop_ns > 0) {
        const int64_t more = bounded(apart * (BILLION / 256) / (int64_t)passed_ns, 2000);
        c->rate_ppb = bounded(c->rate_ppb - more, MOST_PPB);
    }
    c->difference_ns += (apart - c->difference_ns) / FILTER;
    show_difference(esc);
}

/** Whether SYNC0 is switched on. */
static bool has_sync(const struct esc *esc) {
    return (esc->memory[REG_DC_ACTIVATION] & SYNC_ACTIVE) == SYNC_ACTIVE &&
           fsn_get32(esc->memory + REG_SYNC0_CYCLE) != 0;
}

/** A pulse whose time has already passed comes after the time has wrapped once: with 32 bits within
 *  4.29 s, with 64 bits never. */
void esc_clock_activate(struct esc *esc) {
    struct esc_clock *c = &esc->clock;
    const uint64_t now = esc_system_time(esc);
    const uint64_t ahead = fsn_get64(esc->memory + REG_SYNC0_START) - now;
    const uint64_t wait = c->narrow ? (uint32_t)ahead : ahead;
    const bool passed = wait == 0 || wait > (c->narrow ? INT32_MAX : INT64_MAX);
    c->fires = !passed;
    c->pulse_ns = passed && !c->narrow ? UINT64_MAX : now + wait;
    c->near = 0;
}

uint64_t esc_clock_until_pulse(const struct esc *esc) {
    const uint64_t now = esc_system_time(esc);
    const uint64_t first = esc->clock.pulse_ns;
    const uint32_t cycle = fsn_get32(esc->memory + REG_SYNC0_CYCLE);
    if (!has_sync(esc) || first == UINT64_MAX) {
        return UINT64_MAX;
    }
    return now < first ? first - now : cycle - (now - first) % cycle;
}

uint16_t esc_clock_fault(const struct esc *esc) {
    const struct esc_clock *c = &esc->clock;
    if (!has_sync(esc)) {
        return 0;
    }
    const int64_t most_ns = fsn_get32(esc->memory + REG_SYNC0_CYCLE) / 4;
    if (!c->served || since(esc, c->served_ns) > served_most_ns || c->difference_ns > most_ns ||
        c->difference_ns < -most_ns) {
        return AL_CODE_SYNC_FATAL;
    }
    return c->fires || esc_system_time(esc) >= c->pulse_ns ? 0 : AL_CODE_NO_SYNC;
}

void esc_clock_outputs(struct esc *esc) {
    struct esc_clock *c = &esc->clock;
    if (!has_sync(esc) || esc_state(esc) != AL_OP) {
        c->near = 0;
        return;
    }
    const uint64_t now = esc_system_time(esc);
    const uint32_t cycle = fsn_get32(esc->memory + REG_SYNC0_CYCLE);
    const uint32_t behind =
        now >= c->pulse_ns ? (uint32_t)((now - c->pulse_ns) % cycle) : cycle / 2;
    c->near = c->near << 1 | (behind < cycle / 8 || behind > cycle - cycle / 8);
    unsigned late = 0;
    for (uint64_t bits = c->near; bits != 0; bits &= bits - 1) {
        late++;
    }
    if (late >= LATE_OF_64) {
        c->near = 0;
        esc_al_error(esc, AL_SAFEOP, AL_CODE_SYNC);
    }
}
