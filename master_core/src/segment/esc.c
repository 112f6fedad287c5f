/** Registers and datagrams of an emulated SubDevice controller. */
#include "segment/esc.h"

#include <string.h>

enum {
    CMD_APRD = 1,
    CMD_APWR,
    CMD_APRW,
    CMD_FPRD,
    CMD_FPWR,
    CMD_FPRW,
    CMD_BRD,
    CMD_BWR,
    CMD_BRW,
    CMD_LRD,
    CMD_LWR,
    CMD_LRW,
    CMD_ARMW,
    CMD_FRMW,
};

/** Registers that exist, and whether the bus may write them. Other registers cannot be read or
 *  written and do not count: MainDevices interpret a working counter of 0 as missing. */
static const struct {
    uint16_t from, to; /**< first byte, and the first one after it */
    bool writable;
} registers[] = {
    {ESC_PROCESS_DATA, ESC_MEMORY_BYTES, true}, /* fields that every frame uses come first */
    {REG_DC_RECEIVE, REG_DC_END, true},
    {0x0000, 0x000A, false}, /* type, FMMUs, SMs, ports, features */
    {REG_STATION, 0x0012, true},
    {REG_ALIAS, 0x0014, false},
    {REG_DL_CONTROL, 0x0104, true},
    {REG_DL_STATUS, 0x0112, false},
    {REG_AL_CONTROL, 0x0122, true},
    {REG_AL_STATUS, 0x0136, false},
    {0x0140, 0x0142, false}, /* PDI control */
    {0x0200, 0x0202, true},
    {0x0210, 0x0212, false},
    {REG_RX_ERRORS, 0x0314, true},
    {REG_WD_DIVIDER, 0x0402, true},
    {0x0410, 0x0412, true},
    {REG_WD_PROCESS_DATA, 0x0422, true},
    {REG_WD_STATUS, 0x0442, false},
    {REG_WD_COUNT, 0x0444, true},
    {REG_SII_ASSIGN, 0x0510, true},
    {REG_FMMU, REG_FMMU + 16 * ESC_FMMUS, true},
    {REG_SM, REG_SM + 8 * ESC_SMS, true},
};

static bool exists(uint16_t address, uint16_t size_bytes, bool write) {
    /* As in real controllers, an access counts if it includes any existing register. */
    for (size_t i = 0; i < sizeof registers / sizeof registers[0]; i++) {
        const bool overlaps =
            address < registers[i].to && (uint32_t)address + size_bytes > registers[i].from;
        if (overlaps && (!write || registers[i].writable)) {
            return true;
        }
    }
    return false;
}

/** Receive times are also latched without a clock. */
static bool has(const struct esc *esc, uint16_t address, uint16_t size_bytes, bool write) {
    return exists(address, size_bytes, write) &&
           !(esc->clock.absent && address >= REG_DC_TIME && address < REG_DC_END);
}

static bool byte_writable(uint32_t address) {
    for (size_t i = 0; i < sizeof registers / sizeof registers[0]; i++) {
        if (address >= registers[i].from && address < registers[i].to) {
            /* The status of a sync manager and the byte for its device are read only. */
            const bool sm = registers[i].from == REG_SM;
            return registers[i].writable && !(sm && (address % 8 == 5 || address % 8 == 7));
        }
    }
    return false;
}

static bool touches(uint16_t address, uint16_t size_bytes, uint16_t at, uint16_t length) {
    return address < at + length && (uint32_t)address + size_bytes > at;
}

static void read_bytes(const struct esc *esc, uint32_t address, uint8_t *data, uint32_t size,
                       bool or_in) {
    if (!or_in && address + size <= ESC_MEMORY_BYTES) {
        memcpy(data, esc->memory + address, size);
        return;
    }
    for (uint32_t i = 0; i < size; i++) {
        const uint8_t byte = address + i < ESC_MEMORY_BYTES ? esc->memory[address + i] : 0;
        data[i] = or_in ? (uint8_t)(data[i] | byte) : byte;
    }
}

bool esc_read(struct esc *esc, uint16_t address, uint8_t *data, uint16_t size_bytes, bool or_in) {
    if (!has(esc, address, size_bytes, false) || !esc_sm_allows(esc, address, size_bytes, false)) {
        return false;
    }
    if (touches(address, size_bytes, REG_DC_TIME, 8)) {
        esc_clock_show(esc, REG_DC_TIME, esc_system_time(esc));
    }
    esc_sm_before_read(esc, address, size_bytes);
    read_bytes(esc, address, data, size_bytes, or_in);
    esc_sm_after_read(esc, address, size_bytes);
    return true;
}

/** A write to any counter clears the group it belongs to, whatever is written. */
static void clear_counters(struct esc *esc, uint16_t address, uint16_t size_bytes) {
    static const struct {
        uint16_t from, bytes;
    } groups[] = {{REG_RX_ERRORS, 12},
                  {REG_UNIT_ERRORS, 1},
                  {REG_PDI_ERRORS, 1},
                  {REG_LOST_LINK, 4},
                  {REG_WD_COUNT, 2}};
    for (size_t i = 0; i < sizeof groups / sizeof groups[0]; i++) {
        if (touches(address, size_bytes, groups[i].from, groups[i].bytes)) {
            memset(esc->memory + groups[i].from, 0, groups[i].bytes);
        }
    }
}

/** Time after which outputs count as missing, from the divider and the limit in the registers. */
static void load_watchdog(struct esc *esc) {
    const uint64_t divider = fsn_get16(esc->memory + REG_WD_DIVIDER) + 2u;
    esc->watchdog_ns = divider * 40u * fsn_get16(esc->memory + REG_WD_PROCESS_DATA);
}

/** Executes the effects of writing registers. */
static void act(struct esc *esc, uint16_t address, uint16_t size_bytes) {
    clear_counters(esc, address, size_bytes);
    if (touches(address, size_bytes, REG_FMMU, 16 * ESC_FMMUS)) {
        esc_fmmu_load(esc);
    }
    if (touches(address, size_bytes, REG_SM, 8 * ESC_SMS)) {
        esc_sm_load(esc);
    }
    if (touches(address, size_bytes, REG_WD_DIVIDER, REG_WD_STATUS - REG_WD_DIVIDER)) {
        load_watchdog(esc);
    }
    if (touches(address, size_bytes, REG_AL_CONTROL, 1)) {
        esc_al_control(esc);
    }
    if (touches(address, size_bytes, REG_SII_CONTROL + 1, 1)) {
        esc_sii_command(esc);
    }
    if (touches(address, size_bytes, REG_DC_TIME, REG_DC_END - REG_DC_TIME)) {
        esc_clock_limit(esc);
    }
    if (touches(address, size_bytes, REG_DC_LOOP, 2)) {
        esc_clock_reset(esc, false);
    }
    if (touches(address, size_bytes, REG_DC_ACTIVATION, 1)) {
        esc_clock_activate(esc);
    }
}

static void write_registers(struct esc *esc, uint16_t address, const uint8_t *data,
                            uint16_t size_bytes) {
    for (uint32_t i = 0; i < size_bytes; i++) {
        const uint32_t at = address + i;
        if (byte_writable(at)) {
            esc->memory[at] = data[i];
        }
    }
    act(esc, address, size_bytes);
}

bool esc_write(struct esc *esc, uint16_t address, const uint8_t *data, uint16_t size_bytes) {
    if (!has(esc, address, size_bytes, true) || !esc_sm_allows(esc, address, size_bytes, true)) {
        return false;
    }
    if (touches(address, size_bytes, REG_DC_RECEIVE, 4)) {
        return true; /* latched by the segment */
    }
    if (address == REG_DC_TIME) {
        esc_clock_compare(esc, data, size_bytes);
        return true;
    }
    if (address >= ESC_PROCESS_DATA) {
        const uint32_t room = (uint32_t)ESC_MEMORY_BYTES - address;
        memcpy(esc->memory + address, data, size_bytes < room ? size_bytes : room);
    } else {
        write_registers(esc, address, data, size_bytes);
    }
    esc_sm_after_write(esc, address, size_bytes);
    return true;
}

/** A command that reads, writes or both at a physical address. */
static void physical(struct esc *esc, struct datagram *d, bool read, bool write, bool or_in) {
    uint8_t written[1500];
    if (read && write) {
        memcpy(written, d->data, d->size_bytes); /* the incoming bytes are written */
    }
    if (read && esc_read(esc, d->offset, d->data, d->size_bytes, or_in)) {
        d->counter++;
    }
    if (write && esc_write(esc, d->offset, read ? written : d->data, d->size_bytes)) {
        d->counter = (uint16_t)(d->counter + (read ? 2 : 1));
    }
}

static bool is_addressed(const struct esc *esc, uint16_t station) {
    const bool alias_enabled = (esc->memory[REG_DL_CONTROL + 3] & 1) != 0;
    return station == fsn_get16(esc->memory + REG_STATION) ||
           (alias_enabled && station == fsn_get16(esc->memory + REG_ALIAS));
}

/** Read by one, written by all others: distributes the time of the reference clock. */
static void read_multiple_write(struct esc *esc, struct datagram *d, bool addressed) {
    if (addressed && d->offset == REG_DC_TIME) {
        esc_clock_served(esc);
    }
    if (addressed ? esc_read(esc, d->offset, d->data, d->size_bytes, false)
                  : esc_write(esc, d->offset, d->data, d->size_bytes)) {
        d->counter++;
    }
}

/** How a command addresses its SubDevices: by counted position, by station, or all. */
enum addressing { BY_NOTHING, BY_POSITION, BY_STATION, BY_ALL };

static const struct {
    enum addressing by;
    bool reads, writes;
} commands[UINT8_MAX + 1] = {
    [CMD_APRD] = {BY_POSITION, true, false}, [CMD_APWR] = {BY_POSITION, false, true},
    [CMD_APRW] = {BY_POSITION, true, true},  [CMD_FPRD] = {BY_STATION, true, false},
    [CMD_FPWR] = {BY_STATION, false, true},  [CMD_FPRW] = {BY_STATION, true, true},
    [CMD_BRD] = {BY_ALL, true, false},       [CMD_BWR] = {BY_ALL, false, true},
    [CMD_BRW] = {BY_ALL, true, true},        [CMD_ARMW] = {BY_POSITION, true, false},
    [CMD_FRMW] = {BY_STATION, true, false},
};

static bool is_meant(const struct esc *esc, const struct datagram *d, enum addressing by) {
    switch (by) {
    case BY_POSITION:
        return d->position == 0;
    case BY_STATION:
        return is_addressed(esc, d->position);
    case BY_ALL:
        return true;
    default:
        return false;
    }
}

void esc_pass(struct esc *esc, struct datagram *d) {
    const uint8_t c = d->command;
    if (c >= CMD_LRD && c <= CMD_LRW) {
        esc_fmmu_pass(esc, d);
        return;
    }
    const enum addressing by = commands[c].by;
    if (c == CMD_ARMW || c == CMD_FRMW) {
        read_multiple_write(esc, d, is_meant(esc, d, by));
    } else if (is_meant(esc, d, by)) {
        physical(esc, d, commands[c].reads, commands[c].writes, by == BY_ALL);
    }
    if (by == BY_POSITION || by == BY_ALL) {
        d->position++;
    }
}

void esc_latch_times(struct esc *esc, uint64_t arrival_ns, uint64_t return_ns) {
    const uint64_t arrival = esc_local_time(esc, arrival_ns);
    const uint64_t back = esc_local_time(esc, return_ns);
    fsn_put32(esc->memory + REG_DC_RECEIVE, (uint32_t)arrival);
    fsn_put32(esc->memory + REG_DC_RECEIVE + 4, (uint32_t)back);
    esc_clock_show(esc, REG_DC_EPU_TIME, arrival);
}

void esc_idle(struct esc *esc, uint64_t now_ns) {
    esc->now_ns = now_ns;
    if (esc->al_pending && now_ns >= esc->al_due_ns) {
        esc_al_decide(esc);
    }
    if (esc->answer_bytes > 0) {
        esc_mailbox_out(esc);
    }
    if (esc->watchdog_ns > 0 && esc->outputs_seen && now_ns > esc->outputs_ns &&
        now_ns - esc->outputs_ns > esc->watchdog_ns && esc_state(esc) == AL_OP) {
        esc->memory[REG_WD_STATUS] = 0;
        esc_count(esc->memory + REG_WD_COUNT, 1);
        esc_al_error(esc, AL_SAFEOP, AL_CODE_WATCHDOG);
    }
    const uint16_t unclocked = esc_state(esc) == AL_OP ? esc_clock_fault(esc) : 0;
    if (unclocked != 0) {
        esc_al_error(esc, AL_SAFEOP, unclocked);
    }
}

uint8_t esc_state(const struct esc *esc) {
    return esc->memory[REG_AL_STATUS] & 0x0F;
}

/** Writes it to EEPROM and object dictionary, where MainDevices compare it. */
static void show_identity(struct esc *esc, const struct esc_identity *identity) {
    for (uint8_t i = 0; i < 3; i++) {
        fsn_put32(esc->sii + 16 + 4 * (size_t)i, identity->numbers[i]);
        const struct object *object = objects_find(&esc->objects, 0x1018, (uint8_t)(i + 1));
        if (object != NULL) {
            fsn_put32(objects_value(&esc->objects, object), identity->numbers[i]);
        }
    }
}

void esc_power_on(struct esc *esc) {
    memset(esc->memory, 0, sizeof esc->memory);
    uint8_t *m = esc->memory;
    m[REG_TYPE] = 0x11; /* an ET1100, as reported by devices */
    m[0x0002] = 2;
    m[0x0004] = ESC_FMMUS;
    m[0x0005] = ESC_SMS;
    m[0x0006] = 8;    /* KiB of memory */
    m[0x0007] = 0x0F; /* ports 0 and 1 are MII */
    m[REG_AL_STATUS] = AL_INIT;
    m[REG_WD_STATUS] = 1;
    fsn_put16(m + REG_WD_DIVIDER, 0x09C2); /* 100 us */
    fsn_put16(m + 0x0410, 1000);
    fsn_put16(m + REG_WD_PROCESS_DATA, 1000); /* 100 ms */
    memcpy(m + REG_ALIAS, esc->sii + 8, 2);
    m[REG_SII_CONTROL] = 0x40; /* reads give 8 bytes */
    m[0x0140] = 5;             /* SPI */
    for (unsigned i = 0; i < ESC_SMS; i++) {
        esc->buffers[i].fresh = false;
        if (esc->buffers[i].size_bytes > 0) {
            memset(esc->buffers[i].device, 0, esc->buffers[i].size_bytes);
        }
    }
    esc->answer_bytes = 0;
    esc->transfer = (struct transfer){0};
    esc->mailbox_counter = 0;
    esc->outputs_seen = false;
    esc->al_pending = false;
    esc->answer_due_ns = 0;
    load_watchdog(esc);
    esc_sm_load(esc);
    esc_clock_reset(esc, true);
    objects_reset(&esc->objects);
    show_identity(esc, esc->faults.is_other ? &esc->faults.other : &esc->identity);
}
