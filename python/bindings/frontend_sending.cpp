// How a frontend adds records to a batch and sends it.

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <utility>

#include "arguments.hpp"
#include "base/printable.hpp"
#include "batch.hpp"
#include "control/batch/command_check.hpp"
#include "control/batch/record.hpp"
#include "control/motion/number_plan.hpp"
#include "control/motion/state_layout.hpp"
#include "control/sending/batch_builder.hpp"
#include "enums.hpp"
#include "frontend.hpp"
#include "runtime/frontend/link.hpp"
#include "states.hpp"
#include "verb.hpp"
#include "waiting.hpp"

using o80::Batch;
using o80::UntypedFrontend;

namespace {

using ConstBytes = std::span<const std::byte>;

std::uint32_t add_command(const Frontend& self, nb::handle actuator, nb::handle target,
                          nb::handle duration, nb::handle speed, nb::handle until,
                          nb::handle iterations, nb::handle fastest, nb::handle mode,
                          nb::handle profile, nb::handle start, nb::handle every, nb::handle clip) {
  const o80::CommandOptions options =
      command_options(duration, speed, until, iterations, fastest, mode, profile, start, every,
                      self.untyped().schema().head.period);
  if (clip.is(nb::bool_(false)) && self.names_one(actuator)) {
    return self.add_command(actuator, target, options);
  }
  const auto frontend = self.shared();
  Targets targets = self.targets_of(actuator, target);
  self.clip(clip, targets);
  const std::uint32_t place =
      frontend->add_commands(targets.actuators, targets.states, options, targets.masks);
  self.note_clipped(targets);
  return place;
}

/// The newest row, with these actuators at `initial`.
o80::UntypedObservation row_with(const Frontend& self, nb::handle actuators, nb::handle initial) {
  o80::UntypedObservation row = self.shared()->latest();
  const Targets at = [&] {
    try {
      return self.targets_of(actuators, initial);
    } catch (const o80::InvalidArgument& error) {
      throw o80::InvalidArgument(std::string("initial: ") + error.what());
    }
  }();
  const std::byte* state = at.states.data();
  const std::uint64_t* mask = at.masks.empty() ? nullptr : at.masks.data();
  for (const std::uint32_t index : at.actuators) {
    const o80::ActuatorRow& actuator = row.schema().actuators[index];
    const o80::StateLayout layout(row.schema(), actuator.type);
    layout.copy(row.bytes() + row.layout().desired + actuator.offset, state, mask);
    state += layout.size();
    if (mask != nullptr) mask += o80::mask_words(row.schema().scalar_count(actuator.type));
  }
  return row;
}

/// How much later, why, and the desired blocks.
std::tuple<std::int64_t, std::string, nb::bytes> preview(const Frontend& self, nb::handle actuators,
                                                         nb::handle target, nb::handle initial,
                                                         const o80::CommandOptions& options) {
  const auto frontend = self.shared();
  const Targets to = self.targets_of(actuators, target);
  std::optional<o80::UntypedObservation> row;
  if (!initial.is_none()) row = row_with(self, actuators, initial);
  const o80::Preview preview = without_gil([&] {
    return row ? frontend->preview_from(*row, to.actuators, to.states, options, to.masks)
               : frontend->preview(to.actuators, to.states, options, to.masks);
  });
  return {preview.late, preview.text, bytes_of(preview.rows.bytes)};
}

/// Rows of targets for several actuators: all rows of the first, then all rows of the second, and
/// so on; `masks` has for each actuator a bit for each number that is given, or is empty.
Targets rows_of(const Frontend& self, const std::vector<std::uint32_t>& actuators,
                std::uint32_t rows, ConstBytes states, const std::vector<std::uint64_t>& masks,
                nb::handle clip) {
  Targets targets{actuators, {states.begin(), states.end()}, masks};
  self.clip(clip, targets, rows);
  return targets;
}

/// Adds one trajectory for several actuators, with these rows_of(); `times` are the ends of rows
/// [ns].
std::uint32_t add_trajectories(const Frontend& self, const std::vector<std::uint32_t>& actuators,
                               std::uint32_t rows, ConstBytes states,
                               const std::vector<std::uint64_t>& masks,
                               std::span<const std::int64_t> times,
                               const o80::CommandOptions& options, nb::handle clip) {
  const auto frontend = self.shared();
  const Targets targets = rows_of(self, actuators, rows, states, masks, clip);
  const std::uint32_t place =
      frontend->add_trajectories(actuators, rows, targets.states, options, times, masks);
  self.note_clipped(targets);
  return place;
}

Batch pulse(const Frontend& self, nb::handle at, nb::handle late, nb::handle seen) {
  const o80::PulseOptions options = pulse_options(at, late, seen);
  if (!self.is_inline()) return self.untyped().pulse(options);
  return self.released([&](UntypedFrontend& frontend) { return frontend.pulse(options); });
}

Batch pulse_to_end(const Frontend& self, nb::handle at, nb::handle late, nb::handle seen) {
  const o80::PulseOptions options = pulse_options(at, late, seen);
  return self.released([&](UntypedFrontend& frontend) { return frontend.pulse_to_end(options); });
}

Observation wait_for_end(const Frontend& self, const Batch& batch, Patience timeout,
                         nb::handle check) {
  const o80::WaitOptions options{.check = truth_of(check, "check")};
  const auto frontend = self.shared();
  const auto decoder = self.decoder();
  return Observation(decoder, carrying(batch, [&] {
                       return frontend->wait_for_end(batch, timeout, Waiting::keep_waiting,
                                                     options);
                     }));
}

Observation pulse_and_wait(const Frontend& self, Patience timeout, nb::handle at, nb::handle late,
                           nb::handle seen, nb::handle check) {
  truth_of(check, "check");  // refused before anything is sent
  return wait_for_end(self, pulse_to_end(self, at, late, seen), timeout, check);
}

/// The number of iterations of a burst: any whole number.
std::int64_t burst_length(nb::handle iterations) {
  return count_of(iterations, "the number of iterations of a burst");
}

PendingBurst start_burst(const Frontend& self, nb::handle iterations, nb::handle at,
                         nb::handle late, nb::handle seen) {
  const std::int64_t count = burst_length(iterations);
  const o80::PulseOptions options = pulse_options(at, late, seen);
  const auto decoder = self.decoder();
  return self.released([&](UntypedFrontend& frontend) {
    return PendingBurst{frontend.start_burst(count, options), decoder};
  });
}

Observation burst(const Frontend& self, nb::handle iterations, Patience timeout, nb::handle at,
                  nb::handle late, nb::handle seen) {
  const std::int64_t count = burst_length(iterations);
  const o80::PulseOptions options = pulse_options(at, late, seen);
  const auto decoder = self.decoder();
  return Observation(decoder, self.released([&](UntypedFrontend& frontend) {
    return frontend.burst(count, timeout, Waiting::keep_waiting, options);
  }));
}

/// Starts the bursts of a group, each with the decoder of its row.
std::vector<PendingBurst> start_bursts(const std::vector<std::pair<Frontend*, nb::object>>& members,
                                       nb::handle seen) {
  std::vector<std::shared_ptr<UntypedFrontend>> alive;
  std::vector<o80::BurstMember> group;
  for (const auto& [member, iterations] : members) {
    alive.push_back(member->shared());
    group.emplace_back(alive.back().get(), burst_length(iterations));
  }
  const std::optional<o80::Seen> decided = seen_of(seen);
  const std::vector<o80::Burst> bursts =
      without_gil([&] { return o80::start_bursts(group, decided); });
  std::vector<PendingBurst> pending;
  for (std::size_t i = 0; i < bursts.size(); ++i) {
    pending.push_back({bursts[i], members[i].first->decoder()});
  }
  return pending;
}

std::vector<Observation> wait_for_bursts(const std::vector<PendingBurst>& pending,
                                         Patience timeout) {
  std::vector<o80::Burst> bursts;
  for (const PendingBurst& one : pending) bursts.push_back(one.burst);
  std::vector<o80::UntypedObservation> rows =
      without_gil([&] { return o80::wait_for(bursts, timeout, Waiting::keep_waiting); });
  std::vector<Observation> observations;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    observations.emplace_back(pending[i].decoder, std::move(rows[i]));
  }
  return observations;
}

/// Sends a batch of one record at once. `add`: the method of BatchBuilder for it.
template <auto add, class... Arguments>
Batch send_alone(const Frontend& self, const Arguments&... arguments) {
  o80::BatchBuilder batch;
  (batch.*add)(arguments...);
  return self.released([&](UntypedFrontend& frontend) { return frontend.pulse(batch); });
}

/// Sends a chunk. `due`: for each row an uint32, iterations after the anchor.
Batch send_chunk(const Frontend& self, const std::vector<std::uint32_t>& actuators,
                 std::span<const std::uint32_t> due, ConstBytes states,
                 const std::vector<std::uint64_t>& masks, o80::Iteration anchor, std::uint64_t plan,
                 std::uint32_t ease, std::uint32_t first, bool fixed, bool reject_late, bool final,
                 nb::handle profile, nb::handle seen, std::size_t clipped) {
  const o80::ChunkOptions options{.anchor = anchor,
                                  .plan = plan,
                                  .ease = ease,
                                  .first = first,
                                  .fixed = fixed,
                                  .reject_late = reject_late,
                                  .final = final,
                                  .profile = profile_of_rows(profile)};
  const std::optional<o80::Seen> decided = seen_of(seen);
  o80::BatchBuilder batch;
  self.untyped().add_chunk(batch, actuators, due, states, options, masks);
  batch.note_clipped(clipped);
  const Batch sent =
      self.released([&](UntypedFrontend& frontend) { return frontend.pulse(batch, decided); });
  self.clipped += static_cast<std::int64_t>(clipped);
  return sent;
}

using Moments = std::vector<std::array<double, 3>>;  // place, slope and curvature

/// Places, slopes and curvatures (doubles) of the plan of a chunk, in the first `most` iterations
/// from its begin: of one number, from this moment. `ends`: the last iteration of the way to each
/// row, counted from its begin. `low`, `high`: the bounds of the number.
std::array<nb::bytes, 3> plan_of_rows(const std::array<double, 3>& start,
                                      const std::vector<double>& rows,
                                      const std::vector<std::int64_t>& ends, nb::handle profile,
                                      std::size_t most, double low, double high) {
  const o80::Profile shape = profile_of_rows(profile);
  std::array<std::vector<double>, 3> plan;
  o80::NumberPlan way;
  way.start_from({start[0], start[1], start[2]});
  const auto iterations = [&](std::size_t row) {
    return ends[row] - (row == 0 ? 0 : ends[row - 1]);
  };
  for (std::size_t i = 0; i < rows.size() && plan[0].size() < most; ++i) {
    if (shape == o80::Profile::hold) way.hold_on(rows[i]);
    if (shape == o80::Profile::linear) way.line_on(rows[i], iterations(i));
    if (o80::is_curved(shape)) {
      o80::RowsAhead ahead;
      if (i + 1 < rows.size()) ahead = {rows[i + 1], iterations(i + 1), i == 0, rows[i + 1]};
      if (i + 2 < rows.size()) ahead.after = rows[i + 2];
      way.curve_on(shape, rows[i], iterations(i), ahead, {low, high});
    }
    for (std::int64_t k = iterations(i); k > 0 && plan[0].size() < most; --k) {
      plan[0].push_back(way.next());
      const o80::Moment now = way.moment();
      plan[1].push_back(now.speed);
      plan[2].push_back(now.acceleration);
    }
  }
  return {bytes_of(plan[0]), bytes_of(plan[1]), bytes_of(plan[2])};
}

/// Due iterations, as first_row() takes them.
struct DueRows {
  const std::vector<std::uint32_t>& dues;

  std::uint32_t count() const noexcept { return static_cast<std::uint32_t>(dues.size()); }
  std::uint32_t due(std::uint32_t row) const noexcept { return dues[row]; }
  std::uint32_t first_due_from(std::int64_t iterations) const noexcept {
    return static_cast<std::uint32_t>(std::ranges::lower_bound(dues, iterations) - dues.begin());
  }
};

/// The first row that a chunk reaches which begins so many iterations after its anchor. `starts`:
/// where each number is before; `rows`: its rows; `rates`: its limits of speed, acceleration and
/// jerk per iteration.
std::uint32_t first_row(const std::vector<std::uint32_t>& due, std::int64_t begins,
                        std::int64_t ease, const Moments& starts,
                        const std::vector<std::vector<double>>& rows, const Moments& rates) {
  return o80::first_row(DueRows{due}, begins, ease,
                        [&](std::uint32_t row, std::int64_t iterations) {
                          double most = 0.0;
                          for (std::size_t i = 0; i < starts.size(); ++i) {
                            const auto [place, slope, curvature] = starts[i];
                            const auto [speed, acceleration, jerk] = rates[i];
                            most = std::max(most, o80::iterations_to_take_over(
                                                      {place, slope, curvature}, rows[i][row],
                                                      static_cast<double>(iterations),
                                                      {speed, acceleration, jerk}));
                          }
                          return most;
                        })
      .row;
}

std::uint16_t purged(const Frontend& self, nb::handle actuator) {
  return actuator.is_none() ? o80::kEveryActuator
                            : static_cast<std::uint16_t>(self.actuator(actuator));
}

/// Sends a request at once; a bursting backend runs until it has ended.
Batch send_request(const Frontend& self, nb::handle name, nb::handle fields, nb::handle seen) {
  const std::optional<o80::Seen> decided = seen_of(seen);
  const auto frontend = self.shared();
  const std::uint32_t index = frontend->request_index(string_of(name, "the name of a request"));
  const auto payload = request_bytes(frontend->schema(), index, fields);
  frontend->command_check().request(index, payload);
  o80::BatchBuilder batch;
  batch.request(static_cast<std::uint16_t>(index), payload);
  const Waiting waiting;
  return frontend->pulse_to_end(batch, decided);
}

void wait_until_ended(const Frontend& self, const Batch& batch, Patience timeout) {
  const auto frontend = self.shared();
  carrying(batch, [&] { frontend->wait_until_ended(batch, timeout, Waiting::keep_waiting); });
}

std::uint32_t add_request(const Frontend& self, nb::handle name, const nb::kwargs& fields) {
  const auto frontend = self.shared();
  const std::uint32_t index = frontend->request_index(string_of(name, "the name of a request"));
  return frontend->add_request(index, request_bytes(frontend->schema(), index, fields));
}

}  // namespace

void bind_sending(nb::module_& m, nb::class_<Frontend>& frontend) {
  nb::class_<o80::CommandOptions>(m, "CommandOptions",
                                  "Pace, mode, profile and start of a command.")
      .def(nb::new_(&command_options), nb::kw_only(), "duration"_a = nb::none(),
           "speed"_a = nb::none(), "until"_a = nb::none(), "iterations"_a = nb::none(),
           "fastest"_a.none() = false, "mode"_a.none() = "queue", "profile"_a.none(),
           "start"_a.none(), "every"_a = nb::none(), "period"_a = 0, "of_rows"_a = false);
  m.def("plan_of_rows", &plan_of_rows, "start"_a, "rows"_a, "ends"_a, "profile"_a, "most"_a,
        "low"_a, "high"_a);
  m.def("first_row", &first_row, "due"_a, "begins"_a, "ease"_a, "starts"_a, "rows"_a, "rates"_a);
  const auto all = "actuator"_a = nb::none();
  def_verb(frontend, verbs::add_command, &add_command, "actuator"_a.none(), "target"_a.none(),
           nb::kw_only(), "duration"_a = nb::none(), "speed"_a = nb::none(), "until"_a = nb::none(),
           "iterations"_a = nb::none(), "fastest"_a.none() = false, "mode"_a.none() = "queue",
           "profile"_a = nb::none(), "start"_a.none() = "desired", "every"_a = nb::none(),
           "clip"_a.none() = false);
  def_noun(frontend, verbs::clipped, [](const Frontend& self) {
    self.untyped().added();  // in a forked child it raises
    return self.clipped;
  });
  def_verb(frontend, verbs::add_request, &add_request, "name"_a.none(), "fields"_a);
  def_verb(
      frontend, verbs::add_purge,
      [](const Frontend& self, nb::handle actuator) {
        return self.untyped().add_purge(purged(self, actuator));
      },
      all);
  def_verb(
      frontend, verbs::purge,
      [](const Frontend& self, nb::handle actuator) {
        return send_alone<&o80::BatchBuilder::purge>(self, purged(self, actuator));
      },
      all);
  def_verb(
      frontend, verbs::mark,
      [](const Frontend& self, nb::handle text) {
        const std::string line = string_of(text, "the text of a mark");
        if (o80::printable(line) != line) {
          refuse("the text of a mark", "one line of printable text", text);
        }
        return send_alone<&o80::BatchBuilder::mark>(self, line);
      },
      "text"_a.none());
  def_noun(frontend, verbs::added, &of_core<&UntypedFrontend::added>);
  def_verb(frontend, verbs::forget_added, &of_core<&UntypedFrontend::forget_added>);
  def_verb(frontend, verbs::pulse, &pulse, nb::kw_only(), "at"_a = nb::none(),
           "late"_a.none() = "reject", "seen"_a = nb::none());
  def_verb(frontend, verbs::pulse_and_wait, &pulse_and_wait, "timeout"_a = nb::none(),
           nb::kw_only(), "at"_a = nb::none(), "late"_a.none() = "reject", "seen"_a = nb::none(),
           "check"_a.none() = true);

  frontend
      .def("_add_trajectories", &add_trajectories, "actuators"_a, "rows"_a, "states"_a, "masks"_a,
           "times"_a, "options"_a, "clip"_a.none())
      .def(
          "_clip",
          [](const Frontend& self, const std::vector<std::uint32_t>& actuators, std::uint32_t rows,
             ConstBytes states, const std::vector<std::uint64_t>& masks) {
            const Targets inside = rows_of(self, actuators, rows, states, masks, nb::bool_(true));
            return std::pair(bytes_of(inside.states), inside.clipped);
          },
          "actuators"_a, "rows"_a, "states"_a, "masks"_a)
      .def("_send_chunk", &send_chunk, "actuators"_a, "due"_a, "states"_a, "masks"_a, "anchor"_a,
           "plan"_a, "ease"_a, "first"_a, "fixed"_a, "reject_late"_a, "final"_a, "profile"_a,
           "seen"_a.none(), "clipped"_a)
      .def("_close_plan", &send_alone<&o80::BatchBuilder::close_plan, std::uint64_t>, "plan"_a)
      .def(
          "_since",
          [](const Frontend& self, nb::handle seen) {
            return self.shared()->link()->with_newest_row(seen_of(seen))->since;
          },
          "seen"_a)
      .def("_purge_own",
           [](const Frontend& self) {
             return send_alone<&o80::BatchBuilder::purge_own>(self, o80::kEveryActuator);
           })
      .def("_take_control", &send_alone<&o80::BatchBuilder::take_control>)
      .def("_release_control", &send_alone<&o80::BatchBuilder::release_control>)
      .def("_preview", &preview, "actuators"_a.none(), "target"_a.none(), "initial"_a.none(),
           "options"_a)
      .def(
          "_chosen",
          [](const Frontend& self, nb::handle named) {
            return std::pair(self.actuators(named), self.names_one(named));
          },
          "actuators"_a.none(), "Their indices; True if it is one index or name of an actuator.")
      .def("_send_request", &send_request, "name"_a.none(), "fields"_a, "seen"_a.none())
      .def("_wait_until_ended", &wait_until_ended, "batch"_a, "timeout"_a.none())
      .def("_pulse_to_end", &pulse_to_end, "at"_a.none(), "late"_a.none(), "seen"_a.none())
      .def("_wait_for_end", &wait_for_end, "batch"_a, "timeout"_a.none(), "check"_a.none())
      .def("_burst", &burst, "iterations"_a.none(), "timeout"_a.none(), "at"_a.none(),
           "late"_a.none(), "seen"_a.none())
      .def("_start_burst", &start_burst, "iterations"_a.none(), "at"_a.none(), "late"_a.none(),
           "seen"_a.none());

  m.def("start_bursts", &start_bursts, "members"_a, "seen"_a.none());
  m.def("wait_for_bursts", &wait_for_bursts, "bursts"_a, "timeout"_a.none());
}
