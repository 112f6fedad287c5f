/** A bus that fsn-master drives as named numbers that are read and written: all that ros2_control needs
 *  of it, without ROS. Part of the black channel, no safety function.
 *
 *  A state or command is COMPONENT and INTERFACE: SubDevice and entry of the plan (`drive_1`,
 *  `velocity`), or an FSoE connection with `in_data` (1 or 0) and `state` (0 silent … 6 process data).
 */
#ifndef FSOE_NET_ROS_CELL_HPP
#define FSOE_NET_ROS_CELL_HPP

#include <atomic>
#include <chrono>
#include <deque>
#include <memory>
#include <stdexcept>
#include <string>
#include <thread>

struct fsn_realtime;

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
     *  is read. Before configure(). */
    const double *add_state(const std::string &component, const std::string &interface);

    /** Declares a command. Not a number is no command: a target position then follows the actual one,
     *  any other output has its stop value. Before configure(). */
    double *add_command(const std::string &component, const std::string &interface);

    /** Connects, waits until the bus runs, and finds every state and command.
     *  @throws Fault  nobody answers, the bus does not run, or a name is not there. */
    void configure();

    /** Takes the outputs. @throws Fault  they are not free, or the bus has stopped. */
    void activate();

    /** Takes the newest cycle.
     *  @return false  the bus has stopped, cycles or SubDevices are missing, or the outputs were taken
     *  back: fault() says which. RT-safe but for the text of a fault. */
    bool read();

    /** Sends the commands, once activate() has taken the outputs. @return false  one is outside the range of its output: fault() names it, and
     *  nothing is sent. RT-safe but for the text of a fault. */
    bool write();

    /** Gives the outputs back: they take their stop values. States are read on. @throws Fault */
    void deactivate();

    /** Disconnects; the bus goes on. */
    void cleanup();

    const std::string &fault() const { return fault_; }

private:
    struct Value {
        std::string component, interface;
        double number;
        int32_t symbol;           // of the plan; none: of a connection
        int32_t actual;           // of a target position: where the axis is
        std::size_t connection;   // index, for a state of a connection
    };
    struct Connection {
        std::string name;
        std::atomic<int> state{0};
    };

    void open(bool with_outputs);
    void close();
    int32_t find(const std::string &name, bool output) const;
    void resolve();
    void wait_until_running();
    void read_connections();
    void follow_connections();
    bool refuse(const std::string &text);

    Options options_;
    std::deque<Value> states_, commands_;
    std::deque<Connection> connections_;
    fsn_realtime *realtime_ = nullptr;
    bool active_ = false;
    std::thread follower_;
    std::atomic<bool> ending_{false}, follows_{false};
    std::chrono::steady_clock::time_point last_good_;
    std::string fault_;
};

}  // namespace fsoe_net_ros

#endif
