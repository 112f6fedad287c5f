// What the simulated drive is derived from.
#pragma once

namespace kickcat::sim {
class DeviceApp {
public:
    virtual ~DeviceApp() = default;
    virtual void step() = 0;
};
} // namespace kickcat::sim
