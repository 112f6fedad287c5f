/** Programs that the hardware component starts, never through a shell and never in the real-time thread. */
#ifndef PROCESS_HPP_
#define PROCESS_HPP_

#include <condition_variable>
#include <mutex>
#include <string>
#include <sys/types.h>
#include <thread>
#include <vector>

namespace fsoe_net_ros {

struct Outcome {
    int code;                  ///< exit code; -1: ended by a signal
    std::string out, errors;   ///< the first 16 MiB of each
};

/** Runs a program to its end. @throws Fault  it cannot be started, or takes longer than `most_ms`. */
Outcome run_program(const std::vector<std::string> &words, int most_ms);

/** A program that runs next to this process, and ends with it where the system permits that. */
class Child {
public:
    Child() = default;
    ~Child() { stop(); }
    Child(const Child &) = delete;
    Child &operator=(const Child &) = delete;

    /** @throws Fault  it cannot be started. */
    void start(const std::vector<std::string> &words);

    bool is_running();

    /** Asks it to end, kills it if it does not, and waits. */
    void stop();

private:
    void own(const std::vector<std::string> &words);

    std::mutex mutex_;
    std::condition_variable changed_;
    std::thread owner_;   // the end of the thread that started a program ends the program
    pid_t pid_ = -1;      // -1: none; 0: starts
    int error_ = 0;       // of the start
};

}  // namespace fsoe_net_ros

#endif  // PROCESS_HPP_
