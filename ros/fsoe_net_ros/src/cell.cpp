#include "fsoe_net_ros/cell.hpp"

#include <atomic>
#include <cerrno>
#include <cmath>
#include <cstring>
#include <fsn/client.h>
#include <limits>
#include <poll.h>
#include <set>
#include <sys/eventfd.h>
#include <unistd.h>

#include "control_socket.hpp"
#include "driven_axis.hpp"

namespace fsoe_net_ros {

namespace {

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();
constexpr int32_t kNone = FSN_REALTIME_NONE;
constexpr std::size_t kNoConnection = std::numeric_limits<std::size_t>::max();
constexpr int kProcessData = 6, kFailSafeData = 5, kUnknown = 7;
constexpr int kLookMs = 50, kAgainMs = 500, kTryMs = 1000;
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

/** One connection to fsn-master: its memory, and where the names of the cell are in its plan. */
struct Cell::Link {
    struct State {
        int32_t symbol;           // input of the plan; none: of a connection
        std::size_t connection;   // its index
        bool in_data;             // 1 or 0, not the number of its state
    };
    struct Command {
        int32_t symbol, actual, status;   // of a target position: actual position and statusword
        uint64_t stop_value;
        AxisCommand of_axis;
    };
    struct Connection {
        std::string name;
        std::atomic<int> state{kUnknown};
    };

    explicit Link(fsn_realtime *opened) : reader(opened) {}
    ~Link() { fsn_realtime_close(reader); }

    State find_state(const Cell::State &state) const;
    Command find_command(const Cell &cell, const Cell::Command &command) const;
    void find_position(const Cell::Command &command, const struct fsn_realtime_symbol &target, Command &found) const;
    int32_t find_object(const std::string &subdevice, unsigned index) const;

    fsn_realtime *const reader;
    std::vector<State> states;
    std::vector<Command> commands;
    std::deque<Connection> connections;
    std::atomic<bool> answers{true};   // the control socket does
    std::atomic<bool> ended{false};    // the bus was stopped: it must be opened again
};

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

void Cell::claim(const std::string &name) {
    for (std::size_t row = 0; row < commands_.size(); ++row) {
        Command &command = commands_[row];
        if (command.name != name) {
            continue;
        }
        command.claimed = true;
        command.number = kNothing;  // what an earlier controller wrote does not count
        if (writer_ != nullptr && link_->commands[row].of_axis.axis != nullptr) {
            link_->commands[row].of_axis.axis->claim(link_->commands[row].of_axis.role);
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
    if (options_.start) {
        start_bus();
    }
    link_ = connect();
    last_cycle_ = last_complete_ = std::chrono::steady_clock::now();
    is_lost_ = false;
    follower_ = std::thread(&Cell::follow, this, link_);
}

void Cell::activate() {
    if (link_ == nullptr) {
        throw Fault("not connected");
    }
    take_fresh_link();
    if (!link_->answers) {
        throw Fault("fsn-master does not answer yet; activate again in a moment");
    }
    writer_ = open(true);
    // Names were found in the plan of the reader: both must be of one run of the bus.
    if (fsn_realtime_wait(link_->reader, 0, nullptr) == FSN_E_STATE) {
        link_->ended = true;
        deactivate();
        throw Fault("the bus was stopped and started again; activate again in a moment");
    }
    try {
        open_axes();
    } catch (const Fault &) {
        deactivate();
        throw;
    }
    seen_ = is_lost_ = is_fresh_ = false;
    for (Command &command : commands_) {
        command.number = kNothing;
        command.sent = false;
    }
    last_cycle_ = last_complete_ = std::chrono::steady_clock::now();
}

void Cell::deactivate() {
    fsn_realtime_close(writer_);
    writer_ = nullptr;
}

void Cell::disconnect() {
    deactivate();
    link_.reset();
    for (State &state : states_) {
        state.number = kNothing;
    }
    const uint64_t once = 1;
    (void)!::write(wake_, &once, sizeof once);
}

void Cell::cleanup() {
    disconnect();
    if (follower_.joinable()) {
        follower_.join();
    }
    fresh_.reset();
    uint64_t count;
    (void)!::read(wake_, &count, sizeof count);
}

/** Uses the link that the thread has opened, except while outputs are written: they belong to the old one. */
void Cell::take_fresh_link() {
    const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock() || fresh_ == nullptr || !fresh_->answers || link_->answers || writer_ != nullptr) {
        return;
    }
    link_.swap(fresh_);
    last_cycle_ = last_complete_ = std::chrono::steady_clock::now();
}

void Cell::read() {
    if (link_ == nullptr) {
        return;
    }
    take_fresh_link();
    fsn_realtime_cycle cycle{};
    fsn_realtime *const realtime = writer_ != nullptr ? writer_ : link_->reader;
    const fsn_status status = fsn_realtime_wait(realtime, longest_wait_ns(realtime), &cycle);
    const auto now = std::chrono::steady_clock::now();
    const auto most = std::chrono::milliseconds(options_.lost_ms);
    const bool has_cycle = status == FSN_OK;
    if (has_cycle) {
        // The time of the cycle: the newest cycle of a frozen bus is old.
        last_cycle_ = std::chrono::steady_clock::time_point(std::chrono::nanoseconds(cycle.now_ns));
        seen_ = is_fresh_ = true;
        cycle_ns_ = cycle.now_ns;
    }
    if (has_cycle && cycle.actual_wkc == cycle.expected_wkc) {
        last_complete_ = last_cycle_;
    }
    if (status == FSN_E_STATE) {
        link_->ended = true;
    }
    const bool is_stalled = status == FSN_E_STATE || now - last_cycle_ > most;
    for (std::size_t row = 0; row < states_.size(); ++row) {
        show(states_[row].number, *link_, row, has_cycle, is_stalled);
    }
    const char *fault = find_fault(status, is_stalled, now - last_complete_ > most);
    if (fault != nullptr && (!is_lost_ || fault_ != fault)) {
        fault_ = fault;
    }
    is_lost_ = fault != nullptr;
}

uint64_t Cell::longest_wait_ns(const fsn_realtime *realtime) const {
    return options_.waits ? 2 * fsn_realtime_cycle_ns(realtime) : 0;
}

/** Sets a state. The state of a connection is polled separately, but is not current without cycles. */
void Cell::show(double &number, const Link &link, std::size_t row, bool has_cycle, bool is_stalled) const {
    const Link::State &state = link.states[row];
    if (state.connection != kNoConnection) {
        const int now_state = is_stalled ? kUnknown : link.connections[state.connection].state.load();
        const bool in_data = now_state == kProcessData || now_state == kFailSafeData;
        number = !state.in_data ? now_state : (in_data ? 1.0 : 0.0);
    } else if (is_stalled || state.symbol == kNone) {
        number = kNothing;
    } else if (has_cycle) {
        number = fsn_realtime_value(writer_ != nullptr ? writer_ : link.reader, state.symbol);
    }
}

/** Returns the reason why commands cannot be sent, or NULL. */
const char *Cell::find_fault(int status, bool is_stalled, bool is_incomplete) const {
    if (status == FSN_E_STATE) {
        return "the bus was stopped, or fsn-master has ended";
    }
    if (status == FSN_E_CLOSED) {
        return "commands came too late: the outputs took their stop values; raise `misses`, or the "
               "update rate of the controller manager";
    }
    if (!link_->answers) {
        return "fsn-master does not answer";
    }
    if (is_stalled) {
        return "no cycle comes from fsn-master";
    }
    return is_incomplete ? "SubDevices are missing: the working counter is incomplete" : nullptr;
}

bool Cell::write() {
    notice_.clear();
    if (writer_ == nullptr) {
        return true;  // the outputs have their stop values
    }
    if (is_lost_) {
        return false;
    }
    if (!seen_) {
        return true;  // an actual position is not known yet
    }
    for (std::size_t row = 0; row < commands_.size(); ++row) {
        if (!write_command(row)) {
            return refuse(commands_[row].name + " cannot take " + std::to_string(commands_[row].number));
        }
    }
    if (is_fresh_) {
        step_axes();
    }
    is_fresh_ = false;
    if (!commands_.empty() || !axes_.empty()) {
        fsn_realtime_send(writer_);
    }
    return true;
}

/** A target that one axis refuses stops all: the others would continue without it. */
void Cell::step_axes() {
    bool refused = false;
    for (const auto &axis : axes_) {
        const AxisEvent event = axis->step(writer_, cycle_ns_);
        refused = refused || event == AxisEvent::kRefused;
        if (event != AxisEvent::kNothing) {
            report_axis(*axis, event);
        }
    }
    for (const auto &axis : axes_) {
        if (refused) {
            axis->stop();
        }
    }
}

void Cell::report_axis(const DrivenAxis &axis, AxisEvent event) {
    static constexpr const char *kTexts[] = {"", " has stopped", " cannot be enabled",
                                             " is commanded beyond its limits, all axes stop"};
    notice_ += (notice_.empty() ? "" : "; ") + axis.name() + kTexts[static_cast<int>(event)] + " (" +
               axis.phase() + ")";
}

bool Cell::write_command(std::size_t row) {
    Command &command = commands_[row];
    const Link::Command &place = link_->commands[row];
    double number = command.claimed ? command.number : kNothing;
    if (place.of_axis.axis != nullptr) {
        place.of_axis.axis->set(place.of_axis.role, number);
        return true;
    }
    if (place.symbol == kNone) {
        return true;  // bound to nothing
    }
    if (std::isnan(number) && place.actual != kNone) {
        if (holds_position(row)) {
            return true;
        }
        number = fsn_realtime_value(writer_, place.actual);
    }
    if (std::isnan(number)) {
        number = command.initial;
    }
    if (std::isnan(number)) {
        return fsn_realtime_set(writer_, place.symbol, place.stop_value) == FSN_OK;
    }
    command.sent = true;
    return fsn_realtime_set_value(writer_, place.symbol, number) == FSN_OK;
}

/** Whether a target position keeps what was sent last: following the actual position of an enabled
 *  drive would let a loaded axis sag. */
bool Cell::holds_position(std::size_t row) const {
    const int32_t status = link_->commands[row].status;
    const bool enabled =
        status != kNone && (fsn_realtime_get(writer_, status) & kStateMask) == kOperationEnabled;
    return enabled && commands_[row].sent;
}

/** Names of the outputs of commands and axes, each once. */
std::vector<std::string> Cell::output_names() const {
    std::set<std::string> names;
    for (const Command &command : commands_) {
        if (!command.symbol_name.empty()) {
            names.insert(command.symbol_name);
        }
    }
    struct fsn_realtime_symbol symbol{};
    for (uint32_t n = 0; fsn_realtime_symbol(link_->reader, n, &symbol) == FSN_OK; ++n) {
        for (const auto &axis : axes_) {
            if (axis->drives(symbol)) {
                names.insert(symbol.name);
            }
        }
    }
    return {names.begin(), names.end()};
}

void Cell::open_axes() {
    const double cycle_s = 1e-9 * static_cast<double>(fsn_realtime_cycle_ns(writer_));
    for (const auto &axis : axes_) {
        axis->open(writer_, cycle_s * (options_.misses + 1));
    }
}

fsn_realtime *Cell::open(bool with_outputs) const {
    const std::vector<std::string> names = with_outputs ? output_names() : std::vector<std::string>{};
    std::vector<const char *> outputs;
    for (const std::string &name : names) {
        outputs.push_back(name.c_str());
    }
    fsn_realtime_options options{};
    options.socket = options_.socket.c_str();
    options.outputs = outputs.data();
    options.output_count = outputs.size();
    options.misses = options_.misses;
    options.timeout_ms = kTryMs;
    options.plan_sha256 = options_.plan_sha256.empty() ? nullptr : options_.plan_sha256.c_str();
    fsn_realtime_fault fault{};
    fsn_realtime *opened = nullptr;
    if (fsn_realtime_open(&options, &opened, &fault) != FSN_OK) {
        throw Fault(fault.text);
    }
    return opened;
}

int32_t Cell::Link::find_object(const std::string &subdevice, unsigned index) const {
    struct fsn_realtime_symbol symbol{};
    for (uint32_t n = 0; fsn_realtime_symbol(reader, n, &symbol) == FSN_OK; ++n) {
        if (!symbol.output && symbol.index == index && symbol.subindex == 0 && symbol.bits != 0 &&
            subdevice == symbol.subdevice) {
            return static_cast<int32_t>(n);
        }
    }
    return kNone;
}

Cell::Link::State Cell::Link::find_state(const Cell::State &state) const {
    const std::string &name = state.symbol_name;
    if (name.empty()) {
        return {kNone, kNoConnection, false};
    }
    const int32_t symbol = fsn_realtime_input(reader, name.c_str());
    if (symbol != kNone) {
        return {symbol, kNoConnection, false};
    }
    for (std::size_t i = 0; i < connections.size(); ++i) {
        const bool in_data = name == connections[i].name + ".in_data";
        if (in_data || name == connections[i].name + ".state") {
            return {kNone, i, in_data};
        }
    }
    const bool is_output = fsn_realtime_output(reader, name.c_str()) != kNone;
    throw Fault(state.name + ": the plan has no input " + name +
                (is_output ? "; the output of that name is what is sent, not a state: remove the "
                             "state_interface, or map what the SubDevice reports"
                           : "; `fsoe-net console -c list` shows the names"));
}

Cell::Link::Command Cell::Link::find_command(const Cell &cell, const Cell::Command &command) const {
    if (command.symbol_name.empty()) {
        return {kNone, kNone, kNone, 0, command.of_axis};
    }
    const int32_t number = fsn_realtime_output(reader, command.symbol_name.c_str());
    struct fsn_realtime_symbol symbol{};
    if (number == kNone ||
        fsn_realtime_symbol(reader, static_cast<uint32_t>(number), &symbol) != FSN_OK) {
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
        found.actual = fsn_realtime_input(reader, name.c_str());
    }
    if (found.actual == kNone) {
        throw Fault(command.name + " is a target position, and the plan has no actual one: the axis would jump");
    }
}

/** Starts a bus that is stopped, and waits a moment; connect() reports one that does not run. */
void Cell::start_bus() {
    ControlSocket control(options_.socket, wake_);
    const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(kTryMs);
    std::string state = control.request("status").value("state", "");
    if (state == "stopped" || state == "failed") {
        control.request("start");
        do {
            std::this_thread::sleep_for(std::chrono::milliseconds(kLookMs));
            state = control.request("status").value("state", "");
        } while (state != "running" && state != "failed" && std::chrono::steady_clock::now() < until);
    }
}

std::shared_ptr<Cell::Link> Cell::connect() {
    ControlSocket control(options_.socket, wake_);
    const auto status = control.request("status");
    const std::string state = status.value("state", "");
    if (state == "stopped" || state == "failed") {
        const auto &why = status["fault"];
        throw Fault("the bus does not run (" + state + ")" +
                    (why.is_string() ? ": " + why.get<std::string>() : "; `fsoe-net console -c start` starts it"));
    }
    if (state != "running") {
        throw Fault("the bus is not running yet (" + state + ")");
    }
    const auto rows = control.rows("snapshot", "connections");
    const auto link = std::make_shared<Link>(open(false));
    for (const auto &row : rows) {
        link->connections.emplace_back();
        link->connections.back().name = row.value("name", "");
        link->connections.back().state = row.value("observed_state", kUnknown);
    }
    for (const State &row : states_) {
        link->states.push_back(link->find_state(row));
    }
    for (const Command &row : commands_) {
        link->commands.push_back(link->find_command(*this, row));
    }
    return link;
}

bool Cell::is_woken(int wait_ms) const {
    pollfd woken{wake_, POLLIN, 0};
    return poll(&woken, 1, wait_ms) != 0;
}

/** Follows the connections, and connects again when fsn-master is gone. Never takes outputs. */
void Cell::follow(std::shared_ptr<Link> link) {
    std::string reported;
    do {
        if (link != nullptr) {
            follow_connections(*link);
            link.reset();
            continue;
        }
        std::string text = "connected to fsn-master again; commands need a new activation";
        try {
            link = connect();
            const std::lock_guard<std::mutex> lock(mutex_);
            fresh_ = link;
        } catch (const std::exception &fault) {
            text = fault.what();
        }
        if (text != reported && !is_woken(0)) {
            options_.report(text);
        }
        reported = text;
    } while (!is_woken(link == nullptr ? kAgainMs : 0));
}

/** Returns when the link has ended or the thread is woken. */
void Cell::follow_connections(Link &link) {
    try {
        ControlSocket control(options_.socket, wake_);
        do {
            std::size_t number = 0;
            for (const auto &row : control.rows("snapshot", "connections")) {
                if (number < link.connections.size()) {
                    link.connections[number++].state = row.value("observed_state", kUnknown);
                }
            }
        } while (!link.ended && !is_woken(kLookMs));
    } catch (const std::exception &) {
    }
    link.answers = false;
    for (Link::Connection &connection : link.connections) {
        connection.state = kUnknown;
    }
}

bool Cell::refuse(const std::string &text) {
    fault_ = text;
    return false;
}

}  // namespace fsoe_net_ros
