#include "fuzz.h"

#include <string.h>

/* Orders of fuzz_scan.c: 0 frame, 1 send, 2 packet, 3 cycles, 4 poke, 5 start, 6 shape, 7 copy;
 * 0x08: connection; 0x20: to the main; 0x40 to 0xC0: command. */
static const uint8_t start_up[] = {0x11, 0x20, 0x02, 0x05, 0x00, 0x0D, 0x00, 0x83, 0x02, 0xC3,
                                   0x03, 0x43, 0x04, 0x03, 0x06, 0x0D, 0x01, 0x03, 0x06};
static const uint8_t midway[] = {0x00, 0x32, 0x1F, 0x03, 0x0C, 0x04, 0x03, 0x00, 0x55, 0x01, 0x03,
                                 0x04, 0x07, 0x00, 0x00, 0xF0, 0x05, 0x20, 0x01, 0x06, 0x01, 0x00,
                                 0x02, 0x08, 0x01, 0x03, 0x0C, 0x05, 0x01, 0x03, 0x05};
/* Roles guessed wrong, then shown by a Session; lengths differ. */
static const uint8_t swapped[] = {0x21, 0x00, 0x00, 0x05, 0x02, 0x03, 0x0C, 0x05, 0x01, 0x03, 0x05};
/* A datagram that ends inside a frame. */
static const uint8_t cut[] = {0x00, 0x00, 0x00, 0x03, 0x0C, 0x06, 0x00,
                              0x0B, 0x00, 0x00, 0x01, 0x03, 0x0C};
/* Packets cut off after a VLAN tag, twice, and EtherCAT in UDP, whole and cut off. */
static const uint8_t headers[] = {
    0x11, 0x20, 0x02, 0x03, 0x0C, /* a connection, then packets */
    0x02, 14,   0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0x81,
    0x00, 0x02, 18,   0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,
    0x81, 0x00, 0,    1,    0x81, 0x00, 0x02, 42,   0,    0,    0,    0,    0,    0,    0,    0,
    0,    0,    0,    0,    0,    0x08, 0x00, 0x45, 0,    0,    0,    0,    0,    0,    0,    0,
    17,   0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0x88, 0xA4, 0x88, 0xA4, 0,
    0,    0,    0,    0x02, 56,   0,    0,    0,    0,    0,    0,    0,    0,    0,    0,    0,
    0,    0,    0x08, 0x00, 0x45, 0,    0,    0,    0,    0,    0,    0,    0,    17,   0,    0,
    0,    0,    0,    0,    0,    0,    0,    0,    0x88, 0xA4, 0x88, 0xA4, 0,    0,    0,    0,
    0x0C, 0x10, 12,   0,    0,    0,    1,    0,    0,    0,    0,    0,    1,    0,
};

enum {
    CYCLES = 12,
    FRAME_BYTES = 7,
    DATA_BYTES = 40,
    PACKET_BYTES = 14 + 2 + 10 + DATA_BYTES + 2,
};

/** One packet as a capture holds it: LRW with the frames of two connections. */
static size_t put_packet(uint8_t *to, const uint8_t *image) {
    static const uint8_t head[] = {0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 0xFF, 2,
                                   1,    2,    3,    4,    5,    0x88, 0xA4};
    uint8_t *at = to;
    *at++ = 0x02; /* order PACKET, then its length */
    *at++ = PACKET_BYTES;
    *at++ = 0;
    memcpy(at, head, sizeof head);
    at += sizeof head;
    *at++ = 10 + DATA_BYTES + 2;
    *at++ = 0x10;
    const uint8_t datagram[] = {12, 0, 0, 0, 1, 0, DATA_BYTES, 0, 0, 0};
    memcpy(at, datagram, sizeof datagram);
    at += sizeof datagram;
    memcpy(at, image, DATA_BYTES);
    at += DATA_BYTES;
    *at++ = 3;
    *at++ = 0;
    return (size_t)(at - to);
}

/** A capture of two connections in data exchange; bytes only, so that mutations reach headers. */
static uint8_t *capture(size_t *len) {
    uint8_t *bytes = calloc(2 * CYCLES + 1, PACKET_BYTES + 3);
    CHECK(bytes != NULL);
    uint8_t image[DATA_BYTES] = {0};
    struct chain chain[2];
    chain_clear(&chain[0]);
    chain_clear(&chain[1]);
    *len = 3;
    for (unsigned n = 0; n < 2 * CYCLES; n++) {
        for (unsigned c = 0; c < 2; c++) {
            uint8_t *frame = image + 16 * c + 8 * (n % 2);
            frame[0] = FSN_CMD_PROCESS_DATA;
            frame[1] = (uint8_t)n;
            frame[FRAME_BYTES - 2] = (uint8_t)(0x11 * (c + 1));
            chain_finish(&chain[c], n % 2, frame, FRAME_BYTES);
        }
        *len += put_packet(bytes + *len, image);
    }
    return bytes;
}

uint8_t *fuzz_seed(size_t number, size_t *len) {
    static const struct {
        const uint8_t *bytes;
        size_t len;
    } scripts[] = {{start_up, sizeof start_up},
                   {midway, sizeof midway},
                   {swapped, sizeof swapped},
                   {cut, sizeof cut},
                   {headers, sizeof headers}};
    const size_t count = sizeof scripts / sizeof scripts[0];
    if (number >= count) {
        return number == count ? capture(len) : NULL;
    }
    *len = scripts[number].len;
    uint8_t *bytes = malloc(*len);
    CHECK(bytes != NULL);
    memcpy(bytes, scripts[number].bytes, *len);
    return bytes;
}
