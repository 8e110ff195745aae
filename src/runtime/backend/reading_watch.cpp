#include "runtime/backend/reading_watch.hpp"

#include <array>
#include <cstdio>
#include <utility>

#include "describe/number_name.hpp"

namespace o80 {

ReadingWatch::ReadingWatch(const Schema& schema, Of of) : layouts_(schema.types.size()) {
  for (std::uint32_t i = 0; i < schema.actuators.size(); ++i) {
    const ActuatorRow& row = schema.actuators[i];
    if (of == Of::none || (of == Of::followers && row.when_idle != WhenIdle::follow)) continue;
    for (std::uint32_t number = 0; number < row.limits; ++number) {
      const LimitRow& limit = schema.limits[row.first_limit + number];
      const double width = limit.maximum - limit.minimum;
      const bool is_bound =
          std::isfinite(limit.speed) || std::isfinite(width) || limit.noise > 0.0F;
      if (limit.resting != 0 || !is_bound) continue;
      layout_of(schema, row.type, layouts_);
      const double by_error = std::isfinite(limit.error) ? limit.error / 10.0 : 0.0;
      const double noise = limit.noise > 0.0F ? static_cast<double>(limit.noise) : by_error;
      const bool is_slow = std::isfinite(limit.speed) || limit.noise == 0.0F;
      const double outside = std::isfinite(limit.error) ? limit.error : width / 10.0;
      watched_.push_back({i, number, row.offset, row.type, is_slow ? limit.speed : 0.0, noise,
                          limit.minimum - outside, limit.maximum + outside});
    }
  }
}

void ReadingWatch::begin(const std::byte* observed) noexcept {
  for (Watched& each : watched_) {
    each.last = each.before = each.good = value(each, observed);
    each.since = 0.0;
    each.is_wrong = each.was_wrong = false;
  }
}

void ReadingWatch::add(const std::byte* observed, double elapsed) noexcept {
  for (Watched& each : watched_) {
    const double now = value(each, observed);
    const double before = std::exchange(each.before, now);
    each.last = before;
    each.was_wrong = each.is_wrong;
    each.since += elapsed;
    // `<=`, because a comparison with NaN is false: NaN must count as wrong
    if (std::abs(now - before) <= each.reach(elapsed)) continue;
    if (!each.is_wrong) {
      each.is_wrong = true;
      each.good = before;
      each.since = elapsed;
    } else if (std::abs(now - each.good) <= each.reach(each.since)) {
      each.is_wrong = false;
    }
  }
}

std::optional<ReadingWatch::Fault> ReadingWatch::find(const std::byte* observed,
                                                      double elapsed) const noexcept {
  for (const Watched& each : watched_) {
    const double now = value(each, observed);
    if (each.is_outside(now)) return each.outside(now);
    const bool steps = !(std::abs(now - each.before) <= each.reach(elapsed));
    const bool returns = std::abs(now - each.good) <= each.reach(each.since + elapsed);
    if (each.is_wrong ? !(steps && returns) : steps) {
      return Fault{each.actuator, each.number,         each.is_wrong ? each.good : each.before,
                   now,           each.reach(elapsed), false};
    }
  }
  return std::nullopt;
}

std::optional<ReadingWatch::Fault> ReadingWatch::fault_of(const Watched& each) noexcept {
  if (each.is_outside(each.before)) return each.outside(each.before);
  if (each.is_outside(each.last)) return each.outside(each.last);
  if (!each.is_wrong && !each.was_wrong) return std::nullopt;
  const double read = each.is_wrong ? each.before : each.last;
  return Fault{each.actuator, each.number, each.good, read, each.reach(0.0), false};
}

std::optional<ReadingWatch::Fault> ReadingWatch::find_of(std::uint32_t actuator) const noexcept {
  for (const Watched& each : watched_) {
    if (each.actuator != actuator) continue;
    if (const auto fault = fault_of(each)) return fault;
  }
  return std::nullopt;
}

std::optional<ReadingWatch::Fault> ReadingWatch::find_idle(
    const std::uint64_t* active, const std::uint64_t* braking) const noexcept {
  for (const Watched& each : watched_) {
    const std::size_t word = each.actuator / 64;
    if (((active[word] & ~braking[word]) >> (each.actuator % 64) & 1) != 0) continue;
    if (const auto fault = fault_of(each)) return fault;
  }
  return std::nullopt;
}

void describe_reading(const Schema& schema, const ReadingWatch::Fault& fault, std::string_view cure,
                      ShortText<248>& text) noexcept {
  name_number(schema, fault.actuator, fault.number, text);
  text.add(" was read at ").add(fault.read);
  if (fault.is_outside) {
    text.add(", too far outside its bounds (beyond ").add(fault.before).add(")");
  } else {
    std::array<char, 16> tolerance{};
    std::snprintf(tolerance.data(), tolerance.size(), "%.3g", fault.tolerance);
    text.add(" after ").add(fault.before).add(": farther than its speed limit allows (");
    text.add(tolerance.data()).add(")");
  }
  text.add(". Check the sensor and the robot; if the reading is right, ").add(cure);
}

}  // namespace o80
