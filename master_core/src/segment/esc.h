/** One emulated EtherCAT SubDevice controller: registers, memory, FMMUs, sync managers, AL states,
 *  SII interface and mailbox. Independent of plan and link; the time is passed with every frame. */
#ifndef FSN_SEGMENT_ESC_H
#define FSN_SEGMENT_ESC_H

#include <stdbool.h>
#include <stddef.h>
#include <stdint.h>

#include "rt/bytes.h"

/** One value; numbers are stored low byte first. */
struct object {
    uint16_t index;
    uint8_t sub;
    bool writable;
    uint32_t size_bytes;
    uint32_t at; /**< position of its first byte in the values */
};

struct objects {
    struct object *rows; /**< in the order of addition; subindexes of an index are consecutive */
    uint32_t count, room;
    uint8_t *values;  /**< current values */
    uint8_t *initial; /**< values at power-on */
    uint32_t value_bytes, value_room;
    bool failed; /**< out of memory: an object to be added is missing */
};

/** Adds a value, unless it already exists. */
void objects_add(struct objects *objects, uint16_t index, uint8_t sub, bool writable,
                 const void *value, uint32_t size_bytes);

/** Sets a value now and for every power-on; adds it, writable or not, if it does not exist. False
 *  when it has another length, or memory ran out. */
bool objects_put(struct objects *objects, uint16_t index, uint8_t sub, bool writable,
                 const void *value, uint32_t size_bytes);

/** Adds a number of 1, 2 or 4 bytes. */
void objects_add_number(struct objects *objects, uint16_t index, uint8_t sub, bool writable,
                        uint32_t value, uint32_t size_bytes);

/** Returns an object, or NULL. */
const struct object *objects_find(const struct objects *objects, uint16_t index, uint8_t sub);

/** Whether any object has this index. */
bool objects_has(const struct objects *objects, uint16_t index);

uint8_t *objects_value(const struct objects *objects, const struct object *object);

/** Resets all values to those at power-on. */
void objects_reset(struct objects *objects);

void objects_free(struct objects *objects);

enum {
    ESC_MEMORY_BYTES = 0x3000, /**< registers below 0x1000, then 8 KiB of process data memory */
    ESC_PROCESS_DATA = 0x1000,
    ESC_FMMUS = 8,
    ESC_SMS = 8,
    ESC_PORTS = 4,
    ESC_MAILBOX_BYTES = 256, /**< longest supported mailbox */
    ESC_ABORTS = 16,
};

/** Registers; the numbers are those of the SubDevice controller data sheets. */
enum {
    REG_TYPE = 0x0000,
    REG_STATION = 0x0010,
    REG_ALIAS = 0x0012,
    REG_DL_CONTROL = 0x0100,
    REG_DL_STATUS = 0x0110,
    REG_AL_CONTROL = 0x0120,
    REG_AL_STATUS = 0x0130,
    REG_AL_CODE = 0x0134,
    REG_RX_ERRORS = 0x0300,
    REG_FORWARDED_ERRORS = 0x0308,
    REG_UNIT_ERRORS = 0x030C,
    REG_PDI_ERRORS = 0x030D,
    REG_LOST_LINK = 0x0310,
    REG_WD_DIVIDER = 0x0400,
    REG_WD_PROCESS_DATA = 0x0420,
    REG_WD_STATUS = 0x0440,
    REG_WD_COUNT = 0x0442,
    REG_SII_ASSIGN = 0x0500,
    REG_SII_CONTROL = 0x0502,
    REG_SII_ADDRESS = 0x0504,
    REG_SII_DATA = 0x0508,
    REG_FMMU = 0x0600,
    REG_SM = 0x0800,
    REG_DC_RECEIVE = 0x0900,
    REG_DC_TIME = 0x0910,
    REG_DC_EPU_TIME = 0x0918,
    REG_DC_OFFSET = 0x0920,
    REG_DC_DELAY = 0x0928,
    REG_DC_DIFFERENCE = 0x092C,
    REG_DC_LOOP = 0x0930,
    REG_DC_ACTIVATION = 0x0981,
    REG_SYNC0_START = 0x0990,
    REG_SYNC0_CYCLE = 0x09A0,
    REG_DC_END = 0x09A8,
};

/** AL states and codes. */
enum {
    AL_INIT = 1,
    AL_PREOP = 2,
    AL_BOOT = 3,
    AL_SAFEOP = 4,
    AL_OP = 8,
    AL_ERROR = 0x10,
    AL_CODE_INVALID_TRANSITION = 0x0011,
    AL_CODE_UNKNOWN_STATE = 0x0012,
    AL_CODE_NO_BOOT = 0x0013,
    AL_CODE_MAILBOX = 0x0016,
    AL_CODE_SYNC = 0x001A,
    AL_CODE_WATCHDOG = 0x001B,
    AL_CODE_OUTPUTS = 0x001D,
    AL_CODE_INPUTS = 0x001E,
    AL_CODE_SYNC_FATAL = 0x002C,
    AL_CODE_NO_SYNC = 0x002D,
};

/** One sync manager with process data, published or read by the device. The bytes on the bus side
 *  are in the memory of the controller. */
struct esc_buffer {
    uint8_t *device;     /**< newest complete set on the device side */
    uint32_t size_bytes; /**< 0: this sync manager carries no process data */
    bool fresh;          /**< the other side has not yet taken it */
};

/** An SDO that takes several messages. */
struct transfer {
    bool active, upload, toggle, complete;
    uint16_t index;
    uint8_t sub;
    uint32_t size_bytes, done;
    uint8_t data[2048];
};

/** An object that answers with an abort code. */
struct esc_abort {
    uint16_t index;
    uint32_t sub; /**< above 255: all of them */
    uint32_t code;
};

/** Vendor, product code, revision. */
struct esc_identity {
    uint32_t numbers[3];
};

/** Faults that a test sets in a SubDevice; they persist over a power cycle. */
struct esc_faults {
    uint64_t al_delay_ns, mailbox_delay_ns;
    bool is_other; /**< it reports the other identity from the next power-on */
    struct esc_identity other;
    struct esc_abort aborts[ESC_ABORTS];
    uint32_t abort_count;
};

/** A sync manager as in its registers; number counts from 0. */
struct esc_sm {
    uint16_t start, length;
    uint8_t number;
    bool mailbox, from_device; /**< from_device: the bus reads it */
};

/** An FMMU as in its registers. */
struct esc_fmmu {
    uint32_t logical;
    uint16_t length, physical;
    uint8_t start_bit, end_bit, physical_bit;
    bool read, write, whole_bytes;
    uint8_t inside; /**< 1 + place in esc.sms of its process data, in one direction; 0: search */
};

/** Its distributed clock: quartz, and the corrections of the control loop. */
struct esc_clock {
    bool absent;           /**< missing: those registers do not exist */
    bool deaf;             /**< the control loop makes no corrections */
    bool narrow;           /**< its times have 32 bits */
    uint32_t forward_ns;   /**< delay of a frame to the next controller */
    uint64_t offset_ns;    /**< the free-running clock starts at any time */
    int64_t drift_ppb;     /**< rate error of a fast quartz */
    int64_t phase_ns;      /**< correction by the control loop at compared_ns */
    int64_t rate_ppb;      /**< growth of the correction */
    int64_t difference_ns; /**< mean difference from the reference clock */
    uint64_t compared_ns;  /**< when a time last arrived */
    uint64_t served_ns;    /**< when the reference time last passed */
    bool served;           /**< whether it ever passed */
    bool fires;            /**< SYNC0 got a start that had not yet passed */
    uint64_t pulse_ns;     /**< its first pulse, in system time of 64 bits; UINT64_MAX: never */
    uint64_t near;         /**< the last 64 output frames: 1 if a frame was near a pulse */
};

/** Fields that frames use come first, the memory last. The tables repeat registers and contain only
 *  enabled items. They are rebuilt whenever those registers are written. */
struct esc {
    uint64_t now_ns;               /**< of the frame being processed */
    uint64_t outputs_ns;           /**< when outputs were last written */
    uint64_t watchdog_ns;          /**< 0: off */
    uint32_t fmmu_begin, fmmu_end; /**< range of the logical addresses of all FMMUs */
    uint8_t fmmu_count, sm_count;
    bool has_mailbox;
    bool outputs_seen; /**< since PREOP */
    bool al_pending;   /**< a request waits until al_due_ns */
    uint16_t answer_bytes;
    struct esc_fmmu fmmus[ESC_FMMUS];
    struct esc_sm sms[ESC_SMS];
    struct esc_buffer buffers[ESC_SMS];
    uint8_t *sii; /**< contents of the EEPROM */
    size_t sii_bytes;
    struct objects objects;
    uint8_t answer[ESC_MAILBOX_BYTES]; /**< waits until SM1 is empty */
    uint64_t answer_due_ns;
    uint8_t mailbox_counter;
    struct transfer transfer;
    uint64_t al_due_ns;
    struct esc_identity identity; /**< its own */
    struct esc_faults faults;
    uint8_t ports; /**< bit n: port n has a link */
    struct esc_clock clock;
    uint8_t memory[ESC_MEMORY_BYTES];
};

/** One datagram that passes the controller. */
struct datagram {
    uint8_t command;
    uint16_t position, offset; /**< ADP and ADO; together the logical address */
    uint8_t *data;
    uint16_t size_bytes;
    uint16_t counter; /**< working counter */
};

/** Sets a controller to the state after power-on; buffers, SII and objects are kept. */
void esc_power_on(struct esc *esc);

/** Passes a datagram: data, ADP and working counter change as in a real controller. */
void esc_pass(struct esc *esc, struct datagram *datagram);

/** Latches the receive times of its ports after a frame that wrote 0x0900.
 *  @param[in] arrival_ns, return_ns  local time of the frame at port 0, and back from port 1. */
void esc_latch_times(struct esc *esc, uint64_t arrival_ns, uint64_t return_ns);

/** Events between frames: watchdogs, mailbox answers, state transitions. */
void esc_idle(struct esc *esc, uint64_t now_ns);

/** Increases an error counter, up to 255. */
void esc_count(uint8_t *counter, uint32_t more);

/** AL state without the error bit. */
uint8_t esc_state(const struct esc *esc);

/* Parts of the controller, one file each. */

/** A request in AL control; the requested and due state (al.c). */
void esc_al_control(struct esc *esc);
void esc_al_decide(struct esc *esc);
/** Falls back to SAFEOP with an error. */
void esc_al_error(struct esc *esc, uint8_t state, uint16_t code);

/** A command to the SII interface (sii.c). */
void esc_sii_command(struct esc *esc);

/** Distributed clock (clock.c): free-running time, and the common system time. */
uint64_t esc_local_time(const struct esc *esc, uint64_t at_ns);
uint64_t esc_system_time(const struct esc *esc);
/** Writes a time to its register: all of it, or the 32 bits of the clock. */
void esc_clock_show(struct esc *esc, uint16_t address, uint64_t time_ns);
/** Limits the registers to the bits of the clock, and reports their number. */
void esc_clock_limit(struct esc *esc);
/** Restarts the mean difference, and everything after power-on. */
void esc_clock_reset(struct esc *esc, bool power_on);
/** The reference time has passed; the control loop follows it. */
void esc_clock_served(struct esc *esc);
void esc_clock_compare(struct esc *esc, const uint8_t *time, uint16_t size_bytes);
/** SYNC0 was switched on; outputs have arrived. */
void esc_clock_activate(struct esc *esc);
void esc_clock_outputs(struct esc *esc);
/** Time until the next pulse of SYNC0, nanoseconds; UINT64_MAX: off, or no further pulse. */
uint64_t esc_clock_until_pulse(const struct esc *esc);
/** AL status code of a device whose SYNC0 cannot be used; 0: it can, or is off. */
uint16_t esc_clock_fault(const struct esc *esc);

/** Reads the registers of all sync managers and FMMUs again (sm.c, fmmu.c). */
void esc_sm_load(struct esc *esc);
void esc_fmmu_load(struct esc *esc);

/** Whether physical memory may be read or written now, with regard to mailbox sync managers
 *  (sm.c). */
bool esc_sm_allows(const struct esc *esc, uint16_t address, uint16_t size_bytes, bool write);
/** The bus is about to read process data: copies the newest set into the memory (sm.c). */
void esc_sm_before_read(struct esc *esc, uint16_t address, uint16_t size_bytes);
/** Process data of one sync manager, before its first byte is read or after its last is written. */
void esc_sm_take_inputs(struct esc *esc, const struct esc_sm *sm);
void esc_sm_give_outputs(struct esc *esc, const struct esc_sm *sm);
/** The bus has read or written (sm.c). */
void esc_sm_after_read(struct esc *esc, uint16_t address, uint16_t size_bytes);
void esc_sm_after_write(struct esc *esc, uint16_t address, uint16_t size_bytes);
/** Whether the sync managers are configured as the device requires. */
bool esc_sm_mailbox_ok(const struct esc *esc);
bool esc_sm_process_data_ok(const struct esc *esc, bool outputs);

/** Applies the FMMUs to a logical datagram (fmmu.c). */
void esc_fmmu_pass(struct esc *esc, struct datagram *datagram);

/** Reads or writes registers and memory; false if nothing exists there or access is denied. */
bool esc_read(struct esc *esc, uint16_t address, uint8_t *data, uint16_t size_bytes, bool or_in);
bool esc_write(struct esc *esc, uint16_t address, const uint8_t *data, uint16_t size_bytes);

/** Mailbox: a message has arrived; an answer must be sent (mailbox.c). */
void esc_mailbox_in(struct esc *esc);
void esc_mailbox_out(struct esc *esc);

#endif
