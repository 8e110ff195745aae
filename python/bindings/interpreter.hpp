#pragma once

#include <nanobind/nanobind.h>

#include <cxxabi.h>

#include <utility>

/// Waits until the process is gone.
[[noreturn]] void stay() noexcept;

/// Around calls of Python code from C++.
///
/// A daemon thread that wants the interpreter back when it ends is unwound by Python before 3.14,
/// which no frame of C++ survives. It stays where it is instead, as Python does it since.
template <class Call>
auto call_python(Call&& call) {
  try {
    return std::forward<Call>(call)();
  } catch (abi::__forced_unwind&) {
    stay();
  }
}

/// Lets go of the GIL until it is destroyed.
class WithoutGil {
 public:
  WithoutGil();
  WithoutGil(const WithoutGil&) = delete;
  WithoutGil& operator=(const WithoutGil&) = delete;
  ~WithoutGil();

 private:
  PyThreadState* around_;  // what another one of this thread let go of
};

/// Has the GIL until it is destroyed, whether this thread let go of it or not.
class WithGil {
 public:
  WithGil();
  WithGil(const WithGil&) = delete;
  WithGil& operator=(const WithGil&) = delete;
  ~WithGil();

 private:
  PyThreadState* taken_;  // null: it was not let go of
};

/// From here on threads stay when the interpreter has ended.
void bind_interpreter(nanobind::module_& module);
