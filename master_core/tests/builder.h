/** Builds plans for tests, independent of the Python writer: one table of records, then bytes. */
#ifndef FSN_TEST_BUILDER_H
#define FSN_TEST_BUILDER_H

#include <stddef.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>

/** Fails the test with place and text; never compiled out. */
#define CHECK(condition)                                                                           \
    do {                                                                                           \
        if (!(condition)) {                                                                        \
            fprintf(stderr, "%s:%d: not true: %s\n", __FILE__, __LINE__, #condition);              \
            exit(1);                                                                               \
        }                                                                                          \
    } while (0)

/** One sync manager of a test SubDevice: whole bytes, one PDO with 8-bit entries, or none. */
struct build_sm {
    uint8_t direction;
    uint32_t size_bytes;
};

/** One copy between two SubDevices; `sm` counts from 0 inside the SubDevice: 0 output, 1 input. */
struct build_copy {
    uint32_t from, source_byte, to, destination_byte, size_bytes;
};

/** A named entry: `sm` is the record number, 2 * SubDevice + 1 for its inputs. */
struct build_symbol {
    uint32_t sm, bit_offset, bits;
    uint8_t kind; /**< 0: unsigned */
    uint8_t restart_relevant;
    uint64_t stop_value;
    double factor, offset; /**< factor 0: 1 */
};

/** A recognised FSoE frame. */
struct build_block {
    uint32_t sm, byte_offset, size_bytes;
};

/** One of several buses, of SubDevices that follow each other. */
struct build_bus {
    uint32_t cycle_ns, first_subdevice, subdevice_count;
};

/** SubDevices that may be absent, found by the alias 0x0500 and the number of the first. */
struct build_group {
    uint32_t first_subdevice, subdevice_count;
    uint32_t has_place; /**< 1: all such groups have the same place */
};

/** A network of `count` SubDevices, each with one output and one input sync manager. */
struct build {
    uint32_t subdevices;
    const struct build_sm (*sm)[2];  /**< [subdevice][0 output, 1 input] */
    const struct build_copy *copies; /**< FSoE pairs: 2n to sub, 2n + 1 to main; then standard */
    uint32_t pairs, standard;
    uint32_t cycle_ns;
    const struct build_symbol *symbols;
    const struct build_block *blocks;              /**< sorted by sync manager and offset */
    uint32_t symbol_count, block_count, sdo_count; /**< all SDOs belong to the last SubDevice */
    const struct build_bus *buses;
    uint32_t bus_count; /**< more than 0: format 1.2 */
    const struct build_group *groups;
    uint32_t group_count; /**< more than 0: format 1.3 */
};

/** Returns plan bytes to be freed by the caller; copies are sorted by destination here. */
uint8_t *build_plan(const struct build *build, size_t *len_bytes);

/** Appends a name and assigns it to a record; returns the bytes, which may have moved. The CRC is
 *  not written. */
uint8_t *build_name(uint8_t *bytes, size_t *len_bytes, uint32_t section, uint32_t record,
                    const char *text);

/** Writes the CRC again after a test has changed bytes. */
void build_fix_crc(uint8_t *bytes, size_t len_bytes);

/** The e-stop pair: two SubDevices with 9 + 8 and 8 + 8 bytes, one connection of 6-byte frames. */
uint8_t *build_estop(size_t *len_bytes);

/** The e-stop pair with its four FSoE blocks, one SDO, and a byte of standard data after the
 *  frames: symbol 0 in the outputs of the main (bits 52 to 59), symbol 1 in its inputs. */
uint8_t *build_full(size_t *len_bytes);

/** The same in format 1.1: with a hash of safety functions, 32 bytes 0x5A. */
uint8_t *build_with_safety(size_t *len_bytes);

/** Pseudo random numbers that are the same on every machine. */
uint32_t next_random(uint64_t *state);

/** Number of open descriptors of this process; a test closes all that it opens. */
int open_files(void);

/** Name of this program as the kernel shows it: that of an emulator of processors where one runs
 * it. */
const char *program_name(void);

#endif
