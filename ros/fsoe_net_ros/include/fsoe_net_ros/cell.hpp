/** A bus that fsn-master drives as named numbers that are read and written: all that ros2_control needs
 *  of it, without ROS. Part of the black channel, no safety function.
 *
 *  A state is an input of the plan, by its name (`drive_1.velocity`), or an FSoE connection with
 *  `in_data` (1 or 0) and `state` (0 silent … 6 process data, 7 unknown). A command is an output of the
 *  plan. An input and an output may share a name; one is never taken for the other.
 *
 *  Of an axis by CiA 402 the outputs are those of the state machine in <fsn/axis.h>. A controller that
 *  claims its target asks for operation. After a stop of any kind the axis needs another claim.
 *
 *  From configure() on a thread follows the connections. When fsn-master or its bus is gone, it connects
 *  again, and states return by themselves. Commands do not: they need activate() again.
 */
#ifndef FSOE_NET_ROS__CELL_HPP_
#define FSOE_NET_ROS__CELL_HPP_

#include <chrono>
#include <cstdint>
#include <deque>
#include <functional>
#include <memory>
#include <stdexcept>
#include <string>
#include <vector>

struct fsn_realtime;
struct fsn_realtime_symbol;

namespace fsoe_net_ros {

/** Why something cannot be done, for people, with the next step where there is one. */
class Fault : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

/** Commands of an axis. */
enum class AxisRole { kPosition, kVelocity, kEffort, kMode, kResetFault, kHome };
constexpr std::size_t kAxisRoles = 6;

struct AxisOptions {
    std::string component;          ///< joint, for messages
    std::string subdevice;          ///< in the plan
    unsigned number = 0;            ///< objects of axis n are 0x800 * n higher
    int mode = 8;                   ///< mode of operation while no controller commands one
    double max_velocity = 0;        ///< in the unit of the commands; 0: no mode that needs it
    double max_effort = 0;          ///< same
    bool auto_fault_reset = false;  ///< the axis is off afterwards
};

class DrivenAxis;
enum class AxisEvent;

class Cell {
public:
    struct Options {
        std::string socket;         ///< control socket of fsn-master
        std::string plan_sha256;    ///< the plan that it must drive, in hexadecimal; empty: any
        unsigned misses = 10;       ///< cycles that may pass without new commands, see fsn/client.h
        bool start = false;         ///< configure() also starts a bus that is stopped
        bool waits = false;         ///< read() waits for the next cycle, for at most two of them
        unsigned lost_ms = 100;     ///< without a cycle, or with SubDevices missing, until write() fails
        /** Called by the thread: why there is no connection, and when it is back. */
        std::function<void(const std::string &)> report = [](const std::string &) {};
    };

    explicit Cell(Options options);
    ~Cell();
    Cell(const Cell &) = delete;
    Cell &operator=(const Cell &) = delete;

    /** Declares a state; the place of its value, valid as long as this object. Not a number until it
     *  is read.
     *  @param[in] name  `drive_1/position`, as ros2_control calls it. */
    const double *add_state(const std::string &name);

    /** Declares a command; one that is bound to nothing is ignored.
     *
     *  While no controller claims it, or its value is not a number, there is no command. An output
     *  without a command has `initial`, or its stop value where that is not a number. A target
     *  position without one holds the last position that was sent while the drive is enabled, and
     *  follows the actual position while it is not: an axis neither sags nor jumps.
     *  @param[in] name  as ros2_control calls it; claim() and release() take it. */
    double *add_command(const std::string &name, double initial);

    /** Binds states and commands again: until then they have no value. */
    void unbind();

    /** Binds a state, if it was declared. Before configure().
     *  @param[in] symbol  name of an input of the plan, or `CONNECTION.in_data`, `CONNECTION.state`. */
    void bind_state(const std::string &name, const std::string &symbol);

    /** Binds a command, if it was declared, to an output of the plan. Before configure(). */
    void bind_command(const std::string &name, const std::string &symbol);

    /** Adds an axis: a command of one of its outputs is then a command of the axis. Before configure().
     *  @return its number. */
    std::size_t add_axis(const AxisOptions &options);

    /** Binds a command of an axis that is not an output: to reset a fault or to home, when it changes
     *  from 0 to another number. */
    void bind_request(const std::string &name, std::size_t axis, AxisRole role);

    /** Names that are bound to nothing. */
    std::vector<std::string> unbound() const;

    /** Sets the socket, and the plan that fsn-master must drive there. Before configure(). */
    void use(const std::string &socket, const std::string &plan_sha256) {
        options_.socket = socket;
        options_.plan_sha256 = plan_sha256;
    }

    /** A controller commands this from now on; its value counts once it is written. RT-safe. */
    void claim(const std::string &name);

    /** No controller commands this any more: what is written into it does not count. RT-safe. */
    void release(const std::string &name);

    /** @throws Fault  the mode of an axis needs a limit that it does not have. */
    void check_axes() const;

    /** Connects, and finds every state and command. Waits for a reply, and for a bus that it starts, for
     *  at most a second each.
     *  @throws Fault  nobody answers, the bus does not run, a name is not there, or check_axes(). */
    void configure();

    /** Takes the outputs. @throws Fault  they are not free, or the bus has stopped. */
    void activate();

    /** Takes the newest cycle, or waits for the next one. Without one for `lost_ms`, inputs are not a number. RT-safe but for the text
     *  of a fault. */
    void read();

    /** Start of the cycle whose inputs the last read() has, in ns of CLOCK_MONOTONIC; 0: no cycle yet. */
    uint64_t cycle_ns() const { return cycle_ns_; }

    /** Sends the commands, once activate() has taken the outputs.
     *  @return false  the bus has stopped, cycles or SubDevices are missing, the outputs were taken back, or
     *  a command is outside the range of its output: fault() says which, and nothing is sent. Never
     *  without outputs. RT-safe but for the text of a fault. */
    bool write();

    /** What an axis has done by itself in the last write(), empty if nothing. */
    const std::string &notice() const { return notice_; }

    /** Gives the outputs back: they take their stop values, until a controller claims them again. States are
     *  still read. Does not wait. */
    void deactivate();

    /** Gives the outputs back and disconnects, without waiting for any thread: what an error in the
     *  real-time thread may call. States are not a number. The bus continues. */
    void disconnect();

    /** disconnect(), and waits for the thread that follows the connections. */
    void cleanup();

    const std::string &fault() const { return fault_; }

private:
    class Link;
    class Follower;
    struct State {
        std::string name, symbol_name;
        double number;
    };
    struct AxisCommand {
        DrivenAxis *axis;   // null: an output of its own
        AxisRole role;
    };
    struct Command {
        std::string name, symbol_name;
        double number, initial;
        AxisCommand of_axis;  // without an output
        bool claimed, sent;   // a controller has it; a position was sent
    };

    std::vector<std::string> output_names() const;
    AxisCommand find_axis(const Command &command, const struct fsn_realtime_symbol &symbol) const;
    void open_axes();
    void close_writer();
    void take_fresh_link();
    void show(double &number, const Link &link, std::size_t row, bool has_cycle, bool is_stalled) const;
    const char *find_fault(int status, bool is_stalled, bool is_incomplete) const;
    uint64_t longest_wait_ns(const fsn_realtime *realtime) const;
    bool write_command(std::size_t row);
    void step_axes();
    void report_axis(const DrivenAxis &axis, AxisEvent event);
    bool holds_position(std::size_t row) const;
    bool refuse(const std::string &text);

    Options options_;
    std::deque<State> states_;
    std::deque<Command> commands_;
    std::vector<std::unique_ptr<DrivenAxis>> axes_;
    std::shared_ptr<Link> link_;       // from configure() on
    fsn_realtime *writer_ = nullptr;   // from activate() on: has the outputs
    bool seen_ = false;                // the writer has the inputs of a cycle
    bool is_fresh_ = false;            // no write() has answered it yet
    uint64_t cycle_ns_ = 0;            // its start
    std::unique_ptr<Follower> follower_;
    std::chrono::steady_clock::time_point last_cycle_, last_complete_;
    bool is_lost_ = false;
    std::string fault_, notice_;
};

}  // namespace fsoe_net_ros

#endif  // FSOE_NET_ROS__CELL_HPP_
