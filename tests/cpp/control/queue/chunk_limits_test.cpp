// Chunks under limits: within them, and at their last row in the end.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "cases.hpp"
#include "control/chunk_rig.hpp"

namespace o80::test {
namespace {

TEST(ChunkLimits, AFirstAnswerThatComesLateDoesNotThrowTheArm) {
  for (const std::uint32_t first : {0U, 8U}) {
    ChunkRig rig;
    std::vector<double> rows;
    for (int i = 1; i <= 40; ++i) rows.push_back(0.2 * (1.0 - std::cos(std::numbers::pi * i / 40)));
    rig.run_to(351);
    rig.chunk(rows, every(10, 40), {.anchor = 1, .ease = 50, .first = first});
    rig.run_to(800);
    double fastest = 0.0;
    for (Iteration i = 352; i < 800; ++i) {
      fastest = std::max(fastest, std::abs(rig.at(i) - rig.at(i - 1)));
    }
    EXPECT_LE(fastest, 1.2 * 0.2 * std::numbers::pi / 400) << first;
    EXPECT_DOUBLE_EQ(rig.at(799), 0.4);
  }
}

TEST(ChunkLimits, ALowJerkLimitDoesNotLeadAstray) {
  // a sine within the limits, a new chunk every 0.1 s: it is followed as its plan is
  ChunkRig rig(limited_robot(limits_of(5.0, 20.0, 100.0)));
  const auto sine = [](double t) { return 0.5 * std::sin(2.0 * t); };
  std::vector<std::uint32_t> due = every(20, 50);
  double worst = 0.0;
  for (Iteration now = 1; now < 30'000; now += 100) {
    rig.run_to(now);
    const Iteration anchor = std::max<Iteration>(0, now - 1);
    std::vector<double> rows;
    for (const std::uint32_t each : due)
      rows.push_back(sine(1e-3 * static_cast<double>(anchor + each)));
    rig.chunk(rows, due, {.anchor = anchor, .ease = 100});
    if (now < 3000) continue;
    for (Iteration i = now - 100; i < now; ++i) {
      worst = std::max(worst, std::abs(rig.at(i) - sine(1e-3 * static_cast<double>(i))));
    }
  }
  EXPECT_LT(worst, 0.025);
}

TEST(ChunkLimits, ASampledMotionWithinTheLimitsIsNotClamped) {
  const auto sine = [](Iteration i) {
    return 0.4 * std::sin(std::numbers::pi * 1e-3 * static_cast<double>(i));
  };
  for (const std::uint32_t step : {5U, 10U, 25U, 40U}) {
    ChunkRig rig(limited_robot(limits_of(5.0, 10.0, 200.0)));
    const std::vector<std::uint32_t> due = every(step, 1000 / step);
    for (Iteration anchor = 0; anchor < 8000; anchor += 200) {
      std::vector<double> rows;
      for (const std::uint32_t each : due) rows.push_back(sine(anchor + each));
      rig.chunk(rows, due, {.anchor = anchor});
      while (rig.next <= anchor + 200) {
        rig.run_to(rig.next + 1);
        ASSERT_FALSE(rig.clamped() && anchor > 1000) << step << ' ' << rig.next;
      }
    }
  }
}

TEST(ChunkLimits, RowsWithinBoundsWithATakeOverOutsideAreClampedAndReached) {
  ChunkRig rig(limited_robot({.minimum = 0.0, .maximum = 0.505}));
  rig.reach(101, 0.5, 0.0009);
  rig.add(0, overwriting(over(3)), {0.505});
  rig.pulse();
  rig.run_to(103);
  rig.chunk({0.503, 0.3}, every(10, 2), {.anchor = 102, .ease = 10});
  bool clamped = false;
  while (rig.next < 125) {
    rig.run_to(rig.next + 1);
    clamped = clamped || rig.clamped();
    EXPECT_LE(rig.desired(), 0.505);
  }
  EXPECT_TRUE(clamped);
  EXPECT_EQ(rig.at(112), 0.503);
  EXPECT_EQ(rig.at(122), 0.3);
}

/// How far a motion goes past the rows of a chunk that it takes over to, a distance away.
struct TakenOver {
  double past = 0.0;
  BegunChunk begun;
};
TakenOver take_over(double distance, std::uint32_t ease) {
  ChunkRig rig(limited_robot(limits_of(5.0, 20.0, 2000.0)));
  rig.run_to(100);
  const CommandId id =
      rig.chunk(std::vector<double>(60, distance), every(10, 60), {.anchor = 99, .ease = ease});
  TakenOver found;
  while (rig.next < 2000) {
    rig.run_to(rig.next + 1);
    found.past = std::max(found.past, rig.desired() - distance);
  }
  EXPECT_EQ(rig.desired(), distance);
  const StatusChange told = rig.witness.last(id - 1);
  found.begun = BegunChunk::of(told.detail, told.late).value();
  return found;
}

// rule K7
TEST(ChunkLimits, ATakeOverTakesTheTimeThatLimitsNeed) {
  for (const double distance : {0.001, 0.02, 0.1, 0.25}) {
    const auto [past, begun] = take_over(distance, 0);
    EXPECT_LE(past, 1e-12) << distance;
    EXPECT_EQ(begun.needed, 0) << distance;
    const double fewest =
        std::max(std::sqrt(5.8 * distance / 20e-6), std::cbrt(60.0 * distance / 2e-6));
    const double first = std::ceil(std::max(10.0, fewest) / 10.0) - 1.0;  // rows are due every 10
    EXPECT_EQ(begun.row, first) << distance;
  }
  // one that is too short is told, with the time that it would need; as much as there is, at most
  const auto [past, begun] = take_over(0.1, 1);
  EXPECT_GE(begun.needed, 170);
  EXPECT_LE(begun.needed, 171);
  EXPECT_LE(past, 1e-12);
  EXPECT_GT(take_over(1.5, 0).begun.needed, 400);
  EXPECT_EQ(take_over(1.5, 0).begun.row, 29U);
}

/// Random chunks under random limits: all differences within them, all ends at the last row.
// rule K10
TEST(ChunkLimits, RandomScriptsStayWithinLimitsAndEndAtTheirLastRow) {
  for (unsigned seed = 0; seed < cases(60U); ++seed) {
    Dice dice(seed);
    const double speed = dice.magnitude(0.1, 10.0);
    const double acceleration = dice.magnitude(1.0, 100.0);
    const double jerk = seed % 2 == 0 ? dice.magnitude(10.0, 10'000.0) : kNoLimit;
    ChunkRig rig(limited_robot(limits_of(speed, acceleration, jerk)));
    ChunkScript script(seed);
    script.run(rig, 1500);
    rig.run_to(rig.next + 12'000);
    const double v = speed * 1e-3 * (1 + 1e-6) + 1e-14;
    const double a = acceleration * 1e-6 * (1 + 1e-6) + 1e-14;
    const double j = std::isfinite(jerk) ? jerk * 1e-9 * (1 + 1e-6) + 1e-13 : 2 * a;
    double before = 0.0;
    double change = 0.0;
    for (Iteration i = 1; i < rig.next; ++i) {
      const double now = rig.at(i) - (i == 1 ? 0.0 : rig.at(i - 1));
      ASSERT_LE(std::abs(now), v) << seed << " at " << i;
      ASSERT_LE(std::abs(now - before), a) << seed << " at " << i;
      ASSERT_LE(std::abs(now - before - change), j) << seed << " at " << i;
      change = now - before;
      before = now;
    }
    const ChunkScript::Sent* last = nullptr;
    for (const ChunkScript::Sent& sent : script.all) {
      const StatusChange end = rig.witness.last(sent.id);
      ASSERT_EQ(rig.witness.ends_of(sent.id), 1U);
      if (end.status != Status::completed) continue;
      ASSERT_EQ(rig.at(end.iteration), sent.rows.back()) << seed;
      last = &sent;
    }
    if (last == &script.all.back()) {
      EXPECT_EQ(rig.desired(), last->rows.back());
    }
    EXPECT_TRUE(rig.all_blocks_back()) << seed;
  }
}

}  // namespace
}  // namespace o80::test
