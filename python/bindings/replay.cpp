#include "robot/loop/replay.hpp"

#include <cstdint>
#include <memory>
#include <span>
#include <string>

#include "bindings.hpp"
#include "loop_options.hpp"
#include "o80/runtime/observation.hpp"
#include "open_replay.hpp"
#include "robot/driver/library.hpp"
#include "runtime/replay/driverless_replay.hpp"
#include "waiting.hpp"

namespace {

using WithDriver = OpenReplay<o80::Replay>;
using WithoutDriver = OpenReplay<o80::DriverlessReplay>;

/// `period` [ns].
o80::BackendOptions backend_options(const std::string& segment, const o80::OptionValues& loop,
                                    std::int64_t period) {
  o80::BackendOptions backend = loop_options_of(loop).backend;
  backend.segment = segment;
  backend.period = period;
  return backend;
}

void make_with_driver(WithDriver* self, const o80::RobotLibrary& library,
                      const std::string& segment, const o80::OptionValues& loop,
                      const o80::OptionValues& options, std::int64_t period) {
  new (self) WithDriver(
      std::make_unique<o80::Replay>(std::make_unique<o80::DriverInstance>(*library.table, options),
                                    backend_options(segment, loop, period)));
}

void make_without_driver(WithoutDriver* self, const o80::Description& description,
                         const std::string& segment, const o80::OptionValues& loop,
                         std::int64_t period) {
  new (self) WithoutDriver(std::make_unique<o80::DriverlessReplay>(
      description.schema, backend_options(segment, loop, period)));
}

}  // namespace

void bind_replay(nb::module_& m) {
  WithDriver::bind(m, "Replay", "Repeats a recorded run: see o80.replaying.")
      .def("__init__", &make_with_driver, "library"_a, "segment"_a, "loop"_a, "options"_a,
           "period"_a, nb::keep_alive<1, 2>())
      .def(
          "run",
          [](WithDriver& self, std::span<const std::int64_t> times) {
            return self.open().run(times);
          },
          "times"_a, nb::call_guard<Waiting>())
      .def(
          "begin_at_rest",
          [](WithDriver& self, std::int64_t first, std::span<const std::byte> before,
             std::uint32_t slot) { self.open().begin_at_rest(first, before, slot); },
          "first"_a, "before"_a, "slot"_a)
      .def(
          "load_snapshot",
          [](WithDriver& self, std::uint32_t slot, std::span<const std::byte> bytes) {
            self.open().load_snapshot(slot, bytes);
          },
          "slot"_a, "state"_a);
  WithoutDriver::bind(m, "DriverlessReplay",
                      "Repeats a recorded run without its driver: see o80.replaying.")
      .def("__init__", &make_without_driver, "description"_a, "segment"_a, "loop"_a, "period"_a)
      .def(
          "begin_at_rest",
          [](WithoutDriver& self, std::int64_t row) { self.open().begin_at_rest(row); }, "row"_a)
      .def(
          "run",
          [](WithoutDriver& self, std::span<const std::byte> rows) {
            return self.open().run(rows);
          },
          "rows"_a, nb::call_guard<Waiting>());
}
