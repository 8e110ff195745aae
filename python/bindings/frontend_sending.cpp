// What a frontend adds to a batch, and how it sends it.

#include <nanobind/stl/optional.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/string_view.h>
#include <nanobind/stl/vector.h>

#include <cstring>
#include <utility>

#include "arguments.hpp"
#include "batch.hpp"
#include "buffer.hpp"
#include "control/batch_builder.hpp"
#include "control/limits.hpp"
#include "enums.hpp"
#include "frontend.hpp"
#include "waiting.hpp"

namespace nb = nanobind;
using namespace nb::literals;
using o80::Batch;
using o80::UntypedFrontend;

namespace {

void add_command(const Frontend& self, nb::handle actuator, nb::handle target, nb::handle duration,
                 nb::handle speed, nb::handle until, nb::handle iterations, nb::handle fastest,
                 nb::handle mode, nb::handle profile, nb::handle start, nb::handle on_limit) {
  const bool is_fastest = truth_of(fastest, "fastest");
  o80::CommandOptions options{.pace = pace_of(duration, speed, until, iterations, is_fastest),
                              .mode = mode_of(mode),
                              .start = start_of(start),
                              .on_limit = on_limit_of(on_limit)};
  if (!profile.is_none()) options.profile = profile_of(profile);
  const bool several = actuator.is_none() || (PySequence_Check(actuator.ptr()) != 0 &&
                                              PyUnicode_Check(actuator.ptr()) == 0);
  if (several) {
    self.add_commands(actuator, target, options);
  } else {
    self.add_command(actuator, target, options);
  }
}

/// One trajectory for several actuators.
/// `states` holds the rows of the first, then those of the second...; `times` are ends [ns].
void add_trajectories(const Frontend& self, const std::vector<std::uint32_t>& actuators,
                      std::uint32_t rows, nb::handle states, nb::handle times, nb::handle speed,
                      nb::handle iterations, nb::handle mode, nb::handle profile,
                      nb::handle start) {
  const auto frontend = self.shared();
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
  frontend->add_trajectories(actuators, rows, all.span(), options, ends);
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
      return frontend->wait_for_end(batch, timeout_of(timeout), Waiting::keep_waiting);
    }();
    return Observation(decoder, std::move(row));
  });
}

/// Of a burst: any whole number.
std::int64_t burst_length(nb::handle iterations) {
  return count_of(iterations, "the number of iterations of a burst");
}

PendingBurst start_burst(const Frontend& self, nb::handle iterations, nb::handle at,
                         nb::handle late) {
  const std::int64_t count = burst_length(iterations);
  const o80::PulseOptions options = pulse_options(at, late);
  const auto frontend = self.shared();
  const auto decoder = self.decoder();
  const Waiting waiting;
  return {frontend->start_burst(count, options), decoder};
}

Observation burst(const Frontend& self, nb::handle iterations, Seconds timeout, nb::handle at,
                  nb::handle late) {
  const std::int64_t count = burst_length(iterations);
  const o80::PulseOptions options = pulse_options(at, late);
  const auto frontend = self.shared();
  const auto decoder = self.decoder();
  o80::UntypedObservation row = [&] {
    const Waiting waiting;
    return frontend->burst(count, timeout_of(timeout), Waiting::keep_waiting, options);
  }();
  return Observation(decoder, std::move(row));
}

/// Begins the bursts of a group; each comes with what decodes its row.
std::vector<PendingBurst> start_bursts(
    const std::vector<std::pair<Frontend*, nb::object>>& members) {
  std::vector<std::shared_ptr<UntypedFrontend>> alive;
  std::vector<o80::BurstMember> group;
  for (const auto& [member, iterations] : members) {
    alive.push_back(member->shared());
    group.emplace_back(alive.back().get(), burst_length(iterations));
  }
  const std::vector<o80::Burst> bursts = [&] {
    const Waiting waiting;
    return o80::start_bursts(group);
  }();
  std::vector<PendingBurst> pending;
  for (std::size_t i = 0; i < bursts.size(); ++i) {
    pending.push_back({bursts[i], members[i].first->decoder()});
  }
  return pending;
}

std::vector<Observation> wait_for_bursts(const std::vector<PendingBurst>& pending,
                                         Seconds timeout) {
  std::vector<o80::Burst> bursts;
  for (const PendingBurst& one : pending) bursts.push_back(one.burst);
  std::vector<o80::UntypedObservation> rows = [&] {
    const Waiting waiting;
    return o80::wait_for(bursts, timeout_of(timeout), Waiting::keep_waiting);
  }();
  std::vector<Observation> observations;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    observations.emplace_back(pending[i].decoder, std::move(rows[i]));
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

/// Bursting, the backend runs until the request has ended.
Batch send_request(const Frontend& self, std::string_view name, nb::handle fields) {
  const auto frontend = self.shared();
  const std::uint32_t index = frontend->request_index(name);
  const std::vector<std::byte> payload = self.request_bytes(index, fields);
  frontend->command_check().request(index, payload);
  o80::BatchBuilder batch;
  batch.request(static_cast<std::uint16_t>(index), payload);
  const Waiting waiting;
  return frontend->pulse_to_end(batch);
}

void wait_until_ended(const Frontend& self, const Batch& batch, Seconds timeout) {
  const auto frontend = self.shared();
  carrying(batch, [&] {
    const Waiting waiting;
    frontend->wait_until_ended(batch, timeout_of(timeout), Waiting::keep_waiting);
  });
}

void add_request(const Frontend& self, std::string_view name, nb::handle fields) {
  const auto frontend = self.shared();
  const std::uint32_t index = frontend->request_index(name);
  frontend->add_request(index, self.request_bytes(index, fields));
}

}  // namespace

void bind_sending(nb::module_& m, nb::class_<Frontend>& frontend) {
  frontend
      .def(
          "add_command", &add_command, "actuator"_a.none(), "target"_a.none(), nb::kw_only(),
          "duration"_a = nb::none(), "speed"_a = nb::none(), "until"_a = nb::none(),
          "iterations"_a = nb::none(), "fastest"_a.none() = false, "mode"_a.none() = "queue",
          "profile"_a = nb::none(), "start"_a.none() = "desired", "on_limit"_a.none() = "end",
          nb::sig("def add_command(self, actuator: typing.SupportsIndex | str | "
                  "collections.abc.Sequence[typing.SupportsIndex | str] | None, "
                  "target: typing.Any, *, "
                  "duration: float | None = None, speed: float | None = None, "
                  "until: int | None = None, iterations: int | None = None, fastest: bool = False, "
                  "mode: str = 'queue', profile: str | None = None, start: str = 'desired', "
                  "on_limit: str = 'end') -> None"),
          R"(Adds a command to what the next pulse sends.

actuator: its index or its name; several, or None for all, for one command that they carry out
    together: it begins when all their queues have come to it, takes as many iterations as the
    slowest of them, and has one status. It needs one target for each.
target: the state to reach, in the unit of its field: a number for a state of one number;
    otherwise a mapping (what is missing keeps its desired value), a record, or all fields in order.
duration: time to get there [s].
speed: peak speed of the first number that is given [its unit/s].
until: the iteration at which to be there.
iterations: how many iterations to take.
fastest: as fast as the limits of speed, acceleration and jerk allow, at rest at the end.
    Give one of these five, or none to be there in one iteration.
mode: "queue" (after what is there) or "overwrite" (instead of what is there).
profile: "linear" or "minimum_jerk" (None: linear, or minimum_jerk where the actuator has
    acceleration limits).
start: "desired" or "observed", the state to start from.
on_limit: of a command without a pace that the limits do not let arrive in its iteration: "end" (as
    limited, and the actuator comes to rest) or "go_on" (to the target, as fast as they allow).

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

It is served in order with the commands of that pulse. Every field without a default must be given;
`o80 info` shows the defaults.)")
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
      .def("_wait_until_ended", &wait_until_ended, "batch"_a, "timeout"_a.none())
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
      .def("_burst", &burst, "iterations"_a.none(), "timeout"_a.none(), "at"_a.none(), "late"_a,
           nb::sig("def _burst(self, iterations: int, timeout: float | None, at: int | None, "
                   "late: str) -> Observation"))
      .def("_start_burst", &start_burst, "iterations"_a.none(), "at"_a.none(), "late"_a,
           nb::sig("def _start_burst(self, iterations: int, at: int | None, late: str) -> Burst"));

  m.def("start_bursts", &start_bursts, "members"_a,
        nb::sig("def start_bursts(members: collections.abc.Sequence[tuple[Frontend, int]]) "
                "-> list[Burst]"));
  m.def("wait_for_bursts", &wait_for_bursts, "bursts"_a, "timeout"_a.none(),
        nb::sig("def wait_for_bursts(bursts: collections.abc.Sequence[Burst], "
                "timeout: float | None) -> list[Observation]"));
}
