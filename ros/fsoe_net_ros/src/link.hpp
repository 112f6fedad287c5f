/** The connection of a cell to fsn-master, and the thread that renews it. */
#ifndef LINK_HPP_
#define LINK_HPP_

#include <atomic>
#include <deque>
#include <fsn/client.h>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <string>
#include <thread>
#include <vector>

#include "fsoe_net_ros/cell.hpp"

namespace fsoe_net_ros {

constexpr int32_t kNone = FSN_REALTIME_NONE;
constexpr int kUnknown = 7;  // state of a connection
constexpr int kTryMs = 1000;

/** Opens the memory of fsn-master, to write these outputs. @throws Fault  it cannot be opened. */
fsn_realtime *open_client(const Cell::Options &options, const std::vector<std::string> &outputs);

/** One connection: its memory, and the positions of the names of the cell in its plan. */
class Cell::Link {
public:
    struct State {
        int32_t symbol;                 // input of the plan; none: of a connection
        std::atomic<int> *connection;   // its state; null: an input, or nothing
        bool in_data;                   // 1 or 0, not the number of its state
    };
    struct Command {
        int32_t symbol, actual, status;   // of a target position: actual position and statusword
        uint64_t stop_value;
        AxisCommand of_axis;
    };

    /** @param[in] rows  connections of a `snapshot`. @throws Fault  a name is not in the plan. */
    Link(const Cell &cell, const nlohmann::json &rows);

    /** Memory without outputs. */
    fsn_realtime *reader() const { return reader_.get(); }

    /** Sets the states of the connections from the rows of a `snapshot`. */
    void update(const nlohmann::json &rows);

    /** The control socket does not answer: the states of the connections are unknown. */
    void forget();

    std::vector<State> states;
    std::vector<Command> commands;
    std::atomic<bool> answers{true};   // the control socket does
    std::atomic<bool> ended{false};    // the bus was stopped: it must be opened again

private:
    struct Connection {
        std::string name;
        std::atomic<int> state{kUnknown};
    };

    State find_state(const Cell::State &state);
    Command find_command(const Cell &cell, const Cell::Command &command) const;
    void find_position(const Cell::Command &command, const struct fsn_realtime_symbol &target, Command &found) const;
    int32_t find_object(const std::string &subdevice, unsigned index) const;

    std::unique_ptr<fsn_realtime, decltype(&fsn_realtime_close)> reader_;
    std::deque<Connection> connections_;
};

/** Opens links, and follows the newest one in a thread until it has ended. Never takes outputs. */
class Cell::Follower {
public:
    explicit Follower(const Cell &cell);
    ~Follower();
    Follower(const Follower &) = delete;
    Follower &operator=(const Follower &) = delete;

    /** Connects, and starts the thread. @throws Fault  as Cell::configure(). */
    std::shared_ptr<Link> start();

    /** Replaces a link that does not answer by the next one, if there is one. RT-safe. */
    bool renew(std::shared_ptr<Link> &link);

    /** Ends what the thread waits for, without waiting for the thread. RT-safe. */
    void wake();

    /** Ends the thread after wake(), and waits for it. */
    void stop();

private:
    void start_bus() const;
    std::shared_ptr<Link> connect() const;
    void follow(std::shared_ptr<Link> link);
    void follow_connections(Link &link) const;
    bool is_woken(int wait_ms) const;

    const Cell &cell_;
    int wake_;                       // eventfd
    std::mutex mutex_;               // of the next; renew() never waits for it
    std::shared_ptr<Link> fresh_;    // the next link, or the former: the thread frees it
    std::thread thread_;
};

}  // namespace fsoe_net_ros

#endif  // LINK_HPP_
