#include "link.hpp"

#include <string>
#include <vector>

#include "driven_axis.hpp"

namespace fsoe_net_ros {

namespace {

// CiA 402 (IEC 61800-7-201): objects of axis n are 0x800 * n higher.
constexpr unsigned kStatusword = 0x6041, kActualPosition = 0x6064, kTargetPosition = 0x607A;
constexpr unsigned kAxisStep = 0x800, kMostAxes = 8;

/** What is added to the objects of axis 0, of a target position; -1 if the object is not one. */
int axis_base(unsigned index) {
    const unsigned base = index - kTargetPosition;
    return index >= kTargetPosition && base % kAxisStep == 0 && base / kAxisStep < kMostAxes
               ? static_cast<int>(base)
               : -1;
}

bool ends_with(const std::string &text, const std::string &end) {
    return text.size() >= end.size() && text.compare(text.size() - end.size(), end.size(), end) == 0;
}

}  // namespace

fsn_realtime *open_client(const Cell::Options &options, const std::vector<std::string> &outputs) {
    std::vector<const char *> names;
    for (const std::string &name : outputs) {
        names.push_back(name.c_str());
    }
    fsn_realtime_options request{};
    request.socket = options.socket.c_str();
    request.outputs = names.data();
    request.output_count = names.size();
    request.misses = options.misses;
    request.timeout_ms = kTryMs;
    request.plan_sha256 = options.plan_sha256.empty() ? nullptr : options.plan_sha256.c_str();
    fsn_realtime_fault fault{};
    fsn_realtime *opened = nullptr;
    if (fsn_realtime_open(&request, &opened, &fault) != FSN_OK) {
        throw Fault(fault.text);
    }
    return opened;
}

Cell::Link::Link(const Cell &cell, const nlohmann::json &rows)
    : reader_(open_client(cell.options_, {}), fsn_realtime_close) {
    for (const auto &row : rows) {
        connections_.emplace_back();
        connections_.back().name = row.value("name", "");
    }
    update(rows);
    for (const Cell::State &row : cell.states_) {
        states.push_back(find_state(row));
    }
    for (const Cell::Command &row : cell.commands_) {
        commands.push_back(find_command(cell, row));
    }
}

void Cell::Link::update(const nlohmann::json &rows) {
    std::size_t number = 0;
    for (const auto &row : rows) {
        if (number < connections_.size()) {
            connections_[number++].state = row.value("observed_state", kUnknown);
        }
    }
}

void Cell::Link::forget() {
    answers = false;
    for (Connection &connection : connections_) {
        connection.state = kUnknown;
    }
}

int32_t Cell::Link::find_object(const std::string &subdevice, unsigned index) const {
    struct fsn_realtime_symbol symbol{};
    for (uint32_t n = 0; fsn_realtime_symbol(reader(), n, &symbol) == FSN_OK; ++n) {
        if (!symbol.output && symbol.index == index && symbol.subindex == 0 && symbol.bits != 0 &&
            subdevice == symbol.subdevice) {
            return static_cast<int32_t>(n);
        }
    }
    return kNone;
}

Cell::Link::State Cell::Link::find_state(const Cell::State &state) {
    const std::string &name = state.symbol_name;
    if (name.empty()) {
        return {kNone, nullptr, false};
    }
    const int32_t symbol = fsn_realtime_input(reader(), name.c_str());
    if (symbol != kNone) {
        return {symbol, nullptr, false};
    }
    for (Connection &connection : connections_) {
        const bool in_data = name == connection.name + ".in_data";
        if (in_data || name == connection.name + ".state") {
            return {kNone, &connection.state, in_data};
        }
    }
    const bool is_output = fsn_realtime_output(reader(), name.c_str()) != kNone;
    throw Fault(state.name + ": the plan has no input " + name +
                (is_output ? "; the output of that name is what is sent, not a state: remove the "
                             "state_interface, or map what the SubDevice reports"
                           : "; `fsoe-net console -c list` shows the names"));
}

Cell::Link::Command Cell::Link::find_command(const Cell &cell, const Cell::Command &command) const {
    if (command.symbol_name.empty()) {
        return {kNone, kNone, kNone, 0, command.of_axis};
    }
    const int32_t number = fsn_realtime_output(reader(), command.symbol_name.c_str());
    struct fsn_realtime_symbol symbol{};
    if (number == kNone ||
        fsn_realtime_symbol(reader(), static_cast<uint32_t>(number), &symbol) != FSN_OK) {
        throw Fault(command.name + ": the plan has no output " + command.symbol_name +
                    "; `fsoe-net console -c list` shows the names");
    }
    Command found{number, kNone, kNone, symbol.stop_value, cell.find_axis(command, symbol)};
    if (found.of_axis.axis != nullptr) {
        return found;
    }
    if (axis_base(symbol.index) >= 0 || ends_with(command.name, "/position")) {
        find_position(command, symbol, found);
    }
    return found;
}

/** The axis that an output belongs to. @throws Fault  the axis alone writes it. */
Cell::AxisCommand Cell::find_axis(const Command &command, const struct fsn_realtime_symbol &symbol) const {
    for (const auto &axis : axes_) {
        if (!axis->drives(symbol)) {
            continue;
        }
        if (const auto role = axis->role_of(symbol)) {
            return {axis.get(), *role};
        }
        throw Fault(command.name + ": the axis " + axis->name() + " writes its controlword; remove the "
                    "command_interface, or the param `axis` of the component");
    }
    return {};
}

void Cell::Link::find_position(const Cell::Command &command, const struct fsn_realtime_symbol &target,
                               Command &found) const {
    const int base = axis_base(target.index);
    if (base >= 0) {
        found.actual = find_object(target.subdevice, kActualPosition + static_cast<unsigned>(base));
        found.status = find_object(target.subdevice, kStatusword + static_cast<unsigned>(base));
    }
    if (found.actual == kNone) {  // a part of an object, or one of the maker
        const std::string name = std::string(target.subdevice) + ".position";
        found.actual = fsn_realtime_input(reader(), name.c_str());
    }
    if (found.actual == kNone) {
        throw Fault(command.name + " is a target position, and the plan has no actual one: the axis would jump");
    }
}

}  // namespace fsoe_net_ros
