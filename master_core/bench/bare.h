/** SOEM by itself, with nothing of ours: what measurements are compared with. */
#ifndef FSN_BENCH_BARE_H
#define FSN_BENCH_BARE_H

#include <ethercat.h>

enum { MOST_SLAVES = 32 };

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
};

/** Brings so many SubDevices on the interface "near" to OP. */
void bare_bring_up(struct bare *bare, int devices);

/** Brings them to INIT and closes the interface. */
void bare_end(struct bare *bare);

#endif
