/** One SubDevice being surveyed, and the readers of its parts. */
#ifndef FSN_CONTROL_SURVEY_MEMBER_H
#define FSN_CONTROL_SURVEY_MEMBER_H

#include "control/survey/survey.h"

enum {
    FSN_SURVEY_SMS = 16,
    FSN_SURVEY_PDOS = 64,        /**< of one sync manager */
    FSN_SURVEY_TRANSFERS = 8192, /**< objects read of one SubDevice */
    FSN_SURVEY_PROBLEMS = 16,
    FSN_SURVEY_TEXT = 160,
    FSN_SURVEY_ENTRIES = 255,
    FSN_SURVEY_CONNECTIONS = 256, /**< of one SubDevice: modules of a SubDevice profile */
};

/** Contents of an SII; NULL and 0 if it could not be read. */
struct fsn_sii {
    const uint8_t *bytes;
    uint32_t size_bytes;
};

/** One SubDevice being surveyed. */
struct fsn_surveyed {
    const struct fsn_survey *survey;
    uint32_t position;
    struct fsn_bus_member member;
    struct fsn_sii sii;
    bool coe;     /**< objects can be read; until the first one without an answer */
    bool stopped; /**< aborted */
    uint32_t transfers;
    /** Objects with its FSoE connections, if its process data contain FSoE frames. */
    uint16_t fsoe_objects[FSN_SURVEY_CONNECTIONS];
    uint32_t fsoe_object_count;
    uint32_t half_read; /**< sync managers, as bits, of which a part could not be read */
    uint32_t problems;
    char problem[FSN_SURVEY_PROBLEMS][FSN_SURVEY_TEXT];
};

/** Reads what the bus reports about a position; returns as member() of fsn_bus_acyclic. */
fsn_status fsn_survey_begin(struct fsn_surveyed *of, const struct fsn_survey *survey,
                            uint32_t position);

__attribute__((format(printf, 2, 3))) void fsn_survey_problem(struct fsn_surveyed *of,
                                                              const char *format, ...);

/** Reads a number of up to 4 bytes; false, and 0, if it cannot be read (`of->coe` then shows
 *  whether further reads make sense). */
bool fsn_survey_number(struct fsn_surveyed *of, uint16_t index, uint8_t sub, uint32_t *value);
/** Reads a number of 2 bytes; false if there is none. */
bool fsn_survey_word(struct fsn_surveyed *of, uint16_t index, uint8_t sub, uint16_t *value);

/** Records an entry of its process data: index, subindex, bits (fsoe.c). */
void fsn_survey_entry(struct fsn_surveyed *of, uint32_t entry);

/** Writes "sms" (sync_managers.c). */
void fsn_survey_sms(struct fsn_surveyed *of, struct fsn_json *json);
/** Writes "fsoe", after fsn_survey_sms() (fsoe.c). */
void fsn_survey_fsoe(struct fsn_surveyed *of, struct fsn_json *json);

/* SII (sii.c). */

/** The next category of a type from byte *at on (0 at first); returns its bytes, or NULL. */
const uint8_t *fsn_survey_sii_category(const struct fsn_sii *sii, uint16_t type, uint32_t *at,
                                       uint32_t *size_bytes);
/** A string by its number; false if there is none. */
bool fsn_survey_sii_string(const struct fsn_sii *sii, unsigned number,
                           char room[FSN_NAME_BYTES * 4]);
/** Name of the device; false if there is none. */
bool fsn_survey_sii_name(const struct fsn_sii *sii, char room[FSN_NAME_BYTES * 4]);

/** A PDO of the SII. */
struct fsn_sii_pdo {
    uint16_t index;
    uint8_t sm, entries, name;
    const uint8_t *entry; /**< 8 bytes each */
};
/** The next PDO of outputs (or inputs); `at` and `inside` are 0 at first. */
bool fsn_survey_sii_pdo(const struct fsn_sii *sii, bool outputs, uint32_t *at, uint32_t *inside,
                        struct fsn_sii_pdo *pdo);

#endif
