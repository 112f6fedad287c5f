/** A segment in memory and a tiny MainDevice for its tests. */
#ifndef FSN_TEST_SEGMENT_RIG_H
#define FSN_TEST_SEGMENT_RIG_H

#include "builder.h"
#include "fsn/segment.h"

enum { APRD = 1, APWR, APRW, FPRD, FPWR, FPRW, BRD, BWR, BRW, LRD, LWR, LRW, ARMW, FRMW };
enum { LONGEST_LINE = 8 };

struct rig {
    uint8_t *bytes;
    struct fsn_plan *plan;
    struct fsn_segment *segment;
    uint64_t now_ns;
    uint32_t port;     /**< of the MainDevice that sends */
    uint32_t out_port; /**< where the last answer came out */
    uint16_t adp;      /**< of the last answer: positions count up */
    uint8_t data[256]; /**< of the last answer */
};

/** The e-stop pair: outputs and inputs of 9 and 8 bytes, then of 8 and 8. */
struct rig set_up(void);
/** As many SubDevices with 8 + 8 bytes. */
struct rig set_up_line(uint32_t subdevices);
void tear_down(struct rig *rig);

/** Sends one datagram; returns its working counter, or -1 without an answer. */
int datagram(struct rig *rig, uint8_t command, uint16_t adp, uint16_t ado, const void *data,
             uint16_t size);
int write16(struct rig *rig, uint8_t command, uint16_t adp, uint16_t ado, uint16_t value);

/** Gives the first two SubDevices the station addresses 1001 and 1002. */
void set_stations(struct rig *rig);
void set_sm(struct rig *rig, uint16_t station, uint16_t number, uint16_t start, uint16_t length,
            uint8_t control);
void set_fmmu(struct rig *rig, uint16_t station, uint16_t number, uint32_t logical, uint16_t length,
              uint16_t physical, uint8_t type);
uint8_t al(struct rig *rig, uint32_t position);
void to_preop(struct rig *rig, uint16_t station);
void to_op(struct rig *rig, uint16_t station, uint32_t logical, uint16_t outputs);

/** Writes an SDO request to station 1001; each datagram takes 1 ms. */
void post(struct rig *rig, const uint8_t *request, uint16_t size);

/** Sends an SDO request to station 1001 and reads the answer into rig->data; returns its length. */
unsigned sdo(struct rig *rig, const uint8_t *request, uint16_t size);

#endif
