// Stub, see README.md.
#pragma once
#include <hardware_interface/version.h>
#include <stdexcept>
#include <string>
#include <unordered_map>
#include <vector>

namespace hardware_interface {
struct InterfaceInfo {
    std::string name, initial_value, data_type;
};
struct InterfaceDescription {
    InterfaceDescription(const std::string &prefix, const InterfaceInfo &info)
        : interface_info(info), interface_name(prefix + "/" + info.name) {}
    InterfaceInfo interface_info;
    std::string interface_name;
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
#if HARDWARE_INTERFACE_VERSION_MAJOR >= 4  // absent in older ones of Humble
    std::string original_xml;
#endif
};
}  // namespace hardware_interface
