#include "interpreter.hpp"

#include <unistd.h>

#include <atomic>

#include "o80/base/error.hpp"

namespace {

std::atomic<bool> ended{false};
thread_local PyThreadState* released = nullptr;  // null: this thread has the GIL

void take(PyThreadState* state) noexcept {
  if (ended.load(std::memory_order_relaxed)) stay();
  call_python([state] { PyEval_RestoreThread(state); });
}

}  // namespace

void stay() noexcept {
  while (true) pause();
}

WithoutGil::WithoutGil() : around_(std::exchange(released, PyEval_SaveThread())) {}

WithoutGil::~WithoutGil() { take(std::exchange(released, around_)); }

WithGil::WithGil() : taken_(std::exchange(released, nullptr)) {
  if (taken_ != nullptr) {
    take(taken_);
  } else if (PyGILState_Check() == 0) {
    if (ended.load(std::memory_order_relaxed)) stay();
    own_ = call_python([] { return PyGILState_Ensure(); });
  }
}

WithGil::~WithGil() {
  if (taken_ != nullptr) released = PyEval_SaveThread();
  if (own_) PyGILState_Release(*own_);
}

void bind_interpreter(nb::module_&) {
  if (Py_AtExit([] { ended.store(true, std::memory_order_relaxed); }) != 0) {
    throw o80::Error("o80 cannot register its exit handler: Python has no free slot (Py_AtExit)");
  }
}
