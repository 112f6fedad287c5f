#define _GNU_SOURCE

#include "bare.h"

#include <string.h>
#include <sys/socket.h>
#include <time.h>

bool bare_open(struct bare *b, const char *interface, uint16_t nop_bytes) {
    b->context = (ecx_contextt){.port = &b->port,
                                .slavelist = b->slaves,
                                .slavecount = &b->count,
                                .maxslave = MOST_SLAVES,
                                .grouplist = b->groups,
                                .maxgroup = 1,
                                .esibuf = b->esi,
                                .esimap = b->esi_map,
                                .elist = &b->errors,
                                .idxstack = &b->stack,
                                .ecaterror = &b->error,
                                .DCtime = &b->time,
                                .SMcommtype = &b->comm,
                                .PDOassign = &b->assign,
                                .PDOdesc = &b->desc,
                                .eepSM = &b->sm,
                                .eepFMMU = &b->fmmu};
    b->nop_bytes = nop_bytes;
    return ecx_init(&b->context, interface) > 0;
}

bool bare_bring_up(struct bare *b, int devices) {
    if (ecx_config_init(&b->context, FALSE) != devices ||
        ecx_config_map_group(&b->context, b->image, 0) <= 0) {
        return false;
    }
    ecx_configdc(&b->context);
    if (ecx_statecheck(&b->context, 0, EC_STATE_SAFE_OP, 2000000) != EC_STATE_SAFE_OP) {
        return false;
    }
    ecx_send_processdata(&b->context);
    ecx_receive_processdata(&b->context, EC_TIMEOUTRET);
    b->slaves[0].state = EC_STATE_OPERATIONAL;
    ecx_writestate(&b->context, 0);
    return ecx_statecheck(&b->context, 0, EC_STATE_OPERATIONAL, 2000000) == EC_STATE_OPERATIONAL;
}

static uint8 make_nop(struct bare *b) {
    const uint8 index = ecx_getindex(&b->port);
    ecx_setupdatagram(&b->port, &b->port.txbuf[index], EC_CMD_NOP, index, 0, 0, b->nop_bytes,
                      b->image);
    return index;
}

static bool soem_nop(struct bare *b) {
    const uint8 index = make_nop(b);
    const int back = ecx_srconfirm(&b->port, index, EC_TIMEOUTRET);
    ecx_setbufstat(&b->port, index, EC_BUF_EMPTY);
    return back != EC_NOFRAME;
}

bool bare_soem(struct bare *b) {
    if (b->nop_bytes > 0) {
        return soem_nop(b);
    }
    const int expected = 2 * b->groups[0].outputsWKC + b->groups[0].inputsWKC;
    ecx_send_processdata(&b->context);
    return ecx_receive_processdata(&b->context, EC_TIMEOUTRET) == expected;
}

static void keep_frame(struct bare *b, int index) {
    if (b->frame_count < MOST_FRAMES) {
        b->frame_bytes[b->frame_count] = b->port.txbuflength[index];
        memcpy(b->frame[b->frame_count++], b->port.txbuf[index], EC_BUFSIZE);
    }
}

/** Keeps the frames of a cycle as SOEM sends them. */
static void keep_frames(struct bare *b) {
    if (b->nop_bytes > 0) {
        const uint8 index = make_nop(b);
        keep_frame(b, index);
        ecx_setbufstat(&b->port, index, EC_BUF_EMPTY);
        return;
    }
    ecx_send_processdata(&b->context);
    for (int i = 0; i < b->stack.pushed; i++) {
        keep_frame(b, b->stack.idx[i]);
    }
    ecx_receive_processdata(&b->context, EC_TIMEOUTRET);
}

static int64_t now_us(void) {
    struct timespec now;
    clock_gettime(CLOCK_MONOTONIC, &now);
    return (int64_t)now.tv_sec * 1000000 + now.tv_nsec / 1000;
}

static bool receive_one(const struct bare *b) {
    uint8 reply[EC_BUFSIZE];
    const int64_t until_us = now_us() + EC_TIMEOUTRET;
    ssize_t got;
    while ((got = recv(b->port.sockhandle, reply, sizeof reply, MSG_DONTWAIT)) <= 0 &&
           now_us() < until_us) {
    }
    return got > 0;
}

bool bare_send_receive(struct bare *b) {
    if (b->frame_count == 0) {
        keep_frames(b);
    }
    bool came = true;
    for (int i = 0; i < b->frame_count; i++) {
        const size_t len = (size_t)b->frame_bytes[i];
        came = send(b->port.sockhandle, b->frame[i], len, 0) == (ssize_t)len && came;
    }
    for (int i = 0; i < b->frame_count; i++) {
        came = receive_one(b) && came;
    }
    return came;
}

void bare_end(struct bare *b) {
    if (b->nop_bytes == 0) {
        b->slaves[0].state = EC_STATE_INIT;
        ecx_writestate(&b->context, 0);
    }
    ecx_close(&b->context);
}
