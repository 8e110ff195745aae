#include "scripts/end_watch.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <string>

#include "scripts/limit_watch.hpp"

namespace o80::test {
namespace {

std::string positions(long double is, long double expected) {
  return printed("%.17Lg, not %.17Lg", is, expected);
}

}  // namespace

std::optional<Failure> EndWatch::step(const ScriptWorld& world) const {
  for (const SentCommand* command : world.ended) {
    if (command->status != Status::completed) continue;
    if (command->ended_at != world.iteration) {
      return Failure{"completion", "a command completed at another iteration than the present"};
    }
    if (auto failure = on_target(world, *command)) return failure;
  }
  for (std::size_t a = 0; a < world.actuators.size(); ++a) {
    if (auto failure = masks(world, a)) return failure;
    if (auto failure = says_clamped(world, a)) return failure;
    if (world.actuators[a].driver != nullptr) continue;
    if (auto failure = idle(world, a)) return failure;
  }
  return std::nullopt;
}

/// A plan keeps the limits: only what is followed can be changed by them. That is rows, a start at
/// the observed state, targets as they were sent, and a start that is outside the bounds or cannot
/// stop inside them.
std::optional<Failure> EndWatch::says_clamped(const ScriptWorld& world,
                                              std::size_t actuator) const {
  const ActuatorTrack& track = world.actuators[actuator];
  if (!track.clamped || track.driver == nullptr) return std::nullopt;
  const ScriptStep& step = world.step_of(*track.driver);
  const auto& numbers = world.script.actuators[actuator].numbers;
  const bool is_followed = (world.rows_of(*track.driver) > 1 && step.head.pace != Pace::direct) ||
                           step.head.start == Start::observed ||
                           step.head.profile == Profile::as_sent ||
                           std::ranges::any_of(numbers, [](const NumberSpec& number) {
                             return number.bounded() || !number.is_float();  // as its kind is
                           });
  if (is_followed) return std::nullopt;
  return Failure{"plan", world.where(actuator, 0) + "a planned command was clamped"};
}

std::optional<Failure> EndWatch::on_target(const ScriptWorld& world,
                                           const SentCommand& command) const {
  const ScriptStep& step = world.step_of(command);
  const auto& numbers = world.script.actuators[step.actuator].numbers;
  const std::size_t last_row = (world.rows_of(command) - 1) * numbers.size();
  for (std::size_t n = 0; n < numbers.size(); ++n) {
    if (!world.names(command, n)) continue;
    std::array<std::byte, 8> expected{};
    store_as(numbers[n].kind, step.values[last_row + n], expected.data());
    const std::byte* desired =
        world.rig.controller.desired() + world.actuators[step.actuator].numbers[n].offset;
    if (std::memcmp(desired, expected.data(), bytes_of_kind(numbers[n].kind)) != 0) {
      return Failure{"target", world.where(step.actuator, n) + "a completed command ends at " +
                                   positions(load_as(numbers[n].kind, desired),
                                             load_as(numbers[n].kind, expected.data()))};
    }
  }
  return std::nullopt;
}

/// A command makes an actuator active, braking does too, and nothing else.
std::optional<Failure> EndWatch::masks(const ScriptWorld& world, std::size_t actuator) const {
  const ActuatorTrack& track = world.actuators[actuator];
  const bool driven = track.driver != nullptr;
  if (driven && track.braking) {
    return Failure{"masks", world.where(actuator, 0) + "braking though a command runs"};
  }
  const auto& numbers = world.script.actuators[actuator].numbers;
  if (track.clamped && std::ranges::none_of(numbers, &NumberSpec::limited)) {
    return Failure{"masks", world.where(actuator, 0) + "clamped without a limit"};
  }
  if (track.active != (driven || track.braking)) {
    return Failure{"masks", world.where(actuator, 0) +
                                (track.active ? "active without a command or braking"
                                              : "not active though a command runs or it brakes")};
  }
  return std::nullopt;
}

/// Without a command: follows, or stays, unless it brakes and says so.
std::optional<Failure> EndWatch::idle(const ScriptWorld& world, std::size_t actuator) const {
  const ActuatorSpec& spec = world.script.actuators[actuator];
  const ActuatorTrack& track = world.actuators[actuator];
  const bool dropped = track.last != nullptr && track.last->status != Status::completed;
  const bool was_direct = track.last != nullptr && !dropped &&
                          track.dropped_at <= track.last->ended_at &&
                          world.step_of(*track.last).head.pace == Pace::direct;
  for (std::size_t n = 0; n < spec.numbers.size(); ++n) {
    const NumberSpec& number = spec.numbers[n];
    const NumberTrack& place = track.numbers[n];
    if (spec.follow && !number.resting) {
      const long double seen =
          place.reading ? as_stored(number.kind, *place.reading) : place.before;
      const long double expected = std::isfinite(seen) ? seen : place.before;
      if (place.now == expected) continue;
      return Failure{"following", world.where(actuator, n) + positions(place.now, expected)};
    }
    if (track.braking) continue;
    // at rest: a resting field that no direct command left where it is
    const bool was_left = was_direct && world.names(*track.last, n);
    if (number.resting && track.last != nullptr && !was_left && !spec.blend) {
      const long double rest = as_stored(number.kind, number.rest);
      // the rules do not say whether an interrupt after the end of a direct command leaves the
      // field where it is
      const bool unsaid = world.step_of(*track.last).head.pace == Pace::direct &&
                          track.maybe_dropped_at > track.last->ended_at;
      if (place.now != rest && !unsaid) {
        return Failure{"resting",
                       world.where(actuator, n) + "it rests at " + positions(place.now, rest)};
      }
      continue;
    }
    if (place.now != place.before) {
      return Failure{"idle", world.where(actuator, n) + "moves without a command to " +
                                 positions(place.now, place.before)};
    }
  }
  return std::nullopt;
}

}  // namespace o80::test
