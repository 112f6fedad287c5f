// Drives the adapter, linked against the stubs, as a controller manager would: commands come as lines.
//
//   drive_system [class=NAME] [urdf=FILE] [PARAM=VALUE…] [s:COMPONENT/INTERFACE…] [c:COMPONENT/INTERFACE[=INITIAL]…]
//                [p:COMPONENT/PARAM=VALUE…]
//
// Lines: init configure activate deactivate cleanup error · cycle N (read, write, 1 ms), tight N (read, write), write ·
// start NAME…, stop NAME… (a controller claims or releases commands) · set COMPONENT/INTERFACE VALUE ·
// get COMPONENT/INTERFACE. Each line is answered by one. After an error or DEACTIVATE of read or write it calls the
// same function as the resource manager.
#include <chrono>
#include <fstream>
#include <hardware_interface/component_parser.hpp>
#include <hardware_interface/system_interface.hpp>
#include <iostream>
#include <map>
#include <memory>
#include <pluginlib/class_list_macros.hpp>
#include <sstream>
#include <thread>

using hardware_interface::CallbackReturn;
using hardware_interface::return_type;

namespace {

hardware_interface::HardwareInfo info_of(int count, char **words) {
    hardware_interface::HardwareInfo info;
    for (int i = 1; i < count; ++i) {
        if (const std::string word = words[i]; word.rfind("urdf=", 0) == 0) {
            std::ifstream file(word.substr(5));
            info = hardware_interface::parse_control_resources_from_urdf(
                       {std::istreambuf_iterator<char>(file), {}}).front();
        }
    }
    std::map<std::string, hardware_interface::ComponentInfo> found;
    for (int i = 1; i < count; ++i) {
        const std::string word = words[i];
        const auto slash = word.find('/');
        const auto equal = word.find('=');
        if (word.size() > 1 && word[1] == ':') {
            auto &component = found[word.substr(2, slash - 2)];
            component.name = word.substr(2, slash - 2);
            const std::string name = word.substr(slash + 1, equal - slash - 1);
            const std::string value = equal == std::string::npos ? "" : word.substr(equal + 1);
            if (word[0] == 'p') {
                component.parameters[name] = value;
            } else {
                auto &rows = word[0] == 's' ? component.state_interfaces : component.command_interfaces;
                rows.push_back({name, value, "double"});
            }
        } else {
            info.hardware_parameters[word.substr(0, equal)] = word.substr(equal + 1);
        }
    }
    for (auto &row : found) {
        info.gpios.push_back(row.second);
    }
    return info;
}

struct Handles {
    std::vector<std::shared_ptr<const hardware_interface::StateInterface>> states;
    std::vector<std::shared_ptr<hardware_interface::CommandInterface>> commands;
};

#if HARDWARE_INTERFACE_VERSION_MAJOR < 4
bool initialise(hardware_interface::SystemInterface &system, const hardware_interface::HardwareInfo &info) {
    return system.on_init(info) == CallbackReturn::SUCCESS;
}

Handles exported(hardware_interface::SystemInterface &system) {
    Handles found;
    for (const auto &row : system.export_state_interfaces()) {
        found.states.push_back(std::make_shared<hardware_interface::StateInterface>(row));
    }
    for (const auto &row : system.export_command_interfaces()) {
        found.commands.push_back(std::make_shared<hardware_interface::CommandInterface>(row));
    }
    return found;
}

double value_of(const hardware_interface::StateInterface &row) { return row.get_value(); }
#else
bool initialise(hardware_interface::SystemInterface &system, const hardware_interface::HardwareInfo &info) {
    hardware_interface::HardwareComponentInterfaceParams params;
    params.hardware_info = info;
    return system.on_init(params) == CallbackReturn::SUCCESS;
}

Handles exported(hardware_interface::SystemInterface &system) {
    return {system.on_export_state_interfaces(), system.on_export_command_interfaces()};
}

double value_of(const hardware_interface::StateInterface &row) { return row.get_optional().value(); }
#endif

const char *name_of(CallbackReturn result) {
    return result == CallbackReturn::SUCCESS ? "SUCCESS"
                                             : (result == CallbackReturn::FAILURE ? "FAILURE" : "ERROR");
}

const char *cycles(hardware_interface::SystemInterface &system, int count, int sleep_ms) {
    for (int i = 0; i < count; ++i) {
        if (system.read({}, {}) != return_type::OK) {
            system.on_error({});  // also for DEACTIVATE
            return "read ERROR";
        }
        const auto written = system.write({}, {});
        if (written == return_type::ERROR) {
            system.on_error({});
            return "write ERROR";
        }
        if (written != return_type::OK) {
            system.on_deactivate({});
            return "write DEACTIVATE";
        }
        std::this_thread::sleep_for(std::chrono::milliseconds(sleep_ms));
    }
    return "OK";
}

}  // namespace

int main(int count, char **words) {
    const auto info = info_of(count, words);
    const auto chosen = info.hardware_parameters.find("class");
    const std::string plugin = chosen == info.hardware_parameters.end() ? "CellSystem" : chosen->second;
    std::unique_ptr<hardware_interface::SystemInterface> system(stub_classes.at("fsoe_net_ros::" + plugin)());
    const rclcpp_lifecycle::State state;
    Handles handles;
    std::string line;
    while (std::getline(std::cin, line)) {
        std::istringstream text(line);
        std::string verb, name;
        text >> verb;
        std::map<std::string, CallbackReturn (hardware_interface::SystemInterface::*)(
                                  const rclcpp_lifecycle::State &)>
            transitions{{"configure", &hardware_interface::SystemInterface::on_configure},
                        {"activate", &hardware_interface::SystemInterface::on_activate},
                        {"deactivate", &hardware_interface::SystemInterface::on_deactivate},
                        {"cleanup", &hardware_interface::SystemInterface::on_cleanup},
                        {"error", &hardware_interface::SystemInterface::on_error}};
        if (verb == "init") {
            const bool good = initialise(*system, info);
            if (good) {
                handles = exported(*system);
            }
            std::cout << (good ? "SUCCESS" : "ERROR") << std::endl;
        } else if (transitions.count(verb) != 0) {
            std::cout << name_of((system.get()->*transitions[verb])(state)) << std::endl;
        } else if (verb == "cycle" || verb == "tight") {
            int number = 0;
            text >> number;
            std::cout << cycles(*system, number, verb == "cycle" ? 1 : 0) << std::endl;
        } else if (verb == "write") {
            std::cout << (system->write({}, {}) == return_type::OK ? "OK" : "write ERROR") << std::endl;
        } else if (verb == "get") {
            text >> name;
            for (const auto &row : handles.states) {
                if (row->get_name() == name) {
                    std::cout << value_of(*row) << std::endl;
                }
            }
        } else if (verb == "set") {
            std::string value;
            text >> name >> value;
            for (auto &row : handles.commands) {
                if (row->get_name() == name) {
                    (void)row->set_value(std::stod(value));  // operator>> reads "nan" as 0
                }
            }
            std::cout << "OK" << std::endl;
        } else if (verb == "start" || verb == "stop") {
            std::vector<std::string> names;
            while (text >> name) {
                names.push_back(name);
            }
            const std::vector<std::string> none;
            const bool start = verb == "start";
            const auto done = system->perform_command_mode_switch(start ? names : none, start ? none : names);
            std::cout << (done == return_type::OK ? "OK" : "ERROR") << std::endl;
        }
    }
    return 0;
}
