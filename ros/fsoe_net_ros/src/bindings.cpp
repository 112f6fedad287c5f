#include "driven_axis.hpp"
#include "fsoe_net_ros/cell.hpp"

namespace fsoe_net_ros {

const double *Cell::add_state(const std::string &name) {
    states_.push_back({name, "", kNothing});
    return &states_.back().number;
}

double *Cell::add_command(const std::string &name, double initial) {
    commands_.push_back({name, "", kNothing, initial, {}, false, false});
    return &commands_.back().number;
}

void Cell::unbind() {
    cleanup();
    for (State &state : states_) {
        state.symbol_name.clear();
    }
    for (Command &command : commands_) {
        command.symbol_name.clear();
        command.of_axis = {};
    }
    axes_.clear();
}

void Cell::bind_state(const std::string &name, const std::string &symbol) {
    for (State &state : states_) {
        if (state.name == name) {
            state.symbol_name = symbol;
        }
    }
}

void Cell::bind_command(const std::string &name, const std::string &symbol) {
    for (Command &command : commands_) {
        if (command.name == name) {
            command.symbol_name = symbol;
        }
    }
}

std::size_t Cell::add_axis(const AxisOptions &options) {
    axes_.push_back(std::make_unique<DrivenAxis>(options));
    return axes_.size() - 1;
}

void Cell::bind_request(const std::string &name, std::size_t axis, AxisRole role) {
    for (Command &command : commands_) {
        if (command.name == name) {
            command.of_axis = {axes_[axis].get(), role};
        }
    }
}

std::vector<std::string> Cell::unbound() const {
    std::vector<std::string> names;
    for (const State &state : states_) {
        if (state.symbol_name.empty()) {
            names.push_back(state.name);
        }
    }
    for (const Command &command : commands_) {
        if (command.symbol_name.empty() && command.of_axis.axis == nullptr) {
            names.push_back(command.name);
        }
    }
    return names;
}

}  // namespace fsoe_net_ros
