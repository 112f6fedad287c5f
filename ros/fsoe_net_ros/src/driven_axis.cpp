#include "driven_axis.hpp"

#include <algorithm>
#include <cmath>

namespace fsoe_net_ros {

namespace {

constexpr unsigned kAxisStep = 0x800;
// CiA 402 (IEC 61800-7-201): objects of axis 0.
constexpr unsigned kControlword = 0x6040;
constexpr struct {
    unsigned index;
    AxisRole role;
} kRoles[] = {{0x607A, AxisRole::kPosition},
              {0x60FF, AxisRole::kVelocity},
              {0x6071, AxisRole::kEffort},
              {0x6060, AxisRole::kMode}};

bool needs_velocity(int mode) {
    return mode == FSN_AXIS_CSP || mode == FSN_AXIS_CSV || mode == FSN_AXIS_PV;
}

}  // namespace

bool DrivenAxis::drives(const struct fsn_realtime_symbol &symbol) const {
    return role_of(symbol).has_value() ||
           (symbol.output && symbol.index == kControlword + kAxisStep * options_.number &&
            options_.subdevice == symbol.subdevice);
}

std::optional<AxisRole> DrivenAxis::role_of(const struct fsn_realtime_symbol &symbol) const {
    if (!symbol.output || symbol.subindex != 0 || options_.subdevice != symbol.subdevice) {
        return std::nullopt;
    }
    for (const auto &row : kRoles) {
        if (symbol.index == row.index + kAxisStep * options_.number) {
            return row.role;
        }
    }
    return std::nullopt;
}

void DrivenAxis::find_scales(const fsn_realtime *writer) {
    scales_.fill({0, 0});
    struct fsn_realtime_symbol symbol{};
    for (uint32_t n = 0; fsn_realtime_symbol(writer, n, &symbol) == FSN_OK; ++n) {
        if (const auto role = role_of(symbol)) {
            scales_[static_cast<std::size_t>(*role)] = {symbol.factor, symbol.offset};
        }
    }
}

/** A limit in numbers of the drive, at least 1; 0: the object is not mapped, or there is no limit. */
uint32_t DrivenAxis::limit(AxisRole role, double most) const {
    const double raw = most * std::fabs(scales_[static_cast<std::size_t>(role)].factor);
    return static_cast<uint32_t>(
        std::min(std::ceil(raw), static_cast<double>(std::numeric_limits<int32_t>::max())));
}

void DrivenAxis::check() const {
    if (needs_velocity(options_.mode) && options_.max_velocity <= 0) {
        throw Fault(name() + " has no `max_velocity`: add <limit velocity=…> to its joint in the URDF, or the param");
    }
    if (options_.mode == FSN_AXIS_CST && options_.max_effort <= 0) {
        throw Fault(name() + " has no `max_effort`: add <limit effort=…> to its joint in the URDF, or the param");
    }
}

void DrivenAxis::open(const fsn_realtime *writer, double write_s) {
    find_scales(writer);
    fsn_axis_options options{};
    options.subdevice = options_.subdevice.c_str();
    options.number = options_.number;
    options.config.mode = static_cast<int8_t>(options_.mode);
    options.config.max_step = limit(AxisRole::kPosition, options_.max_velocity * write_s);
    options.config.max_velocity = limit(AxisRole::kVelocity, options_.max_velocity);
    options.config.max_torque = static_cast<uint16_t>(
        std::min<uint32_t>(limit(AxisRole::kEffort, options_.max_effort), std::numeric_limits<int16_t>::max()));
    fsn_realtime_fault fault{};
    if (fsn_realtime_axis_open(writer, &options, &own_, &fault) != FSN_OK) {
        throw Fault(name() + ": " + fault.text);
    }
    commands_.fill(kNothing);
    earlier_.fill(kNothing);
    asks_ = homes_ = has_stepped_ = false;
}

void DrivenAxis::claim(AxisRole role) {
    asks_ = asks_ || role == AxisRole::kPosition || role == AxisRole::kVelocity ||
            role == AxisRole::kEffort || role == AxisRole::kHome;
}

void DrivenAxis::stop() {
    asks_ = false;
    fsn_axis_quick_stop(&own_.axis);
}

bool DrivenAxis::is_on() const {
    return own_.axis.phase == FSN_AXIS_ENABLING || own_.axis.phase == FSN_AXIS_ENABLED;
}

AxisEvent DrivenAxis::step(fsn_realtime *writer, uint64_t cycle_ns) {
    fsn_realtime_cycle cycle{};
    cycle.now_ns = cycle_ns;
    const AxisEvent event = has_stepped_ ? obey() : AxisEvent::kNothing;
    const bool was_on = is_on();
    fsn_realtime_axis_step(&own_, writer, &cycle);
    has_stepped_ = true;
    return event == AxisEvent::kNothing && was_on && !is_on() ? AxisEvent::kStopped : event;
}

/** Whether a command has changed from 0 or none to another number. */
bool DrivenAxis::rises(AxisRole role) {
    const auto is_set = [](double number) { return !std::isnan(number) && number != 0; };
    double &earlier = earlier_[static_cast<std::size_t>(role)];
    const bool rising = is_set(command(role)) && !is_set(earlier);
    earlier = command(role);
    return rising;
}

/** Passes the commands on to the state machine. */
AxisEvent DrivenAxis::obey() {
    reset_faults();
    if (asks_ && !enable()) {
        return AxisEvent::kCannotEnable;
    }
    const bool homes = rises(AxisRole::kHome);
    homes_ = (homes_ || homes) && is_on();
    const bool obeyed = set_mode() && set_targets();
    return obeyed || !is_on() ? AxisEvent::kNothing : AxisEvent::kRefused;
}

void DrivenAxis::reset_faults() {
    const bool resets = options_.auto_fault_reset && own_.axis.phase == FSN_AXIS_FAULTED;
    if (rises(AxisRole::kResetFault) || resets) {
        (void)!fsn_axis_reset(&own_.axis);  // refused: there is no fault, or a reset is in progress
    }
}

bool DrivenAxis::enable() {
    asks_ = homes_ = false;
    moved_to_ = kNothing;
    if (own_.axis.state == FSN_AXIS_QUICK_STOP_ACTIVE) {
        fsn_axis_disable(&own_.axis);  // the drive leaves this state only without torque
        return false;
    }
    return fsn_axis_enable(&own_.axis) == FSN_OK;
}

bool DrivenAxis::set_mode() {
    const double mode = std::isnan(command(AxisRole::kMode)) ? options_.mode : command(AxisRole::kMode);
    const bool is_mode = mode >= 0 && mode <= FSN_AXIS_CST && mode == std::floor(mode);
    return is_mode && fsn_axis_set_mode(&own_.axis, static_cast<int8_t>(mode)) == FSN_OK;
}

/** @return false  a target is beyond its limit. */
bool DrivenAxis::set_targets() {
    if (!own_.axis.enabled) {
        return true;  // the targets are those of an axis that is off
    }
    switch (own_.axis.outputs.mode) {
    case FSN_AXIS_CSP:
        return set_position();
    case FSN_AXIS_PP:
        return move();
    case FSN_AXIS_HM:
        return home();
    case FSN_AXIS_CST: {
        const auto raw = raw_of(AxisRole::kEffort, 0);
        const bool fits = raw && *raw >= INT16_MIN && *raw <= INT16_MAX;
        return fits && fsn_axis_set_torque(&own_.axis, static_cast<int16_t>(*raw)) == FSN_OK;
    }
    default: {
        const auto raw = raw_of(AxisRole::kVelocity, 0);
        return raw && fsn_axis_set_velocity(&own_.axis, *raw) == FSN_OK;
    }
    }
}

bool DrivenAxis::set_position() {
    const auto raw = raw_of(AxisRole::kPosition, own_.axis.outputs.position);
    return raw && fsn_axis_set_position(&own_.axis, *raw) == FSN_OK;
}

/** Starts homing once; a request while it runs does not count. */
bool DrivenAxis::home() {
    if (homes_) {
        (void)!fsn_axis_home(&own_.axis);
    }
    homes_ = false;
    return true;
}

/** A new set-point, offered until the drive has accepted the one before. */
bool DrivenAxis::move() {
    const double number = command(AxisRole::kPosition);
    if (std::isnan(number) || number == moved_to_) {
        return true;
    }
    const auto raw = raw_of(AxisRole::kPosition, 0);
    if (raw && fsn_axis_move(&own_.axis, *raw, true) == FSN_OK) {
        moved_to_ = number;
    }
    return raw.has_value();
}

/** A command in numbers of the drive. @return none  it is outside their range. */
std::optional<int32_t> DrivenAxis::raw_of(AxisRole role, double otherwise) const {
    const Scale &scale = scales_[static_cast<std::size_t>(role)];
    const double number = command(role);
    const double raw = std::isnan(number) ? otherwise : std::round(scale.factor * number + scale.offset);
    if (!(raw >= INT32_MIN && raw <= INT32_MAX)) {
        return std::nullopt;
    }
    return static_cast<int32_t>(raw);
}

}  // namespace fsoe_net_ros
