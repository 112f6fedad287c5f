// Age of the inputs that read() hands over: from the start of the bus cycle that read them to the return of read().
//
//   measure_age SOCKET STATE wait|poll PERIOD_US COUNT
//
// `wait` is wait_for_cycle. `poll` reads each PERIOD_US, as a controller manager with a clock of its own. Prints one
// line: median, 99 % and highest age in us, of COUNT reads with a new or an old cycle.
#include <algorithm>
#include <ctime>
#include <iostream>

#include "fsoe_net_ros/cell.hpp"

namespace {

constexpr uint64_t kSecond = 1000000000;

uint64_t now_ns() {
    timespec now{};
    clock_gettime(CLOCK_MONOTONIC, &now);
    return static_cast<uint64_t>(now.tv_sec) * kSecond + static_cast<uint64_t>(now.tv_nsec);
}

void sleep_until(uint64_t at_ns) {
    const timespec at{static_cast<time_t>(at_ns / kSecond), static_cast<decltype(timespec::tv_nsec)>(at_ns % kSecond)};
    clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, nullptr);
}

}  // namespace

int main(int count, char **words) {
    if (count != 6) {
        std::cerr << "measure_age SOCKET STATE wait|poll PERIOD_US COUNT\n";
        return 2;
    }
    const bool waits = std::string(words[3]) == "wait";
    const uint64_t period_ns = std::stoull(words[4]) * 1000;
    const std::size_t reads = std::stoul(words[5]);
    fsoe_net_ros::Cell::Options options;
    options.socket = words[1];
    options.waits = waits;
    fsoe_net_ros::Cell cell(options);
    cell.add_state("age/state");
    cell.bind_state("age/state", words[2]);
    try {
        cell.configure();
    } catch (const fsoe_net_ros::Fault &fault) {
        std::cerr << fault.what() << '\n';
        return 3;
    }
    std::vector<double> ages_us;
    for (uint64_t next_ns = now_ns(); ages_us.size() < reads; next_ns += period_ns) {
        if (!waits) {
            sleep_until(next_ns);
        }
        cell.read();
        if (cell.cycle_ns() != 0) {
            ages_us.push_back(1e-3 * static_cast<double>(now_ns() - cell.cycle_ns()));
        }
    }
    std::sort(ages_us.begin(), ages_us.end());
    std::cout << ages_us[reads / 2] << ' ' << ages_us[reads * 99 / 100] << ' ' << ages_us.back() << std::endl;
    return 0;
}
