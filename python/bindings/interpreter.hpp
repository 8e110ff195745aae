#pragma once

#include <cxxabi.h>

#include <optional>
#include <utility>

#include "nb.hpp"

/// Sleeps until the process ends.
[[noreturn]] void stay() noexcept;

/// Puts the exceptions that this thread handles aside until it is destroyed: a forced unwinding
/// cannot be caught beside one of them.
class NothingCaught {
 public:
  NothingCaught() : caught_(std::exchange(of_this_thread(), nullptr)) {}
  NothingCaught(const NothingCaught&) = delete;
  NothingCaught& operator=(const NothingCaught&) = delete;
  ~NothingCaught() { of_this_thread() = caught_; }

 private:
  /// The stack of handled exceptions: the first member of `__cxa_eh_globals` in the Itanium C++
  /// ABI.
  static void*& of_this_thread() { return *reinterpret_cast<void**>(abi::__cxa_get_globals()); }

  void* caught_;
};

/// Calls Python code from C++, also in a handler.
///
/// At interpreter exit, Python before 3.14 ends a daemon thread that requests the GIL by forced
/// unwinding, which C++ frames do not survive. Such a thread sleeps for ever instead, as in Python
/// 3.14.
template <class Call>
auto call_python(Call&& call) {
  const NothingCaught apart;
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
void bind_interpreter(nb::module_& module);
