#define _POSIX_C_SOURCE 200809L /* readlink() */
#include "app/base/explain.h"

#include <errno.h>
#include <stdio.h>
#include <string.h>
#include <unistd.h>

#include "app/base/holder.h"
#include "fsn/bus.h"

const char *explain_permission(const struct options *options) {
    static char text[640];
    char program[400];
    const ssize_t len = readlink("/proc/self/exe", program, sizeof program);
    snprintf(
        text, sizeof text,
        "it takes CAP_NET_RAW (interface), CAP_SYS_NICE (real-time) and CAP_IPC_LOCK (memory): "
        "setcap cap_net_raw,cap_sys_nice,cap_ipc_lock%s=ep %.*s, or run it as a service, see "
        "fsn-master.service",
        options->xdp ? ",cap_net_admin,cap_bpf" : "", len > 0 ? (int)len : 10,
        len > 0 ? program : "fsn-master");
    return text;
}

static const char *next_step(const struct fsn_fault *fault, const struct options *options) {
    if (fault->sys_errno == EPERM || fault->sys_errno == EACCES ||
        (fault->status == FSN_E_SYS && fault->sys_errno == ENOMEM)) { /* locked memory */
        return explain_permission(options);
    }
    if (fault->sys_errno == ENODEV || fault->sys_errno == ENXIO) {
        return "ip link lists the interfaces";
    }
    if (fault->sys_errno == EMSGSIZE) {
        return "ip link set IF mtu 1500, at both ends of the cable";
    }
    if (fault->sys_errno == EBUSY) {
        return "the kernel's admission control has no room for it; take a longer cycle or fifo";
    }
    return fsn_status_next_step(fault->status);
}

static void put_record(const struct fsn_fault *fault, const struct fsn_plan *plan, char *room,
                       size_t room_bytes) {
    struct fsn_subdevice_info info;
    room[0] = 0;
    if (fault->section == 0 || fault->copy_index == FSN_FAULT_NO_RECORD) {
        return;
    }
    const bool device = fault->section == 1 && plan != NULL &&
                        fsn_plan_subdevice(plan, fault->copy_index, &info) == FSN_OK;
    snprintf(room, room_bytes, "%s %u%s%.80s%s: ", fsn_section_name(fault->section),
             (unsigned)fault->copy_index, device ? " (" : "", device ? info.name : "",
             device ? ")" : "");
}

void explain_fault(const struct fsn_fault *fault, const struct fsn_plan *plan,
                   const struct options *options, char *room, size_t room_bytes) {
    char record[128];
    put_record(fault, plan, record, sizeof record);
    const char *rule = fault->rule != NULL ? fault->rule : fsn_status_text(fault->status);
    snprintf(room, room_bytes, "%s: %s%s%s%.160s%s%s; %s", fsn_status_name(fault->status), record,
             rule, fault->detail[0] != 0 ? ": " : "", fault->detail,
             fault->sys_errno != 0 ? ": " : "",
             fault->sys_errno != 0 ? strerror(fault->sys_errno) : "", next_step(fault, options));
}

static void add_holder(const char *interface, char *room, size_t room_bytes) {
    char name[64];
    char text[HOLDER_TEXT_BYTES];
    const size_t used = strlen(room);
    snprintf(name, sizeof name, "@fsn-maindevice:%.15s", interface != NULL ? interface : "");
    if (interface != NULL && holder_text(name, text)[0] != 0) {
        snprintf(room + used, room_bytes - used, "; %.15s is %s", interface, text);
    }
}

void explain_bus_fault(const struct fsn_fault *fault, const struct fsn_plan *plan,
                       const struct options *options, char *room, size_t room_bytes) {
    explain_fault(fault, plan, options, room, room_bytes);
    if (fault->status != FSN_E_BUS_BUSY) {
        return;
    }
    for (size_t i = 0; i < options->interface_count; i++) {
        const char *after = strchr(options->interfaces[i], '='); /* BUS=INTERFACE */
        add_holder(after != NULL ? after + 1 : options->interfaces[i], room, room_bytes);
    }
    add_holder(options->redundant, room, room_bytes);
}
