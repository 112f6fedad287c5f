// Stub, see README.md.
#pragma once
#include <cstdio>
#include <string>
namespace rclcpp {
class Time {};
class Duration {};
class Logger {};
inline Logger get_logger(const std::string &) { return {}; }
}  // namespace rclcpp
#define RCLCPP_ERROR(logger, ...) \
    (static_cast<void>(logger), std::fprintf(stderr, __VA_ARGS__), std::fputc('\n', stderr))
#define RCLCPP_WARN(...) RCLCPP_ERROR(__VA_ARGS__)
