// Stub, see README.md.
#pragma once
#include <hardware_interface/hardware_info.hpp>
#include <hardware_interface/version.h>
#include <limits>
#include <memory>
#include <optional>
#include <string>

namespace hardware_interface {

#if HARDWARE_INTERFACE_VERSION_MAJOR < 4
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
#else
class Handle {
public:
    explicit Handle(const InterfaceDescription &description) : name_(description.interface_name) {
        if (description.interface_info.data_type != "double") {
            throw std::invalid_argument(name_);
        }
    }
    Handle(const Handle &) = delete;
    const std::string &get_name() const { return name_; }
    template <typename T = double> [[nodiscard]] std::optional<T> get_optional() const { return value_; }
    template <typename T> [[nodiscard]] bool set_value(const T &value) {
        value_ = value;
        return true;
    }

private:
    std::string name_;
    double value_ = std::numeric_limits<double>::quiet_NaN();
};
class StateInterface : public Handle {
public:
    using SharedPtr = std::shared_ptr<StateInterface>;
    using ConstSharedPtr = std::shared_ptr<const StateInterface>;
    using Handle::Handle;
};
class CommandInterface : public Handle {
public:
    using SharedPtr = std::shared_ptr<CommandInterface>;
    using Handle::Handle;
};
#endif

}  // namespace hardware_interface
