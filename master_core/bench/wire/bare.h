/** SOEM by itself, and its frames by send() and recv() alone: what a cycle is compared with. */
#ifndef FSN_BENCH_BARE_H
#define FSN_BENCH_BARE_H

#include <stdbool.h>

#include <ethercat.h>

enum { MOST_SLAVES = 64, MOST_FRAMES = 8 };

struct bare {
    ecx_contextt context;
    ecx_portt port;
    ec_slavet slaves[MOST_SLAVES];
    int count;
    ec_groupt groups[1];
    uint8 esi[EC_MAXEEPBUF];
    uint32 esi_map[EC_MAXEEPBITMAP];
    ec_eringt errors;
    ec_idxstackT stack;
    boolean error;
    int64 time;
    ec_SMcommtypet comm;
    ec_PDOassignt assign;
    ec_PDOdesct desc;
    ec_eepromSMt sm;
    ec_eepromFMMUt fmmu;
    uint8 image[16384];
    uint16 nop_bytes; /**< 0: process data */
    uint8 frame[MOST_FRAMES][EC_BUFSIZE];
    int frame_bytes[MOST_FRAMES], frame_count; /**< of bare_send_receive(), from its first call */
};

/** Opens the interface; false if it is not permitted or unknown. `nop_bytes`: 0, or the data of the
 *  one datagram that the cycles below then send, which no SubDevice executes. */
bool bare_open(struct bare *bare, const char *interface, uint16_t nop_bytes);

/** Brings so many SubDevices to OP; false if they do not get there. */
bool bare_bring_up(struct bare *bare, int devices);

/** One cycle of SOEM's functions; returns whether the working counter is the expected one. */
bool bare_soem(struct bare *bare);

/** The same frames, made once and never read: no MainDevice on a packet socket can be faster. */
bool bare_send_receive(struct bare *bare);

/** Brings the SubDevices that bare_bring_up() has started to INIT; closes the interface. */
void bare_end(struct bare *bare);

#endif
