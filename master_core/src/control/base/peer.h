/** Identity of the sender of a message or a signal, from the kernel and the machine. */
#ifndef FSN_CONTROL_PEER_H
#define FSN_CONTROL_PEER_H

#include <sys/types.h>

#include "control/base/json.h"

enum { FSN_PEER_TEXT_BYTES = 160 };

/** Permissions of a client; each role includes those before it. */
enum fsn_role {
    FSN_NO_ROLE,    /**< may not connect */
    FSN_OBSERVER,   /**< data that are already known: no access to bus, file or output */
    FSN_OPERATOR,   /**< outputs, leases, arming, incidents, diagnosis messages, scans */
    FSN_MAINTAINER, /**< everything: objects, aliases, start and stop */
    FSN_ROLES
};

/** Name of a role, such as "observer". */
const char *fsn_role_name(enum fsn_role role);

/** The role with this name; FSN_NO_ROLE: unknown. */
enum fsn_role fsn_role_of(const char *name);

struct fsn_peer {
    pid_t pid;
    uid_t uid;
    char user[33];    /**< name in /etc/passwd; empty: none */
    char program[17]; /**< name reported by the process; empty: unknown */
};

/** Looks up names for a process. Reads two local files and uses no name service, which may be slow.
 *  Context: control thread, or before any thread. */
void fsn_peer_read(struct fsn_peer *peer, pid_t pid, uid_t uid);

/** Adds pid, uid, user and program to an object; null if unknown. */
void fsn_peer_put(const struct fsn_peer *peer, struct fsn_json *json);

/** The peer in words: "pid 12 (fsoe-net), uid 1000 (anna)".   @return room. */
const char *fsn_peer_text(const struct fsn_peer *peer, char room[FSN_PEER_TEXT_BYTES]);

#endif
