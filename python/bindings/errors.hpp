#pragma once

#include <nanobind/nanobind.h>

#include <string>

/// A class of o80.errors.
nanobind::object python_error(const char* name);
/// Sets it as the error that Python will see; it stays to be thrown.
void set_error(const nanobind::object& type, const char* text);
[[noreturn]] void raise_python(const char* name, const std::string& text);
