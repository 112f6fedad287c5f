/** Modules that answer requests, combined in one structure. */
#ifndef FSN_CONTROL_SERVICES_H
#define FSN_CONTROL_SERVICES_H

#include "control/incidents/incidents.h"
#include "control/jobs/queue.h"
#include "control/reports/bus_view.h"
#include "control/reports/events.h"
#include "control/requests/quota.h"

struct fsn_client;

struct fsn_services {
    struct fsn_bus_view view;
    struct fsn_events events;
    struct fsn_quotas quotas; /**< of events about refusals */
    struct fsn_job_queue jobs;
    struct fsn_incidents *incidents; /**< NULL: none are recorded */
    struct fsn_client *client;       /**< the places of all clients, used and free */
    size_t clients;                  /**< number of places */
    struct fsn_json line;            /**< the cycle being written for a client */
};

#endif
