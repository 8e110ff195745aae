#include "robot/loop/replay.hpp"

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <vector>

#include "bindings.hpp"
#include "loop_options.hpp"
#include "o80/runtime/observation.hpp"
#include "robot/driver/library.hpp"
#include "runtime/replay/driverless_replay.hpp"
#include "waiting.hpp"

namespace {

/// `period` [ns].
o80::BackendOptions backend_options(const std::string& segment, const o80::OptionValues& loop,
                                    std::int64_t period) {
  o80::BackendOptions backend = loop_options_of(loop).backend;
  backend.segment = segment;
  backend.period = period;
  return backend;
}

void make_with_driver(o80::Replay* self, const o80::RobotLibrary& library,
                      const std::string& segment, const o80::OptionValues& loop,
                      const o80::OptionValues& options, std::int64_t period) {
  new (self) o80::Replay(std::make_unique<o80::DriverInstance>(*library.table, options),
                         backend_options(segment, loop, period));
}

void make_without_driver(o80::DriverlessReplay* self, const o80::Description& description,
                         const std::string& segment, const o80::OptionValues& loop,
                         std::int64_t period) {
  new (self) o80::DriverlessReplay(description.schema, backend_options(segment, loop, period));
}

/// Iteration, decision, recorded, replayed.
using MismatchFields = std::tuple<std::int64_t, std::string, std::string, std::string>;

template <class Replay>
std::optional<MismatchFields> mismatch_of(const Replay& self) {
  const auto& found = self.mismatch();
  if (!found) return std::nullopt;
  return MismatchFields{found->iteration, found->decision, found->recorded, found->replayed};
}

/// Binds what both kinds of replay have.
template <class Replay>
nb::class_<Replay> bind(nb::module_& m, const char* name, const char* text) {
  return nb::class_<Replay>(m, name, text)
      .def(
          "add",
          [](Replay& self, const std::vector<const o80::JournalEntry*>& entries) {
            for (const o80::JournalEntry* entry : entries) self.add(*entry);
          },
          "entries"_a)
      .def("begin_at", &Replay::begin_at, "first"_a)
      .def(
          "close", [](nb::handle self) { nb::inst_destruct(self); },
          nb::sig("def close(self) -> None"), "Ends it, so that its segment can be removed.")
      .def_prop_ro("mismatch", &mismatch_of<Replay>)
      .def_prop_ro("fault", &Replay::fault)
      .def_prop_ro("segment", &Replay::segment)
      .def_prop_ro("next", &Replay::next);
}

}  // namespace

void bind_replay(nb::module_& m) {
  using o80::DriverlessReplay;
  using o80::Replay;
  bind<Replay>(m, "Replay", "Repeats a recorded run: see o80.replaying.")
      .def("__init__", &make_with_driver, "library"_a, "segment"_a, "loop"_a, "options"_a,
           "period"_a, nb::keep_alive<1, 2>())
      .def("run", &Replay::run, "times"_a, nb::call_guard<Waiting>())
      .def("begin_at_rest", &Replay::begin_at_rest, "first"_a, "before"_a, "slot"_a)
      .def("load_snapshot", &Replay::load_snapshot, "slot"_a, "state"_a);
  bind<DriverlessReplay>(m, "DriverlessReplay",
                         "Repeats a recorded run without its driver: see o80.replaying.")
      .def("__init__", &make_without_driver, "description"_a, "segment"_a, "loop"_a, "period"_a)
      .def("begin_at_rest", &DriverlessReplay::begin_at_rest, "row"_a)
      .def("run", &DriverlessReplay::run, "rows"_a, nb::call_guard<Waiting>());
}
