#include "control_socket.hpp"

#include <cerrno>
#include <cstring>
#include <poll.h>
#include <sys/socket.h>
#include <sys/time.h>
#include <sys/un.h>
#include <unistd.h>

#include "fsoe_net_ros/cell.hpp"

namespace fsoe_net_ros {

namespace {

constexpr int kReplyMs = 1000;
constexpr std::size_t kMostBytes = 16u << 20;
constexpr unsigned kMostPages = 1000;

}  // namespace

ControlSocket::ControlSocket(const std::string &path, int wake) : path_(path), fd_(-1), wake_(wake) {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.empty() || path.size() >= sizeof address.sun_path) {
        throw Fault("'" + path + "' is not the path of a control socket");
    }
    std::memcpy(address.sun_path, path.c_str(), path.size());
    const timeval most{kReplyMs / 1000, 0};  // for a connect() to a process that is stopped
    fd_ = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    if (fd_ < 0 || setsockopt(fd_, SOL_SOCKET, SO_SNDTIMEO, &most, sizeof most) != 0 ||
        connect(fd_, reinterpret_cast<sockaddr *>(&address), sizeof address) != 0) {
        const std::string why = std::strerror(errno);
        if (fd_ >= 0) {
            ::close(fd_);
        }
        throw Fault("no answer on " + path + ": " + why + "; is fsn-master running?");
    }
}

ControlSocket::~ControlSocket() { ::close(fd_); }

void ControlSocket::wait_for_reply() {
    pollfd ready[2] = {{fd_, POLLIN, 0}, {wake_, POLLIN, 0}};
    const int found = poll(ready, 2, kReplyMs);
    if (found <= 0 || ready[1].revents != 0 || received_.size() > kMostBytes) {
        throw Fault("fsn-master at " + path_ + " does not answer");
    }
}

nlohmann::json ControlSocket::request(const std::string &line) {
    const std::string sent = line + "\n";
    if (send(fd_, sent.data(), sent.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(sent.size())) {
        throw Fault("fsn-master at " + path_ + " is gone");
    }
    std::size_t end;
    while ((end = received_.find('\n')) == std::string::npos) {
        wait_for_reply();
        char buffer[1 << 16];
        const ssize_t got = recv(fd_, buffer, sizeof buffer, 0);
        if (got <= 0) {
            throw Fault("fsn-master at " + path_ + " is gone");
        }
        received_.append(buffer, static_cast<std::size_t>(got));
    }
    const auto reply = nlohmann::json::parse(received_.substr(0, end), nullptr, false);
    received_.erase(0, end + 1);
    if (!reply.is_object() || !reply.contains("ok")) {
        throw Fault(path_ + " does not speak the protocol of fsn-master");
    }
    if (reply["ok"] != true) {
        const std::string hint = reply.value("hint", "");
        throw Fault(line + ": " + reply.value("text", "refused") + (hint.empty() ? "" : "; " + hint));
    }
    return reply;
}

nlohmann::json ControlSocket::rows(const std::string &word, const std::string &list) {
    auto found = nlohmann::json::array();
    std::string line = word;
    for (unsigned page = 0; page < kMostPages; ++page) {
        const auto reply = request(line);
        for (const auto &row : reply.value(list, nlohmann::json::array())) {
            found.push_back(row);
        }
        if (!reply.contains("next")) {
            return found;
        }
        line = word + " " + reply["next"].dump();
    }
    throw Fault(path_ + ": a " + word + " without an end");
}

}  // namespace fsoe_net_ros
