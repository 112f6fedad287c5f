// Stub, see README.md.
#pragma once
#include <string>
#include <unordered_map>
#include <vector>

namespace hardware_interface {
struct InterfaceInfo {
    std::string name, initial_value;
};
struct ComponentInfo {
    std::string name;
    std::unordered_map<std::string, std::string> parameters;
    std::vector<InterfaceInfo> command_interfaces, state_interfaces;
};
struct HardwareInfo {
    std::string name;
    std::unordered_map<std::string, std::string> hardware_parameters;
    std::vector<ComponentInfo> joints, sensors, gpios;
};
}  // namespace hardware_interface
