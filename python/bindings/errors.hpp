#pragma once

#include <nanobind/nanobind.h>

#include <string>

/// A class of o80.base.errors.
nanobind::object python_error(const char* name);
/// Sets the error indicator of Python; the caller throws nanobind::python_error.
void set_error(const nanobind::object& type, const char* text);
[[noreturn]] void raise_python(const char* name, const std::string& text);
