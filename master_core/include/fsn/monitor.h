/** Follows a connection from its frames, starting at any time; never changes a byte. */
#ifndef FSN_MONITOR_H
#define FSN_MONITOR_H

#include <stdbool.h>
#include <stdint.h>

#include "fsn/fsoe.h"

#ifdef __cplusplus
extern "C" {
#endif

/** State of a connection, derived from the commands in both directions. */
enum fsn_observed {
    FSN_OBSERVED_SILENT = 0, /**< no frame in at least one direction */
    FSN_OBSERVED_RESET = 1,
    FSN_OBSERVED_SESSION = 2,
    FSN_OBSERVED_CONNECTION = 3,
    FSN_OBSERVED_PARAMETER = 4,
    FSN_OBSERVED_DATA_FAILSAFE = 5, /**< FailSafeData in at least one direction */
    FSN_OBSERVED_DATA_PROCESS = 6,  /**< ProcessData in both directions */
    FSN_OBSERVED_UNKNOWN = 7        /**< a command that no FSoE frame has */
};

/** Result of the check of one frame. */
enum fsn_verdict {
    FSN_VERDICT_SAME = 0,     /**< same bytes as before, so not an event */
    FSN_VERDICT_RIGHT = 1,    /**< every CRC matches the chain */
    FSN_VERDICT_WRONG = 2,    /**< a CRC does not match */
    FSN_VERDICT_UNCHECKED = 3 /**< the chain is not yet known, or frames were missed */
};

/** Direction of a frame, and index of fsn_connection_status.direction. */
enum fsn_way { FSN_TO_SUB = 0, FSN_TO_MAIN = 1 };

/** Observations of one direction of a connection. */
struct fsn_direction {
    uint64_t frames;        /**< new frames: at least one byte differs from the previous one */
    uint64_t process_data;  /**< of these, ProcessData */
    uint64_t failsafe_data; /**< of these, FailSafeData */
    uint64_t right;         /**< of the frames, those whose CRCs match the chain */
    uint64_t wrong;         /**< of the frames, those with a CRC that does not match */
    uint64_t unchecked;     /**< of the frames, those received while the chain was unknown */
    uint64_t resets;        /**< how often a Reset followed another command */
    uint64_t last_new_ns;   /**< time of the last new frame */
    uint64_t interval_last_ns, interval_min_ns, interval_max_ns; /**< between new data frames */
    uint64_t interval_sum_ns, intervals;
    uint16_t connection_id; /**< last two bytes of the frame */
    uint8_t command;        /**< first byte of the frame */
    uint8_t reset_code;     /**< data byte of the last Reset */
};

/** Bits of the parameters of a connection that are known, or that differ; those of
 *  fsn_connection_info.known. */
enum fsn_stated {
    FSN_STATED_CONNECTION_ID = 1,
    FSN_STATED_ADDRESS = 2,
    FSN_STATED_WATCHDOG = 4,
    FSN_STATED_APP = 8
};

/** Parameters of a connection, as sent by its main in Connection and Parameter frames. */
struct fsn_parameters {
    uint32_t app_crc;       /**< CRC-32 (IEEE 802.3) of the application parameters */
    uint16_t app_bytes;     /**< their length */
    uint16_t connection_id; /**< in the data of the Connection frames */
    uint16_t address;       /**< FSoE address of the sub */
    uint16_t watchdog_ms;
    uint32_t known; /**< enum fsn_stated; the others are 0 */
};

/** Observations of a connection. */
struct fsn_connection_status {
    struct fsn_direction direction[2]; /**< enum fsn_way */
    /** Parameters that the main sent in its last start-up. They are known only if all of its frames
     *  were received from the Session on, with correct CRCs. A Reset does not change them. */
    struct fsn_parameters parameters;
    /** Bits of the parameters that differed from the plan when they were last known; only the core,
     *  which has a plan, sets them. */
    uint32_t differs;
    uint32_t observed; /**< enum fsn_observed */
    /** How often the chain was lost and recovered without a Reset: frames were missed, so a frame
     *  that counted as wrong or unchecked at that point was not a fault of the channel. */
    uint32_t gaps;
};

/** One direction as remembered by the monitor; 0 means unknown for both numbers. */
struct fsn_followed {
    uint32_t size_bytes;
    uint16_t sequence; /**< number of the next frame */
    uint16_t guess;    /**< number of the next frame, if the calculated one was correct */
    uint16_t own;      /**< CRC_0 of the last frame, for the collision rule (§3) */
    bool has_own;
    uint8_t last[FSN_MAX_FRAME_BYTES];
};

/** The list of parameters that the main is sending, in chunks. */
struct fsn_sent_list {
    uint32_t count;  /**< bytes of it received so far */
    uint32_t crc;    /**< CRC-32 of the data after its head, before its last step */
    uint8_t head[6]; /**< its first bytes */
    uint8_t command; /**< of its frames; 0: the start-up is not followed */
};

/** A connection being followed: `status` to read, the rest is private. Holds no pointer and may be
 *  copied. */
struct fsn_monitor {
    struct fsn_connection_status status;
    struct fsn_followed followed[2];
    struct fsn_sent_list sent;
    uint16_t last_crc; /**< CRC_0 of the last frame of either direction */
    uint8_t last_way;  /**< its sender; 2: none */
    bool lost;         /**< the chain was known, and no Reset has occurred since */
};

/** Starts following a connection.
 *  @param[in] to_sub_bytes, to_main_bytes  lengths of the frames, valid FSoE lengths.
 *  @retval FSN_E_ARG  invalid FSoE frame length.
 *  Context: any thread. RT-safe. */
FSN_API FSN_MUST_USE fsn_status fsn_monitor_init(struct fsn_monitor *monitor, uint32_t to_sub_bytes,
                                                 uint32_t to_main_bytes);

/** Observes the bytes of one direction in the image. All zeros before the first frame are not a
 *  frame.
 *  @param[in] way     enum fsn_way.
 *  @param[in] frame   frame of the length passed to fsn_monitor_init() for this direction.
 *  @param[in] now_ns  time of the observation, nanoseconds; any clock, never decreasing.
 *  Context: the thread that owns the monitor. RT-safe: no allocation, lock or system call.
 *  Cost: O(length). */
FSN_API enum fsn_verdict fsn_monitor_frame(struct fsn_monitor *monitor, enum fsn_way way,
                                           const uint8_t *frame, uint64_t now_ns);

/** Whether to observe the frame of the sub first, if both frames are new in one cycle. The sub
 *  answers the main, so the frame of the main comes first. But the main may start a new session
 *  before the answer to its previous frame arrives; that answer still belongs to the old session.
 *  @retval true  the frame of the sub is first.
 *  Context: the thread that owns the monitor. RT-safe. Cost: O(length). */
FSN_API bool fsn_monitor_sub_first(const struct fsn_monitor *monitor, const uint8_t *to_sub,
                                   const uint8_t *to_main);

#ifdef __cplusplus
}
#endif

#endif
