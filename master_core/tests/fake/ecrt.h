/** The part of the programming interface of IgH EtherCAT Master 1.6 that the backend uses, declared
 *  here for its tests, so that they need no installation. The build of fsn_igh proves the backend
 *  against the real header. */
#ifndef FSN_FAKE_ECRT_H
#define FSN_FAKE_ECRT_H

#include <stddef.h>
#include <stdint.h>

enum { EC_MAX_STRING_LENGTH = 64, EC_MAX_PORTS = 4 };

typedef struct ec_master ec_master_t;
typedef struct ec_slave_config ec_slave_config_t;
typedef struct ec_domain ec_domain_t;
typedef struct ec_reg_request ec_reg_request_t;

typedef enum { EC_DIR_INVALID, EC_DIR_OUTPUT, EC_DIR_INPUT } ec_direction_t;
typedef enum { EC_WD_DEFAULT, EC_WD_ENABLE, EC_WD_DISABLE } ec_watchdog_mode_t;
typedef enum { EC_WC_ZERO, EC_WC_INCOMPLETE, EC_WC_COMPLETE } ec_wc_state_t;
typedef enum {
    EC_REQUEST_UNUSED,
    EC_REQUEST_BUSY,
    EC_REQUEST_SUCCESS,
    EC_REQUEST_ERROR
} ec_request_state_t;

typedef struct {
    unsigned int slave_count;
    unsigned int link_up : 1;
    uint8_t scan_busy;
    uint64_t app_time;
} ec_master_info_t;

typedef struct {
    uint8_t link_up, loop_closed, signal_detected;
} ec_slave_port_link_t;

typedef struct {
    uint16_t position;
    uint32_t vendor_id, product_code, revision_number, serial_number;
    uint16_t alias;
    struct {
        ec_slave_port_link_t link;
    } ports[EC_MAX_PORTS];
    uint8_t al_state, error_flag, sync_count;
    uint16_t sdo_count;
    char name[EC_MAX_STRING_LENGTH];
} ec_slave_info_t;

typedef struct {
    unsigned int working_counter;
    ec_wc_state_t wc_state;
    unsigned int redundancy_active;
} ec_domain_state_t;

typedef struct {
    uint16_t index;
    uint8_t subindex, bit_length;
} ec_pdo_entry_info_t;

typedef struct {
    uint16_t index;
    unsigned int n_entries;
    const ec_pdo_entry_info_t *entries;
} ec_pdo_info_t;

typedef struct {
    uint8_t index;
    ec_direction_t dir;
    unsigned int n_pdos;
    const ec_pdo_info_t *pdos;
    ec_watchdog_mode_t watchdog_mode;
} ec_sync_info_t;

ec_master_t *ecrt_open_master(unsigned int index);
int ecrt_master_reserve(ec_master_t *master);
void ecrt_release_master(ec_master_t *master);
int ecrt_master(ec_master_t *master, ec_master_info_t *info);
int ecrt_master_get_slave(ec_master_t *master, uint16_t position, ec_slave_info_t *info);
int ecrt_master_get_sync_manager(ec_master_t *master, uint16_t position, uint8_t sm,
                                 ec_sync_info_t *sync);
int ecrt_master_get_pdo(ec_master_t *master, uint16_t position, uint8_t sm, uint16_t pdo,
                        ec_pdo_info_t *info);
int ecrt_master_get_pdo_entry(ec_master_t *master, uint16_t position, uint8_t sm, uint16_t pdo,
                              uint16_t entry, ec_pdo_entry_info_t *info);
int ecrt_master_sdo_upload(ec_master_t *master, uint16_t position, uint16_t index, uint8_t sub,
                           uint8_t *target, size_t room, size_t *size, uint32_t *abort_code);
int ecrt_master_sdo_download(ec_master_t *master, uint16_t position, uint16_t index, uint8_t sub,
                             const uint8_t *data, size_t size, uint32_t *abort_code);
ec_domain_t *ecrt_master_create_domain(ec_master_t *master);
ec_slave_config_t *ecrt_master_slave_config(ec_master_t *master, uint16_t alias, uint16_t position,
                                            uint32_t vendor_id, uint32_t product_code);
int ecrt_master_set_send_interval(ec_master_t *master, size_t interval_us);
int ecrt_master_activate(ec_master_t *master);
int ecrt_master_deactivate(ec_master_t *master);
int ecrt_master_reset(ec_master_t *master);
int ecrt_master_send(ec_master_t *master);
int ecrt_master_receive(ec_master_t *master);
int ecrt_master_application_time(ec_master_t *master, uint64_t time_ns);
int ecrt_master_sync_slave_clocks(ec_master_t *master);
int ecrt_master_reference_clock_time(const ec_master_t *master, uint32_t *time_ns);

int ecrt_slave_config_sync_manager(ec_slave_config_t *config, uint8_t sm, ec_direction_t direction,
                                   ec_watchdog_mode_t watchdog);
int ecrt_slave_config_pdo_assign_clear(ec_slave_config_t *config, uint8_t sm);
int ecrt_slave_config_pdo_assign_add(ec_slave_config_t *config, uint8_t sm, uint16_t pdo);
int ecrt_slave_config_pdo_mapping_clear(ec_slave_config_t *config, uint16_t pdo);
int ecrt_slave_config_pdo_mapping_add(ec_slave_config_t *config, uint16_t pdo, uint16_t index,
                                      uint8_t sub, uint8_t bits);
int ecrt_slave_config_reg_pdo_entry_pos(ec_slave_config_t *config, uint8_t sm, unsigned int pdo,
                                        unsigned int entry, ec_domain_t *domain, unsigned int *bit);
int ecrt_slave_config_dc(ec_slave_config_t *config, uint16_t assign_activate, uint32_t sync0_cycle,
                         int32_t sync0_shift, uint32_t sync1_cycle, int32_t sync1_shift);
int ecrt_slave_config_sdo(ec_slave_config_t *config, uint16_t index, uint8_t sub,
                          const uint8_t *data, size_t size);
ec_reg_request_t *ecrt_slave_config_create_reg_request(ec_slave_config_t *config, size_t size);

uint8_t *ecrt_domain_data(const ec_domain_t *domain);
size_t ecrt_domain_size(const ec_domain_t *domain);
int ecrt_domain_process(ec_domain_t *domain);
int ecrt_domain_queue(ec_domain_t *domain);
int ecrt_domain_state(const ec_domain_t *domain, ec_domain_state_t *state);

uint8_t *ecrt_reg_request_data(const ec_reg_request_t *request);
ec_request_state_t ecrt_reg_request_state(const ec_reg_request_t *request);
int ecrt_reg_request_read(ec_reg_request_t *request, uint16_t address, size_t size);
int ecrt_reg_request_write(ec_reg_request_t *request, uint16_t address, size_t size);

#endif
