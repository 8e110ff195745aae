#include <string>

#include "bindings.hpp"
#include "interpreter.hpp"
#include "o80/base/version.hpp"

NB_MODULE(_core, m) {
  m.doc() = "The compiled part of o80.";
  // what a program keeps until the interpreter ends, in an attribute of a class or in a thread that
  // is never joined, is not a leak
  nb::set_leak_warnings(false);
  m.def("_warn_of_leaks", [] { nb::set_leak_warnings(true); }, "For tests: reports what is left.");
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
