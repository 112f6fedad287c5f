#include "process.hpp"

#include <array>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstring>
#include <fcntl.h>
#include <poll.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include "fsoe_net_ros/cell.hpp"

extern char **environ;

namespace fsoe_net_ros {

namespace {

constexpr std::size_t kMostBytes = 16u << 20;
constexpr auto kEndTime = std::chrono::seconds(5);

class Pipe {
public:
    Pipe() {
        if (pipe2(ends_.data(), O_CLOEXEC) != 0) {
            throw Fault(std::string("no pipe: ") + std::strerror(errno));
        }
    }
    ~Pipe() {
        ::close(ends_[0]);
        close_writer();
    }
    Pipe(const Pipe &) = delete;
    Pipe &operator=(const Pipe &) = delete;
    int reader() const { return ends_[0]; }
    int writer() const { return ends_[1]; }
    void close_writer() {
        if (ends_[1] >= 0) {
            ::close(ends_[1]);
        }
        ends_[1] = -1;
    }

private:
    std::array<int, 2> ends_{-1, -1};
};

/** Without fork(): that would copy the memory of a real-time process.
 *  @param[in] outputs  for its standard output and error; null: those of this process.
 *  @return 0, or an error number. */
int spawn(const std::vector<std::string> &words, const std::array<const Pipe *, 2> &outputs, pid_t &pid) {
    std::vector<char *> arguments;
    for (const std::string &word : words) {
        arguments.push_back(const_cast<char *>(word.c_str()));
    }
    arguments.push_back(nullptr);
    posix_spawn_file_actions_t actions;
    posix_spawn_file_actions_init(&actions);
    posix_spawn_file_actions_addopen(&actions, STDIN_FILENO, "/dev/null", O_RDONLY, 0);
    for (std::size_t i = 0; i < outputs.size(); ++i) {
        if (outputs[i] != nullptr) {
            posix_spawn_file_actions_adddup2(&actions, outputs[i]->writer(), STDOUT_FILENO + static_cast<int>(i));
        }
    }
    const int error = posix_spawnp(&pid, arguments[0], &actions, nullptr, arguments.data(), environ);
    posix_spawn_file_actions_destroy(&actions);
    return error;
}

Fault no_start(const std::string &program, int error) {
    return Fault(program + " cannot be started: " + std::strerror(error) +
                 "; install it, or give its path as a param of the hardware");
}

/** Reads what is there. @return false  the end. */
bool read_some(int fd, std::string &text) {
    std::array<char, 1 << 14> buffer;
    const ssize_t count = ::read(fd, buffer.data(), buffer.size());
    if (count > 0 && text.size() < kMostBytes) {
        text.append(buffer.data(), static_cast<std::size_t>(count));
    }
    return count > 0;
}

/** Reads both outputs to their ends. @return false  it takes too long. */
bool read_all(const std::array<Pipe, 2> &pipes, Outcome &outcome, int most_ms) {
    const auto until = std::chrono::steady_clock::now() + std::chrono::milliseconds(most_ms);
    std::array<pollfd, 2> ready{{{pipes[0].reader(), POLLIN, 0}, {pipes[1].reader(), POLLIN, 0}}};
    const std::array<std::string *, 2> texts{&outcome.out, &outcome.errors};
    while (ready[0].fd >= 0 || ready[1].fd >= 0) {
        const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
            until - std::chrono::steady_clock::now());
        if (left.count() <= 0 || poll(ready.data(), ready.size(), static_cast<int>(left.count())) < 0) {
            return false;
        }
        for (std::size_t i = 0; i < ready.size(); ++i) {
            if (ready[i].revents != 0 && !read_some(ready[i].fd, *texts[i])) {
                ready[i].fd = -1;
            }
        }
    }
    return true;
}

}  // namespace

Outcome run_program(const std::vector<std::string> &words, int most_ms) {
    std::array<Pipe, 2> pipes;
    pid_t pid = -1;
    const int error = spawn(words, {&pipes[0], &pipes[1]}, pid);
    if (error != 0) {
        throw no_start(words[0], error);
    }
    pipes[0].close_writer();
    pipes[1].close_writer();
    Outcome outcome{-1, "", ""};
    const bool ended = read_all(pipes, outcome, most_ms);
    if (!ended) {
        kill(pid, SIGKILL);
    }
    int status = 0;
    waitpid(pid, &status, 0);
    if (!ended) {
        throw Fault(words[0] + " took longer than " + std::to_string(most_ms / 1000) + " s and was ended");
    }
    outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
    return outcome;
}

void Child::own(const std::vector<std::string> &words) {
    pid_t pid = -1;
    const int error = spawn(words, {nullptr, nullptr}, pid);
    {
        const std::lock_guard<std::mutex> lock(mutex_);
        error_ = error;
        pid_ = error == 0 ? pid : -1;
    }
    changed_.notify_all();
    if (error != 0) {
        return;
    }
    siginfo_t info;
    while (waitid(P_PID, static_cast<id_t>(pid), &info, WEXITED | WNOWAIT) != 0 && errno == EINTR) {
    }
    const std::lock_guard<std::mutex> lock(mutex_);  // until then, the number is that of the program
    waitpid(pid, nullptr, 0);
    pid_ = -1;
    changed_.notify_all();
}

void Child::start(const std::vector<std::string> &words) {
    stop();
    pid_ = 0;
    owner_ = std::thread(&Child::own, this, words);
    std::unique_lock<std::mutex> lock(mutex_);
    changed_.wait(lock, [this] { return pid_ != 0; });
    if (error_ != 0) {
        throw no_start(words[0], error_);
    }
}

bool Child::is_running() {
    const std::lock_guard<std::mutex> lock(mutex_);
    return pid_ > 0;
}

void Child::stop() {
    {
        std::unique_lock<std::mutex> lock(mutex_);
        for (const int number : {SIGTERM, SIGKILL}) {
            if (pid_ > 0) {
                kill(pid_, number);
                changed_.wait_for(lock, kEndTime, [this] { return pid_ < 0; });
            }
        }
    }
    if (owner_.joinable()) {
        owner_.join();
    }
}

}  // namespace fsoe_net_ros
