#include "segment_rig.h"

#include <string.h>

static struct rig open_rig(uint8_t *bytes, size_t len) {
    struct rig rig = {.bytes = bytes};
    CHECK(fsn_plan_load(rig.bytes, len, &rig.plan, NULL) == FSN_OK);
    CHECK(fsn_segment_create(rig.plan, &rig.segment) == FSN_OK);
    return rig;
}

struct rig set_up(void) {
    size_t len;
    uint8_t *bytes = build_estop(&len);
    return open_rig(bytes, len);
}

struct rig set_up_line(uint32_t subdevices) {
    struct build_sm sm[LONGEST_LINE][2];
    CHECK(subdevices <= LONGEST_LINE);
    for (uint32_t i = 0; i < subdevices; i++) {
        sm[i][0] = (struct build_sm){1, 8};
        sm[i][1] = (struct build_sm){2, 8};
    }
    const struct build build = {
        .subdevices = subdevices, .sm = (const struct build_sm(*)[2])sm, .cycle_ns = 1000000};
    size_t len;
    uint8_t *bytes = build_plan(&build, &len);
    return open_rig(bytes, len);
}

void tear_down(struct rig *rig) {
    fsn_plan_free(rig->plan); /* the segment holds it */
    fsn_segment_free(rig->segment);
    free(rig->bytes);
}

/** Sends one datagram; returns its working counter, or -1 without an answer. */
int datagram(struct rig *rig, uint8_t command, uint16_t adp, uint16_t ado, const void *data,
             uint16_t size) {
    uint8_t frame[400] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 1, 1, 1, 1, 1, 1, 0x88, 0xA4};
    const uint16_t length = (uint16_t)(12 + size);
    frame[14] = (uint8_t)length;
    frame[15] = (uint8_t)(0x10 | (length >> 8));
    frame[16] = command;
    frame[18] = (uint8_t)adp;
    frame[19] = (uint8_t)(adp >> 8);
    frame[20] = (uint8_t)ado;
    frame[21] = (uint8_t)(ado >> 8);
    frame[22] = (uint8_t)size;
    frame[23] = (uint8_t)(size >> 8);
    if (data != NULL) {
        memcpy(frame + 26, data, size);
    }
    rig->now_ns += 1000000;
    const size_t len = 16u + length;
    if (fsn_segment_frame_from(rig->segment, rig->port, frame, len, rig->now_ns, &rig->out_port) !=
        len) {
        return -1;
    }
    memcpy(rig->data, frame + 26, size);
    rig->adp = (uint16_t)(frame[18] | frame[19] << 8);
    return frame[26 + size] | (frame[27 + size] << 8);
}

int write16(struct rig *rig, uint8_t command, uint16_t adp, uint16_t ado, uint16_t value) {
    const uint8_t bytes[2] = {(uint8_t)value, (uint8_t)(value >> 8)};
    return datagram(rig, command, adp, ado, bytes, 2);
}

void set_stations(struct rig *rig) {
    CHECK(write16(rig, APWR, 0, 0x0010, 1001) == 1);
    CHECK(write16(rig, APWR, 0xFFFF, 0x0010, 1002) == 1);
}

void set_sm(struct rig *rig, uint16_t station, uint16_t number, uint16_t start, uint16_t length,
            uint8_t control) {
    const uint8_t sm[8] = {(uint8_t)start,
                           (uint8_t)(start >> 8),
                           (uint8_t)length,
                           (uint8_t)(length >> 8),
                           control,
                           0,
                           1,
                           0};
    CHECK(datagram(rig, FPWR, station, (uint16_t)(0x0800 + 8 * number), sm, 8) == 1);
}

void set_fmmu(struct rig *rig, uint16_t station, uint16_t number, uint32_t logical, uint16_t length,
              uint16_t physical, uint8_t type) {
    const uint8_t fmmu[16] = {(uint8_t)logical,
                              (uint8_t)(logical >> 8),
                              0,
                              0,
                              (uint8_t)length,
                              0,
                              0,
                              7,
                              (uint8_t)physical,
                              (uint8_t)(physical >> 8),
                              0,
                              type,
                              1};
    CHECK(datagram(rig, FPWR, station, (uint16_t)(0x0600 + 16 * number), fmmu, 16) == 1);
}

uint8_t al(struct rig *rig, uint32_t position) {
    return fsn_segment_al_status(rig->segment, position, NULL);
}

/** Sync managers 0 and 1 are the mailbox, 2 and 3 carry process data. */
void to_preop(struct rig *rig, uint16_t station) {
    set_sm(rig, station, 0, 0x1000, 128, 0x26);
    set_sm(rig, station, 1, 0x1080, 128, 0x22);
    CHECK(write16(rig, FPWR, station, 0x0120, 0x12) == 1);
}

void to_op(struct rig *rig, uint16_t station, uint32_t logical, uint16_t outputs) {
    to_preop(rig, station);
    set_sm(rig, station, 2, 0x1100, outputs, 0x64);
    set_sm(rig, station, 3, 0x1140, 8, 0x20);
    set_fmmu(rig, station, 0, logical, outputs, 0x1100, 2);
    set_fmmu(rig, station, 1, logical + outputs, 8, 0x1140, 1);
    CHECK(write16(rig, FPWR, station, 0x0120, 4) == 1);
    CHECK(write16(rig, FPWR, station, 0x0120, 8) == 1);
}

void post(struct rig *rig, const uint8_t *request, uint16_t size) {
    uint8_t mailbox[128] = {0};
    mailbox[0] = (uint8_t)(2 + size);
    mailbox[5] = 0x13; /* CoE, counter 1 */
    mailbox[7] = 0x20; /* SDO request */
    memcpy(mailbox + 8, request, size);
    CHECK(datagram(rig, FPWR, 1001, 0x1000, mailbox, 128) == 1);
}

/** Sends an SDO request and reads the answer into rig->data; returns its length. */
unsigned sdo(struct rig *rig, const uint8_t *request, uint16_t size) {
    CHECK(datagram(rig, FPRD, 1001, 0x1080, NULL, 128) == 0); /* nothing to read yet */
    post(rig, request, size);
    CHECK(datagram(rig, FPRD, 1001, 0x080D, NULL, 1) == 1 && (rig->data[0] & 8) != 0);
    CHECK(datagram(rig, FPRD, 1001, 0x1080, NULL, 128) == 1);
    CHECK(rig->data[5] % 16 == 3 || rig->data[5] % 16 == 0);
    return rig->data[0];
}
