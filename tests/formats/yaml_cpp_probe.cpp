// Prints what yaml-cpp reads from the values on standard input, one a line, by the conversions that
// the ROS 2 driver uses. With a path (`nets 0 name`), prints what it reads at that path of the
// document on standard input. See test_yaml_cpp.py.

#include <yaml-cpp/yaml.h>

#include <cstdint>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

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
    try {
        return value.as<std::string>();
    } catch (const YAML::Exception &) {
        return "throws";
    }
}

template <>
std::string read<bool>(const YAML::Node &value) {
    try {
        return value.as<bool>() ? "true" : "false";
    } catch (const YAML::Exception &) {
        return "throws";
    }
}

YAML::Node below(const YAML::Node &node, const std::vector<std::string> &path, std::size_t step) {
    if (step == path.size()) {
        return node;
    }
    const bool is_row = path[step].find_first_not_of("0123456789") == std::string::npos;
    return below(is_row ? node[std::stoul(path[step])] : node[path[step]], path, step + 1);
}

// The text at a path, and how many rows a loop over it has.
void read_document(const std::vector<std::string> &path) {
    const std::string text{std::istreambuf_iterator<char>(std::cin), {}};
    try {
        const YAML::Node node = below(YAML::Load(text), path, 0);
        std::size_t rows = 0;
        for (const auto &row : node) {
            static_cast<void>(row);
            ++rows;
        }
        std::cout << read<std::string>(node) << ' ' << rows << '\n';
    } catch (const YAML::Exception &) {
        std::cout << "throws\n";
    }
}

}  // namespace

int main(int argc, char **argv) {
    if (argc > 1) {
        read_document({argv + 1, argv + argc});
        return 0;
    }
    for (std::string line; std::getline(std::cin, line);) {
        const YAML::Node value = YAML::Load("key: " + line)["key"];
        std::cout << line << '\t' << read<std::string>(value) << '\t' << read<int>(value) << '\t'
                  << read<uint8_t>(value) << '\t' << read<double>(value) << '\t'
                  << read<bool>(value) << '\n';
    }
}
