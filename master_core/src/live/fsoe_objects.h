/** Objects by which SubDevices describe their FSoE connections. */
#ifndef FSN_LIVE_FSOE_OBJECTS_H
#define FSN_LIVE_FSOE_OBJECTS_H

#include "fsn/plan.h"

/** Subindices of the communication parameters of a connection, identical in the manuals of Bosch
 *  Rexroth (ctrlX SAFETY), BBH (SCU), SICK (microScan3), Yaskawa (SLIO), KEB and Novanta, which
 *  refers to ETG.5001.4 and ETG.6100.3. */
enum fsn_parameter {
    FSN_PARAMETER_VERSION = 1,
    FSN_PARAMETER_ADDRESS,
    FSN_PARAMETER_CONNECTION_ID,
    FSN_PARAMETER_WATCHDOG_MS,
    FSN_PARAMETER_SIDE = 6, /**< 0: it is the MainInstance, 1: the SubInstance */
};

enum {
    FSN_ADDRESSES = 0xF980,  /**< FSoE addresses of the SubInstances of a SubDevice */
    FSN_CONNECTIONS = 0xE901 /**< parameters of the first connection of a safety device */
};

/** Communication parameters of the connection whose frames have their command in an object: 0x9nn1
 *  for 0x6nn0 and 0x7nn0, 0xE9n1 for 0xE6n0 and 0xE7n0, 0x6791 for the frame of a CiA 402 drive;
 *  0: none. Context: any thread. */
uint16_t fsn_parameter_object(uint16_t command_index);

/** Object with the state of the connection with these parameters: 0xAnn0, 0xEAn0; 0: unknown. */
uint16_t fsn_diagnosis_object(uint16_t parameter_index);

/** Object mapped at a bit of a sync manager; 0: none begins there, or it is padding. */
uint16_t fsn_object_at(const struct fsn_plan *plan, uint32_t sm, uint32_t bit);

#endif
