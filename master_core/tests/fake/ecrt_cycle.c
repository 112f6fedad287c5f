/** The cyclic calls, and the work next to them. */
#include <errno.h>
#include <string.h>

#include "master.h"

/* -- cycle ---------------------------------------------------------------------------------- */

static bool is_interrupted(void) {
    fake.interrupted -= fake.interrupted > 0;
    return fake.interrupted > 0;
}

static void serve(ec_slave_config_t *config) {
    ec_reg_request_t *request = &config->request;
    struct fake_device *device = fake_attached(config);
    if (request->state != EC_REQUEST_BUSY || device == NULL || fake.deaf) {
        return;
    }
    if (request->writes && request->address == 0x0120) {
        device->al = request->data[0];
        config->pause = 5;
    } else if (request->address == 0x0130) {
        memset(request->data, 0, 6);
        request->data[0] = (uint8_t)(device->al | (device->al_code != 0 ? 0x10 : 0));
        request->data[4] = device->al_code;
    } else if (request->address == 0x0300) {
        request->data[2] = 7;
        request->data[0x11] = 3;
    }
    request->state = EC_REQUEST_SUCCESS;
}

static void bring_up(ec_slave_config_t *config) {
    struct fake_device *device = fake_attached(config);
    if (config->pause > 0) {
        config->pause--;
        return;
    }
    if (device == NULL || device->al == 8 || device->info.error_flag) {
        return;
    }
    if (device->al == 4 && device->refuses_op) {
        device->info.error_flag = 1;
        device->al_code = 0x1B;
        return;
    }
    device->al = (uint8_t)(2 * device->al);
}

int ecrt_master_send(ec_master_t *master) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    if (is_interrupted()) {
        return -EINTR;
    }
    for (unsigned d = 0; d < master->domain_count; d++) {
        if (master->domain[d].datagram == QUEUED) {
            master->domain[d].datagram = SENT;
        }
    }
    for (unsigned c = 0; c < master->config_count; c++) {
        serve(&master->config[c]);
        bring_up(&master->config[c]);
    }
    return 0;
}

/** The interface does not define the content of a domain that did not come back. */
static void scribble(ec_domain_t *domain) {
    memset(domain->data, 0xDD, sizeof domain->data);
}

static size_t bytes_of(const ec_domain_t *domain) {
    unsigned bits = 0;
    for (unsigned i = 0; i < domain->config->pdo_count; i++) {
        bits += domain->config->pdo[i].sm == domain->sm ? domain->config->pdo[i].bits : 0;
    }
    return (bits + 7) / 8;
}

static void answer(ec_domain_t *domain) {
    struct fake_device *device = &fake.device[domain->config->position];
    domain->datagram = RECEIVED;
    domain->counter = 0;
    if (domain->config->position >= fake_line_length() || device->mute || device->al < 4) {
        scribble(domain);
        return;
    }
    domain->counter = 1;
    if (domain->config->direction[domain->sm] == EC_DIR_OUTPUT) {
        memcpy(device->outputs, domain->data, bytes_of(domain));
        device->output_sets++;
    } else {
        memcpy(domain->data, device->inputs, bytes_of(domain));
    }
}

int ecrt_master_receive(ec_master_t *master) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    if (is_interrupted()) {
        return -EINTR;
    }
    for (unsigned d = 0; d < master->domain_count; d++) {
        ec_domain_t *domain = &master->domain[d];
        if (domain->datagram == SENT && fake.lose_frames) {
            domain->datagram = LOST;
            scribble(domain);
        } else if (domain->datagram == SENT) {
            answer(domain);
        }
    }
    return 0;
}

uint8_t *ecrt_domain_data(const ec_domain_t *domain) {
    return fake_fails() ? NULL : ((ec_domain_t *)(uintptr_t)domain)->data;
}

size_t ecrt_domain_size(const ec_domain_t *domain) {
    return fake_fails() ? 0 : bytes_of(domain);
}

/** As the real one: what was received once counts until it is queued again. */
int ecrt_domain_process(ec_domain_t *domain) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    domain->processed = domain->datagram == RECEIVED ? domain->counter : 0;
    return 0;
}

int ecrt_domain_queue(ec_domain_t *domain) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    if (is_interrupted()) {
        return -EINTR;
    }
    domain->datagram = QUEUED;
    return 0;
}

int ecrt_domain_state(const ec_domain_t *domain, ec_domain_state_t *state) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    *state = (ec_domain_state_t){.working_counter = domain->processed,
                                 .wc_state = domain->processed == 1 ? EC_WC_COMPLETE : EC_WC_ZERO};
    return 0;
}

int ecrt_master_application_time(ec_master_t *master, uint64_t time_ns) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    fake.app_time = time_ns;
    return 0;
}

int ecrt_master_sync_slave_clocks(ec_master_t *master) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    fake.clock_syncs++;
    return 0;
}

int ecrt_master_reference_clock_time(const ec_master_t *master, uint32_t *time_ns) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    (void)master;
    fake.clock_reads++;
    *time_ns = fake.reference_time;
    return fake.reference_time != 0 ? 0 : -ENXIO;
}

/* -- register requests ---------------------------------------------------------------------- */

ec_reg_request_t *ecrt_slave_config_create_reg_request(ec_slave_config_t *config, size_t size) {
    if (fake_fails()) {
        return NULL;
    }
    return fake.no_requests || size > REGISTER_BYTES ? NULL : &config->request;
}

uint8_t *ecrt_reg_request_data(const ec_reg_request_t *request) {
    return ((ec_reg_request_t *)(uintptr_t)request)->data;
}

ec_request_state_t ecrt_reg_request_state(const ec_reg_request_t *request) {
    return request->state;
}

static int start(ec_reg_request_t *request, uint16_t address, bool writes) {
    request->address = address;
    request->writes = writes;
    request->state = EC_REQUEST_BUSY;
    return 0;
}

int ecrt_reg_request_read(ec_reg_request_t *request, uint16_t address, size_t size) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    return size > REGISTER_BYTES ? -ENOBUFS : start(request, address, false);
}

int ecrt_reg_request_write(ec_reg_request_t *request, uint16_t address, size_t size) {
    if (fake_fails()) {
        return fake.fails_as;
    }
    return size > REGISTER_BYTES ? -ENOBUFS : start(request, address, true);
}
