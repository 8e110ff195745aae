// Trajectories: rows that are played as those of a chunk, when their queue reaches them.
#include <gtest/gtest.h>

#include <array>
#include <cmath>

#include "control/chunk_rig.hpp"

namespace o80::test {
namespace {

/// A trajectory is a chunk that is anchored where its queue reaches it.
// rule K15
TEST(Trajectory, ItsRowsArePlayedAsThoseOfAChunk) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    Dice dice(seed);
    const auto place = [&] { return dice.real(-1.0, 1.0); };
    const bool limited = seed % 3 == 1;
    const auto robot = [&] {
      return limited ? limited_robot(limits_of(5.0, 40.0, 2000.0)) : plain_robot(1);
    };
    const auto profile =
        std::array{Profile::smooth, Profile::monotone, Profile::linear, Profile::hold}[seed % 4];
    // under limits the span of 16 rows is known in the first iteration
    const auto rows = static_cast<std::uint32_t>(dice.whole(1, limited ? 16 : 30));
    if (profile == Profile::linear && rows == 1) continue;  // a command
    std::vector<double> targets;
    for (std::uint32_t i = 0; i < rows; ++i)
      targets.push_back(i > 0 && dice.one_in(5) ? targets.back() : place());
    const std::int64_t each = dice.whole(1, 25);
    std::vector<std::uint32_t> due = every(static_cast<std::uint32_t>(each), rows);
    std::vector<std::int64_t> times;
    const bool is_timed = rows > 1 && dice.one_in(2);
    for (std::uint32_t i = 0; is_timed && i < rows; ++i) {
      due[i] = (i == 0 ? 0 : due[i - 1]) + static_cast<std::uint32_t>(dice.whole(1, 30));
      // rounded halves up
      times.push_back(due[i] * kMillisecond + dice.whole(-kMillisecond / 2, kMillisecond / 2 - 1));
    }
    // behind a motion that goes on, or one that has ended
    const Iteration start = 60;
    const std::int64_t before = dice.whole(20, 80);
    const double to = place();
    ChunkRig trajectory(robot());
    ChunkRig chunk(robot());
    for (ChunkRig* rig : {&trajectory, &chunk}) {
      rig->run_to(10);
      rig->add(0, over(before), {to});
      rig->pulse();
      rig->run_to(start);
    }
    RecordHead head = overwriting(is_timed ? paced(Pace::duration, 0) : over(each));
    head.profile = profile;
    trajectory.add_rows(0, head, rows, targets, times);
    const CommandId id = record_id(trajectory.pulse(), 0);
    chunk.chunk(targets, due, {.anchor = start - 1, .ease = 1, .fixed = 1}, profile);
    const Iteration last = start + due.back() + 3000;
    trajectory.run_to(last);
    chunk.run_to(last);
    for (Iteration i = start; i < last; ++i)
      ASSERT_EQ(trajectory.at(i), chunk.at(i)) << seed << ' ' << i;
    EXPECT_EQ(trajectory.witness.last(id).status, Status::completed) << seed;
    EXPECT_EQ(trajectory.desired(), targets.back()) << seed;
    for (std::uint32_t i = 0; i < rows && !limited; ++i) {
      EXPECT_EQ(trajectory.at(start - 1 + due[i]), targets[i]) << seed;
    }
    EXPECT_TRUE(trajectory.all_blocks_back());
  }
}

/// Without limits rows jump to the observed state, which is no speed for the command after them.
TEST(Trajectory, AJumpToTheObservedStateIsNoSpeed) {
  ChunkRig rig(plain_robot(1));
  rig.run_to(10);
  rig.observe(0, 100.0);
  RecordHead rows = from_observed(over(7));
  rows.profile = Profile::monotone;
  rig.add_rows(0, rows, 1, {0.0});
  rig.pulse();
  rig.run_to(11);
  rig.add(0, overwriting(smoothly(at_speed(2000.0))), {0.0});
  rig.pulse();
  rig.run_to(12);
  // the motion that it overwrites goes by 5.5 in its first iteration, and by 12 at its fastest
  EXPECT_NEAR(rig.at(10), 94.5, 0.1);
  EXPECT_GT(rig.at(11), rig.at(10) - 20.0);
}

// rule K9
TEST(Trajectory, ACurveThroughAParabolaHasItsSlopes) {
  // the slope of both at three points is that of their parabola
  for (const Profile profile : {Profile::smooth, Profile::monotone}) {
    ChunkRig rig;
    rig.run_to(100);
    std::vector<double> targets;
    const auto parabola = [](double t) { return 1e-4 * t * t; };
    for (int i = 1; i <= 10; ++i) targets.push_back(parabola(10.0 * i));
    rig.add_rows(
        0,
        [&] {
          RecordHead head = over(10);
          head.profile = profile;
          return head;
        }(),
        10, targets);
    rig.pulse();
    rig.run_to(230);
    for (Iteration t = 20; t <= 90; ++t) {
      EXPECT_NEAR(rig.at(99 + t), parabola(static_cast<double>(t)), 1e-12) << t;
    }
    EXPECT_EQ(rig.at(199), targets.back());
    EXPECT_EQ(rig.at(229), targets.back());
  }
}

/// Rows due at one time take an iteration each: what follows at once makes up for them.
TEST(Trajectory, OnlyWhatFollowsAtOnceMakesUpForTheRoundingOfItsTimes) {
  for (const Iteration sent : {Iteration{3}, Iteration{20}}) {
    ChunkRig rig(limited_robot(limits_of(1.0, kNoLimit, kNoLimit)));
    RecordHead head = paced(Pace::duration, 0);
    head.profile = Profile::linear;
    const std::int64_t time = kMillisecond / 2;
    rig.add_rows(0, head, 4, {1.0, 1.0, 1.0, 1.0}, {time, time, time, time});
    rig.pulse();
    rig.run_to(sent);
    rig.add(0, during(10 * kMillisecond), {rig.desired()});
    const CommandId id = record_id(rig.pulse(), 0);
    rig.run_to(60);
    EXPECT_EQ(rig.witness.last(id).iteration, sent == 3 ? 11 : sent + 9);
  }
}

/// Any rows and profiles, as far apart as a double allows, one motion taking over from another.
TEST(Trajectory, HugeRowsStayFinite) {
  constexpr std::array kValues{-1.7e308, 1.7e308, 0.0, 1e-300};
  for (unsigned seed = 0; seed < 1000; ++seed) {
    Dice dice(seed);
    const auto pick = [&](std::int64_t below) {
      return static_cast<std::size_t>(dice.whole(0, below - 1));
    };
    Rig rig(seed % 4 == 0 ? limited_robot(limits_of(5.0, 40.0, 2000.0)) : plain_robot(1));
    for (int i = 0; i < 4; ++i) {
      constexpr std::array kProfiles{Profile::smooth, Profile::monotone, Profile::linear,
                                     Profile::hold, Profile::minimum_jerk};
      RecordHead head = over(dice.whole(1, 5));
      head.profile = kProfiles[pick(5)];
      if (!dice.one_in(3)) head = overwriting(head);
      std::vector<double> rows(1 + pick(9));
      for (double& row : rows) row = kValues[pick(4)];
      rig.add_rows(0, head, static_cast<std::uint32_t>(rows.size()), rows);
      rig.pulse();
      for (std::size_t n = 1 + pick(30); n > 0; --n) {
        rig.step();
        ASSERT_TRUE(std::isfinite(rig.desired())) << seed;
      }
    }
  }
}

}  // namespace
}  // namespace o80::test
