#pragma once

#include <string>

#include "nb.hpp"

/// A class of o80.base.errors.
nb::object python_error(const char* name);
/// Sets the error indicator of Python; the caller throws nb::python_error.
void set_error(const nb::object& type, const char* text);
[[noreturn]] void raise_python(const char* name, const std::string& text);
