// ros2_control's view of a cell: nothing but names and return values. For hardware_interface 2 (Humble), 4
// (Jazzy), 5 and 6: on_init() and handles differ, all else is one. CI compiles it against stubs of each
// generation in test/stubs.
//
// read() is never an error: ros2_control treats every value of it but OK as one, and states would end with
// the commands. A fault is the answer of the write() that follows, which ends the commands alone.
#ifndef CELL_SYSTEM_HPP_
#define CELL_SYSTEM_HPP_

#include <cmath>
#include <hardware_interface/hardware_info.hpp>
#include <hardware_interface/system_interface.hpp>
#include <hardware_interface/types/hardware_interface_return_values.hpp>
#include <limits>
#include <memory>
#include <optional>
#include <rclcpp/rclcpp.hpp>
#include <rclcpp_lifecycle/state.hpp>
#include <string>
#include <vector>

#include "fsoe_net_ros/cell.hpp"

#if __has_include(<hardware_interface/version.h>)  // not in older ones of Humble
#include <hardware_interface/version.h>
#endif
// Here handles contain the values and are shared with controllers; in older versions they point to our values.
#if __has_include(<hardware_interface/types/hardware_component_interface_params.hpp>)
#include <hardware_interface/types/hardware_component_interface_params.hpp>
#define FSOE_NET_ROS_SHARED_HANDLES
#endif

namespace fsoe_net_ros {

#ifdef FSOE_NET_ROS_SHARED_HANDLES
constexpr int kTries = 1000;  // to write a handle while a controller reads it
#endif

using hardware_interface::CallbackReturn;
using hardware_interface::CommandInterface;
using hardware_interface::return_type;
using hardware_interface::StateInterface;

class CellSystem : public hardware_interface::SystemInterface {
public:
#ifdef FSOE_NET_ROS_SHARED_HANDLES
    using InitParams = hardware_interface::HardwareComponentInterfaceParams;
#else
    using InitParams = hardware_interface::HardwareInfo;
#endif
    CallbackReturn on_init(const InitParams &params) override {
        if (SystemInterface::on_init(params) != CallbackReturn::SUCCESS) {
            return CallbackReturn::ERROR;
        }
        return guarded(CallbackReturn::ERROR, [this] {
            Cell::Options options;
            options.socket = socket();
            options.misses = number("misses", options.misses);
            options.lost_ms = number("lost_ms", options.lost_ms);
            options.start = parameter("start", "false") == "true";
            options.waits = parameter("wait_for_cycle", "false") == "true";
            options.report = [](const std::string &text) { RCLCPP_WARN(logger(), "%s", text.c_str()); };
            cell_ = std::make_unique<Cell>(options);
            states_.clear();
            commands_.clear();
            for_each_component(info_, [this](const Component &component) { declare(component); });
            bind(info_);
        });
    }

#ifdef FSOE_NET_ROS_SHARED_HANDLES
    std::vector<StateInterface::ConstSharedPtr> on_export_state_interfaces() override {
        std::vector<StateInterface::ConstSharedPtr> found;
        for (auto &row : states_) {
            row.handle = std::make_shared<StateInterface>(description_of(row));
            found.push_back(row.handle);
        }
        return found;
    }

    std::vector<CommandInterface::SharedPtr> on_export_command_interfaces() override {
        std::vector<CommandInterface::SharedPtr> found;
        for (auto &row : commands_) {
            row.handle = std::make_shared<CommandInterface>(description_of(row));
            found.push_back(row.handle);
        }
        return found;
    }
#else
    std::vector<StateInterface> export_state_interfaces() override {
        std::vector<StateInterface> found;
        for (const auto &row : states_) {
            found.emplace_back(row.component, row.name, const_cast<double *>(row.value));
        }
        return found;
    }

    std::vector<CommandInterface> export_command_interfaces() override {
        std::vector<CommandInterface> found;
        for (const auto &row : commands_) {
            found.emplace_back(row.component, row.name, row.value);
        }
        return found;
    }
#endif

    CallbackReturn on_configure(const rclcpp_lifecycle::State &) override {
        return guarded(CallbackReturn::FAILURE, [this] { cell_->configure(); });
    }
    CallbackReturn on_activate(const rclcpp_lifecycle::State &) override {
        return guarded(CallbackReturn::FAILURE, [this] {
            for (auto &row : commands_) {
                if (!forget(row)) {
                    throw Fault(row.component + "/" + row.name + " is in use; activate again");
                }
            }
            cell_->activate();
        });
    }
    /** Also called by the real-time thread, after DEACTIVATE: waits for no thread. */
    CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) override {
        cell_->deactivate();
        return CallbackReturn::SUCCESS;
    }
    CallbackReturn on_cleanup(const rclcpp_lifecycle::State &) override {
        cell_->cleanup();
        show_states();
        return CallbackReturn::SUCCESS;
    }
    CallbackReturn on_shutdown(const rclcpp_lifecycle::State &) override {
        cell_->cleanup();
        show_states();
        return CallbackReturn::SUCCESS;
    }
    /** Called by the real-time thread after an error: waits for no thread. */
    CallbackReturn on_error(const rclcpp_lifecycle::State &) override {
        cell_->disconnect();
        show_states();
        return CallbackReturn::SUCCESS;
    }

    return_type perform_command_mode_switch(const std::vector<std::string> &start_interfaces,
                                            const std::vector<std::string> &stop_interfaces) override {
        for (const auto &name : stop_interfaces) {
            cell_->release(name);
        }
        for (const auto &name : start_interfaces) {
            for (auto &row : commands_) {
                if (row.component + "/" + row.name == name && !forget(row)) {
                    return return_type::ERROR;
                }
            }
            cell_->claim(name);
        }
        return return_type::OK;
    }

    return_type read(const rclcpp::Time &, const rclcpp::Duration &) override {
        cell_->read();
        show_states();
        return return_type::OK;
    }
    return_type write(const rclcpp::Time &, const rclcpp::Duration &) override {
#ifdef FSOE_NET_ROS_SHARED_HANDLES
        for (auto &row : commands_) {
            *row.value = row.handle->get_optional<double>().value_or(*row.value);
        }
#endif
        const bool written = cell_->write();
        if (!cell_->notice().empty()) {
            RCLCPP_WARN(logger(), "%s; an axis starts only after its controller is activated again",
                        cell_->notice().c_str());
        }
        if (written) {
            return return_type::OK;
        }
        RCLCPP_ERROR(logger(),
                     "%s; after the cause is gone activate the hardware again, then its controllers (on Humble "
                     "deactivate them before)",
                     cell_->fault().c_str());
#if HARDWARE_INTERFACE_VERSION_MAJOR >= 4
        return return_type::DEACTIVATE;
#else
        return return_type::ERROR;
#endif
    }

protected:
    using Component = hardware_interface::ComponentInfo;

    /** Control socket of fsn-master. @throws Fault  it is not stated. */
    virtual std::string socket() const {
        const std::string path = parameter("socket", "");
        if (path.empty()) {
            throw Fault("the hardware has no param `socket`: the control socket of fsn-master");
        }
        return path;
    }

    /** Finds the names of the plan in the params of components; not before on_init(). */
    void bind(const hardware_interface::HardwareInfo &info) {
        cell_->unbind();
        for_each_component(info, [this](const Component &component) { bind_component(component); });
    }

    template <class Work> CallbackReturn guarded(CallbackReturn otherwise, Work work) {
        try {
            work();
            return CallbackReturn::SUCCESS;
        } catch (const std::exception &fault) {
            RCLCPP_ERROR(logger(), "%s", fault.what());
            if (otherwise == CallbackReturn::FAILURE) {
                RCLCPP_ERROR(logger(), "then: ros2 control set_hardware_component_state %s active",
                             info_.name.c_str());
            }
            return otherwise;
        }
    }

    std::string parameter(const std::string &name, const std::string &otherwise) const {
        const auto found = info_.hardware_parameters.find(name);
        return found == info_.hardware_parameters.end() ? otherwise : found->second;
    }

    unsigned number(const std::string &name, unsigned otherwise) const {
        return whole(parameter(name, std::to_string(otherwise)), "param `" + name + "` of the hardware");
    }

    static unsigned whole(const std::string &text, const std::string &place) {
        if (text.empty() || text.size() > 6 ||
            text.find_first_not_of("0123456789") != std::string::npos) {
            throw Fault(place + " is not a whole number: " + text);
        }
        return static_cast<unsigned>(std::stoul(text));
    }

    static rclcpp::Logger logger() { return rclcpp::get_logger("fsoe_net_ros"); }

    std::unique_ptr<Cell> cell_;

private:
    struct State {
        std::string component, name;
        const double *value;
        std::shared_ptr<StateInterface> handle;
    };
    struct Command {
        std::string component, name;
        double *value;
        std::shared_ptr<CommandInterface> handle;
    };

#ifdef FSOE_NET_ROS_SHARED_HANDLES
    template <class Row> static hardware_interface::InterfaceDescription description_of(const Row &row) {
        hardware_interface::InterfaceInfo info{};
        info.name = row.name;
        info.data_type = "double";
        return {row.component, info};
    }
#endif

    template <class Work>
    static void for_each_component(const hardware_interface::HardwareInfo &info, Work work) {
        for (const auto *components : {&info.joints, &info.gpios, &info.sensors}) {
            for (const auto &component : *components) {
                work(component);
            }
        }
    }

    void declare(const Component &component) {
        for (const auto &row : component.state_interfaces) {
            states_.push_back({component.name, row.name, cell_->add_state(component.name + "/" + row.name), {}});
        }
        for (const auto &row : component.command_interfaces) {
            double *value = cell_->add_command(component.name + "/" + row.name, initial_of(component, row));
            commands_.push_back({component.name, row.name, value, {}});
        }
    }

    void bind_component(const Component &component) {
        const auto axis = add_axis(component);
        for (const auto &row : component.state_interfaces) {
            cell_->bind_state(component.name + "/" + row.name, symbol_of(component, "state_interface/", row.name));
        }
        for (const auto &row : component.command_interfaces) {
            const std::string name = component.name + "/" + row.name;
            if (axis && (row.name == "reset_fault" || row.name == "home")) {
                cell_->bind_request(name, *axis,
                                    row.name == "home" ? AxisRole::kHome : AxisRole::kResetFault);
            } else {
                cell_->bind_command(name, symbol_of(component, "command_interface/", row.name));
            }
        }
    }

    /** The axis that a component with the param `axis` has; none: it has no such param. */
    std::optional<std::size_t> add_axis(const Component &component) {
        if (component.parameters.count("axis") == 0) {
            return std::nullopt;
        }
        const auto given = [&component](const char *name, const char *otherwise) {
            const auto found = component.parameters.find(name);
            return found == component.parameters.end() ? std::string(otherwise) : found->second;
        };
        const auto place = [&component](const char *name) {
            return std::string("param `") + name + "` of " + component.name;
        };
        AxisOptions options;
        options.component = component.name;
        options.subdevice = given("axis", "");
        options.number = whole(given("axis_number", "0"), place("axis_number"));
        options.mode = static_cast<int>(whole(given("mode_of_operation", "8"), place("mode_of_operation")));
        options.max_velocity = real(given("max_velocity", "0"), place("max_velocity"));
        options.max_effort = real(given("max_effort", "0"), place("max_effort"));
        options.auto_fault_reset = given("auto_fault_reset", "false") == "true";
        return cell_->add_axis(options);
    }

    void show_states() {
#ifdef FSOE_NET_ROS_SHARED_HANDLES
        for (auto &row : states_) {
            (void)!row.handle->set_value(*row.value);  // false: a controller reads it; the next cycle sets it
        }
#endif
    }

    /** Removes the value of an earlier controller. @return false  a controller keeps the handle locked. */
    static bool forget(Command &row) {
        *row.value = std::numeric_limits<double>::quiet_NaN();
#ifdef FSOE_NET_ROS_SHARED_HANDLES
        for (int i = 0; i < kTries; ++i) {
            if (row.handle->set_value(*row.value)) {
                return true;
            }
        }
        return false;
#else
        return true;
#endif
    }

    /** The name in the plan: `SUBDEVICE.INTERFACE`, or what a param of the component says. */
    static std::string symbol_of(const Component &component, const std::string &side,
                                 const std::string &name) {
        const auto symbol = component.parameters.find(side + name);
        return symbol != component.parameters.end() ? symbol->second : subdevice_of(component) + "." + name;
    }

    static std::string subdevice_of(const Component &component) {
        const auto subdevice = component.parameters.find("subdevice");
        return subdevice != component.parameters.end() ? subdevice->second : component.name;
    }

    /** What an output has without a command; not a number: its stop value. */
    static double initial_of(const Component &component, const hardware_interface::InterfaceInfo &row) {
        if (row.initial_value.empty()) {
            return std::numeric_limits<double>::quiet_NaN();
        }
        return real(row.initial_value, "initial_value of " + component.name + "/" + row.name);
    }

    static double real(const std::string &text, const std::string &place) {
        std::size_t used = 0;
        double value = 0;
        try {
            value = std::stod(text, &used);
        } catch (const std::exception &) {
        }
        if (text.empty() || used != text.size() || !std::isfinite(value)) {
            throw Fault(place + " is not a number: " + text);
        }
        return value;
    }

    std::vector<State> states_;
    std::vector<Command> commands_;
};

}  // namespace fsoe_net_ros

#endif  // CELL_SYSTEM_HPP_
