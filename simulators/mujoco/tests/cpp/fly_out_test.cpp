// Flights to the next bounce within one iteration: the same as in ordinary iterations.

#include "balls/fly_out.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "scenes.hpp"

namespace o80::mujoco {
namespace {

using testing::HasSubstr;

/// A robot whose ball has just left the paddle, or has begun to fly from anywhere.
struct Flying {
  explicit Flying(const OptionValues& more = {}) : robot(court(more)) {}

  void throw_at_the_paddle() {
    const Shot shot = shot_at_the_paddle(robot);
    for (int i = 0; i < 60; ++i) robot.ask("ball", shot.at(i));
    while (robot.burst(1).paddle().count == 0) {
    }
  }
  void throw_from(const Shot& shot) {
    robot.request(Reset{});
    robot.burst(1);
    pose_arm(robot, kPosture);
    robot.ask("ball", shot.at(0));
    robot.burst(2);
  }
  Seen fly_out(const FlyOut& request) {
    robot.request(request);
    return robot.burst(1);
  }

  Inline robot;
};

struct Bounced {
  SurfaceContacts bench, fence, ground;

  explicit Bounced(const Seen& seen)
      : bench(seen.contacts<SurfaceContacts>("bench", 0)),
        fence(seen.contacts<SurfaceContacts>("fence", 0)),
        ground(seen.contacts<SurfaceContacts>("ground", 0)) {}
  bool any() const { return bench.count + fence.count + ground.count > 0; }
};

template <class T>
std::vector<std::byte> bytes_of(const T& value) {
  std::vector<std::byte> bytes(sizeof(T));
  pack(value, bytes.data());
  return bytes;
}

void expect_same_ball(const Seen& one, const Seen& other) {
  EXPECT_TRUE(bytes_of(one.observed<BallState>(4)) == bytes_of(other.observed<BallState>(4)));
  // before a contact the smallest distance is that of the flight, which a moving surface is not in
  if (one.paddle().count > 0 || other.paddle().count > 0) {
    EXPECT_TRUE(bytes_of(one.paddle()) == bytes_of(other.paddle()));
  }
  const Bounced a(one), b(other);
  EXPECT_TRUE(bytes_of(a.bench) == bytes_of(b.bench));
  EXPECT_TRUE(bytes_of(a.fence) == bytes_of(b.fence));
  EXPECT_TRUE(bytes_of(a.ground) == bytes_of(b.ground));
}

using FlyOutTest = SceneTest;

TEST_F(FlyOutTest, EndsAsOrdinaryIterationsDoBitForBit) {
  std::mt19937 random(1);
  std::uniform_real_distribution<double> share(-1, 1);
  int met[3] = {0, 0, 0};
  for (const char* steps : {"1", "3"}) {
    const OptionValues options{{"steps", steps},
                               {"timestep", steps[0] == '1' ? "0.002" : "0.000666666667"}};
    Flying all_at_once(options), ordinary(options);
    for (int n = 0; n < 60; ++n) {
      const Shot shot{{0.4 + 0.9 * share(random), 2.0, 0.8 + 0.2 * share(random)},
                      {share(random), -2.5 + 2.5 * share(random), share(random)},
                      {60 * share(random), 20 * share(random), 20 * share(random)}};
      const std::uint32_t every = n % 2 == 0 ? 1 : 5;
      all_at_once.throw_from(shot);
      ordinary.throw_from(shot);

      const Seen flown = all_at_once.fly_out({.every = every});
      Seen seen = ordinary.robot.burst(every);
      while (!Bounced(seen).any()) seen = ordinary.robot.burst(every);
      expect_same_ball(flown, seen);
      const Bounced bounced(flown);
      met[0] += bounced.bench.count > 0;
      met[1] += bounced.fence.count > 0;
      met[2] += bounced.ground.count > 0;
    }
  }
  for (const int times : met) EXPECT_GT(times, 5);
}

TEST_F(FlyOutTest, KeepsTheRecordOfTheWatchedSurfaceAndGoesOnFromThere) {
  Flying all_at_once, ordinary;
  for (Flying* each : {&all_at_once, &ordinary}) each->throw_at_the_paddle();

  Seen flown = all_at_once.fly_out({.every = 5});
  Seen seen = ordinary.robot.burst(5);
  while (!Bounced(seen).any()) seen = ordinary.robot.burst(5);
  EXPECT_EQ(flown.paddle().count, 1);
  expect_same_ball(flown, seen);

  flown = all_at_once.robot.burst(50);
  seen = ordinary.robot.burst(50);
  EXPECT_EQ(flown.observed<BallState>(4).position, seen.observed<BallState>(4).position);
}

TEST_F(FlyOutTest, EndsOutsideABoxOrAfterTheMostIterations) {
  const Shot shot{{0.4, 2.0, 1.2}, {0, 3, 2}};
  Flying flying, slow;
  for (Flying* each : {&flying, &slow}) each->throw_from(shot);
  const Seen outside = flying.fly_out({.every = 5, .high = {9, 2.5, 9}});
  EXPECT_GT(outside.observed<BallState>(4).position[1], 2.5);
  EXPECT_LT(outside.observed<BallState>(4).position[1], 2.54);
  EXPECT_FALSE(Bounced(outside).any());
  EXPECT_EQ(bytes_of(slow.fly_out({.most = 20}).observed<BallState>(4)),
            bytes_of([&] {
              Flying other;
              other.throw_from(shot);
              return other.robot.burst(20);
            }()
                         .observed<BallState>(4)));
}

TEST_F(FlyOutTest, LeavesTheOtherBallsAndTheClockAlone) {
  Inline robot(court({{"extra_balls", "1"}})), ordinary(court({{"extra_balls", "1"}}));
  for (Inline* each : {&robot, &ordinary}) pose_arm(*each, kPosture);
  robot.burst(3);
  ordinary.burst(3);
  robot.request(FlyOut{.ball = 2});
  const Seen flown = robot.burst(1), seen = ordinary.burst(1);

  EXPECT_EQ(bytes_of(flown.observed<BallState>(4)), bytes_of(seen.observed<BallState>(4)));
  EXPECT_EQ(flown.extended<std::int64_t>("clock"), seen.extended<std::int64_t>("clock"));
  EXPECT_EQ(flown.bench(1).count, 1);
}

TEST_F(FlyOutTest, IsPartOfASnapshotTakenBeforeItsIteration) {
  Flying flying;
  flying.throw_from({{0.4, 2.0, 1.2}, {0, -1, 0}});
  flying.robot.request(FlyOut{});
  flying.robot.request(Snapshot{});
  const Seen once = flying.robot.burst(1);
  flying.robot.burst(10);
  flying.robot.request(Restore{});
  flying.robot.burst(1);  // a restore shows its state in a row of its own
  EXPECT_EQ(bytes_of(flying.robot.latest().observed<BallState>(4)),
            bytes_of(once.observed<BallState>(4)));
}

TEST_F(FlyOutTest, IsRefusedForABallThatIsNotThereOrIsCommanded) {
  Flying flying;
  const auto answer = [&](const FlyOut& request) {
    flying.robot.request(request);
    Batch batch = flying.robot.frontend.pulse();
    flying.robot.burst(1);
    return std::string(batch.handle(0).text);
  };
  EXPECT_THAT(answer({.ball = 0}), HasSubstr("ball must be from 1 to 1, got 0"));
  EXPECT_THAT(answer({.ball = 2}), HasSubstr("ball must be from 1 to 1, got 2"));
  EXPECT_THAT(answer({.every = 0}), HasSubstr("every must be at least 1, got 0"));
  EXPECT_THAT(answer({.most = 100'001}), HasSubstr("most from 1 to 100000, got 100001"));
  for (int i = 0; i < 9; ++i) flying.robot.ask("ball", Shot{{0.4, 2, 1}, {0, 1, 0}}.at(i));
  flying.robot.burst(2);
  EXPECT_THAT(answer({}), HasSubstr("a command moved ball 1 in the last iteration: wait for its"));

  Inline without(pendulum());
  without.request(FlyOut{});
  Batch batch = without.frontend.pulse();
  without.burst(1);
  EXPECT_THAT(std::string(batch.handle(0).text), HasSubstr("this simulation has no balls"));
}

}  // namespace
}  // namespace o80::mujoco
