#include "fsoe_net_ros/cell.hpp"

#include <cmath>
#include <fsn/client.h>
#include <limits>
#include <vector>

#include "control_socket.hpp"

namespace fsoe_net_ros {

namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
constexpr int32_t kNone = FSN_REALTIME_NONE;
constexpr std::size_t kNoConnection = std::numeric_limits<std::size_t>::max();
constexpr int kProcessData = 6, kFailSafeData = 5, kUnknown = 0;
constexpr auto kLook = std::chrono::milliseconds(50);

bool is_target_position(const std::string &interface) {
    return interface == "position" || interface.rfind("0x607a", 0) == 0;
}

}  // namespace

Cell::Cell(Options options) : options_(std::move(options)) {}

Cell::~Cell() { cleanup(); }

const double *Cell::add_state(const std::string &component, const std::string &interface) {
    states_.push_back({component, interface, kNothing, kNone, kNone, kNoConnection});
    return &states_.back().number;
}

double *Cell::add_command(const std::string &component, const std::string &interface) {
    commands_.push_back({component, interface, kNothing, kNone, kNone, kNoConnection});
    return &commands_.back().number;
}

void Cell::configure() {
    cleanup();
    wait_until_running();
    read_connections();
    open(false);
    try {
        resolve();
    } catch (const Fault &) {
        cleanup();
        throw;
    }
    ending_ = false;
    follows_ = true;
    follower_ = std::thread(&Cell::follow_connections, this);
}

void Cell::activate() {
    open(true);
    for (Value &command : commands_) {
        command.number = kNothing;  // what an earlier controller wrote counts no longer
    }
}

void Cell::deactivate() { open(false); }

void Cell::cleanup() {
    ending_ = true;
    if (follower_.joinable()) {
        follower_.join();
    }
    close();
}

bool Cell::read() {
    if (realtime_ == nullptr) {
        return refuse("not connected");
    }
    fsn_realtime_cycle cycle{};
    const fsn_status status = fsn_realtime_wait(realtime_, 0, &cycle);
    const auto now = std::chrono::steady_clock::now();
    if (status == FSN_E_STATE) {
        return refuse("the bus was stopped, or fsn-master has ended");
    }
    if (status == FSN_E_CLOSED) {
        return refuse("commands came too late: the outputs took their stop values; raise `misses`, or the "
                      "update rate of the controller manager");
    }
    if (status == FSN_OK) {
        for (Value &state : states_) {
            if (state.symbol != kNone) {
                state.number = fsn_realtime_value(realtime_, state.symbol);
            }
        }
        if (cycle.actual_wkc == cycle.expected_wkc) {
            last_good_ = now;
        }
    }
    for (Value &state : states_) {
        if (state.connection != kNoConnection) {
            const int now_state = connections_[state.connection].state;
            const bool in_data = now_state == kProcessData || now_state == kFailSafeData;
            state.number = state.interface == "state" ? now_state : (in_data ? 1.0 : 0.0);
        }
    }
    if (!follows_) {
        return refuse("fsn-master does not answer");
    }
    if (now - last_good_ > std::chrono::milliseconds(options_.lost_ms)) {
        return refuse(status == FSN_OK ? "SubDevices are missing: the working counter is incomplete"
                                       : "no cycle comes from fsn-master");
    }
    return true;
}

bool Cell::write() {
    if (realtime_ == nullptr) {
        return refuse("not connected");
    }
    if (!active_) {
        return true;  // the outputs are nobody's, and have their stop values
    }
    for (const Value &command : commands_) {
        double number = command.number;
        if (std::isnan(number) && command.actual != kNone) {
            number = fsn_realtime_value(realtime_, command.actual);
        }
        if (!std::isnan(number) &&
            fsn_realtime_set_value(realtime_, command.symbol, number) != FSN_OK) {
            return refuse(command.component + "/" + command.interface + " cannot take " +
                          std::to_string(number));
        }
    }
    if (!commands_.empty()) {
        fsn_realtime_send(realtime_);
    }
    return true;
}

void Cell::open(bool with_outputs) {
    close();
    std::vector<std::string> names;
    std::vector<const char *> outputs;
    if (with_outputs) {
        for (const Value &command : commands_) {
            names.push_back(command.component + "." + command.interface);
        }
        for (const std::string &name : names) {
            outputs.push_back(name.c_str());
        }
    }
    fsn_realtime_options options{};
    options.socket = options_.socket.c_str();
    options.outputs = outputs.data();
    options.output_count = outputs.size();
    options.misses = options_.misses;
    fsn_realtime_fault fault{};
    if (fsn_realtime_open(&options, &realtime_, &fault) != FSN_OK) {
        realtime_ = nullptr;
        throw Fault(fault.text);
    }
    active_ = with_outputs;
    last_good_ = std::chrono::steady_clock::now();
}

void Cell::close() {
    fsn_realtime_close(realtime_);
    realtime_ = nullptr;
}

int32_t Cell::find(const std::string &name, bool output) const {
    const uint32_t count = fsn_realtime_symbol_count(realtime_);
    for (uint32_t number = 0; number < count; ++number) {
        struct fsn_realtime_symbol symbol{};
        if (fsn_realtime_symbol(realtime_, number, &symbol) == FSN_OK && symbol.bits != 0 &&
            symbol.output == output && name == symbol.name) {
            return static_cast<int32_t>(number);
        }
    }
    return kNone;
}

void Cell::resolve() {
    for (Value &state : states_) {
        const std::string name = state.component + "." + state.interface;
        state.symbol = find(name, false);
        if (state.symbol == kNone) {
            state.symbol = find(name, true);  // what was sent
        }
        for (std::size_t i = 0; state.symbol == kNone && i < connections_.size(); ++i) {
            const bool known = state.interface == "in_data" || state.interface == "state";
            if (known && connections_[i].name == state.component) {
                state.connection = i;
            }
        }
        if (state.symbol == kNone && state.connection == kNoConnection) {
            throw Fault("the plan has no state " + state.component + "/" + state.interface +
                        "; `fsoe-net console -c list` shows the names");
        }
    }
    for (Value &command : commands_) {
        command.symbol = find(command.component + "." + command.interface, true);
        if (command.symbol == kNone) {
            throw Fault("the plan has no output " + command.component + "/" + command.interface +
                        "; `fsoe-net console -c list` shows the names");
        }
        if (is_target_position(command.interface)) {
            for (const char *entry : {".0x6064:00", ".position"}) {
                if (command.actual == kNone) {
                    command.actual = find(command.component + entry, false);
                }
            }
            if (command.actual == kNone) {
                throw Fault(command.component + "/" + command.interface +
                            " is a target position, and the plan has no actual one: the axis would jump");
            }
        }
    }
}

void Cell::wait_until_running() {
    ControlSocket control(options_.socket);
    const auto until = std::chrono::steady_clock::now() + std::chrono::seconds(options_.start_s);
    bool started = false;
    for (;;) {
        const auto status = control.request("status");
        const std::string state = status.value("state", "");
        if (state == "running") {
            return;
        }
        if ((state == "stopped" || state == "failed") && (started || !options_.start)) {
            const auto &why = status["fault"];
            throw Fault("the bus does not run (" + state + ")" +
                        (why.is_string() ? ": " + why.get<std::string>() : std::string()));
        }
        if (state == "stopped" || state == "failed") {
            control.request("start");
            started = true;
        }
        if (std::chrono::steady_clock::now() > until) {
            throw Fault("the bus is not running yet: " + state);
        }
        std::this_thread::sleep_for(kLook);
    }
}

void Cell::read_connections() {
    ControlSocket control(options_.socket);
    const auto snapshot = control.request("snapshot");
    connections_.clear();
    for (const auto &row : snapshot.value("connections", nlohmann::json::array())) {
        connections_.emplace_back();
        connections_.back().name = row.value("name", "");
        connections_.back().state = row.value("outside", kUnknown);
    }
}

void Cell::follow_connections() {
    try {
        ControlSocket control(options_.socket);
        while (!ending_) {
            const auto snapshot = control.request("snapshot");
            std::size_t number = 0;
            for (const auto &row : snapshot.value("connections", nlohmann::json::array())) {
                if (number < connections_.size()) {
                    connections_[number++].state = row.value("outside", kUnknown);
                }
            }
            std::this_thread::sleep_for(kLook);
        }
    } catch (const std::exception &) {
        for (Connection &connection : connections_) {
            connection.state = kUnknown;
        }
        follows_ = false;
    }
}

bool Cell::refuse(const std::string &text) {
    fault_ = text;
    return false;
}

}  // namespace fsoe_net_ros
