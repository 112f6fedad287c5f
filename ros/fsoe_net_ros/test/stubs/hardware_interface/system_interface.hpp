// Stub, see README.md.
#pragma once
#include <hardware_interface/handle.hpp>
#include <hardware_interface/types/hardware_interface_return_values.hpp>
#include <rclcpp/rclcpp.hpp>
#include <rclcpp_lifecycle/state.hpp>
#include <string>
#include <vector>
#if HARDWARE_INTERFACE_VERSION_MAJOR >= 4
#include <hardware_interface/types/hardware_component_interface_params.hpp>
#endif

namespace hardware_interface {
enum class CallbackReturn { SUCCESS, FAILURE, ERROR };

class SystemInterface {
public:
    SystemInterface() = default;
    SystemInterface(const SystemInterface &) = delete;
    virtual ~SystemInterface() = default;
#if HARDWARE_INTERFACE_VERSION_MAJOR < 4
    virtual CallbackReturn on_init(const HardwareInfo &info) {
        info_ = info;
        return CallbackReturn::SUCCESS;
    }
    virtual std::vector<StateInterface> export_state_interfaces() = 0;
    virtual std::vector<CommandInterface> export_command_interfaces() = 0;
#else
    virtual CallbackReturn on_init(const HardwareComponentInterfaceParams &params) {
        info_ = params.hardware_info;
        return CallbackReturn::SUCCESS;
    }
    [[deprecated]] virtual std::vector<StateInterface> export_state_interfaces() { return {}; }
    [[deprecated]] virtual std::vector<CommandInterface> export_command_interfaces() { return {}; }
    virtual std::vector<StateInterface::ConstSharedPtr> on_export_state_interfaces() { return {}; }
    virtual std::vector<CommandInterface::SharedPtr> on_export_command_interfaces() { return {}; }
#endif
#if HARDWARE_INTERFACE_VERSION_MAJOR == 4
    [[deprecated]] virtual CallbackReturn on_init(const HardwareInfo &) { return CallbackReturn::ERROR; }
#endif
    virtual CallbackReturn on_configure(const rclcpp_lifecycle::State &) = 0;
    virtual CallbackReturn on_activate(const rclcpp_lifecycle::State &) = 0;
    virtual CallbackReturn on_deactivate(const rclcpp_lifecycle::State &) = 0;
    virtual CallbackReturn on_cleanup(const rclcpp_lifecycle::State &) = 0;
    virtual CallbackReturn on_shutdown(const rclcpp_lifecycle::State &) = 0;
    virtual CallbackReturn on_error(const rclcpp_lifecycle::State &) = 0;
    virtual return_type perform_command_mode_switch(const std::vector<std::string> &,
                                                    const std::vector<std::string> &) {
        return return_type::OK;
    }
    virtual return_type read(const rclcpp::Time &time, const rclcpp::Duration &period) = 0;
    virtual return_type write(const rclcpp::Time &time, const rclcpp::Duration &period) = 0;

protected:
    HardwareInfo info_;
};
}  // namespace hardware_interface
