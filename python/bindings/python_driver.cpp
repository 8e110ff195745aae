// A driver class in Python as a robot: its table of functions calls the class.

#include <algorithm>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "bindings.hpp"
#include "buffer.hpp"
#include "interpreter.hpp"
#include "o80/base/error.hpp"
#include "o80/base/version.hpp"
#include "o80/robot/make_table.hpp"
#include "o80/robot/run.hpp"
#include "robot/driver/library.hpp"
#include "robot/loop/robot_provenance.hpp"
#include "schema_builder.hpp"

using o80::FaultText;
using o80::OptionValue;
using o80::RequestAnswer;

namespace {

void set_text(char* text, std::size_t size, const std::string& from) {
  const std::size_t length = std::min(from.size(), size - 1);
  std::memcpy(text, from.data(), length);
  text[length] = 0;
}
void set_text(FaultText* fault, const std::string& text) {
  set_text(fault->text, sizeof fault->text, text);
}

/// Calls Python with the GIL. An exception is stored as the fault, and the result is `failed`.
template <class Result, class Call>
Result guarded(FaultText* fault, Result failed, Call&& call) noexcept {
  const WithGil locked;
  try {
    return call_python(call);
  } catch (nb::python_error& error) {
    try {
      const nb::object said = call_python([&] {
        return nb::module_::import_("o80.drivers.adapter").attr("fault_of")(error.value());
      });
      set_text(fault, shown_text(said));
    } catch (...) {
      set_text(fault, error.what());
    }
  } catch (const std::exception& error) {
    set_text(fault, error.what());
  }
  return failed;
}

/// The same for a function without an answer; 1 if it has failed.
template <class Call>
int done(FaultText* fault, Call&& call) noexcept {
  return guarded<int>(fault, 1, [&] {
    call();
    return 0;
  });
}

/// One class: python/o80/drivers/driver_class.py. It is never deleted, because its table lasts as
/// long as the process.
struct PythonClass {
  nb::object described;
  std::string name;
  std::string built_with;
  o80::RobotTable table{};
};

/// One driver object: python/o80/drivers/adapter.py.
struct PythonDriver {
  explicit PythonDriver(nb::object made) : adapter(std::move(made)) {}

  void take_buffers() {
    desired = std::make_unique<Bytes>(adapter.attr("desired_block"), PyBUF_WRITABLE);
    observed = std::make_unique<Bytes>(adapter.attr("observed_block"), PyBUF_WRITABLE);
    extended = std::make_unique<Bytes>(adapter.attr("extended_block"), PyBUF_WRITABLE);
    fresh = std::make_unique<Bytes>(adapter.attr("fresh_block"), PyBUF_WRITABLE);
    active = std::make_unique<Bytes>(adapter.attr("active_words"), PyBUF_WRITABLE);
    adapter.attr("give_differences")(
        nb::cpp_function([this](const std::vector<std::uint32_t>& offsets, std::uint32_t order) {
          if (now == nullptr) {
            throw o80::InvalidArgument("rate() and rate2() have values in write() only");
          }
          std::vector<double> differences;
          for (const std::uint32_t offset : offsets) {
            differences.push_back(now->difference(now->context, offset, order));
          }
          return differences;
        }));
  }

  nb::object adapter;
  std::unique_ptr<Bytes> desired, observed, extended, fresh, active;
  std::size_t requests = 0;
  const o80::DesiredView* now = nullptr;  // during write()
};

PythonDriver& driver(void* robot) { return *static_cast<PythonDriver*>(robot); }

nb::list pairs(const OptionValue* values, std::uint32_t count) {
  nb::list all;
  for (std::uint32_t i = 0; i < count; ++i) {
    all.append(nb::make_tuple(values[i].name, values[i].text));
  }
  return all;
}

const nb::object& class_of(void* self) { return static_cast<PythonClass*>(self)->described; }

void options(void* self, void* context, void (*each)(void*, const o80::OptionRow*)) {
  const WithGil locked;
  for (nb::handle row : class_of(self).attr("options")) {
    const auto texts = nb::cast<std::vector<std::string>>(row);
    const o80::OptionRow plain{texts[0].c_str(), texts[1].c_str(), texts[2].c_str(),
                               texts[3].c_str(), texts[4].c_str()};
    each(context, &plain);
  }
}

int accepts(void* self, const OptionValue* values, std::uint32_t count, FaultText* fault) {
  return done(fault, [&] { class_of(self).attr("config")(pairs(values, count)); });
}

void* create(void* self, const OptionValue* values, std::uint32_t count, FaultText* fault) {
  return guarded<void*>(fault, nullptr, [&]() -> void* {
    return new PythonDriver(class_of(self).attr("make")(pairs(values, count)));
  });
}

int describe(void* robot, std::int64_t period, void* context, o80::SchemaTaker* take,
             FaultText* fault) {
  return done(fault, [&] {
    PythonDriver& self = driver(robot);
    const nb::object builder = self.adapter.attr("describe")(period);
    o80::Schema schema = nb::cast<SchemaBuilder&>(builder).schema;
    schema.head.period = nb::cast<std::int64_t>(self.adapter.attr("period"));
    schema.head.block = o80::round_up(schema.head.block, 8);
    self.requests = schema.requests.size();
    self.take_buffers();
    const std::vector<std::byte> bytes = to_bytes(schema);
    take(context, bytes.data(), bytes.size(), schema.hooks.data());
  });
}

int start(void* robot, FaultText* fault) {
  return done(fault, [&] { driver(robot).adapter.attr("start")(); });
}

int wait(void* robot, std::int64_t due, FaultText* fault) {
  return done(fault, [&] { driver(robot).adapter.attr("wait")(due); });
}

void copy(Bytes& to, const void* from) {
  const auto block = to.writable();
  if (!block.empty()) std::memcpy(block.data(), from, block.size());
}
void copy(void* to, const Bytes& from) {
  const auto block = from.span();
  if (!block.empty()) std::memcpy(to, block.data(), block.size());
}

int write(void* robot, const o80::DesiredView* desired, FaultText* fault) {
  PythonDriver& self = driver(robot);
  self.now = desired;
  const int failed = done(fault, [&] {
    copy(*self.desired, desired->states);
    copy(*self.active, desired->active);
    self.adapter.attr("write")(desired->iteration, desired->time, desired->period);
  });
  self.now = nullptr;
  return failed;
}

/// Report of the adapter about a reading: see `Adapter.read`.
void take_report(PythonDriver& self, nb::handle told, o80::ReadingView* reading) {
  const nb::tuple report = nb::cast<nb::tuple>(told);
  reading->finished = nb::cast<bool>(report[0]) ? 1 : 0;
  reading->missed = nb::cast<bool>(report[1]) ? 1 : 0;
  reading->follows = reading->desired != nullptr && nb::cast<bool>(report[6]) ? 1 : 0;
  if (reading->desired != nullptr && nb::cast<bool>(report[2])) {
    reading->has_desired = 1;
    copy(reading->desired, *self.fresh);
  }
  if (!report[3].is_none()) {
    reading->halted = 1;
    set_text(&reading->halt_text, shown_text(report[3]));
  }
  for (nb::handle actuator : report[4]) {
    const auto index = nb::cast<std::size_t>(actuator);
    reading->interrupted[index / 64] |= std::uint64_t{1} << index % 64;
  }
  for (nb::handle each : report[5]) {
    const auto [index, answer, text] =
        nb::cast<std::tuple<std::size_t, std::uint32_t, nb::object>>(each);
    o80::RequestReport& request = reading->requests[index];
    request.changed = 1;
    request.answer = static_cast<RequestAnswer>(answer);
    set_text(request.text, sizeof request.text, shown_text(text));
    reading->reported = 1;
  }
}

int read(void* robot, o80::ReadingView* reading, FaultText* fault) {
  return done(fault, [&] {
    PythonDriver& self = driver(robot);
    copy(*self.observed, reading->observed);
    copy(*self.extended, reading->extended);
    nb::list runs;
    for (std::size_t i = 0; i < self.requests; ++i) runs.append(reading->requests[i].runs != 0);
    const nb::object told = self.adapter.attr("read")(reading->iteration, reading->time,
                                                      reading->desired != nullptr, runs);
    copy(reading->observed, *self.observed);
    copy(reading->extended, *self.extended);
    if (!told.is_none()) take_report(self, told, reading);
  });
}

/// (answer, text) of a handler.
RequestAnswer answer_of(nb::handle told, FaultText* text) {
  const auto [answer, said] = nb::cast<std::pair<std::uint32_t, nb::object>>(told);
  set_text(text, shown_text(said));
  return static_cast<RequestAnswer>(answer);
}

RequestAnswer request(void* robot, std::uint32_t index, const std::byte* payload, FaultText* text) {
  return guarded<RequestAnswer>(text, RequestAnswer::failed, [&] {
    PythonDriver& self = driver(robot);
    const auto size = nb::cast<std::size_t>(self.adapter.attr("payload_sizes")[index]);
    return answer_of(self.adapter.attr("request")(index, nb::bytes(payload, size)), text);
  });
}

int halt(void* robot, FaultText* fault) {
  return done(fault, [&] { driver(robot).adapter.attr("halt")(); });
}

RequestAnswer resume(void* robot, FaultText* text) {
  return guarded<RequestAnswer>(text, RequestAnswer::failed, [&] {
    return answer_of(driver(robot).adapter.attr("resume")(), text);
  });
}

void stop(void* robot) {
  FaultText ignored{};
  done(&ignored, [&] { driver(robot).adapter.attr("stop")(); });
}

void destroy(void* robot) {
  const WithGil locked;
  delete static_cast<PythonDriver*>(robot);
}

/// Makes a table for a class. `described` is kept for ever.
o80::RobotLibrary library_of(const nb::object& described, const std::string& path) {
  auto* made = new PythonClass{described,
                               nb::cast<std::string>(described.attr("name")),
                               nb::cast<std::string>(described.attr("built_with")),
                               {}};
  o80::RobotTable& table = made->table;
  table.version = o80::kRobotTableVersion;
  table.size = sizeof table;
  table.row_sizes = o80::kSchemaRowSizes;
  table.name = made->name.c_str();
  table.built_with = made->built_with.c_str();
  table.self = made;
  table.options = &options;
  table.accepts = &accepts;
  table.create = &create;
  table.describe = &describe;
  table.start = &start;
  if (nb::cast<bool>(described.attr("has_wait"))) {
    table.paces_itself = 1;
    table.wait = &wait;
  }
  table.write = &write;
  table.read = &read;
  table.request = &request;
  if (nb::cast<bool>(described.attr("has_halt"))) table.halt = &halt;
  if (nb::cast<bool>(described.attr("has_resume"))) table.resume = &resume;
  table.stop = &stop;
  table.destroy = &destroy;
  o80::name_library(table, path, nb::cast<std::string>(described.attr("source")));
  return {nb::cast<std::string>(described.attr("path")), &table};
}

int run_driver(const o80::RobotLibrary& library, std::vector<std::string> words) {
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  const WithoutGil released;
  return o80::run(*library.table, static_cast<int>(words.size()), arguments.data());
}

}  // namespace

void bind_python_driver(nb::module_& m) {
  m.def("python_library", &library_of, "described"_a, "path"_a,
        "Makes a robot of a driver class (o80.drivers.driver_class.DriverClass).");
  m.def("run_driver", &run_driver, "library"_a, "words"_a,
        "Runs a robot in this process until it ends, with the flags of `o80 run`; its exit code.");
}
