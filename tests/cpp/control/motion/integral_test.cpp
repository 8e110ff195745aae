// Bounds of what a velocity moves (IntegralBounds), and the differences that drivers may ask for.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <limits>
#include <vector>

#include "control/motion/motion.hpp"
#include "control/rig.hpp"
#include "dice.hpp"

namespace o80::test {
namespace {

constexpr std::int64_t kVelocityPeriod = 4'000'000;  // [ns]

/// A joint with an observed position and a commanded velocity, bounded at -1 and 1.
Schema velocity_robot(const Limits& velocity, double reaction, double minimum = -1.0) {
  Schema schema =
      robot_of({scalar_field("position", Kind::float64), scalar_field("velocity", Kind::float64)});
  schema.head.period = kVelocityPeriod;
  Limits limits = velocity;
  limits.integral = {"position", minimum, 1.0, reaction};
  schema.actuator(0).limits("velocity", limits).rests_at("velocity", 0.0);
  return schema;
}

constexpr Limits kJoint{.minimum = -1.5, .maximum = 1.5, .speed = 5.0, .acceleration = 100.0};

/// The joint itself: follows the desired velocity after a delay [iterations], with a lag of first
/// order [s].
class VelocityRig : public Rig {
 public:
  VelocityRig(const Limits& limits, double reaction, int delay = 0, double lag = 0.0,
              double minimum = -1.0)
      : Rig(velocity_robot(limits, reaction, minimum)), lag_(lag), sent_(delay, 0.0) {}

  void command(double velocity, RecordHead head = overwriting(direct())) {
    head.masked = 1;
    add_rows(0, head, 1, {0.0, velocity}, {}, {2});
    id = record_id(pulse(), 0);
  }
  void iterate(double noise = 0.0) {
    observe(0, position + noise);
    observe(8, velocity_);
    step();
    sent_.push_back(desired(1));
    const double now = sent_.front();
    sent_.pop_front();
    const double share = lag_ > 0.0 ? 1.0 - std::exp(-kPeriod / lag_) : 1.0;
    velocity_ += share * (now - velocity_);
    position += velocity_ * kPeriod;
  }

  static constexpr double kPeriod = static_cast<double>(kVelocityPeriod) * 1e-9;
  double position = 0.0;
  CommandId id = 0;

 private:
  double lag_;
  std::deque<double> sent_;
  double velocity_ = 0.0;
};

/// How far random streams of velocities come past the bounds [rad].
double farthest_outside(int streams, double reaction, int delay, double lag, double noise) {
  Dice dice(1);
  double farthest = 0.0;
  for (int stream = 0; stream < streams; ++stream) {
    VelocityRig rig(kJoint, reaction, delay, lag);
    const int every = 1 + static_cast<int>(dice.real(1.0, 25.0));
    const bool wanders = dice.real(0.0, 1.0) < 0.5;
    double velocity = 0.0;
    double before = 0.0;
    double change = 0.0;
    for (int i = 0; i < 1500; ++i) {
      if (i % every == 0) {
        velocity = wanders ? std::clamp(velocity + dice.real(-0.6, 0.6), -1.5, 1.5)
                           : std::copysign(dice.real(0.1, 1.5), dice.real(-0.4, 0.6));
        rig.command(velocity);
      }
      rig.iterate(dice.real(-noise, noise));
      const double now = rig.desired(1) - before;
      EXPECT_LE(std::abs(now), 5.0 * VelocityRig::kPeriod * (1.0 + 1e-8));
      EXPECT_LE(std::abs(now - change),
                100.0 * VelocityRig::kPeriod * VelocityRig::kPeriod * (1.0 + 1e-6));
      before = rig.desired(1);
      change = now;
      farthest = std::max(farthest, std::abs(rig.position) - 1.0);
    }
  }
  return farthest;
}

// rule L7
TEST(IntegralBounds, HoldInRandomStreams) {
  EXPECT_LE(farthest_outside(40, 0.0, 0, 0.0, 1e-4), 0.3e-3);
}

TEST(IntegralBounds, HoldWhereTheRobotIsLate) {
  const double two = 2.0 * VelocityRig::kPeriod;
  EXPECT_LE(farthest_outside(40, 0.02 + two, 2, 0.02, 1e-4), 1.0e-3);
  EXPECT_LE(farthest_outside(40, 0.05, 0, 0.05, 1e-4), 10.0e-3);
}

// rule L7
TEST(IntegralBounds, ACommandAtABoundEndsAndItsFieldRests) {
  VelocityRig rig(kJoint, 0.0);
  rig.command(0.5, over(10));
  for (int i = 0; i < 1000 && !is_end(rig.witness.status(rig.id)); ++i) rig.iterate();
  EXPECT_EQ(rig.witness.status(rig.id), Status::completed);
  rig.position = 0.9;
  rig.command(1.0, over(50));
  for (int i = 0; i < 1000 && !is_end(rig.witness.status(rig.id)); ++i) rig.iterate();
  const StatusChange end = rig.witness.last(rig.id);
  EXPECT_EQ(end.status, Status::interrupted);
  EXPECT_EQ(end.reason, Reason::limits);
  EXPECT_EQ(end.detail, (Limited{Limit::above_integral, 1}.packed()));
  for (int i = 0; i < 50; ++i) rig.iterate();
  EXPECT_EQ(rig.desired(1), 0.0);
  EXPECT_NEAR(rig.position, 1.0, 1e-3);
}

TEST(IntegralBounds, AVelocityThatIsKeptBrakesBeforeTheBound) {
  VelocityRig rig(kJoint, 0.0);
  rig.command(0.5);
  for (int i = 0; i < 2000; ++i) rig.iterate();
  EXPECT_EQ(rig.witness.status(rig.id), Status::completed);
  EXPECT_EQ(rig.desired(1), 0.0);
  EXPECT_NEAR(rig.position, 1.0, 1e-3);
  EXPECT_FALSE(rig.active());

  // the same velocity again is a motion again, though it is equal to the last set-point
  rig.position = 0.0;
  rig.command(0.5, direct());
  for (int i = 0; i < 200; ++i) rig.iterate();
  EXPECT_EQ(rig.desired(1), 0.5);
}

TEST(IntegralBounds, OutsideItMovesInwardOnly) {
  for (const Limits& limits : {kJoint, Limits{}}) {
    VelocityRig rig(limits, 0.0);
    rig.position = 1.2;
    rig.command(0.8, over(20));
    for (int i = 0; i < 200; ++i) {
      rig.iterate();
      EXPECT_EQ(rig.desired(1), 0.0);
    }
    EXPECT_EQ(rig.witness.status(rig.id), Status::interrupted);
    rig.command(-0.8, direct());
    rig.iterate();
    EXPECT_LT(rig.desired(1), 0.0);
    for (int i = 0; i < 200; ++i) rig.iterate();
    EXPECT_EQ(rig.desired(1), -0.8);
  }
}

TEST(IntegralBounds, OneOfThemIsEnough) {
  constexpr double kInfinity = std::numeric_limits<double>::infinity();
  for (const Limits& limits : {kJoint, Limits{.speed = 5.0}, Limits{}}) {
    VelocityRig rig(limits, 0.01, 0, 0.0, -kInfinity);
    rig.command(1.5);
    for (int i = 0; i < 500; ++i) rig.iterate();
    EXPECT_NEAR(rig.position, 1.0, 0.01);
    EXPECT_LE(rig.position, 1.0 + 1e-3);
    rig.command(-1.5, direct());
    for (int i = 0; i < 2000; ++i) rig.iterate();
    EXPECT_EQ(rig.desired(1), -1.5);
    EXPECT_LT(rig.position, -10.0);
  }
}

TEST(IntegralBounds, HoldWithoutLimitsOfTheVelocity) {
  for (const int delay : {0, 3, 10}) {
    VelocityRig rig(Limits{}, delay * VelocityRig::kPeriod, delay);
    for (int i = 0; i < 1000; ++i) {
      if (i % 10 == 0) rig.command(3.0);
      rig.iterate();
      EXPECT_LE(rig.position, 1.0 + 1e-9);
    }
    EXPECT_GT(rig.position, 0.99);
  }
}

TEST(IntegralBounds, AReadingThatIsNoNumberIsTheLastOne) {
  VelocityRig rig(kJoint, 0.0);
  rig.position = 0.99;
  rig.iterate();
  rig.command(1.0);
  for (int i = 0; i < 100; ++i) {
    rig.observe(0, std::nan(""));
    rig.step();
    EXPECT_LT(rig.desired(1), 0.4);
  }
}

// ------------------------------------------------------------------------- differences

TEST(Differences, SumToTheStates) {
  Dice dice(7);
  for (const Limits& limits :
       {Limits{}, Limits{.speed = 2.0, .acceleration = 15.0, .jerk = 500.0}}) {
    Schema robot = plain_robot(2, 2);
    for (std::uint32_t i = 0; i < 2; ++i) robot.actuator(i).limits("x1", limits);
    Rig rig(robot);
    std::vector<double> sums(4, 0.0);
    std::vector<double> speeds(4, 0.0);
    for (int i = 0; i < 3000; ++i) {
      if (dice.real(0.0, 1.0) < 0.02) {
        RecordHead head = dice.real(0.0, 1.0) < 0.5 ? direct() : over(1 + i % 70);
        if (dice.real(0.0, 1.0) < 0.5) head = overwriting(head);
        rig.add(i % 2, smoothly(head), {dice.real(-1.0, 1.0), dice.real(-1.0, 1.0)});
        rig.pulse();
      }
      rig.step();
      for (std::uint32_t n = 0; n < 4; ++n) {
        const double speed = rig.controller.difference(8 * n, 1);
        sums[n] += speed;
        EXPECT_NEAR(sums[n], rig.desired(n), 1e-12);
        if (rig.active(n / 2)) {
          EXPECT_NEAR(rig.controller.difference(8 * n, 2), speed - speeds[n], 1e-12);
        }
        speeds[n] = speed;
      }
    }
    EXPECT_FALSE(std::ranges::all_of(sums, [](double sum) { return sum == 0.0; }));
  }
}

TEST(Differences, AreZeroWithoutAMotion) {
  Rig rig(plain_robot(1));
  rig.add(0, over(10), {1.0});
  rig.pulse();
  rig.run(4);
  EXPECT_NEAR(rig.controller.difference(0, 1), 0.1, 1e-12);
  rig.run(20);
  EXPECT_EQ(rig.controller.difference(0, 1), 0.0);
  EXPECT_EQ(rig.controller.difference(0, 2), 0.0);
  EXPECT_EQ(rig.controller.difference(4, 1), 0.0);
}

}  // namespace
}  // namespace o80::test
