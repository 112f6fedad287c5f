/** Status codes: negative, stable, one table. Details of a refusal are in a caller-owned fault. */
#ifndef FSN_STATUS_H
#define FSN_STATUS_H

#include <stdbool.h>
#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

#if defined(__GNUC__)
#define FSN_API __attribute__((visibility("default")))
#define FSN_MUST_USE __attribute__((warn_unused_result))
#else
#define FSN_API
#define FSN_MUST_USE
#endif

/** Name, value, text. Values never change; new ones are added. */
#define FSN_STATUS_TABLE(X)                                                                        \
    X(OK, 0, "done")                                                                               \
    X(E_ARG, -1, "an argument is not allowed")                                                     \
    X(E_NOMEM, -2, "out of memory")                                                                \
    X(E_STATE, -3, "not possible in this state")                                                   \
    X(E_SYS, -4, "the operating system refused; see sys_errno")                                    \
    X(E_BUSY, -5, "no stable snapshot could be taken; try again")                                  \
    X(E_SPACE, -6, "the given buffer is too small")                                                \
    X(E_CLOSED, -7, "this output is closed to writes")                                             \
    X(E_ABSENT, -8, "this build does not contain what was requested")                              \
    X(E_PLAN_MAGIC, -20, "these bytes are not a plan")                                             \
    X(E_PLAN_VERSION, -21, "the plan format has another version")                                  \
    X(E_PLAN_LENGTH, -22, "the length does not fit; the plan is cut off or too long")              \
    X(E_PLAN_CRC, -23, "CRC-32 does not fit; the plan was changed")                                \
    X(E_PLAN_SECTION, -24, "the section table is damaged")                                         \
    X(E_PLAN_RESERVED, -25, "a reserved field or an unknown flag is not zero")                     \
    X(E_PLAN_STRING, -26, "a string lies outside the strings or has a control character")          \
    X(E_PLAN_REFERENCE, -27, "a record refers to a record that does not exist or is not its own")  \
    X(E_PLAN_LAYOUT, -28, "entries do not add up to their sync manager")                           \
    X(E_PLAN_VALUE, -29, "a value is not allowed")                                                 \
    X(E_COPY_RANGE, -40, "bytes lie outside their sync manager")                                   \
    X(E_COPY_DIRECTION, -41, "a copy must read an input and write an output")                      \
    X(E_COPY_ALIGN, -42, "a copy does not start and end on a byte")                                \
    X(E_COPY_OVERLAP, -43, "two destinations overlap, or copies are not sorted")                   \
    X(E_COPY_FRAME, -44, "a copy does not cover exactly one FSoE frame")                           \
    X(E_COPY_PAIR, -45, "a connection is not a pair of opposite copies")                           \
    X(E_BUS_IMAGE, -60, "the bus gives a sync manager no place inside its image")                  \
    X(E_BUS_OVERLAP, -61, "the bus lays inputs over outputs")                                      \
    X(E_BUS_STRADDLE, -62, "a copy would be split over two datagrams")                             \
    X(E_BUS_BUSY, -63, "another MainDevice is talking on this interface")                          \
    X(E_BUS_SILENT, -64, "no SubDevice answers on this interface")                                 \
    X(E_BUS_MISSING, -65, "a SubDevice of the plan is missing")                                    \
    X(E_BUS_IDENTITY, -66, "a SubDevice is not the one in the plan")                               \
    X(E_BUS_MAPPING, -67, "a SubDevice maps other process data than the plan")                     \
    X(E_BUS_ADDRESS, -68, "a SubDevice has another FSoE address than the plan")                    \
    X(E_BUS_SDO, -69, "a SubDevice refuses a start-up SDO")                                        \
    X(E_BUS_STATE, -70, "a SubDevice does not reach the requested state")                          \
    X(E_BUS_CLOCK, -71, "the clock of a SubDevice cannot be set")                                  \
    X(E_BUS_MAILBOX, -72, "a SubDevice does not answer an SDO")

/** Result of every call that can fail. */
typedef enum fsn_status {
#define FSN_STATUS_ENUM(name, value, text) FSN_##name = (value),
    FSN_STATUS_TABLE(FSN_STATUS_ENUM)
#undef FSN_STATUS_ENUM
} fsn_status;

/** A fault that is not about a single record. */
#define FSN_FAULT_NO_RECORD 0xFFFFFFFFu
enum { FSN_DETAIL_BYTES = 160 };

/** Position and reason of a refusal. Owned by the caller, written by each refusal. */
struct fsn_fault {
    fsn_status status;
    uint32_t section;    /**< plan section, 1 … 10; 0 for the header or no plan at all */
    uint32_t copy_index; /**< number of the record in its section: in section 8, of the copy */
    uint32_t byte;       /**< offset in the plan file, bytes; 0 if the bus is wrong, not the file */
    int sys_errno;       /**< errno of the failed system call, otherwise 0 */
    bool link_down;      /**< FSN_E_BUS_SILENT: an interface of the bus has no link */
    const char *rule; /**< the rule that is broken, as text; static, never NULL after a refusal */
    char detail[FSN_DETAIL_BYTES]; /**< the value found instead; often empty */
};

/** Returns the version of the loaded library, e.g. "0.1.0"; FSN_VERSION_STRING is that of the
 *  headers. Context: any thread. */
FSN_API const char *fsn_version(void);

/** Returns "FSN_E_COPY_RANGE" and the like; "FSN_E_?" for an unknown value. Context: any thread. */
FSN_API const char *fsn_status_name(fsn_status status);

/** Returns the status as one sentence. Context: any thread. */
FSN_API const char *fsn_status_text(fsn_status status);

/** Returns the remedy for a status as one line of text; empty for FSN_OK. Context: any thread. */
FSN_API const char *fsn_status_next_step(fsn_status status);

/** Returns the name of a plan section, e.g. "copy". Context: any thread. */
FSN_API const char *fsn_section_name(uint32_t section);

#ifdef __cplusplus
}
#endif

#endif
