#include "control/motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <type_traits>

#include "describe/visit_number.hpp"

namespace o80 {
namespace {

/// The fraction `share` between `from` and `to`, never outside, despite rounding and overflow.
double between(double from, double to, double distance, double share) noexcept {
  const double value = from + distance * share;
  const double low = std::min(from, to);
  const double high = std::max(from, to);
  if (value >= low && value <= high) return value;
  if (value < low && std::isfinite(distance)) return low;
  if (value > high && std::isfinite(distance)) return high;
  // the distance has overflowed, or `from` is not finite
  const double weighed = from * (1.0 - share) + to * share;
  return std::isfinite(weighed) ? weighed : to;
}

template <class T>
void store(std::byte* out, T value) noexcept {
  std::memcpy(out, &value, sizeof value);
}

template <class T, class Real>
T to_integer(Real value) noexcept {
  const Real rounded = std::round(value);
  if (!(rounded > static_cast<Real>(std::numeric_limits<T>::min()))) {
    return std::numeric_limits<T>::min();
  }
  if (!(rounded < static_cast<Real>(std::numeric_limits<T>::max()))) {
    return std::numeric_limits<T>::max();
  }
  return static_cast<T>(rounded);
}

/// For integers that a double cannot hold: interpolates in long double.
template <class T>
T moved_wide(T from, T to, double share) noexcept {
  const auto start = static_cast<long double>(from);
  const auto target = static_cast<long double>(to);
  return to_integer<T>(start + (target - start) * static_cast<long double>(share));
}

}  // namespace

Motion::Motion(const StateLayout& layout)
    : layout_(layout),
      stride_((layout.size() + 15) / 16 * 16),
      ends_(3 * stride_ / sizeof(std::uint64_t)),
      exact_(layout.numbers().size(), std::numeric_limits<double>::quiet_NaN()),
      starts_(layout.numbers().size()),
      targets_(layout.numbers().size()),
      values_(layout.numbers().size()),
      ways_(layout.numbers().size()),
      kept_(layout.numbers().size()) {}

void Motion::begin(Iteration first, std::int64_t iterations, Profile profile, Pace pace) noexcept {
  first_ = first;
  last_ = first + (iterations - 1);
  iterations_ = static_cast<double>(iterations);
  profile_ = profile;
  pace_ = pace;
  continues_ = moving_ && profile == Profile::minimum_jerk && pace != Pace::fastest;
  moving_ = false;
  measured_ = false;
  if (iterations > 1) measure();  // else there is nothing to interpolate
  start_at_from();
}

void Motion::start_at_from() noexcept {
  std::fill(exact_.begin(), exact_.end(), std::numeric_limits<double>::quiet_NaN());
}

double Motion::distance(std::size_t number) const noexcept {
  return target_of(number) - start_of(number);
}

double Motion::target_of(std::size_t number) const noexcept {
  const auto* from = reinterpret_cast<const std::byte*>(ends_.data());
  return layout_.number(number, from + stride_);
}

double Motion::start_of(std::size_t number) const noexcept {
  const auto* from = reinterpret_cast<const std::byte*>(ends_.data());
  return std::isnan(exact_[number]) ? layout_.number(number, from) : exact_[number];
}

/// Computes start, target and way of each number. Not called before they are needed: most commands
/// of one iteration do not need them.
void Motion::measure() noexcept {
  measured_ = true;
  const auto& numbers = layout_.numbers();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!numbers[i].moves()) continue;
    starts_[i] = start_of(i);
    targets_[i] = target_of(i);
    if (continues_) ways_[i] = way(i, iterations_);
  }
}

/// The overwritten motion fades to rest within the time that it had left, inside the span of its
/// present position, stopping position and target, and the new target.
Motion::Way Motion::way(std::size_t number, double iterations) const noexcept {
  const Kept& kept = kept_[number];
  const double start = start_of(number);
  const double target = target_of(number);
  Way way;
  way.low = std::min({start, target, kept.stop, kept.target});
  way.high = std::max({start, target, kept.stop, kept.target});
  way.fading =
      Fading::of(kept.moment, std::min(left_, iterations), way.high - start, start - way.low);
  return way;
}

void Motion::state(Iteration iteration, std::byte* out) noexcept {
  now_ = iteration;
  if (iteration >= last_) {
    layout_.copy(out, to());
    return;
  }
  const double time = static_cast<double>(iteration - first_ + 1) / iterations_;
  if (layout_.hooks().blend != nullptr) {
    std::byte* blended = to() + stride_;
    layout_.hooks().blend(blended, from(), to(), share_of(time));
    // a blend() that divides by zero gives an invalid state: keep the last one
    if (layout_.finite(blended)) layout_.copy(out, blended);
  } else if (layout_.plain() && !continues_) {
    plain_state(share_of(time), out);
  } else {
    mixed_state(time, out);
  }
}

double Motion::number(std::size_t number) const noexcept {
  return arrived() ? target_of(number) : values_[number];
}

void Motion::plain_state(double share, std::byte* out) noexcept {
  for (std::size_t i = 0; i < starts_.size(); ++i) {
    values_[i] = between(starts_[i], targets_[i], targets_[i] - starts_[i], share);
    store(out + i * sizeof(double), values_[i]);
  }
}

double Motion::moved(std::size_t number, double time) const noexcept {
  const double start = starts_[number];
  const double distance = targets_[number] - start;
  if (continues_) {
    const Way& way = ways_[number];
    const double value = start + way.fading.position(time * iterations_) +
                         (distance - way.fading.distance()) * minimum_jerk(time);
    if (std::isfinite(value)) return std::clamp(value, way.low, way.high);
  }
  return between(start, targets_[number], distance, share_of(time));
}

void Motion::mixed_state(double time, std::byte* out) noexcept {
  const std::byte* begins = reinterpret_cast<const std::byte*>(ends_.data());
  const std::byte* ends = begins + stride_;
  const auto& numbers = layout_.numbers();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::uint32_t offset = numbers[i].offset;
    std::byte* at = out + offset;
    if (!numbers[i].moves()) {  // booleans and enumerations switch at the start
      std::memcpy(at, ends + offset, numbers[i].size);
      continue;
    }
    values_[i] = moved(i, time);
    visit_number(numbers[i].kind, [&]<class T>(T) {
      if constexpr (std::is_floating_point_v<T>) {
        store(at, static_cast<T>(values_[i]));
      } else if (sizeof(T) < 8) {
        store(at, to_integer<T>(values_[i]));
      } else if (continues_) {
        store(at, to_integer<T>(static_cast<long double>(values_[i])));
      } else {
        store(at, moved_wide(load<T>(begins + offset), load<T>(ends + offset), share_of(time)));
      }
    });
  }
}

void Motion::keep_moving(const std::byte* ahead, std::int64_t rows) noexcept {
  moving_ = pace_ != Pace::direct && layout_.hooks().blend == nullptr;
  if (!moving_) return;
  if (!measured_) measure();
  const double done = std::min(iterations_, static_cast<double>(now_ - first_ + 1));
  left_ = iterations_ - done + static_cast<double>(rows) * iterations_;
  const double time = done / iterations_;
  for (std::size_t i = 0; i < kept_.size(); ++i) {
    Kept& kept = kept_[i];
    if (!layout_.numbers()[i].moves()) {
      kept = {};
      continue;
    }
    kept = {{}, 0.0, targets_[i], layout_.number(i, ahead)};
    double distance = targets_[i] - starts_[i];
    if (profile_ == Profile::linear) {
      kept.moment.velocity = left_ > 0.0 ? distance / iterations_ : 0.0;
    } else {
      if (continues_) {
        kept.moment = ways_[i].fading.at(done);
        distance -= ways_[i].fading.distance();
        kept.stop = starts_[i] + ways_[i].fading.distance();
      } else {
        kept.stop = starts_[i];
      }
      kept.moment.velocity += distance * minimum_jerk_slope(time) / iterations_;
      kept.moment.acceleration +=
          distance * minimum_jerk_curvature(time) / (iterations_ * iterations_);
    }
    kept.step = moved(i, time) - moved(i, std::max(0.0, done - 1.0) / iterations_);
    const bool usable =
        std::isfinite(kept.moment.velocity) && std::isfinite(kept.moment.acceleration);
    if (!usable) kept.moment = {};
  }
}

void Motion::keep_moving(const std::byte* state, std::size_t number, const Moment& moment,
                         double stop, std::int64_t iterations) noexcept {
  if (!moving_) {
    if (moment.velocity == 0.0 && moment.acceleration == 0.0) return;
    for (std::size_t i = 0; i < kept_.size(); ++i) {
      const double here = layout_.numbers()[i].moves() ? layout_.number(i, state) : 0.0;
      kept_[i] = {{}, 0.0, here, here};
    }
    left_ = 0.0;
    moving_ = true;
  }
  kept_[number] = {moment, moment.velocity, stop, stop};
  left_ = std::max(left_, static_cast<double>(iterations));
}

void Motion::leave_out(const std::uint64_t* mask) noexcept {
  for (std::size_t i = 0; moving_ && i < kept_.size(); ++i) {
    if (!masked(mask, i)) kept_[i].moment = {};
  }
}

std::int64_t Motion::iterations_at(std::size_t number, double speed) noexcept {
  const double start = start_of(number);
  const double target = target_of(number);
  if (!moving_) return minimum_jerk_iterations(target - start, speed);

  // drop an acceleration that would raise the speed further
  Kept& kept = kept_[number];
  Moment& moment = kept.moment;
  if (moment.velocity * moment.acceleration > 0.0 && std::abs(moment.velocity) > speed) {
    const double size = std::min(std::abs(moment.velocity), std::max(speed, std::abs(kept.step)));
    moment = {std::copysign(size, moment.velocity), 0.0};
  } else if (moment.velocity * moment.acceleration > 0.0) {
    moment.acceleration = 0.0;
  }
  const double most = std::max(speed, std::abs(moment.velocity)) * (1.0 + 1e-12);
  const auto fits = [&](std::int64_t n) {
    const auto count = static_cast<double>(n);
    const double rest = target - start - way(number, count).fading.distance();
    return highest_speed(moment.velocity, rest, count) <= most;
  };
  std::int64_t enough = 1;
  while (!fits(enough) && enough < kMostIterations / 2) enough *= 2;
  std::int64_t few = enough / 2;
  while (enough - few > 1) {
    const std::int64_t middle = few + (enough - few) / 2;
    (fits(middle) ? enough : few) = middle;
  }
  return enough;
}

}  // namespace o80
