#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <vector>

#include "scripts/script_world.hpp"

namespace o80::test {

/// Every desired number is finite and keeps its limits (docs/commands/limits.md#limits).
///
/// Rates are held against differences of the published positions: the first one against the speed,
/// the second against the acceleration, the third against the jerk, all per iteration. A field
/// that rounds hides a difference of one iteration, so differences over 2 to 32 iterations are
/// looked at too.
class LimitWatch {
 public:
  explicit LimitWatch(const ScriptWorld& world);

  void restart(const ScriptWorld& world);
  std::optional<Failure> step(const ScriptWorld& world);

 private:
  static constexpr std::size_t kLongestLag = 32;
  static constexpr std::size_t kKept = 128;  // above 3 lags, a power of two

  struct Past {
    std::array<long double, kKept> positions{};
    std::size_t newest = 0;

    void fill(long double position);
    void add(long double position);
    long double back(std::size_t iterations) const {
      return positions[(newest + kKept - iterations) % kKept];
    }
  };

  std::optional<Failure> bounds(const ScriptWorld& world, std::size_t actuator,
                                std::size_t number) const;
  std::optional<Failure> rates(const ScriptWorld& world, std::size_t actuator, std::size_t number,
                               const Past& past) const;

  std::vector<std::vector<Past>> pasts_;
};

/// The most by which a published number may differ from the limiter's own.
long double rounding_of(const NumberSpec& number, long double position);

}  // namespace o80::test
