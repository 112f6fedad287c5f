// Stub, see README.md.
#pragma once
#include <hardware_interface/hardware_info.hpp>
#include <hardware_interface/types/hardware_interface_return_values.hpp>
#include <rclcpp/rclcpp.hpp>
#include <rclcpp_lifecycle/state.hpp>

namespace hardware_interface {
enum class CallbackReturn { SUCCESS, FAILURE, ERROR };

class StateInterface {
public:
    StateInterface(const std::string &prefix, const std::string &name, double *value)
        : name_(prefix + "/" + name), value_(value) {}
    const std::string &get_name() const { return name_; }
    double get_value() const { return *value_; }

protected:
    std::string name_;
    double *value_;
};
class CommandInterface : public StateInterface {
public:
    using StateInterface::StateInterface;
    void set_value(double value) { *value_ = value; }
};

class SystemInterface {
public:
    virtual ~SystemInterface() = default;
    virtual CallbackReturn on_init(const HardwareInfo &info) {
        info_ = info;
        return CallbackReturn::SUCCESS;
    }
    virtual std::vector<StateInterface> export_state_interfaces() = 0;
    virtual std::vector<CommandInterface> export_command_interfaces() = 0;
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
