/** Included before SOEM's ethercatmain.c, so that sii.c replaces a function of it: see there. */
#ifndef FSN_SOEM_WEAK_H
#define FSN_SOEM_WEAK_H

#pragma weak ecx_siifind

#endif
