#include "scripts/limit_watch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>

namespace o80::test {
namespace {

constexpr long double kPeriod = 1e-3L;

std::string text_of(const char* what, long double value, long double allowed) {
  return printed("%s %.12Lg where %.12Lg is allowed", what, value, allowed);
}

/// A field that rests follows nothing.
bool is_following(const ScriptWorld& world, std::size_t actuator, std::size_t number) {
  const ActuatorSpec& spec = world.script.actuators[actuator];
  return spec.follow && world.actuators[actuator].driver == nullptr &&
         !spec.numbers[number].resting;
}

}  // namespace

long double rounding_of(const NumberSpec& number, long double position) {
  const long double size = std::fabs(position);
  switch (number.kind) {
    case Kind::float64:
      // of sums that it took to get there
      return 4.0L * size * std::numeric_limits<double>::epsilon();
    case Kind::float32:
      return size * std::numeric_limits<float>::epsilon() + 2e-45L;
    default: {
      // to nearest, but inwards at the bounds
      const bool at_bound =
          position + 1.0L >= number.limits.maximum || position - 1.0L <= number.limits.minimum;
      return (at_bound ? 1.0L : 0.5L) + size * std::numeric_limits<double>::epsilon();
    }
  }
}

void LimitWatch::Past::fill(long double position) { positions.fill(position); }

void LimitWatch::Past::add(long double position) {
  newest = (newest + 1) % kKept;
  positions[newest] = position;
}

LimitWatch::LimitWatch(const ScriptWorld& world) {
  for (const ActuatorTrack& actuator : world.actuators)
    pasts_.emplace_back(actuator.numbers.size());
  restart(world);
}

void LimitWatch::restart(const ScriptWorld& world) {
  for (std::size_t a = 0; a < pasts_.size(); ++a) {
    for (std::size_t n = 0; n < pasts_[a].size(); ++n) {
      pasts_[a][n].fill(world.actuators[a].numbers[n].now);
    }
  }
}

std::optional<Failure> LimitWatch::step(const ScriptWorld& world) {
  for (std::size_t a = 0; a < pasts_.size(); ++a) {
    for (std::size_t n = 0; n < pasts_[a].size(); ++n) {
      const NumberTrack& track = world.actuators[a].numbers[n];
      if (!std::isfinite(track.now)) {
        return Failure{"finite", world.where(a, n) + "desired is not finite"};
      }
      if (is_following(world, a, n)) {
        pasts_[a][n].fill(track.now);
        continue;
      }
      pasts_[a][n].add(track.now);
      if (!world.script.actuators[a].numbers[n].moves()) continue;
      if (auto failure = bounds(world, a, n)) return failure;
      if (auto failure = rates(world, a, n, pasts_[a][n])) return failure;
    }
  }
  return std::nullopt;
}

/// Inside, or not further outside than before.
std::optional<Failure> LimitWatch::bounds(const ScriptWorld& world, std::size_t actuator,
                                          std::size_t number) const {
  const NumberSpec& spec = world.script.actuators[actuator].numbers[number];
  const NumberTrack& track = world.actuators[actuator].numbers[number];
  const long double highest = std::max<long double>(spec.limits.maximum, track.before);
  const long double lowest = std::min<long double>(spec.limits.minimum, track.before);
  const long double nearest = std::clamp(track.now, lowest, highest);
  if (track.now == nearest) return std::nullopt;
  return Failure{"bounds", world.where(actuator, number) + text_of("at", track.now, nearest)};
}

std::optional<Failure> LimitWatch::rates(const ScriptWorld& world, std::size_t actuator,
                                         std::size_t number, const Past& past) const {
  const NumberSpec& spec = world.script.actuators[actuator].numbers[number];
  if (!std::isfinite(spec.limits.speed)) return std::nullopt;
  const long double speed = spec.limits.speed * kPeriod;
  const long double acceleration = spec.limits.acceleration * kPeriod * kPeriod;
  const long double jerk = spec.limits.jerk * kPeriod * kPeriod * kPeriod;

  const std::size_t longest = spec.kind == Kind::float64 ? 1 : kLongestLag;
  for (std::size_t lag = 1; lag <= longest; lag *= 2) {
    const auto k = static_cast<long double>(lag);
    const long double p0 = past.back(0);
    const long double p1 = past.back(lag);
    const long double p2 = past.back(2 * lag);
    const long double p3 = past.back(3 * lag);
    const long double rounding = std::max({rounding_of(spec, p0), rounding_of(spec, p1),
                                           rounding_of(spec, p2), rounding_of(spec, p3)});
    const auto exceeds = [&](long double value, long double allowed, int roundings) {
      return std::fabs(value) > allowed * (1.0L + 1e-9L) + roundings * rounding;
    };
    const std::string over = lag == 1 ? "" : " over " + std::to_string(lag) + " iterations";
    const auto failed = [&](const char* what, long double value, long double allowed) {
      return Failure{what, world.where(actuator, number) + text_of(what, value, allowed) + over};
    };
    const long double first = p0 - p1;
    if (exceeds(first, speed * k, 2)) return failed("speed", first, speed * k);
    const long double second = p0 - 2 * p1 + p2;
    if (std::isfinite(acceleration) && exceeds(second, acceleration * k * k, 4)) {
      return failed("acceleration", second, acceleration * k * k);
    }
    const long double third = p0 - 3 * p1 + 3 * p2 - p3;
    if (std::isfinite(jerk) && exceeds(third, jerk * k * k * k, 8)) {
      return failed("jerk", third, jerk * k * k * k);
    }
  }
  return std::nullopt;
}

}  // namespace o80::test
