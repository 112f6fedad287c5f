/** Cycles as lines, for the clients that watch them. */
#ifndef FSN_CONTROL_STREAM_H
#define FSN_CONTROL_STREAM_H

#include "control/requests/client.h"

/** Sends clients the completed cycles that they watch. */
void fsn_streams_serve(struct fsn_services *services);

/** Ends the subscription of a client. */
void fsn_stream_end(struct fsn_client *client);

#endif
