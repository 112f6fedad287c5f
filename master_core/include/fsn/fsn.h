/** Includes everything: load a plan, run it on a bus. */
#ifndef FSN_FSN_H
#define FSN_FSN_H

#include "fsn/bus.h"
#include "fsn/core.h"
#include "fsn/emulated.h"
#include "fsn/fsoe.h"
#include "fsn/handover.h"
#include "fsn/monitor.h"
#include "fsn/plan.h"
#include "fsn/scan.h"
#include "fsn/several.h"
#include "fsn/status.h"
#include "fsn/version.h"

#endif
