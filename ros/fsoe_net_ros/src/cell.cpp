#include "fsoe_net_ros/cell.hpp"

#include <cmath>
#include <set>

#include "driven_axis.hpp"
#include "link.hpp"

namespace fsoe_net_ros {

namespace {

constexpr int kProcessData = 6, kFailSafeData = 5;
constexpr uint64_t kStateMask = 0x6F, kOperationEnabled = 0x27;

}  // namespace

Cell::Cell(Options options) : options_(std::move(options)), follower_(std::make_unique<Follower>(*this)) {}

Cell::~Cell() { cleanup(); }

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
    check_axes();
    link_ = follower_->start();
    last_cycle_ = last_complete_ = std::chrono::steady_clock::now();
    is_lost_ = false;
}

void Cell::check_axes() const {
    for (const auto &axis : axes_) {
        axis->check();
    }
}

void Cell::activate() {
    if (link_ == nullptr) {
        throw Fault("not connected");
    }
    take_fresh_link();
    if (!link_->answers) {
        throw Fault("fsn-master does not answer yet; activate again in a moment");
    }
    writer_ = open_client(options_, output_names());
    // Names were found in the plan of the reader: both must be of one run of the bus.
    if (fsn_realtime_wait(link_->reader(), 0, nullptr) == FSN_E_STATE) {
        link_->ended = true;
        close_writer();
        throw Fault("the bus was stopped and started again; activate again in a moment");
    }
    try {
        open_axes();
    } catch (const Fault &) {
        close_writer();
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
    close_writer();
    for (Command &command : commands_) {
        command.claimed = false;  // its controller may still be active, as always after a fault on Humble
    }
}

void Cell::close_writer() {
    fsn_realtime_close(writer_);
    writer_ = nullptr;
}

void Cell::disconnect() {
    deactivate();
    link_.reset();
    for (State &state : states_) {
        state.number = kNothing;
    }
    follower_->wake();
}

void Cell::cleanup() {
    disconnect();
    follower_->stop();
}

/** Uses the link that the thread has opened, except while outputs are written: they belong to the old one. */
void Cell::take_fresh_link() {
    if (writer_ == nullptr && follower_->renew(link_)) {
        last_cycle_ = last_complete_ = std::chrono::steady_clock::now();
    }
}

void Cell::read() {
    if (link_ == nullptr) {
        return;
    }
    take_fresh_link();
    fsn_realtime_cycle cycle{};
    fsn_realtime *const realtime = writer_ != nullptr ? writer_ : link_->reader();
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
    if (state.connection != nullptr) {
        const int now_state = is_stalled ? kUnknown : state.connection->load();
        const bool in_data = now_state == kProcessData || now_state == kFailSafeData;
        number = !state.in_data ? now_state : (in_data ? 1.0 : 0.0);
    } else if (is_stalled || state.symbol == kNone) {
        number = kNothing;
    } else if (has_cycle) {
        number = fsn_realtime_value(writer_ != nullptr ? writer_ : link.reader(), state.symbol);
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
    for (uint32_t n = 0; fsn_realtime_symbol(link_->reader(), n, &symbol) == FSN_OK; ++n) {
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

bool Cell::refuse(const std::string &text) {
    fault_ = text;
    return false;
}

}  // namespace fsoe_net_ros
