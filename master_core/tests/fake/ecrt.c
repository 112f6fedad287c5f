/** Set-up, scan and mailbox. */
#include <errno.h>
#include <stdio.h>
#include <string.h>

#include "master.h"

enum { ABORT_ABSENT = 0x06020000, ABORT_READ_ONLY = 0x06010002 };

struct fake fake;
static struct ec_master the_master;

static void note(const char *what) {
    const size_t used = strlen(fake.log);
    snprintf(fake.log + used, sizeof fake.log - used, "%s ", what);
}

bool fake_fails(void) {
    fake.calls++;
    const bool fails = fake.fails_from > 0 && fake.calls >= fake.fails_from &&
                       fake.calls < fake.fails_from + fake.fails_for;
    if (fails) {
        fake.failed++;
        errno = -fake.fails_as;
    }
    return fails;
}

/* -- for the tests -------------------------------------------------------------------------- */

void fake_reset(unsigned devices) {
    memset(&fake, 0, sizeof fake);
    fake.device_count = devices;
    for (unsigned n = 0; n < devices; n++) {
        fake.device[n].present = true;
        fake.device[n].al = 2;
        fake.device[n].info.vendor_id = 2;
        fake.device[n].info.product_code = 0x1000 + n;
        fake.device[n].info.revision_number = 1;
        fake_object(n, 0x1000, 0, 0x1389, 4, true);
    }
}

static struct fake_object *find(struct fake_device *device, uint16_t index, uint8_t sub) {
    for (unsigned i = 0; i < device->object_count; i++) {
        if (device->objects[i].index == index && device->objects[i].sub == sub) {
            return &device->objects[i];
        }
    }
    return NULL;
}

void fake_object(unsigned device, uint16_t index, uint8_t sub, uint32_t value, uint8_t size,
                 bool read_only) {
    struct fake_object *object = find(&fake.device[device], index, sub);
    if (object == NULL) {
        object = &fake.device[device].objects[fake.device[device].object_count++];
    }
    *object =
        (struct fake_object){.index = index, .sub = sub, .size = size, .read_only = read_only};
    for (unsigned i = 0; i < 4; i++) {
        object->data[i] = (uint8_t)(value >> (8 * i));
    }
}

void fake_unplug(unsigned device) {
    for (unsigned n = device; n < fake.device_count; n++) {
        fake.device[n].present = false;
    }
    fake.scans = 2;
}

void fake_plug(unsigned device) {
    for (unsigned n = device; n < fake.device_count; n++) {
        fake.device[n].present = true;
        fake.device[n].al = 1;
    }
    fake.scans = 2;
}

unsigned fake_line_length(void) {
    unsigned count = 0;
    while (count < fake.device_count && fake.device[count].present) {
        count++;
    }
    return count;
}

/* -- master --------------------------------------------------------------------------------- */

ec_master_t *ecrt_open_master(unsigned int index) {
    if (fake_fails()) {
        return NULL;
    }
    if (fake.no_master || index != 0) {
        errno = ENOENT;
        return NULL;
    }
    note("open");
    fake.open_masters++;
    memset(&the_master, 0, sizeof the_master);
    return &the_master;
}

int ecrt_master_reserve(ec_master_t *master) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    note("reserve");
    return fake.reserved_by_other ? -EBUSY : 0;
}

void ecrt_release_master(ec_master_t *master) {
    (void)master;
    note("release");
    fake.open_masters--;
}

int ecrt_master(ec_master_t *master, ec_master_info_t *info) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    *info = (ec_master_info_t){
        .slave_count = fake_line_length(), .link_up = !fake.link_down, .scan_busy = fake.scans > 0};
    if (fake.scans > 0) {
        info->slave_count = 0;
        fake.scans--;
    }
    return 0;
}

int ecrt_master_get_slave(ec_master_t *master, uint16_t position, ec_slave_info_t *info) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    fake.scans += fake.scan_in_look ? 2 : 0;
    fake.scan_in_look = false;
    if (fake.scans > 0 || position >= fake_line_length()) {
        return -EINVAL;
    }
    struct fake_device *device = &fake.device[position];
    *info = device->info;
    info->position = position;
    info->al_state = device->al;
    info->ports[0].link.link_up = 1;
    info->error_flag = device->info.error_flag || (device->refuses_preop && device->al == 1);
    return 0;
}

int ecrt_master_get_sync_manager(ec_master_t *master, uint16_t position, uint8_t sm,
                                 ec_sync_info_t *sync) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    if (position >= FAKE_DEVICES || sm >= SMS) {
        return -EINVAL;
    }
    *sync = (ec_sync_info_t){.index = sm, .n_pdos = fake.device[position].sii_bits[sm] > 0};
    return 0;
}

int ecrt_master_get_pdo(ec_master_t *master, uint16_t position, uint8_t sm, uint16_t pdo,
                        ec_pdo_info_t *info) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    *info = (ec_pdo_info_t){.index = 0x1600, .n_entries = 2};
    return pdo == 0 && fake.device[position].sii_bits[sm] > 8 ? 0 : -EINVAL;
}

int ecrt_master_get_pdo_entry(ec_master_t *master, uint16_t position, uint8_t sm, uint16_t pdo,
                              uint16_t entry, ec_pdo_entry_info_t *info) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    (void)pdo;
    const unsigned bits = fake.device[position].sii_bits[sm];
    *info = (ec_pdo_entry_info_t){.bit_length = (uint8_t)(entry == 0 ? 8 : bits - 8)};
    return 0;
}

/** Finds whose mailbox it is; or an error as of IgH 1.6. */
static int find_mailbox(uint16_t position, struct fake_device **device) {
    if (fake.scans > 0) {
        fake.sdo_while_scanning++;
        return -EIO;
    }
    if (position >= fake_line_length()) {
        return -EINVAL;
    }
    *device = &fake.device[position];
    return (*device)->al < 2 ? -EIO : (*device)->object_count == 0 ? -EPROTONOSUPPORT : 0;
}

int ecrt_master_sdo_upload(ec_master_t *master, uint16_t position, uint16_t index, uint8_t sub,
                           uint8_t *target, size_t room, size_t *size, uint32_t *abort_code) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    struct fake_device *device = NULL;
    const int error = find_mailbox(position, &device);
    if (error != 0) {
        return error;
    }
    const struct fake_object *object = find(device, index, sub);
    if (object == NULL) {
        *abort_code = ABORT_ABSENT;
        return -EIO;
    }
    if (object->size > room) {
        return -EOVERFLOW;
    }
    memcpy(target, object->data, object->size);
    *size = object->size;
    return 0;
}

int ecrt_master_sdo_download(ec_master_t *master, uint16_t position, uint16_t index, uint8_t sub,
                             const uint8_t *data, size_t size, uint32_t *abort_code) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    struct fake_device *device = NULL;
    const int error = find_mailbox(position, &device);
    if (error != 0) {
        return error;
    }
    fake.downloads++;
    note(fake.active ? "download-active" : "download");
    struct fake_object *object = find(device, index, sub);
    if (object == NULL || object->read_only || size != object->size) {
        *abort_code = object == NULL ? ABORT_ABSENT : ABORT_READ_ONLY;
        return -EIO;
    }
    memcpy(object->data, data, size);
    return 0;
}

int ecrt_master_set_send_interval(ec_master_t *master, size_t interval_us) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    fake.send_interval = (unsigned)interval_us;
    return 0;
}

int ecrt_master_activate(ec_master_t *master) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    note("activate");
    if (fake.activate_fails) {
        return -ENOMEM;
    }
    fake.active = true;
    return 0;
}

int ecrt_master_deactivate(ec_master_t *master) {
    (void)master;
    note("deactivate");
    fake.active = false;
    return 0;
}

int ecrt_master_reset(ec_master_t *master) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    for (unsigned n = 0; n < fake.device_count; n++) {
        fake.device[n].resets += fake.device[n].info.error_flag;
        fake.device[n].info.error_flag = 0;
    }
    return 0;
}

/* -- configuration -------------------------------------------------------------------------- */

ec_domain_t *ecrt_master_create_domain(ec_master_t *master) {
    if (fake_fails()) {
        return NULL;
    }
    return master->domain_count < DOMAINS ? &master->domain[master->domain_count++] : NULL;
}

/** Position of a configuration: so many places after the device with that alias. */
static unsigned ring_of(uint16_t alias, uint16_t position) {
    unsigned first = 0;
    while (alias != 0 && first < FAKE_DEVICES && fake.device[first].info.alias != alias) {
        first++;
    }
    return first + position;
}

ec_slave_config_t *ecrt_master_slave_config(ec_master_t *master, uint16_t alias, uint16_t position,
                                            uint32_t vendor_id, uint32_t product_code) {
    if (fake_fails()) {
        return NULL;
    }
    ec_slave_config_t *config = &master->config[master->config_count++];
    *config = (ec_slave_config_t){.position = (uint16_t)ring_of(alias, position),
                                  .vendor_id = vendor_id,
                                  .product_code = product_code};
    return config;
}

int ecrt_slave_config_sync_manager(ec_slave_config_t *config, uint8_t sm, ec_direction_t direction,
                                   ec_watchdog_mode_t watchdog) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    config->direction[sm] = direction;
    fake.device[config->position].watchdog[sm] = (int)watchdog;
    return 0;
}

int ecrt_slave_config_pdo_assign_clear(ec_slave_config_t *config, uint8_t sm) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)config;
    (void)sm;
    return 0;
}

int ecrt_slave_config_pdo_assign_add(ec_slave_config_t *config, uint8_t sm, uint16_t pdo) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    config->pdo[config->pdo_count++] = (struct pdo){.index = pdo, .sm = sm};
    return 0;
}

int ecrt_slave_config_pdo_mapping_clear(ec_slave_config_t *config, uint16_t pdo) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)config;
    (void)pdo;
    return 0;
}

int ecrt_slave_config_pdo_mapping_add(ec_slave_config_t *config, uint16_t pdo, uint16_t index,
                                      uint8_t sub, uint8_t bits) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)index;
    (void)sub;
    for (unsigned i = 0; i < config->pdo_count; i++) {
        config->pdo[i].bits += config->pdo[i].index == pdo ? bits : 0;
    }
    return 0;
}

int ecrt_slave_config_reg_pdo_entry_pos(ec_slave_config_t *config, uint8_t sm, unsigned int pdo,
                                        unsigned int entry, ec_domain_t *domain,
                                        unsigned int *bit) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)pdo;
    (void)entry;
    domain->config = config;
    domain->sm = sm;
    *bit = 0;
    return 0;
}

int ecrt_slave_config_dc(ec_slave_config_t *config, uint16_t assign_activate, uint32_t sync0_cycle,
                         int32_t sync0_shift, uint32_t sync1_cycle, int32_t sync1_shift) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    fake.device[config->position].assign_activate = assign_activate;
    fake.device[config->position].sync0_cycle = sync0_cycle;
    (void)sync0_shift;
    (void)sync1_cycle;
    (void)sync1_shift;
    return 0;
}

int ecrt_slave_config_sdo(ec_slave_config_t *config, uint16_t index, uint8_t sub,
                          const uint8_t *data, size_t size) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)config;
    (void)index;
    (void)sub;
    (void)data;
    (void)size;
    note("config-sdo");
    return 0;
}

struct fake_device *fake_attached(const ec_slave_config_t *config) {
    if (fake.scans > 0 || config->position >= fake_line_length()) {
        return NULL;
    }
    struct fake_device *device = &fake.device[config->position];
    const bool same = device->info.vendor_id == config->vendor_id &&
                      device->info.product_code == config->product_code;
    return same ? device : NULL;
}
