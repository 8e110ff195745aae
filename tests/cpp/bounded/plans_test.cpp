// Whatever a number does, and whatever its limits and its target are, the start of a plan and each
// iteration do a bounded amount of work.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <vector>

#include "bounded/counted_work.hpp"
#include "control/motion/number_motion.hpp"
#include "dice.hpp"

namespace o80::test {
namespace {

constexpr double kNoLimit = std::numeric_limits<double>::infinity();
constexpr std::int64_t kPlayed = 500;  // iterations of a motion, at most

// a cruising speed that FastestMotion finds: both changes of speed of each one that it tries
constexpr std::uint32_t kCruise = 2 * 60;
// two of them, and what is done once or bisects a number of iterations
constexpr std::uint32_t kStart = 2 * kCruise + 50;
constexpr std::uint32_t kStretch = kCruise + 4;
// the searches of a NumberLimiter that follows
constexpr std::uint32_t kFollow = 2 * 16 + 8;
// of a VelocityChange: it searches by doubling and halving, up to 1e12 iterations
constexpr std::uint32_t kTrapezoids = 4 + 2 * 40;
// numbers of iterations that are tried, each also with up to ten stops on the way
constexpr std::uint32_t kSmooth = (8 + 32) * (2 + 2 * 10);

class PlansTest : public testing::Test {
 protected:
  NumberMotion number_at(double position, double bound, const Rates& rates) {
    NumberMotion number(NumberLimiter(-bound, bound, rates), std::nullopt);
    number.restart(position);
    return number;
  }
  NumberMotion any_number() {
    Rates rates{dice_.magnitude(1e-5, 10), kNoLimit, kNoLimit};
    if (!dice_.one_in(8)) rates.acceleration = rates.speed * dice_.magnitude(1e-4, 10);
    if (!dice_.one_in(4)) rates.jerk = rates.acceleration * dice_.magnitude(1e-4, 10);
    const double bound = dice_.one_in(3) ? dice_.magnitude(1e-2, 100) : kNoLimit;
    return number_at(dice_.real(-1, 1) * std::min(bound, 1.0), bound, rates);
  }
  Requested any_target(const NumberMotion& number) {
    const double far = dice_.one_in(20) ? dice_.magnitude(1e4, 1e300) : dice_.magnitude(1e-8, 1e3);
    const double near =
        number.guard().moment().speed * dice_.real(0, 20);  // about where it can stop
    Requested requested;
    requested.target = number.position() + (dice_.one_in(4) ? near : dice_.real(-1, 1) * far);
    if (dice_.one_in(3)) requested.profile = Profile::minimum_jerk;
    if (dice_.one_in(3))
      requested.cruise = number.guard().rates().speed * dice_.magnitude(1e-3, 1.6);
    if (dice_.one_in(3)) requested.iterations = static_cast<std::int64_t>(dice_.magnitude(1, 1e9));
    if (dice_.one_in(10)) requested.start = dice_.real(-1, 1);
    return requested;
  }
  std::int64_t some_of(std::int64_t iterations) {
    return static_cast<std::int64_t>(dice_.real(0, 1) * static_cast<double>(iterations));
  }

  Dice dice_{11};
};

void expect_bounded(const CountedWork& work, std::uint32_t speed_changes) {
  EXPECT_LE(work[Work::speed_change], speed_changes);
  EXPECT_LE(work[Work::trapezoid], kTrapezoids * work[Work::speed_change]);
  EXPECT_LE(work[Work::smooth_motion], kSmooth);
}

TEST_F(PlansTest, AreBoundedFromAnyMotionWithinAnyLimits) {
  for (int round = 0; round < 5'000 && !HasFailure(); ++round) {
    NumberMotion number = any_number();
    for (int part = 0; part < 5; ++part) {
      SCOPED_TRACE(testing::Message() << "round " << round << ", part " << part);
      work_since_last_asked();
      number.begin();
      std::int64_t iterations = number.propose(any_target(number));
      expect_bounded(work_since_last_asked(), kStart);
      if (iterations > kLongestPlan) break;
      // often another number of the state needs more
      if (dice_.one_in(2)) iterations += static_cast<std::int64_t>(dice_.magnitude(1, 1e3));
      number.settle(iterations);
      expect_bounded(work_since_last_asked(), kStart + kStretch);

      for (std::int64_t i = std::min(some_of(iterations), kPlayed); i > 0; --i) {
        number.step(-kNoLimit, kNoLimit);
        expect_bounded(work_since_last_asked(), number.follows() ? kFollow : 0);
      }
      if (!dice_.one_in(4)) continue;
      number.end();
      for (int i = 0; i < 10; ++i) number.brake();
      expect_bounded(work_since_last_asked(), 10 * kFollow);
    }
  }
}

/// Of many starts: the changes of speed of the median, and of the 99th percentile.
struct Usual {
  std::uint32_t median;
  std::uint32_t p99;
};
Usual usual_of(std::vector<std::uint32_t> counts) {
  std::sort(counts.begin(), counts.end());
  return {counts[counts.size() / 2], counts[counts.size() * 99 / 100]};
}

TEST_F(PlansTest, OfAnArmUsuallyNeedFewChangesOfSpeed) {
  // 2/s 15/s2 500/s3 at 500 Hz
  const Rates arm{2.0 / 500, 15.0 / 250'000, 500.0 / 125'000'000};
  std::vector<std::uint32_t> from_rest;
  std::vector<std::uint32_t> moving;
  std::vector<std::uint32_t> stretched;
  for (int round = 0; round < 3'000; ++round) {
    NumberMotion number = number_at(0.0, kNoLimit, arm);
    const auto start = [&](std::int64_t more) {
      Requested requested;
      requested.target = number.position() + dice_.real(-1, 1);
      work_since_last_asked();
      number.begin();
      const std::int64_t iterations = number.propose(requested) + more;
      number.settle(iterations);
      return iterations;
    };
    for (auto i = some_of(start(0)); i > 0; --i) number.step(-kNoLimit, kNoLimit);
    from_rest.push_back(work_since_last_asked()[Work::speed_change]);
    for (auto i = some_of(start(0)); i > 0; --i) number.step(-kNoLimit, kNoLimit);
    moving.push_back(work_since_last_asked()[Work::speed_change]);
    start(1 + some_of(100));
    stretched.push_back(work_since_last_asked()[Work::speed_change]);
  }
  EXPECT_LE(usual_of(from_rest).median, 3U);
  EXPECT_LE(usual_of(from_rest).p99, 6U);
  EXPECT_LE(usual_of(moving).median, 4U);
  EXPECT_LE(usual_of(moving).p99, 9U);
  EXPECT_LE(usual_of(stretched).median, 9U);
  EXPECT_LE(usual_of(stretched).p99, 18U);
}

}  // namespace
}  // namespace o80::test
