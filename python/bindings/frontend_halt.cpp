#include <nanobind/stl/optional.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/tuple.h>

#include <string>
#include <tuple>

#include "arguments.hpp"
#include "base/printable.hpp"
#include "frontend.hpp"
#include "verb.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

std::uint64_t halt(const Frontend& self, nb::handle why) {
  const std::string reason = string_of(why, "the reason of a halt");
  const std::shared_ptr<o80::UntypedFrontend> frontend = self.shared();
  const Waiting waiting;  // an inline robot may be in a burst of another thread
  return frontend->halt(reason);
}

bool resume(const Frontend& self, std::uint64_t number, nb::handle timeout, bool accept_reading) {
  const o80::Timeout patience = timeout_of(timeout);
  const std::shared_ptr<o80::UntypedFrontend> frontend = self.shared();
  const Waiting waiting;
  return frontend->resume(number, patience, Waiting::keep_waiting, accept_reading);
}

/// Name, iteration, who, progress.
nb::list running_requests(const Frontend& self) {
  nb::list all;
  for (const o80::RequestUnderWay& each : self.untyped().running_requests()) {
    all.append(nb::make_tuple(each.name, each.since, each.who, each.progress));
  }
  return all;
}

std::uint64_t halt_segment(const std::string& segment, const std::string& reason,
                           nb::handle timeout) {
  const o80::Timeout patience = timeout_of(timeout);
  const Waiting waiting;
  return o80::halt(segment, reason, patience, Waiting::keep_waiting);
}

}  // namespace

std::optional<HaltFields> halt_fields(const std::optional<o80::Halt>& halt) {
  if (!halt) return std::nullopt;
  return HaltFields{halt->number, std::string(to_text(halt->cause)), halt->iteration,
                    o80::printable(halt->who_text()), o80::printable(halt->reason())};
}

void bind_halting(nb::module_& m, nb::class_<Frontend>& frontend) {
  m.def("halt", &halt_segment, "segment"_a, "reason"_a, "timeout"_a.none());
  def_verb(frontend, "halt", verbs::halt, &halt, "reason"_a.none() = "");
  def_verb(frontend, "keep_alive", verbs::keep_alive,
           [](const Frontend& self) { self.untyped().keep_alive(); });
  frontend
      .def_prop_ro("_halted",
                   [](const Frontend& self) { return halt_fields(self.untyped().halted()); })
      .def_prop_ro("_running_requests", &running_requests,
                   nb::sig("def _running_requests(self) -> list[tuple[str, int, str, str]]"))
      .def("_resume", &resume, "number"_a, "timeout"_a.none(), "accept_reading"_a);
}
