// Prints what yaml-cpp reads from the values on standard input, one a line, by the conversions that
// the ROS 2 driver uses. See test_yaml_cpp.py.

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <iostream>
#include <sstream>
#include <string>

namespace {

template <typename T>
std::string read(const YAML::Node &value) {
    try {
        std::ostringstream text;
        text << std::boolalpha << +value.as<T>();
        return text.str();
    } catch (const YAML::Exception &) {
        return "throws";
    }
}

template <>
std::string read<std::string>(const YAML::Node &value) {
    return value.as<std::string>();
}

template <>
std::string read<bool>(const YAML::Node &value) {
    try {
        return value.as<bool>() ? "true" : "false";
    } catch (const YAML::Exception &) {
        return "throws";
    }
}

}  // namespace

int main() {
    for (std::string line; std::getline(std::cin, line);) {
        const YAML::Node value = YAML::Load("key: " + line)["key"];
        std::cout << line << '\t' << read<std::string>(value) << '\t' << read<int>(value) << '\t'
                  << read<uint8_t>(value) << '\t' << read<double>(value) << '\t'
                  << read<bool>(value) << '\n';
    }
}
