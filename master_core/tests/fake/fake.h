/** IgH EtherCAT Master in memory, as far as the backend sees it: one master, a line of devices. It
 *  works in send() and receive() only, so a test decides when anything happens. */
#ifndef FSN_FAKE_H
#define FSN_FAKE_H

#include <stdbool.h>

#include <ecrt.h>

enum { FAKE_DEVICES = 4, FAKE_OBJECTS = 64, FAKE_BYTES = 64, FAKE_LOG = 4096 };

struct fake_object {
    uint16_t index;
    uint8_t sub, size;
    uint8_t data[8];
    bool read_only;
};

struct fake_device {
    bool present;
    ec_slave_info_t info;
    struct fake_object objects[FAKE_OBJECTS];
    unsigned object_count; /**< 0: no CoE */
    unsigned sii_bits[4];  /**< of its sync managers; 0: no data */
    uint8_t inputs[FAKE_BYTES], outputs[FAKE_BYTES];
    uint8_t al, al_code;
    bool refuses_op, refuses_preop;
    bool mute;       /**< stays on the ring, but takes part in no process data */
    int watchdog[4]; /**< as configured, per sync manager */
    uint32_t assign_activate, sync0_cycle;
    unsigned resets;      /**< times a refusal was taken back */
    unsigned output_sets; /**< times outputs arrived */
};

struct fake {
    struct fake_device device[FAKE_DEVICES];
    unsigned device_count;
    bool no_master, reserved_by_other, link_down, lose_frames, activate_fails, no_requests;
    bool deaf;         /**< no register request is answered */
    int scans;         /**< calls of ecrt_master() that still find a scan going on */
    bool scan_in_look; /**< a scan begins with the next ecrt_master_get_slave() */
    int interrupted;   /**< cyclic calls that still end by a signal */
    int open_masters;
    bool active;
    unsigned sdo_while_scanning, downloads, clock_syncs, clock_reads, send_interval;
    uint64_t app_time;
    uint32_t reference_time; /**< 0: none */
    /** Calls number `fails_from` (0: none) and so many of them fail, with a negative error. */
    unsigned calls, fails_from, fails_for, failed;
    int fails_as;
    char log[FAKE_LOG]; /**< calls of the set-up, in order */
};

extern struct fake fake;

/** Counts a call; returns whether it is to fail in this test. */
bool fake_fails(void);

/** As many devices as the test plans have: vendor 2, product 0x1000 + n, revision 1, in PREOP. */
void fake_reset(unsigned devices);
void fake_object(unsigned device, uint16_t index, uint8_t sub, uint32_t value, uint8_t size,
                 bool read_only);
/** Takes a device and all devices after it from the line, or puts them back in INIT. */
void fake_unplug(unsigned device);
void fake_plug(unsigned device);

#endif
