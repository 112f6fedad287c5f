#include <cerrno>
#include <cstring>
#include <poll.h>
#include <sys/eventfd.h>
#include <unistd.h>

#include "control_socket.hpp"
#include "link.hpp"

namespace fsoe_net_ros {

namespace {

constexpr int kLookMs = 50, kAgainMs = 500;

bool is_stopped(const std::string &state) { return state == "stopped" || state == "failed"; }

}  // namespace

Cell::Follower::Follower(const Cell &cell) : cell_(cell), wake_(eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
    if (wake_ < 0) {
        throw Fault(std::string("no eventfd: ") + std::strerror(errno));
    }
}

Cell::Follower::~Follower() {
    wake();
    stop();
    ::close(wake_);
}

std::shared_ptr<Cell::Link> Cell::Follower::start() {
    if (cell_.options_.start) {
        start_bus();
    }
    const auto link = connect();
    thread_ = std::thread(&Follower::follow, this, link);
    return link;
}

void Cell::Follower::wake() {
    const uint64_t once = 1;
    (void)!::write(wake_, &once, sizeof once);
}

void Cell::Follower::stop() {
    if (thread_.joinable()) {
        thread_.join();
    }
    fresh_.reset();
    uint64_t count;
    (void)!::read(wake_, &count, sizeof count);
}

bool Cell::Follower::renew(std::shared_ptr<Link> &link) {
    const std::unique_lock<std::mutex> lock(mutex_, std::try_to_lock);
    if (!lock.owns_lock() || fresh_ == nullptr || !fresh_->answers || link->answers) {
        return false;
    }
    link.swap(fresh_);
    return true;
}

/** Starts a bus that is stopped, and waits a moment; connect() reports one that does not run. */
void Cell::Follower::start_bus() const {
    ControlSocket control(cell_.options_.socket, wake_);
    const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(kTryMs);
    std::string state = control.request("status").value("state", "");
    if (!is_stopped(state)) {
        return;
    }
    control.request("start");
    do {
        std::this_thread::sleep_for(std::chrono::milliseconds(kLookMs));
        state = control.request("status").value("state", "");
    } while (state != "running" && state != "failed" && std::chrono::steady_clock::now() < until);
}

std::shared_ptr<Cell::Link> Cell::Follower::connect() const {
    ControlSocket control(cell_.options_.socket, wake_);
    const auto status = control.request("status");
    const std::string state = status.value("state", "");
    if (is_stopped(state)) {
        const auto &why = status["fault"];
        throw Fault("the bus does not run (" + state + ")" +
                    (why.is_string() ? ": " + why.get<std::string>() : "; `fsoe-net console -c start` starts it"));
    }
    if (state != "running") {
        throw Fault("the bus is not running yet (" + state + ")");
    }
    return std::make_shared<Link>(cell_, control.rows("snapshot", "connections"));
}

bool Cell::Follower::is_woken(int wait_ms) const {
    pollfd woken{wake_, POLLIN, 0};
    return poll(&woken, 1, wait_ms) != 0;
}

void Cell::Follower::follow(std::shared_ptr<Link> link) {
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
            cell_.options_.report(text);
        }
        reported = text;
    } while (!is_woken(link == nullptr ? kAgainMs : 0));
}

/** Returns when the link has ended or the thread is woken. */
void Cell::Follower::follow_connections(Link &link) const {
    try {
        ControlSocket control(cell_.options_.socket, wake_);
        do {
            link.update(control.rows("snapshot", "connections"));
        } while (!link.ended && !is_woken(kLookMs));
    } catch (const std::exception &) {
    }
    link.forget();
}

}  // namespace fsoe_net_ros
