#include "frontend.hpp"

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/shared_ptr.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

#include <array>
#include <cmath>
#include <cstring>
#include <optional>

#include "arguments.hpp"
#include "batch.hpp"
#include "bindings.hpp"
#include "o80/control/batch_builder.hpp"
#include "o80/describe/table.hpp"
#include "observation.hpp"
#include "states.hpp"
#include "waiting.hpp"
#include "words.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using o80::Batch;
using o80::InvalidArgument;
using o80::Iteration;
using o80::UntypedFrontend;

namespace {

using Seconds = std::optional<double>;

/// The compiled half of o80.Frontend.
class Frontend {
 public:
  Frontend(const Attachment& attachment, std::shared_ptr<Decoder> decoder)
      : untyped_(attachment.frontend), robot_(attachment.robot), decoder_(std::move(decoder)) {
    const o80::Schema& schema = untyped_->schema();
    for (std::uint32_t i = 0; i < schema.actuators.size(); ++i) {
      const auto name = schema.actuators[i].name.view();
      indices_[nb::str(name.data(), name.size())] = i;
      plain_.push_back(plain_number(schema, schema.actuators[i].type));
    }
  }

  UntypedFrontend& untyped() const { return *untyped_; }
  /// For calls without the GIL: `reattach` may replace it meanwhile.
  std::shared_ptr<UntypedFrontend> shared() const { return untyped_; }
  const std::shared_ptr<const Decoder>& decoder() const { return decoder_; }
  bool is_inline() const { return robot_ != nullptr; }

  /// From an index or a name.
  std::uint32_t actuator(nb::handle named) const {
    if (PyUnicode_Check(named.ptr())) {
      PyObject* found = PyDict_GetItemWithError(indices_.ptr(), named.ptr());
      if (found != nullptr) return static_cast<std::uint32_t>(PyLong_AsLong(found));
      return untyped_->actuator(nb::cast<std::string_view>(named));
    }
    const nb::object index = nb::steal(PyNumber_Index(named.ptr()));
    std::int64_t number = 0;
    if (!index.is_valid() || !nb::try_cast<std::int64_t>(index, number)) {
      PyErr_Clear();
      throw InvalidArgument("an actuator is given by its index or its name, not by " +
                            nb::cast<std::string>(nb::repr(named)));
    }
    return untyped_->check().actuator(number);
  }

  void add_command(nb::handle named, nb::handle target, const o80::CommandOptions& options) const {
    const std::uint32_t index = actuator(named);
    const o80::Schema& schema = untyped_->schema();
    if (const o80::FieldRow* number = plain_[index]) {
      alignas(8) std::array<std::byte, 8> state;
      if (number->kind == o80::Kind::float64 && PyFloat_Check(target.ptr())) {
        const double value = PyFloat_AS_DOUBLE(target.ptr());
        std::memcpy(state.data(), &value, sizeof value);
      } else {
        write_number(schema, *number, target, state.data(), name_of(index));
      }
      untyped_->add_command(index, {state.data(), number->size}, options);
      return;
    }
    const StateBytes state(schema, schema.actuators[index].type, target, name_of(index));
    untyped_->add_command(index, state.bytes, options,
                          state.whole ? std::span<const std::uint64_t>{} : state.mask);
  }

  std::vector<std::byte> request_bytes(std::uint32_t index, nb::handle fields) const {
    const o80::Schema& schema = untyped_->schema();
    const o80::RequestRow& row = schema.requests[index];
    return StateBytes(schema, row.type, fields, "request '" + row.name.str() + "'").bytes;
  }

  Observation blank() const { return Observation(decoder_); }

  /// Gives the lane back and stops an inline robot.
  void close() {
    const std::shared_ptr<UntypedFrontend> frontend = untyped_;
    const std::shared_ptr<o80::InlineRobot> robot = std::move(robot_);
    const Waiting waiting;
    frontend->close();
    if (robot) robot->stop();
  }

  void reattach(const Attachment& attachment) { untyped_ = attachment.frontend; }

  Iteration next = -1;  // of wait_for_next; -1: not asked yet

 private:
  std::string name_of(std::uint32_t index) const {
    return "the target of actuator '" + untyped_->schema().actuators[index].name.str() + "'";
  }

  std::shared_ptr<UntypedFrontend> untyped_;
  std::shared_ptr<o80::InlineRobot> robot_;
  std::shared_ptr<const Decoder> decoder_;
  nb::dict indices_;
  std::vector<const o80::FieldRow*> plain_;  // of each actuator; null: a struct
};

// ------------------------------------------------------------------------------ commanding

void add_command(const Frontend& self, nb::handle actuator, nb::handle target, nb::handle duration,
                 nb::handle speed, nb::handle until, nb::handle iterations, nb::handle mode,
                 nb::handle profile, nb::handle start) {
  self.add_command(actuator, target,
                   {.pace = pace_of(duration, speed, until, iterations),
                    .mode = mode_of(mode),
                    .profile = profile_of(profile),
                    .start = start_of(start)});
}

/// The memory of a Python object.
struct Bytes {
  explicit Bytes(nb::handle owner, int flags = PyBUF_SIMPLE) {
    if (PyObject_GetBuffer(owner.ptr(), &view, flags) != 0) throw nb::python_error();
  }
  Bytes(const Bytes&) = delete;
  Bytes& operator=(const Bytes&) = delete;
  ~Bytes() { PyBuffer_Release(&view); }
  std::span<const std::byte> span() const {
    return {static_cast<const std::byte*>(view.buf), static_cast<std::size_t>(view.len)};
  }
  Py_buffer view{};
};

/// One trajectory for each of several actuators, all or none.
/// `states` holds the rows of the first, then those of the second...; `times` are ends [ns].
void add_trajectories(const Frontend& self, const std::vector<std::uint32_t>& actuators,
                      std::uint32_t rows, nb::handle states, nb::handle times, nb::handle speed,
                      nb::handle iterations, nb::handle mode, nb::handle profile,
                      nb::handle start) {
  UntypedFrontend& frontend = self.untyped();
  o80::CommandOptions options{.pace = pace_of(nb::none(), speed, nb::none(), iterations),
                              .mode = mode_of(mode),
                              .profile = profile_of(profile),
                              .start = start_of(start)};
  std::vector<std::int64_t> ends;
  if (!times.is_none()) {
    const Bytes bytes(times);
    ends.resize(bytes.span().size() / sizeof(std::int64_t));
    std::memcpy(ends.data(), bytes.span().data(), ends.size() * sizeof(std::int64_t));
  }
  const Bytes all(states);
  const std::size_t each = all.span().size() / std::max<std::size_t>(1, actuators.size());
  // what one of them refuses is refused before any is added
  for (std::size_t i = 0; i < actuators.size() && actuators.size() > 1 && rows > 0; ++i) {
    frontend.check().targets(actuators[i], all.span().subspan(i * each, each));
    if (!speed.is_none()) frontend.check().speed(actuators[i], options.pace.per_second);
  }
  for (std::size_t i = 0; i < actuators.size(); ++i) {
    frontend.add_trajectory(actuators[i], rows, all.span().subspan(i * each, each), options, ends);
  }
}

Batch pulse(const Frontend& self, nb::handle at, nb::handle late) {
  const o80::PulseOptions options = pulse_options(at, late);
  if (!self.is_inline()) return self.untyped().pulse(options);
  const auto frontend = self.shared();
  const Waiting waiting;
  return frontend->pulse(options);
}

Observation pulse_and_wait(const Frontend& self, Seconds timeout, nb::handle at, nb::handle late) {
  const o80::PulseOptions options = pulse_options(at, late);
  const auto frontend = self.shared();
  const auto decoder = self.decoder();
  const Batch batch = [&] {
    const Waiting waiting;
    return frontend->pulse_to_end(options);
  }();
  return carrying(batch, [&] {
    o80::UntypedObservation row = [&] {
      const Waiting waiting;
      return frontend->wait_for_end(batch, timeout_of(timeout), Waiting::check);
    }();
    return Observation(decoder, std::move(row));
  });
}

PendingBurst start_burst(const Frontend& self, std::int64_t iterations) {
  const auto frontend = self.shared();
  const Waiting waiting;
  return {frontend->start_burst(iterations), self.decoder()};
}

Observation burst(const Frontend& self, std::int64_t iterations, Seconds timeout) {
  const auto frontend = self.shared();
  const auto decoder = self.decoder();
  o80::UntypedObservation row = [&] {
    const Waiting waiting;
    return frontend->burst(iterations, timeout_of(timeout), Waiting::check);
  }();
  return Observation(decoder, std::move(row));
}

std::vector<Observation> burst_group(const std::vector<std::pair<Frontend*, std::int64_t>>& members,
                                     Seconds timeout) {
  std::vector<std::shared_ptr<UntypedFrontend>> alive;
  std::vector<std::pair<UntypedFrontend*, std::int64_t>> group;
  for (const auto& [member, iterations] : members) {
    alive.push_back(member->shared());
    group.emplace_back(alive.back().get(), iterations);
  }
  std::vector<o80::UntypedObservation> rows = [&] {
    const Waiting waiting;
    return o80::burst(group, timeout_of(timeout), Waiting::check);
  }();
  std::vector<Observation> observations;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    observations.emplace_back(members[i].first->decoder(), std::move(rows[i]));
  }
  return observations;
}

/// A batch of one record, sent at once.
template <class Fill>
Batch send_alone(const Frontend& self, Fill&& fill) {
  o80::BatchBuilder batch;
  fill(batch);
  const auto frontend = self.shared();
  const Waiting waiting;
  return frontend->pulse(batch);
}

std::uint16_t purged(const Frontend& self, nb::handle actuator) {
  return actuator.is_none() ? o80::kEveryActuator
                            : static_cast<std::uint16_t>(self.actuator(actuator));
}

Batch send_request(const Frontend& self, std::string_view name, nb::handle fields) {
  const std::uint32_t index = self.untyped().request_index(name);
  const std::vector<std::byte> payload = self.request_bytes(index, fields);
  self.untyped().check().request(index, payload);
  return send_alone(self, [&](o80::BatchBuilder& batch) {
    batch.request(static_cast<std::uint16_t>(index), payload);
  });
}

void add_request(const Frontend& self, std::string_view name, nb::handle fields) {
  const std::uint32_t index = self.untyped().request_index(name);
  self.untyped().add_request(index, self.request_bytes(index, fields));
}

// ------------------------------------------------------------------------------ observing

Observation latest(const Frontend& self) {
  Observation observation = self.blank();
  self.untyped().latest(observation.row.bytes());
  return observation;
}

Observation wait_for(const Frontend& self, Iteration iteration, Seconds timeout) {
  Observation observation = self.blank();
  const auto frontend = self.shared();
  const Waiting waiting;
  frontend->wait_for(iteration, observation.row.bytes(), timeout_of(timeout), Waiting::check);
  return observation;
}

Observation next_row(const std::shared_ptr<UntypedFrontend>& frontend,
                     const std::shared_ptr<const Decoder>& decoder, Iteration& position,
                     Seconds timeout) {
  Observation observation(decoder);
  Iteration next = position;
  {
    const Waiting waiting;
    observation.missed =
        frontend->wait_for_next(next, observation.row.bytes(), timeout_of(timeout), Waiting::check);
  }
  position = std::max(position, next);
  return observation;
}

Observation wait_for_next(Frontend& self, Seconds timeout) {
  if (self.next < 0) self.next = self.untyped().published() + 1;
  return next_row(self.shared(), self.decoder(), self.next, timeout);
}

/// Rows in sequence, from a position of its own.
struct Stream {
  std::shared_ptr<UntypedFrontend> frontend;
  std::shared_ptr<const Decoder> decoder;
  Iteration next;
  Seconds timeout;
};

Stream stream(const Frontend& self, nb::handle since, Seconds timeout) {
  const Iteration first =
      since.is_none() ? self.untyped().published() + 1 : count_of(since, "since");
  return {self.shared(), self.decoder(), std::max<Iteration>(first, 0), timeout};
}

/// Fills an array of rows; gives the first iteration and how many there were.
std::pair<Iteration, std::size_t> read_rows(const Frontend& self, Iteration first,
                                            nb::handle array) {
  const Bytes bytes(array, PyBUF_WRITABLE);
  const auto frontend = self.shared();
  const Waiting waiting;
  const std::size_t rows = bytes.span().size() / frontend->layout().size;
  const o80::HistoryReader::Range range =
      frontend->link()->history.read_range(first, rows, static_cast<std::byte*>(bytes.view.buf));
  return {range.first, range.count};
}

Attachment attach(const std::string& segment, Seconds timeout, bool read_only, bool dead) {
  const Waiting waiting;
  o80::FrontendOptions options;
  options.timeout = timeout_of(timeout);
  options.access = read_only ? o80::Access::read_only : o80::Access::read_write;
  options.dead = dead;
  options.check = Waiting::check;
  return {std::make_shared<UntypedFrontend>(segment, options), nullptr};
}

std::shared_ptr<o80::Description> description_of(const Attachment& attachment) {
  return std::make_shared<o80::Description>(*attachment.frontend->description());
}

}  // namespace

void bind_frontend(nb::module_& m) {
  nb::class_<Attachment>(m, "Attachment", "A frontend that has no class yet.")
      .def_prop_ro("description", &description_of)
      .def_prop_ro("robot",
                   [](const Attachment& self) { return self.frontend->schema().head.robot.str(); });
  m.def("attach", &attach, "segment"_a, "timeout"_a.none(), "read_only"_a, "dead"_a);
  m.def("difference", [](const o80::Description& expected, const o80::Description& found) {
    return o80::difference(expected.schema, found.schema);
  });

  nb::class_<Stream>(m, "Stream", "Every observation, in order.")
      .def(
          "__iter__", [](nb::object self) { return self; }, nb::sig("def __iter__(self) -> Stream"))
      .def("__next__", [](Stream& self) {
        return next_row(self.frontend, self.decoder, self.next, self.timeout);
      });

  nb::class_<Frontend>(m, "Frontend", "The compiled half of o80.Frontend.")
      .def(nb::init<const Attachment&, std::shared_ptr<Decoder>>())
      .def("add_command", &add_command, "actuator"_a.none(), "target"_a.none(), nb::kw_only(),
           "duration"_a = nb::none(), "speed"_a = nb::none(), "until"_a = nb::none(),
           "iterations"_a = nb::none(), "mode"_a = "queue", "profile"_a = "linear",
           "start"_a = "desired",
           nb::sig(
               "def add_command(self, actuator: typing.SupportsIndex | str, target: typing.Any, *, "
               "duration: float | None = None, speed: float | None = None, "
               "until: int | None = None, iterations: int | None = None, "
               "mode: str = 'queue', profile: str = 'linear', start: str = 'desired') -> None"),
           R"(Adds a command to what the next pulse sends.

actuator: its index or its name.
target: the state to reach, in the unit of its field: a number for a state of one number;
    otherwise a mapping (what is missing keeps its desired value), a record, or all fields in order.
duration: time to get there [s].
speed: peak speed of the first number of the state [its unit/s].
until: the iteration at which to be there.
iterations: how many iterations to take.
    Give one of these four, or none to be there in one iteration.
mode: "queue" (after what is there) or "overwrite" (instead of what is there).
profile: "linear" or "minimum_jerk".
start: "desired" or "observed", the state to start from.

Raises InvalidArgument for what the robot cannot follow.)")
      .def("_add_trajectories", &add_trajectories, "actuators"_a, "rows"_a, "states"_a,
           "times"_a.none(), "speed"_a.none(), "iterations"_a.none(), "mode"_a, "profile"_a,
           "start"_a)
      .def(
          "add_request",
          [](const Frontend& self, std::string_view name, const nb::kwargs& fields) {
            add_request(self, name, fields);
          },
          "name"_a, "fields"_a,
          nb::sig("def add_request(self, name: str, /, **fields: typing.Any) -> None"),
          R"(Adds a request to what the next pulse sends.

It is served in order with the commands of that pulse; fields that are not given are zero.)")
      .def(
          "add_purge",
          [](const Frontend& self, nb::handle actuator) {
            self.untyped().add_purge(purged(self, actuator));
          },
          "actuator"_a = nb::none(),
          nb::sig(
              "def add_purge(self, actuator: typing.SupportsIndex | str | None = None) -> None"),
          "Adds a purge (of one actuator, or of all) to what the next pulse sends.")
      .def(
          "purge",
          [](const Frontend& self, nb::handle actuator) {
            const std::uint16_t which = purged(self, actuator);
            return send_alone(self, [&](o80::BatchBuilder& batch) { batch.purge(which); });
          },
          "actuator"_a = nb::none(),
          nb::sig("def purge(self, actuator: typing.SupportsIndex | str | None = None) -> Batch"),
          R"(Drops all commands of an actuator (None: of all), whoever sent them, at once.

Needs no pulse; what was added and not pulsed stays added.)")
      .def("_purge_own",
           [](const Frontend& self) {
             return send_alone(
                 self, [](o80::BatchBuilder& batch) { batch.purge_own(o80::kEveryActuator); });
           })
      .def("_take_control",
           [](const Frontend& self) {
             return send_alone(self, [](o80::BatchBuilder& batch) { batch.take_control(); });
           })
      .def("_release_control",
           [](const Frontend& self) {
             return send_alone(self, [](o80::BatchBuilder& batch) { batch.release_control(); });
           })
      .def("_index", &Frontend::actuator, "named"_a)
      .def("_send_request", &send_request, "name"_a, "fields"_a)
      .def_prop_ro(
          "added", [](const Frontend& self) { return self.untyped().added(); },
          "How many commands, requests and purges were added and not pulsed.")
      .def(
          "forget_added", [](const Frontend& self) { self.untyped().forget_added(); },
          "Drops what was added and not pulsed.")
      .def("pulse", &pulse, nb::kw_only(), "at"_a = nb::none(), "late"_a = "reject",
           nb::sig("def pulse(self, *, at: int | None = None, late: str = 'reject') -> Batch"),
           R"(Sends what was added, as one batch; does not wait.

at: the iteration at which the batch is taken (None: at once).
late: what if that iteration has begun: "reject" the batch, or take it "now".

Raises LaneFull if too much is in flight (nothing is sent, all stays added), NoLane, ReadOnly,
BackendGone.)")
      .def("pulse_and_wait", &pulse_and_wait, "timeout"_a = nb::none(), nb::kw_only(),
           "at"_a = nb::none(), "late"_a = "reject",
           nb::sig("def pulse_and_wait(self, timeout: float | None = None, *, "
                   "at: int | None = None, late: str = 'reject') -> Observation"),
           R"(Sends what was added and waits until all of it has ended.

A bursting backend runs as long as that takes. Returns the observation of the last iteration. What
was rejected, purged or limited raises nothing: pulse and the statuses of its batch tell.

Raises TimeoutError after `timeout` [s], which carries the `batch`, and what pulse raises.)")
      .def("_burst", &burst, "iterations"_a, "timeout"_a.none())
      .def("_start_burst", &start_burst, "iterations"_a)
      .def("latest", &latest, "The newest observation.")
      .def("wait_for", &wait_for, "iteration"_a, "timeout"_a = nb::none(),
           R"(The observation of an iteration, as soon as it is there (a past one: at once).

Raises RowOverwritten if the history no longer holds it, TimeoutError after `timeout` [s],
BackendGone.)")
      .def("wait_for_next", &wait_for_next, "timeout"_a = nb::none(),
           R"(The observation after the one this call returned before; the first time, the next one.

If the reader fell behind, `missed` of the observation says how many were overwritten unread. The
position belongs to this frontend: threads that all need every row use a stream each.

Raises TimeoutError after `timeout` [s], BackendGone.)")
      .def("stream", &stream, "since"_a = nb::none(), "timeout"_a = nb::none(),
           nb::sig("def stream(self, since: int | None = None, timeout: float | None = None) "
                   "-> Stream"),
           R"(Iterates over every observation, in order, from `since` (None: the next one).

timeout: longest wait for one of them [s].)")
      .def("_read_rows", &read_rows, "first"_a, "array"_a)
      .def_prop_ro(
          "published", [](const Frontend& self) { return self.untyped().published(); },
          "The iteration of the newest observation.")
      .def_prop_ro(
          "oldest", [](const Frontend& self) { return self.untyped().oldest(); },
          "The iteration of the oldest observation still there.")
      .def_prop_ro(
          "segment", [](const Frontend& self) { return self.untyped().segment(); },
          "The name of the segment.")
      .def_prop_ro(
          "epoch", [](const Frontend& self) { return self.untyped().epoch(); },
          "Names this run of the backend; another one of the same name has another.")
      .def_prop_ro(
          "bursting", [](const Frontend& self) { return self.untyped().bursting(); },
          "Whether the backend stands still until it is burst.")
      .def_prop_ro(
          "life", [](const Frontend& self) { return std::string(name_of(self.untyped().life())); },
          "starting, running, stopped, failed, superseded or killed.")
      .def_prop_ro(
          "closed", [](const Frontend& self) { return self.untyped().closed(); },
          "Whether it was closed.")
      .def_prop_ro("_is_inline", &Frontend::is_inline)
      .def("_close", &Frontend::close)
      .def("_reattach", &Frontend::reattach, "attachment"_a);

  m.def("burst_group", &burst_group, "members"_a, "timeout"_a.none());
}
