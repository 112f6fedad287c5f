// Stub, see README.md.
#pragma once
#include <hardware_interface/hardware_info.hpp>

namespace hardware_interface {
struct HardwareComponentInterfaceParams {
    HardwareInfo hardware_info;
};
}  // namespace hardware_interface
