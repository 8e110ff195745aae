// Cancels waits of another thread.

#include <utility>

#include "bindings.hpp"
#include "waiting.hpp"

namespace {

thread_local const std::atomic<bool>* cancelled_call = nullptr;

/// While this object exists, `cancelled` ends the waits of this thread.
class CancelledBy {
 public:
  explicit CancelledBy(const std::atomic<bool>& cancelled)
      : before_(std::exchange(cancelled_call, &cancelled)) {}
  CancelledBy(const CancelledBy&) = delete;
  CancelledBy& operator=(const CancelledBy&) = delete;
  ~CancelledBy() { cancelled_call = before_; }

 private:
  const std::atomic<bool>* before_;
};

}  // namespace

nb::object Canceller::call(nb::handle callable) {
  const CancelledBy scope(cancelled_);
  return call_python([&] { return callable(); });
}

bool Canceller::cancelled_here() noexcept {
  return cancelled_call != nullptr && cancelled_call->load(std::memory_order_relaxed);
}

void bind_canceller(nb::module_& m) {
  nb::class_<Canceller>(m, "Canceller", "Cancels the waits of one thread from another thread.")
      .def(nb::init<>())
      .def("cancel", &Canceller::cancel)
      .def("call", &Canceller::call, "callable"_a,
           nb::sig("def call(self, callable: collections.abc.Callable[[], typing.Any]) "
                   "-> typing.Any"));
}
