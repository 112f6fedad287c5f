/** Parses captured Ethernet frames down to process data. Every length comes from the capture, so
 *  none is trusted. */
#include "scan/scan.h"

#include <stdlib.h>
#include <string.h>

enum {
    ETHERTYPE_ETHERCAT = 0x88A4,
    ETHERTYPE_VLAN = 0x8100,
    ETHERTYPE_QINQ = 0x88A8,
    ETHERTYPE_IPV4 = 0x0800,
    UDP_PORT = 0x88A4,
    MAC_BYTES = 12,
    DATAGRAM_HEAD_BYTES = 10,
    WKC_BYTES = 2,
    PROCESS_DATA_START = 0x1000, /**< lower: registers of the SubDevice controller */
};

enum { CMD_APRD = 1, CMD_FPRW = 6, CMD_BRD = 7, CMD_LRD = 10, CMD_LRW = 12 };

static unsigned big16(const uint8_t *at) {
    return (unsigned)at[0] << 8 | at[1];
}

static unsigned little16(const uint8_t *at) {
    return (unsigned)at[1] << 8 | at[0];
}

/** Returns the start of the EtherCAT header, 0 if this is not EtherCAT. */
static size_t ethercat_start(const uint8_t *bytes, size_t len) {
    size_t at = MAC_BYTES;
    if (len < at + 2) {
        return 0;
    }
    unsigned type = big16(bytes + at);
    /* VLAN tags can be nested, and may be added by a switch with a monitor port. */
    while ((type == ETHERTYPE_VLAN || type == ETHERTYPE_QINQ) && at + 6 <= len) {
        at += 4;
        type = big16(bytes + at);
    }
    at += 2;
    if (type == ETHERTYPE_ETHERCAT) {
        return at;
    }
    /* EtherCAT over UDP has its own port; only IPv4 is specified. */
    if (type != ETHERTYPE_IPV4 || at + 20 > len || bytes[at] >> 4 != 4 || bytes[at + 9] != 17) {
        return 0;
    }
    /* The header of IPv4 has a variable length. */
    at += 4u * (bytes[at] & 0x0Fu);
    if (at + 8 > len || big16(bytes + at + 2) != UDP_PORT) {
        return 0;
    }
    return at + 8;
}

/** Whether a command moves process data, given its address. */
static bool is_process_data(uint8_t command, uint32_t address) {
    if (command >= CMD_LRD && command <= CMD_LRW) {
        return true;
    }
    return command >= CMD_APRD && command <= CMD_FPRW && address >> 16 >= PROCESS_DATA_START;
}

static void end_run(struct fsn_scan *scan) {
    if (scan->run.any_answer) {
        scan_process_data(scan, &scan->run);
    }
    scan->run.command = 0;
    scan->run.any_answer = false;
}

/** Appends a datagram to the run that it continues, or begins another run. */
static void take(struct fsn_scan *scan, uint8_t command, uint32_t address, const uint8_t *data,
                 uint16_t size) {
    struct run *run = &scan->run;
    const bool is_logical = command >= CMD_LRD && command <= CMD_LRW;
    if (!is_logical || run->command != command || run->address + run->size_bytes != address) {
        end_run(scan);
        run->command = command;
        run->address = address;
        run->size_bytes = 0;
        run->any_answer = false;
    }
    const bool answered = little16(data + size) != 0;
    memcpy(run->data + run->size_bytes, data, size);
    memset(run->answered + run->size_bytes, answered, size);
    run->size_bytes = (uint16_t)(run->size_bytes + size);
    run->any_answer = run->any_answer || answered;
    scan->counts.datagrams += answered;
    scan->counts.unanswered += !answered;
}

/** Parses the datagrams; false if one does not fit. */
static bool walk(struct fsn_scan *scan, const uint8_t *at, size_t len) {
    bool more = true;
    while (more) {
        if (len < DATAGRAM_HEAD_BYTES + WKC_BYTES) {
            return false;
        }
        const uint8_t command = at[0];
        const uint32_t address = little16(at + 2) | (uint32_t)little16(at + 4) << 16;
        const unsigned flags = little16(at + 6);
        const uint16_t size = flags & 0x07FF;
        more = (flags & 0x8000) != 0;
        if (len < (size_t)DATAGRAM_HEAD_BYTES + size + WKC_BYTES) {
            return false;
        }
        const uint8_t *data = at + DATAGRAM_HEAD_BYTES;
        if (is_process_data(command, address)) {
            take(scan, command, address, data, size);
        }
        at = data + size + WKC_BYTES;
        len -= (size_t)DATAGRAM_HEAD_BYTES + size + WKC_BYTES;
    }
    return true;
}

/** Returns a MainDevice and its bus: number and source address, without the bit that SubDevices
 *  set. */
static uint64_t bus_of(uint32_t bus, const uint8_t *bytes) {
    const uint8_t *source = bytes + 6;
    uint64_t key = bus & 0xFFFFu;
    for (unsigned i = 0; i < 6; i++) {
        key = key << 8 | (i == 0 ? source[i] & 0xFDu : source[i]);
    }
    return key;
}

uint32_t fsn_scan_packet(struct fsn_scan *scan, uint32_t bus, const uint8_t *bytes,
                         size_t len_bytes, uint64_t time_ns) {
    scan->counts.packets++;
    scan->now_ns = time_ns;
    const size_t start = ethercat_start(bytes, len_bytes);
    if (start == 0) {
        return scan->queue_count;
    }
    scan->counts.ethercat++;
    scan->bus = bus_of(bus, bytes);
    scan->pair_tries = PAIR_TRIES;
    if (start + 2 > len_bytes) {
        scan->counts.malformed++;
        return scan->queue_count;
    }
    const unsigned head = little16(bytes + start);
    const size_t said = head & 0x07FF;
    const size_t left = len_bytes - start - 2;
    /* In a truncated packet, complete datagrams are still valid. */
    if (head >> 12 == 1 && !walk(scan, bytes + start + 2, said < left ? said : left)) {
        scan->counts.malformed++;
    }
    end_run(scan);
    scan_end_of_packet(scan);
    return scan->queue_count;
}

fsn_status fsn_scan_create(struct fsn_scan **scan) {
    if (scan == NULL) {
        return FSN_E_ARG;
    }
    *scan = calloc(1, sizeof **scan);
    if (*scan == NULL) {
        return FSN_E_NOMEM;
    }
    (*scan)->candidates = calloc(MAX_CANDIDATES, sizeof *(*scan)->candidates);
    (*scan)->found = calloc(MAX_CONNECTIONS, sizeof *(*scan)->found);
    (*scan)->frames = calloc((size_t)MAX_CANDIDATES * MEMORY, FSN_MAX_FRAME_BYTES);
    if ((*scan)->candidates == NULL || (*scan)->found == NULL || (*scan)->frames == NULL) {
        fsn_scan_free(*scan);
        *scan = NULL;
        return FSN_E_NOMEM;
    }
    return FSN_OK;
}

void fsn_scan_free(struct fsn_scan *scan) {
    if (scan == NULL) {
        return;
    }
    for (uint32_t i = 0; i < scan->window_count; i++) {
        free(scan->windows[i].last);
        free(scan->windows[i].strikes);
        free(scan->windows[i].slots);
    }
    free(scan->candidates);
    free(scan->frames);
    free(scan->found);
    free(scan->queue);
    free(scan);
}

bool fsn_scan_next(struct fsn_scan *scan, struct fsn_sighting *sighting) {
    if (scan->queue_count == 0) {
        return false;
    }
    *sighting = scan->queue[scan->queue_head];
    scan->queue_head++;
    scan->queue_count--;
    if (scan->queue_count == 0) {
        scan->queue_head = 0;
    }
    return true;
}

uint32_t fsn_scan_connection_count(const struct fsn_scan *scan) {
    return scan->found_count;
}

fsn_status fsn_scan_connection(const struct fsn_scan *scan, uint32_t number,
                               struct fsn_scan_connection *connection) {
    if (number >= scan->found_count) {
        return FSN_E_ARG;
    }
    *connection = scan->found[number].info;
    connection->status = scan->found[number].monitor.status;
    return FSN_OK;
}

void fsn_scan_counts(const struct fsn_scan *scan, struct fsn_scan_counts *counts) {
    *counts = scan->counts;
}
