// How a frontend moves a robot and waits until it is observed there.

#include <cstring>
#include <limits>
#include <utility>

#include "arguments.hpp"
#include "batch.hpp"
#include "control/batch/record.hpp"
#include "control/motion/state_layout.hpp"
#include "frontend.hpp"
#include "states.hpp"
#include "waiting.hpp"

using o80::Move;
using o80::MoveOptions;

namespace {

constexpr double kNotJudged = std::numeric_limits<double>::infinity();

bool is_mapping(nb::handle value) { return nb::hasattr(value, "keys"); }
bool is_number(nb::handle value) {
  return nb::hasattr(value, "__float__") && !nb::hasattr(value, "__len__");
}

/// Appends the tolerances of all numbers of an actuator: from a number for those with a target, or
/// from a mapping.
void append_tolerances(const o80::Schema& schema, const o80::ActuatorRow& actuator,
                       nb::handle given, const std::uint64_t* mask, std::vector<double>& all) {
  const o80::StateLayout layout(schema, actuator.type);
  if (!is_mapping(given)) {
    const double tolerance = number_of(given, "tolerance");
    for (std::size_t i = 0; i < layout.numbers().size(); ++i) {
      all.push_back(o80::masked(mask, i) ? tolerance : kNotJudged);
    }
    return;
  }
  const StateBytes state(schema, actuator.type, given,
                         "the tolerance of actuator '" + actuator.name.str() + "'");
  for (std::size_t i = 0; i < layout.numbers().size(); ++i) {
    const bool is_given = o80::masked(state.mask.data(), i);
    all.push_back(is_given ? layout.number(i, state.bytes.data()) : kNotJudged);
  }
}

/// Reads tolerances: a number for all numbers, a mapping from the fields of each state to numbers,
/// or a sequence with one of these for each actuator.
void set_tolerances(const o80::Schema& schema, nb::handle given, const Targets& targets,
                    MoveOptions& options) {
  if (is_number(given)) {
    options.tolerance = number_of(given, "tolerance");
    return;
  }
  const bool is_one = is_mapping(given);
  if (!is_one && !is_sequence_of(given, targets.actuators.size())) {
    refuse("tolerance",
           "a number, a mapping from fields to numbers, or one of these for each actuator", given);
  }
  const std::uint64_t* mask = targets.masks.empty() ? nullptr : targets.masks.data();
  for (std::size_t i = 0; i < targets.actuators.size(); ++i) {
    const o80::ActuatorRow& actuator = schema.actuators[targets.actuators[i]];
    const nb::object one = is_one ? nb::borrow(given) : nb::object(given[i]);
    append_tolerances(schema, actuator, one, mask, options.tolerances);
    if (mask != nullptr) mask += o80::mask_words(schema.scalar_count(actuator.type));
  }
}

/// `timeout`, of the wait that follows, is refused before anything is sent.
Move start_move(const Frontend& self, nb::handle actuators, nb::handle targets,
                nb::handle tolerance, Patience /*timeout*/, const o80::CommandOptions& command) {
  const auto frontend = self.shared();
  MoveOptions options{.command = command};
  const Targets chosen = self.targets_of(actuators, targets);
  set_tolerances(self.decoder()->description->schema, tolerance, chosen, options);
  const Waiting waiting;
  return frontend->start_move(chosen.actuators, chosen.states, options, chosen.masks);
}

Observation wait_for_move(const Frontend& self, const Move& move, Patience timeout) {
  const auto frontend = self.shared();
  const auto decoder = self.decoder();
  return Observation(decoder, carrying(move.batch(), [&] {
                       return frontend->wait_for_move(move, timeout, Waiting::keep_waiting);
                     }));
}

}  // namespace

void bind_moving(nb::module_& m, nb::class_<Frontend>& frontend) {
  nb::class_<Move>(m, "Move", "A motion that was sent.").def_prop_ro("batch", [](const Move& self) {
    return self.batch();
  });
  frontend
      .def("_start_move", &start_move, "actuators"_a.none(), "targets"_a.none(),
           "tolerance"_a.none(), "timeout"_a.none(), "options"_a)
      .def("_wait_for_move", &wait_for_move, "move"_a, "timeout"_a.none());
}
