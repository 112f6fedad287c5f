/** Objects next to the cycle of the backend on IgH, and a bus without a plan. */
#include <errno.h>
#include <string.h>

#include "fsn/acyclic.h"
#include "igh_rig.h"
#include "plan/plan_internal.h"

/* -- objects -------------------------------------------------------------------------------- */

static void objects_are_reached_beside_the_cycle(void) {
    struct rig *rig = bring_up();
    uint8_t data[8] = {0};
    struct fsn_transfer t = {.index = 0xF980, .sub = 1, .data = data, .size_bytes = sizeof data};
    CHECK(fsn_core_upload(rig->core, 1, &t) == FSN_OK && t.size_bytes == 2 && data[0] == ADDRESS);
    t = (struct fsn_transfer){.index = 0xF980, .sub = 9, .data = data, .size_bytes = 8};
    CHECK(fsn_core_upload(rig->core, 1, &t) == FSN_E_BUS_SDO && t.abort_code != 0);
    t = (struct fsn_transfer){.index = 0x8000, .sub = 1, .data = data, .size_bytes = 1};
    CHECK(fsn_core_upload(rig->core, 1, &t) == FSN_E_SPACE);
    t.size_bytes = 4;
    memcpy(data, "abcd", 4);
    CHECK(fsn_core_download(rig->core, 1, &t) == FSN_OK);
    memset(data, 0, sizeof data);
    CHECK(fsn_core_upload(rig->core, 1, &t) == FSN_OK && memcmp(data, "abcd", 4) == 0);
    CHECK(fsn_core_upload(rig->core, 2, &t) == FSN_E_ARG);
    CHECK(fsn_core_sii_read(rig->core, 1, &t) == FSN_E_ABSENT);
    CHECK(fsn_core_alias_write(rig->core, 1, 5) == FSN_E_ABSENT);
    fake_unplug(1);
    run(rig, 50, FSN_AL_OP);
    CHECK(fsn_core_upload(rig->core, 1, &t) == FSN_E_BUS_MISSING);
    tear_down(rig);
}

static void a_bus_is_visited_without_a_plan(void) {
    const struct fsn_live_options options = {.interface = "0"};
    const struct fsn_bus_acyclic *acyclic = fsn_backend_igh()->ops->acyclic;
    struct rig *rig = set_up(); /* for its devices */
    struct fsn_bus_member member;
    struct fsn_fault fault;
    void *bus = NULL;
    bool changed = true;
    uint32_t entries[64];
    uint32_t count;
    uint16_t index;
    bool output;
    CHECK(fsn_backend_igh()->create(&options, &bus, &fault) == FSN_OK);
    CHECK(acyclic->visit(bus, &changed, &fault) == FSN_OK && !changed && acyclic->count(bus) == 2);
    CHECK(acyclic->member(bus, 1, &member) == FSN_OK && member.subdevice == FSN_NONE);
    CHECK(member.vendor_id == 2 && member.product_code != 0 && member.al_status == FSN_AL_PREOP);
    CHECK(acyclic->member(bus, 2, &member) == FSN_E_BUS_MISSING);
    CHECK(acyclic->pdo(bus, 1, 9, 0, &index, &output, entries, 64, &count) == FSN_E_ARG);
    acyclic->quit(bus);
    fake.reserved_by_other = true;
    CHECK(acyclic->visit(bus, &changed, &fault) == FSN_E_BUS_BUSY && fake.open_masters == 0);
    fsn_backend_igh()->free(bus);
    fake.reserved_by_other = false;
    tear_down(rig);
}

/* -- objects, once more ----------------------------------------------------------------------- */

static void errors_of_a_mailbox_have_a_status(void) {
    static const struct {
        int error;
        unsigned times;
        fsn_status status;
    } rows[] = {
        {-ENOBUFS, 1, FSN_E_SPACE},       {-EOVERFLOW, 1, FSN_E_SPACE},
        {-EOPNOTSUPP, 1, FSN_E_ABSENT},   {-EPROTONOSUPPORT, 1, FSN_E_ABSENT},
        {-EPROTO, 1, FSN_E_BUS_STATE},    {-EBADMSG, 1, FSN_E_BUS_STATE},
        {-EIO, 1, FSN_E_BUS_MAILBOX},     {-EINTR, 99, FSN_OK},
        {-EINTR, 100, FSN_E_BUS_MAILBOX}, {-EINVAL, 1, FSN_E_BUS_MISSING},
    };
    struct rig *rig = bring_up();
    for (size_t i = 0; i < 2 * sizeof rows / sizeof rows[0]; i++) {
        uint8_t data[4] = {1, 2, 3, 4};
        struct fsn_transfer t = {.position = 1, .index = 0x8000, .sub = 1, .data = data};
        t.size_bytes = sizeof data;
        fake.fails_from = fake.calls + 1;
        fake.fails_for = rows[i / 2].times;
        fake.fails_as = rows[i / 2].error;
        const struct fsn_bus_acyclic *acyclic = fsn_backend_igh()->ops->acyclic;
        CHECK((i % 2 == 0 ? acyclic->upload : acyclic->download)(rig->bus, &t) ==
              rows[i / 2].status);
    }
    tear_down(rig);
}

static void members_are_told_with_their_nodes(void) {
    const struct fsn_bus_acyclic *acyclic = fsn_backend_igh()->ops->acyclic;
    struct rig *rig = set_up();
    fake.device[0].info.serial_number = 77;
    fake.device[0].info.alias = 9;
    snprintf(fake.device[0].info.name, sizeof fake.device[0].info.name, "logic");
    CHECK(open_with(rig, 0) == FSN_OK);
    reach_op(rig);
    run(rig, 100, FSN_AL_OP);
    struct fsn_bus_member m;
    CHECK(acyclic->count(rig->bus) == 2 && acyclic->member(rig->bus, 0, &m) == FSN_OK);
    CHECK(m.subdevice == 0 && m.serial == 77 && m.alias == 9 && m.station == 1 && m.revision == 1);
    CHECK(strcmp(m.name, "logic") == 0 && m.ports == 0x0F && m.al_status == FSN_AL_OP);
    CHECK(m.errors_known && m.rx_errors[1] == 7 && m.link_lost[1] == 3 && m.link[0] == 1);
    CHECK(acyclic->place(rig->bus, 0) == 0 && acyclic->place(rig->bus, 1) == 1);
    CHECK(acyclic->place(rig->bus, 2) == FSN_NONE);
    fake.device[1].info.error_flag = 1;
    CHECK(acyclic->member(rig->bus, 1, &m) == FSN_OK);
    CHECK(m.subdevice == 1 && m.al_status == (FSN_AL_OP | FSN_AL_ERROR));
    fake.device[1].info.error_flag = 0;
    fake_unplug(1);
    run(rig, 40, FSN_AL_OP);
    CHECK(acyclic->place(rig->bus, 1) == FSN_NONE && acyclic->count(rig->bus) == 1);
    CHECK(acyclic->member(rig->bus, 1, &m) == FSN_E_BUS_MISSING && m.subdevice == FSN_NONE);
    fake.fails_from = fake.calls + 1;
    fake.fails_for = 1;
    fake.fails_as = -EIO;
    CHECK(acyclic->count(rig->bus) == 0);
    tear_down(rig);
    rig = set_up();
    fake.no_requests = true;
    CHECK(open_with(rig, 0) == FSN_OK && acyclic->member(rig->bus, 0, &m) == FSN_OK);
    CHECK(m.subdevice == FSN_NONE || !m.errors_known);
    tear_down(rig);
}

static void pdos_are_told_by_the_sii(void) {
    const struct fsn_bus_acyclic *acyclic = fsn_backend_igh()->ops->acyclic;
    struct rig *rig = bring_up();
    uint16_t index;
    bool output = true;
    uint32_t entries[4];
    uint32_t count;
    fake.device[1].sii_bits[2] = 24;
    CHECK(acyclic->pdo(rig->bus, 1, 2, 0, &index, &output, entries, 4, &count) == FSN_OK);
    CHECK(index == 0x1600 && !output && count == 2 && entries[0] == 8 && entries[1] == 16);
    CHECK(acyclic->pdo(rig->bus, 1, 2, 0, &index, &output, entries, 1, &count) == FSN_OK);
    CHECK(count == 1);
    CHECK(acyclic->pdo(rig->bus, 1, 2, 1, &index, &output, entries, 4, &count) == FSN_E_ARG);
    CHECK(acyclic->pdo(rig->bus, 1, 3, 0, &index, &output, entries, 4, &count) == FSN_E_ARG);
    fake.device[1].sii_bits[3] = 8;
    CHECK(acyclic->pdo(rig->bus, 1, 3, 0, &index, &output, entries, 4, &count) == FSN_E_ARG);
    fake.fails_from = fake.calls + 4; /* the second entry */
    fake.fails_for = 1;
    fake.fails_as = -EIO;
    CHECK(acyclic->pdo(rig->bus, 1, 2, 0, &index, &output, entries, 4, &count) == FSN_OK);
    CHECK(count == 1);
    tear_down(rig);
    /* Data that cannot be read completely is not checked: of the calls that fail in turn, four make
     * a wrong SII unknown. */
    unsigned unknown = 0;
    for (unsigned n = 1; n < 60; n++) {
        rig = set_up();
        fake.device[0].object_count = 0;
        fake.device[0].sii_bits[2] = 80;
        fake.fails_from = n;
        fake.fails_for = 1;
        fake.fails_as = -EIO;
        unknown += open_with(rig, 0) == FSN_OK;
        tear_down(rig);
    }
    CHECK(unknown == 4);
}

int main(void) {
    errors_of_a_mailbox_have_a_status();
    members_are_told_with_their_nodes();
    pdos_are_told_by_the_sii();
    objects_are_reached_beside_the_cycle();
    a_bus_is_visited_without_a_plan();
    return 0;
}
