// Exclusive control as a context manager.

#include "runtime/frontend/control_block.hpp"

#include <memory>
#include <optional>
#include <utility>

#include "batch.hpp"
#include "bindings.hpp"
#include "errors.hpp"
#include "frontend.hpp"
#include "pickling.hpp"
#include "runtime/frontend/link.hpp"
#include "waiting.hpp"

namespace {

/// Exclusive control within a `with` block. An exception may come between any two instructions of
/// Python, so control is given back by the destructor too.
class Control {
 public:
  Control(nb::object frontend, Patience timeout)
      : frontend_(std::move(frontend)), timeout_(timeout) {
    nb::cast<Frontend&>(frontend_).shared()->link()->check_usable();
  }
  Control(const Control&) = delete;
  Control& operator=(const Control&) = delete;
  ~Control() { drop(); }

  nb::object enter() {
    if (entered_) throw o80::Error("this block of control has begun: call control() for each one");
    entered_ = true;
    const auto frontend = nb::cast<Frontend&>(frontend_).shared();
    try {
      {
        const Waiting waiting;
        block_ = std::make_shared<o80::ControlBlock>(frontend);
      }
      const o80::Batch taken = block_->taken();
      wait_for(taken);
      const o80::Handle handle = taken.handle(0);
      if (handle.status != o80::Status::completed) {
        raise_python("ControlTaken", "no control of '" + frontend->segment() + "': " + handle.text);
      }
    } catch (...) {
      drop();
      throw;
    }
    return frontend_;
  }

  void exit() {
    const std::shared_ptr<o80::ControlBlock> block = block_;
    if (!block || nb::cast<Frontend&>(frontend_).untyped().link()->segment.forked()) return;
    try {
      const o80::Batch released = without_gil([&] { return block->leave(); });
      if (!released.empty()) wait_for(released);
    } catch (const o80::BackendGone&) {
    } catch (const o80::Closed&) {
    }
    block_.reset();
  }

  static int traverse(PyObject* self, visitproc visit, void* arg) {
    Py_VISIT(Py_TYPE(self));
    if (nb::inst_ready(self)) Py_VISIT(nb::inst_ptr<Control>(self)->frontend_.ptr());
    return 0;
  }
  static int clear(PyObject* self) {
    if (!nb::inst_ready(self)) return 0;
    nb::inst_ptr<Control>(self)->drop();
    nb::inst_ptr<Control>(self)->frontend_.reset();
    return 0;
  }

 private:
  void wait_for(const o80::Batch& batch) const {
    carrying(batch, [&] { batch.wait(timeout_, Waiting::keep_waiting, {.check = false}); });
  }

  /// May be called while an exception of Python is under way.
  void drop() noexcept {
    const std::shared_ptr<o80::ControlBlock> block = std::move(block_);
    if (!block) return;
    const nb::error_scope under_way;
    const Waiting waiting;
    block->leave_quietly();
  }

  nb::object frontend_;
  o80::Timeout timeout_;
  bool entered_ = false;
  std::shared_ptr<o80::ControlBlock> block_;
};

PyType_Slot control_slots[] = {
    {Py_tp_traverse, reinterpret_cast<void*>(&Control::traverse)},
    {Py_tp_clear, reinterpret_cast<void*>(&Control::clear)},
    {0, nullptr},
};

}  // namespace

void bind_control(nb::module_& m) {
  nb::class_<Control> control(m, "Control", nb::type_slots(control_slots),
                              "Exclusive control within a `with` block.");
  refuse_to_pickle(control, "exclusive control", "nothing, and take control there");
  control
      .def(nb::init<nb::object, Patience>(), "frontend"_a, "timeout"_a.none(),
           nb::sig("def __init__(self, frontend: Frontend, timeout: float | None) -> None"))
      .def("__enter__", &Control::enter, nb::sig("def __enter__(self) -> Frontend"))
      .def(
          "__exit__", [](Control& self, nb::handle, nb::handle, nb::handle) { self.exit(); },
          "kind"_a.none(), "error"_a.none(), "trace"_a.none(),
          nb::sig("def __exit__(self, kind: type[BaseException] | None, error: BaseException | "
                  "None, trace: types.TracebackType | None) -> None"));
}
