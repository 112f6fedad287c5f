// Stub, see README.md: the part of a description that the package reads, by the parser of ros2_control.
#pragma once
#include <hardware_interface/hardware_info.hpp>
#include <string>
#include <tinyxml2.h>
#include <unordered_map>
#include <vector>

namespace hardware_interface {

inline std::string stub_text(const tinyxml2::XMLElement *element) {
    return element != nullptr && element->GetText() != nullptr ? element->GetText() : "";
}

template <class Work> void stub_each(const tinyxml2::XMLElement *parent, const char *name, Work work) {
    const auto *child = parent != nullptr ? parent->FirstChildElement(name) : nullptr;
    for (; child != nullptr; child = child->NextSiblingElement(name)) {
        work(child);
    }
}

inline void stub_params(const tinyxml2::XMLElement *parent, std::unordered_map<std::string, std::string> &rows) {
    stub_each(parent, "param", [&rows](const auto *row) { rows[row->Attribute("name")] = stub_text(row); });
}

inline std::vector<HardwareInfo> parse_control_resources_from_urdf(const std::string &urdf) {
    tinyxml2::XMLDocument document;
    if (document.Parse(urdf.c_str()) != tinyxml2::XML_SUCCESS) {
        throw std::runtime_error("invalid URDF");
    }
    std::vector<HardwareInfo> found;
    stub_each(document.FirstChildElement("robot"), "ros2_control", [&](const auto *block) {
        HardwareInfo info{};
        info.name = block->Attribute("name");
        stub_params(block->FirstChildElement("hardware"), info.hardware_parameters);
        for (auto [kind, rows] : {std::pair{"joint", &info.joints}, std::pair{"gpio", &info.gpios},
                                  std::pair{"sensor", &info.sensors}}) {
            stub_each(block, kind, [rows = rows](const auto *element) {
                ComponentInfo component{};
                component.name = element->Attribute("name");
                stub_params(element, component.parameters);
                const auto add = [](auto &interfaces) {
                    return [&interfaces](const auto *row) {
                        std::unordered_map<std::string, std::string> params;
                        stub_params(row, params);
                        interfaces.push_back({row->Attribute("name"), params["initial_value"], "double"});
                    };
                };
                stub_each(element, "state_interface", add(component.state_interfaces));
                stub_each(element, "command_interface", add(component.command_interfaces));
                rows->push_back(component);
            });
        }
#if HARDWARE_INTERFACE_VERSION_MAJOR >= 4
        info.original_xml = urdf;
#endif
        found.push_back(info);
    });
    return found;
}

}  // namespace hardware_interface
