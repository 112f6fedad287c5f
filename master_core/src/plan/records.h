/** Records of a plan file. Written by scripts/plan-records from fsoe_net/plan/records.py. */
#ifndef FSN_PLAN_RECORDS_H
#define FSN_PLAN_RECORDS_H

/* Section: number, bytes of one record. */
#define FSN_SECTION_TABLE(X)                                                                       \
    X(SUBDEVICE, 1, 48)                                                                            \
    X(SM, 2, 24)                                                                                   \
    X(PDO, 3, 16)                                                                                  \
    X(ENTRY, 4, 12)                                                                                \
    X(SDO, 5, 16)                                                                                  \
    X(SYMBOL, 6, 44)                                                                               \
    X(BLOCK, 7, 16)                                                                                \
    X(COPY, 8, 32)                                                                                 \
    X(CONNECTION, 9, 40)                                                                           \
    X(STRINGS, 10, 1)                                                                              \
    X(SAFETY, 11, 32)                                                                              \
    X(BUS, 12, 16)                                                                                 \
    X(GROUP, 13, 16)

/* SubDevice: type, name, first byte. */
#define FSN_SUBDEVICE_FIELDS(X)                                                                    \
    X(subdevice, u32, name, 0)                                                                     \
    X(subdevice, u16, alias, 4)                                                                    \
    X(subdevice, u16, position, 6)                                                                 \
    X(subdevice, u32, vendor_id, 8)                                                                \
    X(subdevice, u32, product_code, 12)                                                            \
    X(subdevice, u32, revision_low, 16)                                                            \
    X(subdevice, u32, revision_high, 20)                                                           \
    X(subdevice, u32, first_sm, 24)                                                                \
    X(subdevice, u32, sm_count, 28)                                                                \
    X(subdevice, u32, first_sdo, 32)                                                               \
    X(subdevice, u32, sdo_count, 36)                                                               \
    X(subdevice, u16, assign_activate, 40)                                                         \
    X(subdevice, u16, in_copy, 42)                                                                 \
    X(subdevice, u32, driver, 44)

/* Sync manager: type, name, first byte. */
#define FSN_SM_FIELDS(X)                                                                           \
    X(sm, u32, subdevice, 0)                                                                       \
    X(sm, u8, index, 4)                                                                            \
    X(sm, u8, direction, 5)                                                                        \
    X(sm, u8, watchdog, 6)                                                                         \
    X(sm, u8, registered, 7)                                                                       \
    X(sm, u32, bits, 8)                                                                            \
    X(sm, u32, first_pdo, 12)                                                                      \
    X(sm, u32, pdo_count, 16)                                                                      \
    X(sm, u32, reserved, 20)

/* PDO: type, name, first byte. */
#define FSN_PDO_FIELDS(X)                                                                          \
    X(pdo, u16, index, 0)                                                                          \
    X(pdo, u16, reserved, 2)                                                                       \
    X(pdo, u32, first_entry, 4)                                                                    \
    X(pdo, u32, entry_count, 8)                                                                    \
    X(pdo, u32, bit_offset, 12)

/* Entry: type, name, first byte. */
#define FSN_ENTRY_FIELDS(X)                                                                        \
    X(entry, u16, index, 0)                                                                        \
    X(entry, u8, subindex, 2)                                                                      \
    X(entry, u8, registered, 3)                                                                    \
    X(entry, u16, bits, 4)                                                                         \
    X(entry, u8, kind, 6)                                                                          \
    X(entry, u8, reserved, 7)                                                                      \
    X(entry, u32, bit_offset, 8)

/* Start-up SDO: type, name, first byte. */
#define FSN_SDO_FIELDS(X)                                                                          \
    X(sdo, u16, index, 0)                                                                          \
    X(sdo, u8, subindex, 2)                                                                        \
    X(sdo, u8, size_bytes, 3)                                                                      \
    X(sdo, u32, reserved, 4)                                                                       \
    X(sdo, u64, value, 8)

/* Symbol: type, name, first byte. */
#define FSN_SYMBOL_FIELDS(X)                                                                       \
    X(symbol, u32, name, 0)                                                                        \
    X(symbol, u32, sm, 4)                                                                          \
    X(symbol, u32, bit_offset, 8)                                                                  \
    X(symbol, u16, bits, 12)                                                                       \
    X(symbol, u8, kind, 14)                                                                        \
    X(symbol, u8, flags, 15)                                                                       \
    X(symbol, u32, reserved, 16)                                                                   \
    X(symbol, u64, stop_value, 20)                                                                 \
    X(symbol, u64, factor, 28)                                                                     \
    X(symbol, u64, offset, 36)

/* FSoE block: type, name, first byte. */
#define FSN_BLOCK_FIELDS(X)                                                                        \
    X(block, u32, sm, 0)                                                                           \
    X(block, u32, byte_offset, 4)                                                                  \
    X(block, u16, frame_bytes, 8)                                                                  \
    X(block, u16, safe_bytes, 10)                                                                  \
    X(block, u32, copied, 12)

/* Copy: type, name, first byte. */
#define FSN_COPY_FIELDS(X)                                                                         \
    X(copy, u32, source_sm, 0)                                                                     \
    X(copy, u32, source_bit, 4)                                                                    \
    X(copy, u32, destination_sm, 8)                                                                \
    X(copy, u32, destination_bit, 12)                                                              \
    X(copy, u32, bits, 16)                                                                         \
    X(copy, u32, net, 20)                                                                          \
    X(copy, u16, kind, 24)                                                                         \
    X(copy, u16, reserved, 26)                                                                     \
    X(copy, u32, connection, 28)

/* Connection: type, name, first byte. */
#define FSN_CONNECTION_FIELDS(X)                                                                   \
    X(connection, u32, name, 0)                                                                    \
    X(connection, u32, net, 4)                                                                     \
    X(connection, u32, main, 8)                                                                    \
    X(connection, u32, sub, 12)                                                                    \
    X(connection, u32, copy_to_sub, 16)                                                            \
    X(connection, u32, copy_to_main, 20)                                                           \
    X(connection, u16, connection_id, 24)                                                          \
    X(connection, u16, address, 26)                                                                \
    X(connection, u16, watchdog_ms, 28)                                                            \
    X(connection, u16, known, 30)                                                                  \
    X(connection, u16, safe_to_sub, 32)                                                            \
    X(connection, u16, safe_to_main, 34)                                                           \
    X(connection, u32, app_parameters, 36)

/* Bus: type, name, first byte. */
#define FSN_BUS_FIELDS(X)                                                                          \
    X(bus, u32, name, 0)                                                                           \
    X(bus, u32, cycle_ns, 4)                                                                       \
    X(bus, u32, first_subdevice, 8)                                                                \
    X(bus, u32, subdevice_count, 12)

/* Group: type, name, first byte. */
#define FSN_GROUP_FIELDS(X)                                                                        \
    X(group, u32, name, 0)                                                                         \
    X(group, u32, place, 4)                                                                        \
    X(group, u32, first_subdevice, 8)                                                              \
    X(group, u32, subdevice_count, 12)

#endif
