/** Version of the library; the plan format has a separate version, see plan.h. */
#ifndef FSN_VERSION_H
#define FSN_VERSION_H

#define FSN_VERSION_MAJOR 0
#define FSN_VERSION_MINOR 1
#define FSN_VERSION_PATCH 0
#define FSN_VERSION_STRING "0.1.0"

#endif
