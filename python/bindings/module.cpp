#include <nanobind/nanobind.h>

#include <string>

#include "bindings.hpp"
#include "interpreter.hpp"
#include "o80/base/version.hpp"

namespace nb = nanobind;

NB_MODULE(_core, m) {
  m.doc() = "The compiled part of o80.";
  // a frontend that is alive at the end of the interpreter is not a leak
  nb::set_leak_warnings(
      PyObject_IsTrue(nb::module_::import_("sys").attr("flags").attr("dev_mode").ptr()) == 1);
  m.def(
      "version", [] { return nb::str(o80::version().data(), o80::version().size()); },
      "The version of the compiled library.");
  bind_interpreter(m);
  bind_errors(m);
  bind_segment_list(m);
  bind_observation(m);
  bind_batch(m);
  bind_canceller(m);
  bind_frontend(m);
  bind_control(m);
  bind_backend(m);
  bind_robots(m);
  bind_inline_group(m);
  bind_loop_state(m);
  bind_journal(m);
  bind_provenance(m);
  bind_played_segment(m);
  bind_nearest_name(m);
  bind_replay(m);
  bind_python_driver(m);
}
