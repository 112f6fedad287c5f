/** A bus that fsn-master drives as named numbers that are read and written: all that ros2_control needs
 *  of it, without ROS. Part of the black channel, no safety function.
 *
 *  A state is an input of the plan, by its name (`drive_1.velocity`), or an FSoE connection with
 *  `in_data` (1 or 0) and `state` (0 silent … 6 process data). A command is an output of the plan. An
 *  input and an output may share a name; one is never taken for the other.
 */
#ifndef FSOE_NET_ROS_CELL_HPP
#define FSOE_NET_ROS_CELL_HPP

#include <atomic>
#include <chrono>
#include <cstdint>
#include <deque>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

struct fsn_realtime;
struct fsn_realtime_symbol;

namespace fsoe_net_ros {

/** Why something cannot be done, for people, with the next step where there is one. */
class Fault : public std::runtime_error {
public:
    using std::runtime_error::runtime_error;
};

class Cell {
public:
    struct Options {
        std::string socket;         ///< control socket of fsn-master
        unsigned misses = 10;       ///< cycles that may pass without new commands, see fsn/client.h
        bool start = false;         ///< configure() also starts a bus that is stopped
        unsigned start_s = 60;      ///< how long it may take to run
        unsigned lost_ms = 100;     ///< without a cycle, or with SubDevices missing, until read() fails
    };

    explicit Cell(Options options);
    ~Cell();
    Cell(const Cell &) = delete;
    Cell &operator=(const Cell &) = delete;

    /** Declares a state; the place of its value, valid as long as this object. Not a number until it
     *  is read. Before configure().
     *  @param[in] name    `drive_1/position`, for messages.
     *  @param[in] symbol  name of an input of the plan, or `CONNECTION.in_data`, `CONNECTION.state`. */
    const double *add_state(const std::string &name, const std::string &symbol);

    /** Declares a command. Before configure().
     *
     *  While no controller claims it, or its value is not a number, there is no command. An output
     *  without a command has `initial`, or its stop value where that is not a number. A target
     *  position without one holds the last position that was sent while the drive is enabled, and
     *  follows the actual position while it is not: an axis neither sags nor jumps.
     *  @param[in] name  as ros2_control calls it; claim() and release() take it. */
    double *add_command(const std::string &name, const std::string &symbol, double initial);

    /** A controller commands this from now on; its value counts once it is written. RT-safe. */
    void claim(const std::string &name);

    /** No controller commands this any more: what is written into it does not count. RT-safe. */
    void release(const std::string &name);

    /** Connects, waits until the bus runs, and finds every state and command.
     *  @throws Fault  nobody answers, the bus does not run, or a name is not there. */
    void configure();

    /** Takes the outputs. @throws Fault  they are not free, or the bus has stopped. */
    void activate();

    /** Takes the newest cycle.
     *  @return false  the bus has stopped, cycles or SubDevices are missing, or the outputs were taken
     *  back: fault() says which. RT-safe but for the text of a fault. */
    bool read();

    /** Sends the commands, once activate() has taken the outputs.
     *  @return false  one is outside the range of its output: fault() names it, and nothing is sent.
     *  RT-safe but for the text of a fault. */
    bool write();

    /** Gives the outputs back: they take their stop values. States are still read. Does not wait. */
    void deactivate();

    /** Gives the outputs back and disconnects, without waiting for any thread: what an error in the
     *  real-time thread may call. The bus continues. */
    void disconnect();

    /** disconnect(), and waits for the thread that follows the connections. */
    void cleanup();

    const std::string &fault() const { return fault_; }

private:
    struct State {
        std::string name, symbol_name;
        double number;
        int32_t symbol;           // input of the plan; none: of a connection
        std::size_t connection;   // its index
        bool in_data;             // 1 or 0, not the number of its state
    };
    struct Command {
        std::string name, symbol_name;
        double number, initial;
        int32_t symbol, actual, status;   // of a target position: actual position and statusword
        uint64_t stop_value;
        bool claimed, sent;               // a controller has it; a position was sent
    };
    struct Connection {
        std::string name;
        std::atomic<int> state{0};
    };

    fsn_realtime *open(bool with_outputs) const;
    fsn_realtime *current() const { return writer_ != nullptr ? writer_ : reader_; }
    int32_t find_object(const std::string &subdevice, unsigned index) const;
    void resolve_state(State &state);
    void resolve_command(Command &command);
    void resolve_position(Command &command, const struct fsn_realtime_symbol &target);
    bool write_command(Command &command);
    bool holds_position(Command &command) const;
    void wait_until_running();
    void read_connections();
    void follow_connections();
    bool refuse(const std::string &text);

    Options options_;
    std::deque<State> states_;
    std::deque<Command> commands_;
    std::deque<Connection> connections_;
    fsn_realtime *reader_ = nullptr;   // from configure() on
    fsn_realtime *writer_ = nullptr;   // from activate() on: has the outputs
    bool seen_ = false;                // the writer has the inputs of a cycle
    std::thread follower_;
    int wake_;                         // eventfd: ends what the follower waits for
    std::atomic<bool> follows_{false};
    std::chrono::steady_clock::time_point last_good_;
    std::string fault_;
};

}  // namespace fsoe_net_ros

#endif
