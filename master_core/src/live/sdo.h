/** SDO transfers over a mailbox, step by step; all received data are treated as hostile input. */
#ifndef FSN_LIVE_SDO_H
#define FSN_LIVE_SDO_H

#include "fsn/acyclic.h"

enum { FSN_MAILBOX_BYTES = 1486, FSN_MAILBOX_LEAST = 16 };

/** The mailbox of one SubDevice. */
struct fsn_mailbox {
    void *context;
    uint16_t in_bytes, out_bytes; /**< length from it, length to it */
    /** Counter of the next message, 1 to 7. */
    uint8_t (*next_counter)(void *context);
    /** Discards the waiting messages, then sends `out_bytes` bytes. */
    bool (*send)(void *context, const uint8_t *message);
    /** The next message of `in_bytes` bytes; false on a timeout. */
    bool (*receive)(void *context, uint8_t *message);
};

/** Results as upload() and download() of fsn_bus_acyclic. */
fsn_status fsn_sdo_upload(const struct fsn_mailbox *mailbox, struct fsn_transfer *transfer);
fsn_status fsn_sdo_download(const struct fsn_mailbox *mailbox, struct fsn_transfer *transfer);

#endif
