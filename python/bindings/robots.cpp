#include <nanobind/nanobind.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <memory>

#include "bindings.hpp"
#include "frontend.hpp"
#include "robot/library.hpp"
#include "robot/run_options.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;

namespace {

/// Starts a robot in this process; its bursts run in the thread that asks for them.
Attachment start_inline(const o80::RobotLibrary& library, const std::string& segment,
                        std::int64_t period, std::uint64_t history,
                        const o80::OptionValues& options) {
  const Waiting waiting;
  o80::BackendOptions backend;
  backend.segment = segment;
  backend.period = period;
  backend.history = history;
  auto robot =
      std::make_shared<o80::InlineRobot>(std::make_unique<o80::Robot>(*library.table, options),
                                         std::move(backend), Waiting::keep_waiting);
  return {std::make_shared<o80::UntypedFrontend>(robot->segment(), robot), robot};
}

}  // namespace

void bind_robots(nb::module_& m) {
  nb::class_<o80::Option>(m, "Option", "One value a robot can be started with.")
      .def_ro("name", &o80::Option::name)
      .def_ro("kind", &o80::Option::kind, "number, integer, boolean, text, or what is allowed")
      .def_ro("default", &o80::Option::default_text, "as text")
      .def_ro("help", &o80::Option::help)
      .def_ro("unit", &o80::Option::unit);
  nb::class_<o80::RobotLibrary>(m, "RobotLibrary", "A robot library that is loaded.")
      .def_ro("path", &o80::RobotLibrary::path)
      .def_prop_ro("name",
                   [](const o80::RobotLibrary& self) { return std::string(self.table->name); })
      .def_prop_ro(
          "built_with",
          [](const o80::RobotLibrary& self) { return std::string(self.table->built_with); })
      .def_prop_ro("options",
                   [](const o80::RobotLibrary& self) { return o80::options_of(*self.table); })
      .def("start_inline", &start_inline, "segment"_a, "period"_a, "history"_a, "options"_a);
  m.def("load_robot", &o80::RobotLibrary::load, "name_or_path"_a);
  m.def("unused_segment_name", &o80::unused_segment_name, "robot"_a);
  m.def("find_robots", [] {
    std::vector<std::pair<std::string, std::string>> found;
    for (const o80::RobotFile& file : o80::find_robots()) found.emplace_back(file.name, file.path);
    return found;
  });
  m.def(
      "run_flags",
      [] {
        std::size_t count = 0;
        const o80::RunFlag* flags = o80::run_flags(count);
        nb::list all;
        for (std::size_t i = 0; i < count; ++i) {
          all.append(nb::make_tuple(flags[i].name, flags[i].value, flags[i].help));
        }
        return all;
      },
      nb::sig("def run_flags() -> list[tuple[str, str | None, str]]"),
      "Name, value and help of each flag of every robot's process.");
}
