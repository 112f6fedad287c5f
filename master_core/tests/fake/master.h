/** Data shared by the two files of the fake. */
#ifndef FSN_FAKE_MASTER_H
#define FSN_FAKE_MASTER_H

#include "fake.h"

enum { PDOS = 16, ENTRIES = 32, SMS = 4, DOMAINS = 2 * FAKE_DEVICES, REGISTER_BYTES = 20 };

struct pdo {
    uint16_t index;
    uint8_t sm;
    unsigned bits;
};

struct ec_reg_request {
    uint8_t data[REGISTER_BYTES];
    uint16_t address;
    bool writes;
    ec_request_state_t state;
};

struct ec_slave_config {
    uint16_t position;
    uint32_t vendor_id, product_code;
    ec_direction_t direction[SMS];
    struct pdo pdo[PDOS];
    unsigned pdo_count;
    struct ec_reg_request request;
    unsigned pause; /**< sends until it notices that a device left its state */
};

enum datagram { IDLE, QUEUED, SENT, RECEIVED, LOST };

struct ec_domain {
    ec_slave_config_t *config;
    uint8_t sm;
    uint8_t data[FAKE_BYTES];
    enum datagram datagram;
    unsigned counter, processed;
};

struct ec_master {
    struct ec_slave_config config[FAKE_DEVICES];
    unsigned config_count;
    struct ec_domain domain[DOMAINS];
    unsigned domain_count;
    bool synced;
};

/** Devices that answer, from the first on. */
unsigned fake_line_length(void);
/** The device a configuration is attached to, or NULL. */
struct fake_device *fake_attached(const ec_slave_config_t *config);

#endif
