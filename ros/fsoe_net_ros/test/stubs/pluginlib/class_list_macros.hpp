// Stub, see README.md: keeps the classes of a library by their names.
#pragma once
#include <functional>
#include <hardware_interface/system_interface.hpp>
#include <map>
#include <string>

inline std::map<std::string, std::function<hardware_interface::SystemInterface *()>> stub_classes;

#define STUB_JOIN(a, b) a##b
#define STUB_EXPORT(Class, number) \
    static const bool STUB_JOIN(stub_known_, number) = \
        stub_classes.emplace(#Class, [] { return new Class; }).second;
#define PLUGINLIB_EXPORT_CLASS(Class, Base) STUB_EXPORT(Class, __COUNTER__)
