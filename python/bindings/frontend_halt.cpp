#include <string>
#include <tuple>

#include "arguments.hpp"
#include "base/printable.hpp"
#include "frontend.hpp"
#include "o80/base/error.hpp"
#include "verb.hpp"
#include "waiting.hpp"

using o80::InvalidArgument;

namespace {

std::string halted_text(const std::string& segment, std::uint64_t number) {
  return "'" + segment + "' is halted (halt " + std::to_string(number) + "), but ";
}

/// Calls `check`; its complaint begins with `done`.
template <class Check>
void refuse_after(const std::string& done, Check&& check) {
  try {
    check();
  } catch (const InvalidArgument& error) {
    throw InvalidArgument(done + error.what());
  }
}

/// Halts, also if the arguments are wrong; then raises what is wrong with them.
std::uint64_t halt(const Frontend& self, const nb::args& given, const nb::kwargs& named) {
  nb::object why = nb::str("");
  if (given.size() != 0) {
    why = given[0];
  } else if (named.size() != 0) {
    why = named.contains("reason") ? nb::object(named["reason"]) : nb::object(named.values()[0]);
  }
  const std::string text = shown_text(why, "");
  const std::shared_ptr<o80::UntypedFrontend> frontend = self.shared();
  // an inline robot may be in a burst of another thread
  const std::uint64_t number = without_gil([&] { return frontend->halt(text); });
  const std::string done = halted_text(frontend->segment(), number);
  if (given.size() + named.size() > 1 || (named.size() == 1 && !named.contains("reason"))) {
    throw nb::type_error(done.c_str());  // explained by its Verb
  }
  refuse_after(done, [&] { string_of(why, "the reason of a halt"); });
  return number;
}

bool resume(const Frontend& self, std::uint64_t number, Patience timeout, bool accept_reading) {
  return self.released([&](o80::UntypedFrontend& frontend) {
    return frontend.resume(number, timeout, Waiting::keep_waiting, accept_reading);
  });
}

std::uint64_t halt_segment(nb::handle segment, nb::handle reason, nb::handle timeout) {
  const std::string name = string_of(segment, "the name of a segment");
  o80::Timeout patience = std::chrono::nanoseconds(0);
  std::optional<InvalidArgument> wrong;
  try {
    patience = timeout_of(timeout);
  } catch (const InvalidArgument& error) {
    wrong = error;
  }
  const std::string text = shown_text(reason, "");
  const std::uint64_t number =
      without_gil([&] { return o80::halt(name, text, patience, Waiting::keep_waiting); });
  refuse_after(halted_text(name, number), [&] {
    string_of(reason, "the reason of a halt");
    if (wrong) throw InvalidArgument(*wrong);
  });
  return number;
}

}  // namespace

std::optional<HaltFields> halt_fields(const std::optional<o80::Halt>& halt) {
  if (!halt) return std::nullopt;
  return HaltFields{halt->number, std::string(to_text(halt->cause)), halt->iteration,
                    o80::printable(halt->who_text()), o80::printable(halt->reason())};
}

std::vector<RunningFields> running_fields(const o80::UntypedFrontend& frontend) {
  std::vector<RunningFields> all;
  for (const o80::RequestUnderWay& each : frontend.running_requests()) {
    all.emplace_back(each.name, each.since, each.who, each.progress);
  }
  return all;
}

void bind_halting(nb::module_& m, nb::class_<Frontend>& frontend) {
  m.def("halt", &halt_segment, "segment"_a.none(), "reason"_a.none(), "timeout"_a.none(),
        nb::sig("def halt(segment: object, reason: object, timeout: object) -> int"));
  m.def(
      "printable", [](nb::handle text) { return shown_text(text, ""); }, "text"_a.none(),
      nb::sig("def printable(text: object) -> str"));
  def_verb(frontend, verbs::halt, &halt);
  def_verb(frontend, verbs::keep_alive, &of_core<&o80::UntypedFrontend::keep_alive>);
  frontend
      .def_prop_ro("_halted",
                   [](const Frontend& self) { return halt_fields(self.untyped().halted()); })
      .def_prop_ro("_running_requests",
                   [](const Frontend& self) { return running_fields(self.untyped()); })
      .def("_resume", &resume, "number"_a, "timeout"_a.none(), "accept_reading"_a);
}
