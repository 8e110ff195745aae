#include <memory>

#include "bindings.hpp"
#include "describe/table.hpp"
#include "frontend.hpp"
#include "loop_options.hpp"
#include "o80/base/error.hpp"
#include "o80/robot/real_time.hpp"
#include "robot/driver/library.hpp"
#include "robot/driver/machine_limits.hpp"
#include "robot/group/inline_robot.hpp"
#include "waiting.hpp"

namespace {

/// Name, kind, allowed values, default, help, and where the option can be given.
nb::list described_loop_options() {
  using Option = o80::LoopOption;
  nb::list all;
  for (const Option& each : o80::loop_options()) {
    all.append(nb::make_tuple(each.name, each.kind_name(), each.allowed, each.otherwise, each.help,
                              (each.scope & (Option::kProcess | Option::kFlag)) != 0,
                              (each.scope & Option::kProcess) != 0,
                              (each.scope & Option::kInline) != 0,
                              (each.scope & Option::kEmbedded) != 0));
  }
  return all;
}

/// Starts a robot in this process; its bursts run in the thread that requests them.
Attachment start_inline(const o80::RobotLibrary& library, const std::string& segment,
                        const o80::OptionValues& loop, const o80::OptionValues& options) {
  const Waiting waiting;
  o80::BackendOptions backend = loop_options_of(loop).backend;
  backend.segment = segment;
  auto robot = std::make_shared<o80::InlineRobot>(
      std::make_unique<o80::DriverInstance>(*library.table, options), std::move(backend),
      Waiting::keep_waiting);
  return {std::make_shared<o80::UntypedFrontend>(robot->backend(), robot), robot};
}

/// Description of a robot with these options. The robot is constructed, but not started.
std::shared_ptr<o80::Description> description_of(const o80::RobotLibrary& library,
                                                 const o80::OptionValues& options) {
  const o80::Schema schema = o80::DriverInstance(*library.table, options).describe();
  o80::check(schema);
  return std::make_shared<o80::Description>(o80::Description{schema, o80::row_layout(schema)});
}

}  // namespace

o80::LoopOptions loop_options_of(const o80::OptionValues& values, o80::LoopOptions otherwise) {
  o80::LoopOptions options = std::move(otherwise);
  for (const auto& [name, text] : values) {
    const o80::LoopOption* option = o80::find_loop_option(name);
    if (option == nullptr) throw o80::InvalidArgument("there is no option '" + name + "'");
    o80::set_loop_option(options, *option, text, name);
  }
  return options;
}

void bind_robots(nb::module_& m) {
  nb::class_<o80::Option>(m, "Option", "One option with which a robot can be started.")
      .def_ro("name", &o80::Option::name)
      .def_ro("kind", &o80::Option::kind, "number, integer, boolean, text, or what is allowed")
      .def_ro("default", &o80::Option::default_text, "as text")
      .def_ro("help", &o80::Option::help)
      .def_ro("unit", &o80::Option::unit);
  nb::class_<o80::RobotLibrary>(m, "RobotLibrary", "A loaded robot library.")
      .def_ro("path", &o80::RobotLibrary::path)
      .def_prop_ro("name",
                   [](const o80::RobotLibrary& self) { return std::string(self.table->name); })
      .def_prop_ro(
          "built_with",
          [](const o80::RobotLibrary& self) { return std::string(self.table->built_with); })
      .def_prop_ro("options",
                   [](const o80::RobotLibrary& self) { return o80::options_of(*self.table); })
      .def("describe", &description_of, "options"_a)
      .def("start_inline", &start_inline, "segment"_a, "loop"_a, "options"_a);
  m.def("load_robot", &o80::RobotLibrary::load, "name_or_path"_a);
  m.def(
      "become_real_time",
      [](int priority) {
        using Options = o80::RealTimeOptions;
        o80::set_up_real_time(
            {.policy = Options::Policy::automatic, .priority = priority, .stack = 0});
        return (sched_getscheduler(0) & ~SCHED_RESET_ON_FORK) == SCHED_FIFO;
      },
      "priority"_a,
      "Gives the calling thread the policy fifo, until it runs for 200 ms without sleep; False if "
      "the machine refuses.");
  m.def("unused_segment_name", &o80::unused_segment_name, "robot"_a);
  m.def("no_such_robot", &o80::no_such_robot, "name"_a, "known"_a,
        "The text of an error: what is there instead, or how to install it.");
  m.def("find_robots", [] {
    std::vector<std::pair<std::string, std::string>> found;
    for (const o80::RobotFile& file : o80::find_robots()) found.emplace_back(file.name, file.path);
    return found;
  });
  m.def(
      "machine_limits",
      [] {
        const auto texts = [](const o80::MachineLimit& limit) {
          return nb::make_tuple(limit.at_once, limit.for_good, limit.undo);
        };
        return nb::make_tuple(texts(o80::kPriorityLimit), texts(o80::kMemoryLimit));
      },
      nb::sig("def machine_limits() -> tuple[tuple[str, str, str], tuple[str, str, str]]"),
      "The commands that raise the limits of priority and locked memory: in this shell, for good, "
      "and the one that undoes the second.");
  m.def(
      "loop_options", &described_loop_options,
      nb::sig("def loop_options() -> list[tuple[str, str, str, str, str, bool, bool, bool, bool]]"),
      "What can be set about every backend: name, kind, what is allowed, what holds otherwise, "
      "help; and whether `o80 run`, `start`, `inline` and `Backend` take it.");
  m.def(
      "check_loop_options", [](const o80::OptionValues& loop) { loop_options_of(loop); }, "loop"_a,
      "Raises InvalidArgument if one cannot have that text.");
}
