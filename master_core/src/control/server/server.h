/** The server of the socket. One thread. */
#ifndef FSN_CONTROL_SERVER_H
#define FSN_CONTROL_SERVER_H

#include <sys/stat.h>

#include "control/incidents/changes.h"
#include "control/requests/client.h"
#include "control/server/control.h"

struct fsn_control {
    struct fsn_services services;
    struct fsn_changes changes;
    const struct fsn_control_access *access;
    struct fsn_client client[FSN_CONTROL_CLIENTS];
    uint64_t polled_ns; /**< data sent before this time has been read when clients are served */
    uint32_t last_number;
    uint64_t
        turned_away_due_ns; /**< of fsn_pace_allows(): events about users that may not connect */
    uint32_t turned_away;   /**< attempts since the last event */
    size_t first_observer;  /**< the first to be served */
    int listener;           /**< -1: none */
    char path[108];         /**< as long as the system allows */
    dev_t device;           /**< of the socket's file, so that only our own file is removed */
    ino_t inode;
};

/** Closes the socket and removes its file, if it is still our own. */
void fsn_control_close_socket(struct fsn_control *control);

#endif
