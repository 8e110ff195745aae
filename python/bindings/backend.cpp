#include "o80/runtime/backend.hpp"

#include <nanobind/nanobind.h>
#include <nanobind/stl/array.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstring>
#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <thread>
#include <utility>

#include "bindings.hpp"
#include "o80/memory/fork.hpp"
#include "o80/runtime/observation.hpp"
#include "pickling.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using o80::InvalidArgument;

namespace {

constexpr std::int64_t kLook = 50'000'000;  // between looks at signals [ns]

/// A schema while Python describes it.
struct SchemaBuilder {
  o80::Schema schema;

  explicit SchemaBuilder(const std::string& robot) { schema.head.robot = o80::NameText(robot); }

  /// A type from its fields: (name, kind, shape, text, labels or None, type).
  std::uint32_t add_type(const std::string& name, const nb::list& fields) {
    std::vector<o80::FieldRow> members;
    for (nb::handle each : fields) members.push_back(member(nb::cast<nb::tuple>(each)));
    return schema.add_type(name, std::move(members));
  }

  std::uint32_t add_actuators(const std::string& group, std::uint32_t type, std::uint32_t count,
                              bool is_array) {
    return schema.add_actuators(group, type, count, is_array);
  }

  void set_extended(std::uint32_t type) { schema.head.extended = type; }

  void add_request(const std::string& name, std::uint32_t type, const std::string& help,
                   bool while_halted) {
    schema.add_request(name, type, help, while_halted);
  }

  void name_actuator(std::uint32_t actuator, const std::string& name) {
    schema.actuator(actuator).name(name);
  }

  void set_follow(std::uint32_t actuator) {
    schema.actuator(actuator).when_idle(o80::WhenIdle::follow);
  }

  std::vector<std::string> actuators() const {
    std::vector<std::string> names;
    for (const o80::ActuatorRow& row : schema.actuators) names.push_back(row.name.str());
    return names;
  }

  /// Of a field, or of the first number if it is empty: as o80::Limits has them, in its order.
  void set_limits(std::uint32_t actuator, const std::string& field,
                  const std::array<double, 6>& given) {
    const o80::Limits limits{given[0], given[1], given[2], given[3], given[4], given[5]};
    if (field.empty()) {
      schema.actuator(actuator).limits(limits);
    } else {
      schema.actuator(actuator).limits(field, limits);
    }
  }

  void rests_at(std::uint32_t actuator, const std::string& field, double value) {
    schema.actuator(actuator).rests_at(field, value);
  }

 private:
  o80::FieldRow member(const nb::tuple& row) {
    const auto name = nb::cast<std::string>(row[0]);
    const auto shape = nb::cast<std::vector<std::uint32_t>>(row[2]);
    if (shape.size() > 2) {
      throw InvalidArgument("field '" + name + "' has " + std::to_string(shape.size()) +
                            " dimensions: at most 2 can be described");
    }
    o80::FieldRow field = o80::scalar_field(name, kind_of(nb::cast<std::string>(row[1])),
                                            nb::cast<std::string>(row[3]));
    if (!shape.empty()) field.rows = shape[0];
    if (shape.size() == 2) field.columns = shape[1];
    if (field.kind == o80::Kind::structure) field.type = nb::cast<std::uint32_t>(row[5]);
    if (field.kind == o80::Kind::enumeration) add_labels(field, nb::cast<nb::dict>(row[4]));
    return field;
  }

  void add_labels(o80::FieldRow& field, const nb::dict& labels) {
    field.size = 8;
    field.is_signed = 1;
    field.first_label = static_cast<std::uint32_t>(schema.labels.size());
    field.labels = static_cast<std::uint32_t>(labels.size());
    for (const auto& [name, value] : labels) {
      schema.labels.push_back(
          {o80::NameText(nb::cast<std::string>(name)), nb::cast<std::int64_t>(value)});
    }
  }

  static o80::Kind kind_of(const std::string& name) {
    using o80::Kind;
    constexpr const char* kNames[] = {"bool",    "int8",   "int16",  "int32",  "int64",
                                      "uint8",   "uint16", "uint32", "uint64", "float32",
                                      "float64", "enum",   "struct"};
    for (std::size_t i = 0; i < std::size(kNames); ++i) {
      if (name == kNames[i]) return static_cast<Kind>(i);
    }
    throw InvalidArgument("numbers of kind '" + name + "' cannot be described");
  }
};

/// The compiled half of o80.Backend.
///
/// Python fills `observed`, `extended` and `fresh_desired`, memory of its own; `publish` and a
/// fresh start copy them into the row. Its own members are guarded by the GIL.
class Backend final : public o80::RequestServer {
 public:
  Backend(const SchemaBuilder& builder, const o80::BackendOptions& options)
      : backend_(std::make_shared<o80::UntypedBackend>(builder.schema, options, this)),
        name_(options.segment),
        observed_(zeros(backend_->layout().block)),
        extended_(zeros(backend_->layout().extended_size)),
        fresh_desired_(zeros(backend_->layout().block)) {}

  const nb::bytearray& observed() const { return observed_; }
  const nb::bytearray& extended() const { return extended_; }
  const nb::bytearray& fresh_desired() const { return fresh_desired_; }
  /// Called with index and payload; gives None, a text (rejected), or True (start afresh).
  nb::object serve_with = nb::none();

  /// Throws Closed or UsedAfterFork.
  o80::UntypedBackend& checked() const {
    guard_.check("the backend of segment '" + name_ + "'");
    if (!backend_) {
      throw o80::Closed("the backend of segment '" + name_ + "' was closed: make a new one");
    }
    return *backend_;
  }

  /// For what may not happen inside of `step`. Throws Error as well.
  o80::UntypedBackend& between_steps() const {
    o80::UntypedBackend& backend = checked();
    if (!stepping_) return backend;
    throw o80::Error("the backend of segment '" + name_ +
                     "' is inside of step: use it in one thread, and not from the handler of a "
                     "request (stop and close may be called from anywhere)");
  }

  void publish() {
    o80::UntypedBackend& backend = between_steps();
    copy(observed_, backend.observed());
    copy(extended_, backend.extended());
    backend.publish();
    begun_ = true;
  }

  /// True if an iteration is under way, False if the backend is to end.
  bool step(std::optional<double> timeout) {
    between_steps();
    if (!begun_) throw InvalidArgument("publish row 0 before the first step");
    const Stepping stepping(*this);
    o80::Step step = stepping.backend->try_step();
    if (step == o80::Step::standing) step = wait(*stepping.backend, timeout);
    if (raised_) std::rethrow_exception(std::exchange(raised_, nullptr));
    if (!backend_) {
      throw o80::Closed("the backend of segment '" + name_ + "' was closed while it was in step");
    }
    return step == o80::Step::run;
  }

  /// Why the steps ended on their own; empty if they did not.
  std::string failure() const {
    return backend_ && !guard_.forked() ? std::string(backend_->failure()) : "";
  }

  /// Lets go of the name; a step under way raises Closed, and does that when it is left.
  void end(bool failed, const std::string& text) {
    if (!backend_ || guard_.forked()) return;
    last_words_ = {failed ? o80::State::failed : o80::State::stopped, text};
    const std::shared_ptr<o80::UntypedBackend> ended = std::move(backend_);
    if (!stepping_) return finish(*ended);
    ended->ask_to_stop();
    if (stepping_thread_ == std::this_thread::get_id()) return;  // a handler in it
    const o80::Deadline deadline(kPatience);
    const Waiting waiting;
    while (stepping_) {
      if (deadline.over()) {
        throw o80::TimeoutError("the backend of segment '" + name_ +
                                "' ends when the handler of a request returns, which it has not");
      }
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
      Waiting::check();
    }
  }

  static int traverse(PyObject* self, visitproc visit, void* arg) {
    Py_VISIT(Py_TYPE(self));
    if (nb::inst_ready(self)) Py_VISIT(nb::inst_ptr<Backend>(self)->serve_with.ptr());
    return 0;
  }
  static int clear(PyObject* self) {
    if (nb::inst_ready(self)) nb::inst_ptr<Backend>(self)->serve_with.reset();
    return 0;
  }

 private:
  static constexpr std::chrono::seconds kPatience{5};

  /// While a step is under way; it keeps the backend.
  struct Stepping {
    explicit Stepping(Backend& whose) : owner(whose), backend(whose.backend_) {
      owner.stepping_thread_ = std::this_thread::get_id();
      owner.stepping_ = true;
    }
    Stepping(const Stepping&) = delete;
    Stepping& operator=(const Stepping&) = delete;
    ~Stepping() {
      if (!owner.backend_) owner.finish(*backend);
      owner.stepping_ = false;
    }
    Backend& owner;
    std::shared_ptr<o80::UntypedBackend> backend;
  };

  void finish(o80::UntypedBackend& backend) {
    backend.end(last_words_.first, last_words_.second);
    serve_with = nb::none();
  }

  static nb::bytearray zeros(std::size_t size) {
    const std::vector<std::byte> bytes(size);
    return nb::bytearray(bytes.data(), size);
  }

  static void copy(const nb::bytearray& from, std::byte* to) {
    if (from.size() > 0) std::memcpy(to, from.c_str(), from.size());
  }

  o80::Step wait(o80::UntypedBackend& backend, std::optional<double> timeout) {
    const o80::Deadline deadline(timeout_of(timeout));
    const Waiting waiting;
    while (true) {
      const o80::Step step = backend.step_within(deadline.left(kLook));
      if (step != o80::Step::standing) return step;
      if (deadline.over()) {
        throw o80::TimeoutError("nobody asked '" + name_ +
                                "' for an iteration in time: it is bursting");
      }
      Waiting::check();
    }
  }

  o80::Served serve(std::uint32_t request, std::span<const std::byte> payload) noexcept override {
    const WithGil locked;
    try {
      const nb::object answer = call_python(
          [&] { return serve_with(request, nb::bytes(payload.data(), payload.size())); });
      if (answer.is_none()) return o80::Served::done();
      if (nb::isinstance<nb::str>(answer)) {
        return o80::Served::rejected(nb::cast<std::string>(answer));
      }
      return o80::Served::start_afresh();
    } catch (nb::python_error& error) {
      raised_ = std::current_exception();
      const auto type = nb::cast<std::string>(error.type().attr("__name__"));
      return o80::Served::failed(type + ": " + nb::cast<std::string>(nb::str(error.value())));
    } catch (std::exception& error) {
      raised_ = std::current_exception();
      return o80::Served::failed(error.what());
    }
  }

  bool halt() noexcept override {
    const WithGil locked;
    try {
      call_python([&] { return serve_with.attr("halt")(); });
      return true;
    } catch (std::exception&) {
      raised_ = std::current_exception();
      return false;
    }
  }

  o80::Served resume() noexcept override {
    const WithGil locked;
    try {
      const nb::object answer = call_python([&] { return serve_with.attr("resume")(); });
      if (answer.is_none()) return o80::Served::done();
      return o80::Served::rejected(nb::cast<std::string>(answer));
    } catch (std::exception& error) {
      raised_ = std::current_exception();
      return o80::Served::failed(error.what());
    }
  }

  /// The handler has read the robot anew.
  bool read_fresh(o80::FreshReading& reading) noexcept override {
    const WithGil locked;
    copy(observed_, reading.observed);
    copy(extended_, reading.extended);
    copy(fresh_desired_, reading.desired);
    reading.has_desired = true;
    return true;
  }

  std::shared_ptr<o80::UntypedBackend> backend_;
  std::string name_;
  nb::bytearray observed_, extended_, fresh_desired_;
  o80::ForkGuard guard_;
  std::exception_ptr raised_;
  bool begun_ = false;
  std::atomic<bool> stepping_{false};
  std::thread::id stepping_thread_;
  std::pair<o80::State, std::string> last_words_;
};

PyType_Slot backend_slots[] = {{Py_tp_traverse, reinterpret_cast<void*>(&Backend::traverse)},
                               {Py_tp_clear, reinterpret_cast<void*>(&Backend::clear)},
                               {0, nullptr}};

o80::Stale stale_called(const std::string& name) {
  if (const auto stale = o80::stale_of(name)) return *stale;
  throw InvalidArgument("stale must be 'hold', 'purge', 'halt' or 'stop', got '" + name + "'");
}

Backend* make(const SchemaBuilder& builder, const std::string& segment, std::int64_t period,
              bool bursting, std::uint64_t history, std::uint32_t lanes, std::uint32_t lane_blocks,
              std::uint32_t permission, const std::string& stale, std::int64_t silence,
              bool resume) {
  o80::BackendOptions options;
  options.segment = segment;
  options.period = period;
  options.bursting = bursting;
  options.history = history;
  options.lanes = lanes;
  options.lane_blocks = lane_blocks;
  options.permission = permission;
  options.stale = stale_called(stale);
  options.silence = silence;
  options.resume = resume;
  return new Backend(builder, options);
}

}  // namespace

void bind_backend(nb::module_& m) {
  nb::class_<SchemaBuilder>(m, "SchemaBuilder", "A robot while it is described.")
      .def(nb::init<const std::string&>(), "robot"_a)
      .def("add_type", &SchemaBuilder::add_type, "name"_a, "fields"_a,
           nb::sig("def add_type(self, name: str, fields: list[typing.Any]) -> int"))
      .def("add_actuators", &SchemaBuilder::add_actuators, "group"_a, "type"_a, "count"_a,
           "is_array"_a)
      .def("set_extended", &SchemaBuilder::set_extended, "type"_a)
      .def("add_request", &SchemaBuilder::add_request, "name"_a, "type"_a, "help"_a,
           "while_halted"_a)
      .def("name_actuator", &SchemaBuilder::name_actuator, "actuator"_a, "name"_a)
      .def("set_follow", &SchemaBuilder::set_follow, "actuator"_a)
      .def("set_limits", &SchemaBuilder::set_limits, "actuator"_a, "field"_a, "limits"_a)
      .def("rests_at", &SchemaBuilder::rests_at, "actuator"_a, "field"_a, "value"_a)
      .def_prop_ro("actuators", &SchemaBuilder::actuators);

  nb::class_<Backend> bound(m, "Backend", nb::type_slots(backend_slots),
                            "The compiled half of o80.Backend.");
  refuse_to_pickle(bound, "a backend", "its segment's name, and open o80.Frontend(name) there");
  bound
      .def(nb::new_(&make), "builder"_a, "segment"_a, "period"_a, "bursting"_a, "history"_a,
           "lanes"_a, "lane_blocks"_a, "permission"_a, "stale"_a, "silence"_a, "resume"_a)
      .def_rw("serve_with", &Backend::serve_with, nb::arg().none())
      .def_prop_ro("description",
                   [](const Backend& self) {
                     auto description = std::make_shared<o80::Description>();
                     description->schema = self.checked().schema();
                     description->layout = self.checked().layout();
                     return description;
                   })
      .def_prop_ro("observed", &Backend::observed)
      .def_prop_ro("extended", &Backend::extended)
      .def_prop_ro("fresh_desired", &Backend::fresh_desired)
      .def("desired",
           [](const Backend& self) {
             const o80::UntypedBackend& backend = self.checked();
             return nb::bytearray(backend.desired(), backend.layout().block);
           })
      .def("active",
           [](const Backend& self) {
             const o80::UntypedBackend& backend = self.checked();
             return nb::bytes(backend.active(), backend.layout().mask_words * 8);
           })
      .def("check", [](const Backend& self) { self.checked(); })
      .def("publish", &Backend::publish)
      .def("step", &Backend::step, "timeout"_a.none())
      .def(
          "interrupt",
          [](const Backend& self, std::uint32_t actuator) {
            self.between_steps().interrupt(actuator);
          },
          "actuator"_a)
      .def(
          "halt",
          [](const Backend& self, const std::string& text) {
            self.checked().halt(o80::HaltCause::driver, text);
          },
          "text"_a)
      .def("ask_to_stop", [](const Backend& self) { self.checked().ask_to_stop(); })
      .def("end", &Backend::end, "failed"_a, "text"_a)
      .def_prop_ro("failure", &Backend::failure)
      .def_prop_ro("iteration", [](const Backend& self) { return self.checked().iteration(); })
      .def_prop_ro("time", [](const Backend& self) { return self.checked().time(); });
}
