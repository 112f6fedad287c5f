// What the simulated drive needs of a SubDevice, without a bus: a state, and its objects by index.
#pragma once

#include <cstdint>
#include <map>
#include <type_traits>

namespace kickcat {
enum class State { SAFE_OP, OPERATIONAL };

namespace slave {
class Slave {
public:
    State state() const { return State::OPERATIONAL; }

    void add(std::uint16_t index, void *value) { objects_[index] = value; }

    template <typename T> void bind(std::uint16_t index, T *&place, std::uint8_t = 0) {
        const auto found = objects_.find(index);
        place = found == objects_.end() ? nullptr : static_cast<T *>(found->second);
    }

private:
    std::map<std::uint16_t, void *> objects_;
};
} // namespace slave
} // namespace kickcat
