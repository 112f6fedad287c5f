/** Acyclic access to SubDevices next to the running cycle: objects, SII, registers. */
#ifndef FSN_ACYCLIC_H
#define FSN_ACYCLIC_H

#include "fsn/bus.h"

#ifdef __cplusplus
extern "C" {
#endif

struct fsn_core;

enum {
    FSN_SDO_BYTES = 65536, /**< longest object to read or write */
    FSN_SII_BYTES = 65536, /**< longest SII content to read */
    FSN_NAME_BYTES = 64,
};

/** Bits of `mailbox` of a member, as in the SII. */
enum {
    FSN_MAILBOX_AOE = 0x01,
    FSN_MAILBOX_EOE = 0x02,
    FSN_MAILBOX_COE = 0x04,
    FSN_MAILBOX_FOE = 0x08,
    FSN_MAILBOX_SOE = 0x10,
    FSN_MAILBOX_VOE = 0x20,
};

/** Content of a ring position, planned or not. */
struct fsn_bus_member {
    uint32_t subdevice;                                 /**< number in the plan, or FSN_NONE */
    uint32_t vendor_id, product_code, revision, serial; /**< 0: unknown to the bus */
    uint16_t station, alias;
    uint16_t mailbox; /**< protocols, FSN_MAILBOX_…; 0: none */
    uint16_t al_code;
    uint8_t al_status; /**< FSN_AL_NONE: no answer at present */
    bool has_dc;
    uint8_t ports; /**< bit n: it has port n; 0: unknown */
    bool errors_known;
    uint8_t link[FSN_PORTS];
    uint8_t link_lost[FSN_PORTS], rx_errors[FSN_PORTS];
    char name[FSN_NAME_BYTES]; /**< name as known to the bus; may be empty */
};

/** One transfer with one SubDevice. */
struct fsn_transfer {
    uint32_t position; /**< ring position, from 0 */
    uint16_t index;
    uint8_t sub;
    uint8_t *data;       /**< data to write, or room for the data read */
    uint32_t size_bytes; /**< of data; after an upload: bytes read */
    uint32_t abort_code; /**< after FSN_E_BUS_SDO: abort code of the SubDevice; 0: unknown */
    /** Called between two steps of a long transfer; may be NULL; false aborts the transfer. */
    bool (*between)(void *self);
    void *self;
};

/** Acyclic operations of a bus. Each may be NULL, except count() and place(). All run in the thread
 *  that calls poll(). They may block for as long as a SubDevice may take for one mailbox answer. */
struct fsn_bus_acyclic {
    /** Opens the bus without a plan, to scan it: listens first, locks the interface, finds all
     *  SubDevices and requests PREOP. Replaces open(); ended by `quit`. Set-up thread.
     *  @param[out] states_changed  whether AL states were changed. */
    fsn_status (*visit)(void *bus, bool *states_changed, struct fsn_fault *fault);
    void (*quit)(void *bus);
    /** Members of the ring. */
    uint32_t (*count)(void *bus);
    /** Ring position of a SubDevice of the plan; FSN_NONE: no SubDevice there. */
    uint32_t (*place)(void *bus, uint32_t subdevice);
    /** Data of a member; reads its registers where the bus can.
     *  @retval FSN_E_BUS_MISSING  no answer; data known from before is filled in. */
    fsn_status (*member)(void *bus, uint32_t position, struct fsn_bus_member *member);
    /** Object through CoE.
     *  @retval FSN_E_ABSENT       the SubDevice has no CoE.
     *  @retval FSN_E_BUS_SDO      an abort code.
     *  @retval FSN_E_BUS_MISSING  no answer.
     *  @retval FSN_E_SPACE        too long.
     *  @retval FSN_E_BUS_STATE    an invalid answer.
     *  @retval FSN_E_STATE        aborted by `between`. */
    fsn_status (*upload)(void *bus, struct fsn_transfer *transfer);
    fsn_status (*download)(void *bus, struct fsn_transfer *transfer);
    /** Reads size_bytes of the SII from byte `offset` on, both multiples of 8.
     *  @retval FSN_E_BUS_MISSING  no answer. */
    fsn_status (*sii_read)(void *bus, uint32_t position, uint32_t offset, uint8_t *data,
                           uint32_t size_bytes);
    /** Writes one word of the SII. */
    fsn_status (*sii_write)(void *bus, uint32_t position, uint32_t offset, uint16_t word);
    /** Process data known to the bus without objects: PDO `pdo` of a sync manager.
     *  @retval FSN_E_ARG  unknown PDO.   NULL: read from the SII. */
    fsn_status (*pdo)(void *bus, uint32_t position, uint8_t sm, uint32_t pdo, uint16_t *index,
                      bool *output, uint32_t *entries, uint32_t room, uint32_t *count);
};

/** Returns the text of an SDO abort code; never an empty text.
 *  Context: any thread. */
FSN_API const char *fsn_abort_text(uint32_t code);

/** Reads or writes an object of a SubDevice of the plan; fills in the position in `transfer`.
 *  @retval FSN_E_ARG          unknown SubDevice, or a missing or too long buffer.
 *  @retval FSN_E_ABSENT       this bus, or this SubDevice, has no objects.
 *  @retval FSN_E_BUS_MISSING  no SubDevice there, or no answer.
 *  @retval others             as upload() and download() of fsn_bus_acyclic.
 *  Context: the thread that calls fsn_core_poll(). May block. */
FSN_API FSN_MUST_USE fsn_status fsn_core_upload(struct fsn_core *core, uint32_t subdevice,
                                                struct fsn_transfer *transfer);
FSN_API FSN_MUST_USE fsn_status fsn_core_download(struct fsn_core *core, uint32_t subdevice,
                                                  struct fsn_transfer *transfer);

/** Reads the SII up to the end of its categories, at most size_bytes; sets `size_bytes` to the
 *  length read.
 *  Context: the thread that calls fsn_core_poll(). May block for seconds; calls `between`. */
FSN_API FSN_MUST_USE fsn_status fsn_core_sii_read(struct fsn_core *core, uint32_t subdevice,
                                                  struct fsn_transfer *transfer);

/** Writes the station alias and the checksum of its block into the SII, and reads both back. The
 *  SubDevice uses them after its next power-on.
 *  @retval FSN_E_BUS_STATE  the values read back differ.
 *  Context: the thread that calls fsn_core_poll(). May block. */
FSN_API FSN_MUST_USE fsn_status fsn_core_alias_write(struct fsn_core *core, uint32_t subdevice,
                                                     uint16_t alias);

/** The same by position, on a bus opened with or without a plan. Context: its acyclic thread. */
FSN_API FSN_MUST_USE fsn_status fsn_acyclic_read_sii(const struct fsn_bus_acyclic *acyclic,
                                                     void *bus, struct fsn_transfer *transfer);

#ifdef __cplusplus
}
#endif

#endif
