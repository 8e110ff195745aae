#include "o80/control/motion.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace o80 {
namespace {

/// `share` of the way, never outside it, whatever rounding or overflow would do.
double between(double from, double to, double distance, double share) noexcept {
  const double value = from + distance * share;
  const double low = std::min(from, to);
  const double high = std::max(from, to);
  if (value >= low && value <= high) return value;
  if (value < low && std::isfinite(distance)) return low;
  if (value > high && std::isfinite(distance)) return high;
  // the distance overflowed, or the way starts from no number
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

/// Integers that a double cannot hold go their way in long double.
template <class T>
T moved_wide(T from, T to, double share, bool quintic, double offset) noexcept {
  const auto start = static_cast<long double>(from);
  const auto target = static_cast<long double>(to);
  if (quintic) return to_integer<T>(start + static_cast<long double>(offset));
  return to_integer<T>(start + (target - start) * static_cast<long double>(share));
}

}  // namespace

Motion::Motion(const StateLayout& layout)
    : layout_(layout),
      stride_((layout.size() + 15) / 16 * 16),
      ends_(3 * stride_ / sizeof(std::uint64_t)),
      starts_(layout.numbers().size()),
      targets_(layout.numbers().size()),
      ways_(layout.numbers().size()),
      moments_(layout.numbers().size()) {}

void Motion::begin(Iteration first, std::int64_t iterations, Profile profile, Pace pace) noexcept {
  first_ = first;
  last_ = first + (iterations - 1);
  iterations_ = static_cast<double>(iterations);
  profile_ = profile;
  pace_ = pace;
  quintic_ = moving_ && profile == Profile::minimum_jerk;
  moving_ = false;
  measured_ = false;
  if (iterations > 1) measure();  // else nothing lies between
}

/// The ways of all numbers; asked for as late as possible, for most rows of one iteration need
/// none.
void Motion::measure() noexcept {
  measured_ = true;
  const auto& numbers = layout_.numbers();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    if (!numbers[i].moves()) continue;
    starts_[i] = layout_.number(i, from());
    targets_[i] = layout_.number(i, to());
    ways_[i] =
        Quintic::from(targets_[i] - starts_[i], quintic_ ? moments_[i] : Moment{}, iterations_);
  }
}

void Motion::state(Iteration iteration, std::byte* out) noexcept {
  now_ = iteration;
  if (iteration >= last_) {
    layout_.copy(out, to());
    return;
  }
  const double time = static_cast<double>(iteration - first_ + 1) / iterations_;
  const double share = share_of(time);
  if (layout_.hooks().blend != nullptr) {
    std::byte* blended = to() + stride_;
    layout_.hooks().blend(blended, from(), to(), share);
    layout_.copy(out, blended);
  } else if (layout_.plain() && !quintic_) {
    plain_state(share, out);
  } else {
    mixed_state(share, time, out);
  }
}

void Motion::plain_state(double share, std::byte* out) const noexcept {
  for (std::size_t i = 0; i < starts_.size(); ++i) {
    store(out + i * sizeof(double), between(starts_[i], targets_[i], ways_[i].distance, share));
  }
}

double Motion::moved(std::size_t number, double share, double time) const noexcept {
  if (quintic_) {
    const double value = starts_[number] + ways_[number].at(QuinticWeights::position(time));
    if (std::isfinite(value)) return value;
  }
  return between(starts_[number], targets_[number], ways_[number].distance, share);
}

void Motion::mixed_state(double share, double time, std::byte* out) const noexcept {
  const std::byte* begins = reinterpret_cast<const std::byte*>(ends_.data());
  const std::byte* ends = begins + stride_;
  const auto& numbers = layout_.numbers();
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    const std::uint32_t offset = numbers[i].offset;
    std::byte* at = out + offset;
    const auto wide = [&]<class T>(T) {
      const double way = quintic_ ? ways_[i].at(QuinticWeights::position(time)) : 0.0;
      store(at, moved_wide(load<T>(begins + offset), load<T>(ends + offset), share, quintic_, way));
    };
    switch (numbers[i].kind) {
      case Kind::float64:
        store(at, moved(i, share, time));
        break;
      case Kind::float32: {
        // a quintic may leave the span of its ends, and that of a float
        const auto value = static_cast<float>(
            std::clamp<double>(moved(i, share, time), std::numeric_limits<float>::lowest(),
                               std::numeric_limits<float>::max()));
        store(at, value);
        break;
      }
      case Kind::int8:
        store(at, to_integer<std::int8_t>(moved(i, share, time)));
        break;
      case Kind::int16:
        store(at, to_integer<std::int16_t>(moved(i, share, time)));
        break;
      case Kind::int32:
        store(at, to_integer<std::int32_t>(moved(i, share, time)));
        break;
      case Kind::int64:
        wide(std::int64_t{});
        break;
      case Kind::uint8:
        store(at, to_integer<std::uint8_t>(moved(i, share, time)));
        break;
      case Kind::uint16:
        store(at, to_integer<std::uint16_t>(moved(i, share, time)));
        break;
      case Kind::uint32:
        store(at, to_integer<std::uint32_t>(moved(i, share, time)));
        break;
      case Kind::uint64:
        wide(std::uint64_t{});
        break;
      default:  // booleans and enumerations switch at the start
        std::memcpy(at, ends + offset, numbers[i].size);
    }
  }
}

void Motion::keep_moving() noexcept {
  moving_ = pace_ != Pace::direct && layout_.hooks().blend == nullptr;
  if (!moving_) return;
  if (!measured_) measure();
  const double time = std::min(1.0, static_cast<double>(now_ - first_ + 1) / iterations_);
  const bool linear = profile_ == Profile::linear;
  const QuinticWeights slope = QuinticWeights::slope(time);
  const QuinticWeights curvature = QuinticWeights::curvature(time);
  for (std::size_t i = 0; i < moments_.size(); ++i) {
    Moment moment;
    if (layout_.numbers()[i].moves()) {
      moment.velocity = (linear ? ways_[i].distance : ways_[i].at(slope)) / iterations_;
      moment.acceleration = linear ? 0.0 : ways_[i].at(curvature) / (iterations_ * iterations_);
    }
    const bool usable = std::isfinite(moment.velocity) && std::isfinite(moment.acceleration);
    moments_[i] = usable ? moment : Moment{};
  }
}

}  // namespace o80
