// Stub, see README.md: gives the class to whoever loads the library.
#pragma once
#define PLUGINLIB_EXPORT_CLASS(Class, Base) \
    extern "C" Base *stub_create() { return new Class; }
