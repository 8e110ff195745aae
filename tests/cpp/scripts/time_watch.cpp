#include "scripts/time_watch.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>

namespace o80::test {
namespace {

constexpr std::int64_t kPeriodNs = 1'000'000;

/// True if rows that follow their limits may have given way in the iteration after they were due:
/// what comes then has their exact time. `previous` can be null.
bool gave_way_when_due(const ScriptWorld& world, const SentCommand* previous) {
  if (previous == nullptr || previous->status != Status::overwritten) return false;
  const auto& times = world.step_of(*previous).times;
  if (times.empty()) return false;
  const auto rows = static_cast<std::int64_t>(times.size());
  return world.iteration <= previous->active_since + std::max(rows, times.back() / kPeriodNs + 1);
}

}  // namespace

TimeWatch::TimeWatch(const ScriptWorld& world) { restart(world); }

void TimeWatch::restart(const ScriptWorld& world) { clocks_.assign(world.actuators.size(), {}); }

std::optional<Failure> TimeWatch::step(const ScriptWorld& world) {
  for (const SentCommand* command : world.ended) {
    const ScriptStep& step = world.step_of(*command);
    if (step.head.pace == Pace::until && command->status == Status::rejected) {
      clocks_[step.actuator].known = false;
    }
  }
  for (const SentCommand* member : world.members) {
    const ScriptStep& step = world.step_of(*member);
    const bool late = step.head.pace == Pace::until && step.head.amount < world.iteration;
    if (late && member->active_since == kNever) clocks_[step.actuator].known = false;
  }
  for (std::size_t a = 0; a < clocks_.size(); ++a) {
    if (begins(world, a)) begin(world, a);
  }
  for (std::size_t a = 0; a < clocks_.size(); ++a) {
    if (begins(world, a)) begin_together(world, a);
  }
  for (std::size_t a = 0; a < clocks_.size(); ++a) {
    const ActuatorTrack& actuator = world.actuators[a];
    if (actuator.driver == nullptr) continue;
    if (actuator.driver->ended_at == world.iteration) {
      if (auto failure = end(world, a)) return failure;
    }
  }
  return std::nullopt;
}

bool TimeWatch::begins(const ScriptWorld& world, std::size_t actuator) {
  const SentCommand* driver = world.actuators[actuator].driver;
  return driver != nullptr && driver != world.actuators[actuator].previous;
}

/// A duration of several actuators counts from the latest of their queues' exact ends.
void TimeWatch::begin_together(const ScriptWorld& world, std::size_t actuator) {
  const SentCommand& command = *world.actuators[actuator].driver;
  if (!command.is_member || world.step_of(command).head.pace != Pace::duration) return;
  Clock together = clocks_[actuator];
  const auto each_other = [&](auto&& visit) {
    for (std::size_t a = 0; a < clocks_.size(); ++a) {
      const SentCommand* other = world.actuators[a].driver;
      if (other != nullptr && other->lane == command.lane && other->id == command.id) visit(a);
    }
  };
  each_other([&](std::size_t a) {
    together.exact = std::max(together.exact, clocks_[a].exact);
    together.known = together.known && clocks_[a].known;
  });
  each_other([&](std::size_t a) { clocks_[a] = together; });
}

void TimeWatch::begin(const ScriptWorld& world, std::size_t actuator) {
  const SentCommand* previous = world.actuators[actuator].previous;
  const bool unbroken = previous != nullptr && previous->ended_at == world.iteration - 1 &&
                        previous->status == Status::completed &&
                        world.actuators[actuator].dropped_at != world.iteration &&
                        world.step_of(*world.actuators[actuator].driver).head.mode == Mode::queue;
  if (!unbroken) {
    clocks_[actuator] = {(world.iteration - 1) * kPeriodNs, !gave_way_when_due(world, previous)};
  }
  if (world.actuators[actuator].maybe_dropped_at == world.iteration) {
    clocks_[actuator].known = false;
  }
}

/// Limits can make a command longer than requested, of several actuators those of any.
bool TimeWatch::may_be_late(const ScriptWorld& world, const SentCommand& command) {
  const auto has_rates = [](const ActuatorSpec& actuator) {
    return std::ranges::any_of(actuator.numbers, [](const NumberSpec& number) {
      return std::isfinite(number.limits.speed);
    });
  };
  const auto& all = world.script.actuators;
  return command.is_member ? std::ranges::any_of(all, has_rates)
                           : has_rates(all[world.step_of(command).actuator]);
}

std::optional<Failure> TimeWatch::end(const ScriptWorld& world, std::size_t actuator) {
  const SentCommand& command = *world.actuators[actuator].driver;
  const ScriptStep& step = world.step_of(command);
  Clock& clock = clocks_[actuator];
  const Iteration took = command.ended_at - command.active_since + 1;
  const auto rows = static_cast<std::int64_t>(world.rows_of(command));
  if (command.status != Status::completed) return std::nullopt;

  Iteration expected = command.ended_at;
  Iteration tolerance = 0;
  switch (step.head.pace) {
    case Pace::direct:
      clock.exact += rows * kPeriodNs;
      expected = command.active_since + rows - 1;
      break;
    case Pace::iterations:
      clock.exact += rows * std::max<std::int64_t>(1, step.head.amount) * kPeriodNs;
      expected = command.active_since + rows * std::max<std::int64_t>(1, step.head.amount) - 1;
      break;
    case Pace::until:
      clock = {step.head.amount * kPeriodNs, true};
      expected = step.head.amount;
      break;
    case Pace::duration: {
      clock.exact += step.times.empty() ? step.head.amount : step.times.back();
      if (!clock.known) return std::nullopt;
      expected = std::max(command.active_since, (clock.exact + kPeriodNs / 2) / kPeriodNs);
      tolerance = 1;
      break;
    }
    default:
      clock.exact += took * kPeriodNs;
  }
  const bool is_late = command.ended_at > expected + tolerance && may_be_late(world, command);
  if (command.ended_at > expected && may_be_late(world, command)) {
    // the exact time starts anew, but not if rounding made it late
    clock = {command.ended_at * kPeriodNs, is_late};
  }
  if (command.ended_at < expected - tolerance ||
      (command.ended_at > expected + tolerance && !is_late)) {
    std::array<char, 160> text{};
    std::snprintf(text.data(), text.size(), "a command of %lld rows ended at %lld, not at %lld",
                  static_cast<long long>(rows), static_cast<long long>(command.ended_at),
                  static_cast<long long>(expected));
    return Failure{"timing", world.where(actuator, 0) + text.data()};
  }
  return std::nullopt;
}

}  // namespace o80::test
