#include "fsoe_net_ros/cell.hpp"

#include <cerrno>
#include <cmath>
#include <cstring>
#include <fsn/client.h>
#include <limits>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>
#include <vector>

#include "control_socket.hpp"

namespace fsoe_net_ros {

namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
constexpr int32_t kNone = FSN_REALTIME_NONE;
constexpr std::size_t kNoConnection = std::numeric_limits<std::size_t>::max();
constexpr int kProcessData = 6, kFailSafeData = 5, kUnknown = 0;
constexpr int kLookMs = 50;
// CiA 402 (IEC 61800-7-201): objects of axis n are 0x800 * n higher.
constexpr unsigned kStatusword = 0x6041, kActualPosition = 0x6064, kTargetPosition = 0x607A;
constexpr unsigned kAxisStep = 0x800, kMostAxes = 8;
constexpr uint64_t kStateMask = 0x6F, kOperationEnabled = 0x27;

/** What is added to the objects of axis 0, of a target position; -1: the object is none. */
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

Cell::Cell(Options options)
    : options_(std::move(options)), wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (wake_ < 0) {
        throw Fault(std::string("no eventfd: ") + std::strerror(errno));
    }
}

Cell::~Cell() {
    cleanup();
    ::close(wake_);
}

const double *Cell::add_state(const std::string &name, const std::string &symbol) {
    states_.push_back({name, symbol, kNothing, kNone, kNoConnection, false});
    return &states_.back().number;
}

double *Cell::add_command(const std::string &name, const std::string &symbol, double initial) {
    commands_.push_back({name, symbol, kNothing, initial, kNone, kNone, kNone, 0, false, false});
    return &commands_.back().number;
}

void Cell::claim(const std::string &name) {
    for (Command &command : commands_) {
        if (command.name == name) {
            command.claimed = true;
            command.number = kNothing;  // what an earlier controller wrote does not count
        }
    }
}

void Cell::release(const std::string &name) {
    for (Command &command : commands_) {
        if (command.name == name) {
            command.claimed = false;
        }
    }
}

void Cell::configure() {
    cleanup();
    wait_until_running();
    read_connections();
    reader_ = open(false);
    try {
        for (State &state : states_) {
            resolve_state(state);
        }
        for (Command &command : commands_) {
            resolve_command(command);
        }
    } catch (const Fault &) {
        cleanup();
        throw;
    }
    last_good_ = std::chrono::steady_clock::now();
    follows_ = true;
    follower_ = std::thread(&Cell::follow_connections, this);
}

void Cell::activate() {
    writer_ = open(true);
    seen_ = false;
    for (Command &command : commands_) {
        command.number = kNothing;
        command.sent = false;
    }
    last_good_ = std::chrono::steady_clock::now();
}

void Cell::deactivate() {
    fsn_realtime_close(writer_);
    writer_ = nullptr;
}

void Cell::disconnect() {
    deactivate();
    fsn_realtime_close(reader_);
    reader_ = nullptr;
    const uint64_t once = 1;
    (void)!::write(wake_, &once, sizeof once);
}

void Cell::cleanup() {
    disconnect();
    if (follower_.joinable()) {
        follower_.join();
    }
    uint64_t count;
    (void)!::read(wake_, &count, sizeof count);
}

bool Cell::read() {
    fsn_realtime *realtime = current();
    if (realtime == nullptr) {
        return refuse("not connected");
    }
    fsn_realtime_cycle cycle{};
    const fsn_status status = fsn_realtime_wait(realtime, 0, &cycle);
    const auto now = std::chrono::steady_clock::now();
    if (status == FSN_E_STATE) {
        return refuse("the bus was stopped, or fsn-master has ended");
    }
    if (status == FSN_E_CLOSED) {
        return refuse("commands came too late: the outputs took their stop values; raise `misses`, or the "
                      "update rate of the controller manager");
    }
    seen_ = seen_ || status == FSN_OK;
    if (status == FSN_OK && cycle.actual_wkc == cycle.expected_wkc) {
        last_good_ = now;
    }
    for (State &state : states_) {
        if (state.connection != kNoConnection) {
            const int now_state = connections_[state.connection].state;
            const bool in_data = now_state == kProcessData || now_state == kFailSafeData;
            state.number = !state.in_data ? now_state : (in_data ? 1.0 : 0.0);
        } else if (status == FSN_OK) {
            state.number = fsn_realtime_value(realtime, state.symbol);
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
    if (reader_ == nullptr) {
        return refuse("not connected");
    }
    if (writer_ == nullptr || !seen_) {
        return true;  // the outputs have their stop values; an actual position is not known yet
    }
    for (Command &command : commands_) {
        if (!write_command(command)) {
            return refuse(command.name + " cannot take " + std::to_string(command.number));
        }
    }
    if (!commands_.empty()) {
        fsn_realtime_send(writer_);
    }
    return true;
}

bool Cell::write_command(Command &command) {
    double number = command.claimed ? command.number : kNothing;
    if (std::isnan(number) && command.actual != kNone) {
        if (holds_position(command)) {
            return true;
        }
        number = fsn_realtime_value(writer_, command.actual);
    }
    if (std::isnan(number)) {
        number = command.initial;
    }
    if (std::isnan(number)) {
        return fsn_realtime_set(writer_, command.symbol, command.stop_value) == FSN_OK;
    }
    command.sent = true;
    return fsn_realtime_set_value(writer_, command.symbol, number) == FSN_OK;
}

/** Whether a target position keeps what was sent last: following the actual position of an enabled
 *  drive would let a loaded axis sag. */
bool Cell::holds_position(Command &command) const {
    const bool enabled =
        command.status != kNone &&
        (fsn_realtime_get(writer_, command.status) & kStateMask) == kOperationEnabled;
    return enabled && command.sent;
}

fsn_realtime *Cell::open(bool with_outputs) const {
    std::vector<const char *> outputs;
    if (with_outputs) {
        for (const Command &command : commands_) {
            outputs.push_back(command.symbol_name.c_str());
        }
    }
    fsn_realtime_options options{};
    options.socket = options_.socket.c_str();
    options.outputs = outputs.data();
    options.output_count = outputs.size();
    options.misses = options_.misses;
    fsn_realtime_fault fault{};
    fsn_realtime *opened = nullptr;
    if (fsn_realtime_open(&options, &opened, &fault) != FSN_OK) {
        throw Fault(fault.text);
    }
    return opened;
}

int32_t Cell::find_object(const std::string &subdevice, unsigned index) const {
    struct fsn_realtime_symbol symbol{};
    for (uint32_t n = 0; fsn_realtime_symbol(reader_, n, &symbol) == FSN_OK; ++n) {
        if (!symbol.output && symbol.index == index && symbol.subindex == 0 && symbol.bits != 0 &&
            subdevice == symbol.subdevice) {
            return static_cast<int32_t>(n);
        }
    }
    return kNone;
}

void Cell::resolve_state(State &state) {
    state.symbol = fsn_realtime_input(reader_, state.symbol_name.c_str());
    state.connection = kNoConnection;
    for (std::size_t i = 0; state.symbol == kNone && i < connections_.size(); ++i) {
        state.in_data = state.symbol_name == connections_[i].name + ".in_data";
        if (state.in_data || state.symbol_name == connections_[i].name + ".state") {
            state.connection = i;
            break;
        }
    }
    if (state.symbol != kNone || state.connection != kNoConnection) {
        return;
    }
    const bool is_output = fsn_realtime_output(reader_, state.symbol_name.c_str()) != kNone;
    throw Fault(state.name + ": the plan has no input " + state.symbol_name +
                (is_output ? "; the output of that name is what is sent, not a state: remove the "
                             "state_interface, or map what the SubDevice reports"
                           : "; `fsoe-net console -c list` shows the names"));
}

void Cell::resolve_command(Command &command) {
    command.symbol = fsn_realtime_output(reader_, command.symbol_name.c_str());
    struct fsn_realtime_symbol symbol{};
    if (command.symbol == kNone ||
        fsn_realtime_symbol(reader_, static_cast<uint32_t>(command.symbol), &symbol) != FSN_OK) {
        throw Fault(command.name + ": the plan has no output " + command.symbol_name +
                    "; `fsoe-net console -c list` shows the names");
    }
    command.stop_value = symbol.stop_value;
    command.actual = command.status = kNone;
    if (axis_base(symbol.index) >= 0 || ends_with(command.name, "/position")) {
        resolve_position(command, symbol);
    }
}

void Cell::resolve_position(Command &command, const struct fsn_realtime_symbol &target) {
    const int base = axis_base(target.index);
    if (base >= 0) {
        command.actual = find_object(target.subdevice, kActualPosition + static_cast<unsigned>(base));
        command.status = find_object(target.subdevice, kStatusword + static_cast<unsigned>(base));
    }
    if (command.actual == kNone) {  // a part of an object, or one of the maker
        const std::string name = std::string(target.subdevice) + ".position";
        command.actual = fsn_realtime_input(reader_, name.c_str());
    }
    if (command.actual == kNone) {
        throw Fault(command.name + " is a target position, and the plan has no actual one: the axis would jump");
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
        std::this_thread::sleep_for(std::chrono::milliseconds(kLookMs));
    }
}

void Cell::read_connections() {
    ControlSocket control(options_.socket);
    connections_.clear();
    for (const auto &row : control.rows("snapshot", "connections")) {
        connections_.emplace_back();
        connections_.back().name = row.value("name", "");
        connections_.back().state = row.value("observed_state", kUnknown);
    }
}

void Cell::follow_connections() {
    pollfd woken{wake_, POLLIN, 0};
    try {
        ControlSocket control(options_.socket, wake_);
        do {
            std::size_t number = 0;
            for (const auto &row : control.rows("snapshot", "connections")) {
                if (number < connections_.size()) {
                    connections_[number++].state = row.value("observed_state", kUnknown);
                }
            }
        } while (poll(&woken, 1, kLookMs) == 0);
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
