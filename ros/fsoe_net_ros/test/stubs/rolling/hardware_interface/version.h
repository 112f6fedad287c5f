// Stub, see README.md.
#pragma once
#define HARDWARE_INTERFACE_VERSION_MAJOR 6
