// Stub, see README.md.
#pragma once
#include <cstdint>
#include <hardware_interface/version.h>
namespace hardware_interface {
#if HARDWARE_INTERFACE_VERSION_MAJOR >= 4
enum class return_type : std::uint8_t { OK = 0, ERROR = 1, DEACTIVATE = 2 };
#else
enum class return_type : std::uint8_t { OK = 0, ERROR = 1 };
#endif
}  // namespace hardware_interface
