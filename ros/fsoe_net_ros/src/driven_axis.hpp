/** An axis of a cell: the state machine of <fsn/axis.h>, driven by commands of controllers. */
#ifndef DRIVEN_AXIS_HPP_
#define DRIVEN_AXIS_HPP_

#include <array>
#include <fsn/axis.h>
#include <fsn/client.h>
#include <limits>
#include <optional>
#include <string>
#include <utility>

#include "fsoe_net_ros/cell.hpp"

namespace fsoe_net_ros {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();  // no value, no command

/** What a step has found. */
enum class AxisEvent { kNothing, kStopped, kCannotEnable, kRefused };

class DrivenAxis {
public:
    explicit DrivenAxis(AxisOptions options) : options_(std::move(options)) {}

    const std::string &name() const { return options_.component; }

    /** Whether this axis writes an output. */
    bool drives(const struct fsn_realtime_symbol &symbol) const;

    /** The command that an output of this axis takes; none: the axis alone writes it. */
    std::optional<AxisRole> role_of(const struct fsn_realtime_symbol &symbol) const;

    /** @throws Fault  its mode needs a limit that it does not have. */
    void check() const;

    /** Finds the objects in a client that owns their outputs; the axis is off.
     *  @param[in] write_s  longest time between two writes: a position may change by as much as
     *                      `max_velocity` permits in it.
     *  @throws Fault  an object is missing. */
    void open(const fsn_realtime *writer, double write_s);

    /** A controller has claimed a command: a target, or homing, asks for operation. RT-safe. */
    void claim(AxisRole role);

    /** Sets a command for the next step; not a number: none. RT-safe. */
    void set(AxisRole role, double number) { commands_[static_cast<std::size_t>(role)] = number; }

    /** One cycle of the bus, by its start. RT-safe. */
    AxisEvent step(fsn_realtime *writer, uint64_t cycle_ns);

    /** Quick stop; it needs a claim to start again. RT-safe. */
    void stop();

    /** State of the axis in words. */
    const char *phase() const { return fsn_axis_phase_name(own_.axis.phase); }

private:
    struct Scale {
        double factor, offset;
    };

    double command(AxisRole role) const { return commands_[static_cast<std::size_t>(role)]; }
    void find_scales(const fsn_realtime *writer);
    uint32_t limit(AxisRole role, double most) const;
    bool is_on() const;
    bool rises(AxisRole role);
    AxisEvent obey();
    void reset_faults();
    bool enable();
    bool set_mode();
    bool set_targets();
    bool set_position();
    bool move();
    bool home();
    std::optional<int32_t> raw_of(AxisRole role, double otherwise) const;

    AxisOptions options_;
    fsn_realtime_axis own_{};
    std::array<double, kAxisRoles> commands_{}, earlier_{};
    std::array<Scale, kAxisRoles> scales_{};
    double moved_to_ = 0;
    bool asks_ = false, homes_ = false, has_stepped_ = false;
};

}  // namespace fsoe_net_ros

#endif  // DRIVEN_AXIS_HPP_
