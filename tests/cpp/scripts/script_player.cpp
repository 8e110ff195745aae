#include "scripts/script_player.hpp"

#include <cmath>
#include <string>

#include "scripts/end_watch.hpp"
#include "scripts/limit_watch.hpp"
#include "scripts/span_watch.hpp"

namespace o80::test {
namespace {

constexpr int kIdleIterations = 8;
constexpr std::int64_t kLongestMotion = 1'000'000;

class Player {
 public:
  explicit Player(const Script& script) : world_(script), limits_(world_), spans_(world_) {}

  std::optional<Failure> play() {
    for (std::size_t i = 0; i < world_.script.steps.size(); ++i) {
      if (auto failure = act(world_.script.steps[i], i)) return failure;
    }
    return finish();
  }

 private:
  std::optional<Failure> act(const ScriptStep& step, std::size_t place);
  std::optional<Failure> run(std::int64_t iterations);
  std::optional<Failure> settle();
  std::optional<Failure> come_to_rest();
  std::optional<Failure> finish();
  void watch_again();
  std::int64_t braking_time() const;

  ScriptWorld world_;
  LimitWatch limits_;
  SpanWatch spans_;
  EndWatch ends_;
};

std::optional<Failure> Player::act(const ScriptStep& step, std::size_t place) {
  switch (step.action) {
    case Action::run:
      return run(step.count);
    case Action::settle:
      return settle();
    case Action::resume:
      if (auto failure = come_to_rest()) return failure;
      world_.restart(nullptr);
      watch_again();
      break;
    case Action::restart:
    case Action::restart_with:
      world_.act(step, place);
      watch_again();
      break;
    default:
      world_.act(step, place);
  }
  return std::nullopt;
}

/// After a fresh start.
void Player::watch_again() {
  limits_.restart(world_);
  spans_.restart(world_);
}

std::optional<Failure> Player::run(std::int64_t iterations) {
  for (std::int64_t i = 0; i < iterations; ++i) {
    if (auto failure = world_.step()) return failure;
    if (auto failure = limits_.step(world_)) return failure;
    if (auto failure = spans_.step(world_)) return failure;
    if (auto failure = ends_.step(world_)) return failure;
  }
  return std::nullopt;
}

std::optional<Failure> Player::settle() {
  for (std::int64_t i = 0; world_.rig.controller.active(); ++i) {
    if (i == kLongestMotion) return Failure{"arrival", "a command never arrives"};
    if (auto failure = run(1)) return failure;
  }
  return std::nullopt;
}

/// More iterations than any motion of the robot needs to come to rest.
std::int64_t Player::braking_time() const {
  double longest = 0.0;
  for (std::size_t a = 0; a < world_.actuators.size(); ++a) {
    for (std::size_t n = 0; n < world_.actuators[a].numbers.size(); ++n) {
      const NumberSpec& spec = world_.script.actuators[a].numbers[n];
      const double speed = spec.limits.speed * 1e-3;
      if (!std::isfinite(speed)) continue;
      const double acceleration = spec.limits.acceleration * 1e-6;
      const double jerk = spec.limits.jerk * 1e-9;
      double time = std::isfinite(acceleration) ? speed / acceleration : 0.0;
      if (std::isfinite(jerk)) time += 2.0 * acceleration / jerk + std::sqrt(speed / jerk);
      const auto place = static_cast<double>(world_.actuators[a].numbers[n].now);
      // an integer may be anywhere within one of what is published
      const double hidden = spec.is_float() ? 0.0 : 1.0;
      if (spec.resting) time += (std::fabs(place - spec.rest) + hidden) / speed;
      longest = std::fmax(longest, time);
    }
  }
  return static_cast<std::int64_t>(4.0 * longest) + 20;
}

std::optional<Failure> Player::come_to_rest() {
  const std::int64_t longest = braking_time();
  for (std::int64_t i = 0; world_.rig.controller.active() || world_.rig.controller.braking(); ++i) {
    if (i == longest) return Failure{"braking", "nothing runs, but it never comes to rest"};
    if (world_.rig.controller.active()) {
      world_.purge(kEveryActuator);
    }
    if (auto failure = run(1)) return failure;
  }
  return std::nullopt;
}

/// Purges, brakes, and stands still; then all is told and every block is back.
std::optional<Failure> Player::finish() {
  world_.purge(kEveryActuator);
  if (auto failure = run(1)) return failure;
  if (auto failure = come_to_rest()) return failure;
  if (auto failure = run(kIdleIterations)) return failure;
  for (const SentCommand* command : world_.sent) {
    if (command->ended_at == kNever) {
      return Failure{"one end", "a command has no end status: " + std::to_string(command->id)};
    }
  }
  std::uint64_t freed = 0;
  for (const std::uint64_t blocks : world_.rig.witness.freed_blocks) freed += blocks;
  if (!world_.rig.all_blocks_back() || freed != world_.blocks_sent) {
    return Failure{"blocks", "blocks are missing from the pool at the end"};
  }
  return std::nullopt;
}

}  // namespace

std::optional<Failure> play(const Script& script) { return Player(script).play(); }

std::string report(const Script& script, const Failure& failure) {
  return failure.property + ": " + failure.text + "\n" + script.text();
}

}  // namespace o80::test
