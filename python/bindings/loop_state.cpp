#include "runtime/frontend/loop_state.hpp"

#include <chrono>
#include <string>
#include <tuple>
#include <vector>

#include "bindings.hpp"
#include "frontend.hpp"
#include "o80/runtime/frontend.hpp"
#include "o80/runtime/journal.hpp"
#include "waiting.hpp"

namespace {

/// The data of a backend for `o80 list`, which does not need NumPy to decode a row.
struct BackendState {
  std::string robot;
  o80::LoopState loop;
  std::optional<HaltFields> halt;
  std::vector<RunningFields> running;  // requests
  std::vector<std::int64_t> decision_latencies;
};

/// The decision latency of each batch in the journal that says what it was decided by [iterations];
/// -1: not known.
std::vector<std::int64_t> decision_latencies(const o80::UntypedFrontend& frontend) {
  constexpr int kMost = 100'000;  // a fast writer adds entries meanwhile
  std::vector<std::int64_t> latencies;
  o80::Journal journal(frontend);
  o80::JournalEntry entry;
  for (int i = 0; i < kMost && journal.next(entry); ++i) {
    if (entry.kind != o80::JournalKind::taken || !entry.seen) continue;
    const o80::Iteration since = entry.seen->since;
    latencies.push_back(since < 0 ? -1 : entry.iteration - since);
  }
  return latencies;
}

BackendState backend_state(const std::string& segment) {
  const Waiting waiting;
  const o80::UntypedFrontend frontend(segment, {.timeout = std::chrono::milliseconds(200),
                                                .access = o80::Access::read_only,
                                                .dead = true,
                                                .starting = true,
                                                .keep_waiting = Waiting::keep_waiting});
  return {frontend.schema().head.robot.str(), o80::loop_state(frontend),
          halt_fields(frontend.halted()), running_fields(frontend), decision_latencies(frontend)};
}

std::optional<double> seconds(std::optional<std::int64_t> nanoseconds) {
  if (!nanoseconds) return std::nullopt;
  return static_cast<double>(*nanoseconds) / 1e9;
}

std::optional<std::tuple<std::string, double>> slow_verb(const o80::LoopState& state) {
  if (state.slow_verb == o80::Verb::none) return std::nullopt;
  return std::tuple{std::string(to_text(state.slow_verb)), *seconds(state.slow_for)};
}

}  // namespace

void bind_loop_state(nb::module_& m) {
  using o80::LoopState;
  nb::class_<LoopState>(m, "LoopState", "State of a backend's loop.")
      .def_prop_ro("life", [](const LoopState& self) { return std::string(name_of(self.life)); })
      .def_prop_ro("word", [](const LoopState& self) { return std::string(self.word()); })
      .def_ro("bursting", &LoopState::bursting)
      .def_ro("played", &LoopState::played)
      .def_prop_ro("frequency",
                   [](const LoopState& self) { return 1e9 / static_cast<double>(self.period); })
      .def_ro("last", &LoopState::last)
      .def_ro("overruns", &LoopState::overruns)
      .def_ro("skipped", &LoopState::skipped)
      .def_ro("starvations", &LoopState::starvations)
      .def_ro("rate", &LoopState::rate)
      .def_prop_ro("row_age", [](const LoopState& self) { return seconds(self.row_age); })
      .def_prop_ro("slow_verb", &slow_verb)
      .def_ro("process_stopped", &LoopState::process_stopped)
      .def_prop_ro("stalled", &LoopState::stalled)
      .def_prop_ro("hang", &LoopState::hang)
      .def_prop_ro("trouble", &LoopState::trouble);
  nb::class_<BackendState>(m, "BackendState")
      .def_ro("robot", &BackendState::robot)
      .def_ro("loop", &BackendState::loop)
      .def_ro("halt", &BackendState::halt)
      .def_ro("running", &BackendState::running)
      .def_ro("decision_latencies", &BackendState::decision_latencies);
  m.def("backend_state", &backend_state, "segment"_a);
  m.def("loop_state", [](const Frontend& self) { return o80::loop_state(self.untyped()); });
}
