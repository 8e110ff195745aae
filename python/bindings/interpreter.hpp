#pragma once

#include <nanobind/nanobind.h>

#include <cxxabi.h>

#include <optional>
#include <utility>

/// Sleeps until the process ends.
[[noreturn]] void stay() noexcept;

/// Calls Python code from C++.
///
/// At interpreter exit, Python before 3.14 ends a daemon thread that requests the GIL by forced
/// unwinding, which C++ frames do not survive. Such a thread sleeps for ever instead, as in Python
/// 3.14.
template <class Call>
auto call_python(Call&& call) {
  try {
    return std::forward<Call>(call)();
  } catch (abi::__forced_unwind&) {
    stay();
  }
}

/// Releases the GIL until it is destroyed.
class WithoutGil {
 public:
  WithoutGil();
  WithoutGil(const WithoutGil&) = delete;
  WithoutGil& operator=(const WithoutGil&) = delete;
  ~WithoutGil();

 private:
  PyThreadState* around_;  // released by an outer WithoutGil of this thread
};

/// Holds the GIL until it is destroyed: in a thread that had it already, in one that released it by
/// WithoutGil, and in one that is not of Python.
class WithGil {
 public:
  WithGil();
  WithGil(const WithGil&) = delete;
  WithGil& operator=(const WithGil&) = delete;
  ~WithGil();

 private:
  PyThreadState* taken_;  // null: this thread had the GIL already, or is not of Python
  std::optional<PyGILState_STATE> own_;
};

/// From this call on, threads that request the GIL after the interpreter has ended sleep for ever.
void bind_interpreter(nanobind::module_& module);
