// Properties of the controller that hold for whatever it is asked, tried on thousands of random
// queues of several lanes; the seeds are fixed, so that a failure comes again.
#include <gtest/gtest.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <map>
#include <random>

#include "control/rig.hpp"

namespace o80::test {
namespace {

class Dice {
 public:
  explicit Dice(std::uint64_t seed) : random_(seed) {}
  std::int64_t whole(std::int64_t low, std::int64_t high) {
    return std::uniform_int_distribution<std::int64_t>(low, high)(random_);
  }
  double real(double low, double high) {
    return std::uniform_real_distribution<double>(low, high)(random_);
  }
  bool one_in(std::int64_t n) { return whole(1, n) == 1; }

 private:
  std::mt19937_64 random_;
};

RecordHead any_pace(Dice& dice, Iteration now) {
  RecordHead head;
  switch (dice.whole(0, 4)) {
    case 0:
      head = direct();
      break;
    case 1:
      head = over(dice.whole(0, 12));
      break;
    case 2:
      head = during(dice.whole(0, 9 * kMillisecond));
      break;
    case 3:
      head = at_speed(dice.real(50.0, 5000.0));
      break;
    default:
      head = until(now + dice.whole(-3, 30));
  }
  if (dice.one_in(2)) head = smoothly(head);
  if (dice.one_in(6)) head = from_observed(head);
  return head;
}

struct Sent {
  std::uint32_t lane;
  CommandId id;
  bool batch;
};

TEST(ControllerProperty, EveryRecordEndsExactlyOnceAndEveryBlockComesBack) {
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    Dice dice(seed);
    Schema schema = plain_robot(3, 2);
    if (dice.one_in(2))
      schema.actuator(0).limits({.minimum = -5.0, .maximum = 5.0, .speed = 900.0});
    if (dice.one_in(2)) schema.actuator(1).when_idle(WhenIdle::follow);
    schema.add_request("nothing", kNoType, "no payload");
    Rig rig(schema);
    std::vector<Sent> sent;
    std::map<std::uint32_t, std::uint64_t> blocks;

    for (int round = 0; round < 60; ++round) {
      const auto lane = static_cast<std::uint32_t>(dice.whole(0, 3));
      const std::int64_t records = dice.whole(0, 8);
      for (std::int64_t i = 0; i < records; ++i) {
        const auto actuator = static_cast<std::uint16_t>(dice.whole(0, 2));
        RecordHead head = any_pace(dice, rig.next);
        if (dice.one_in(5)) head = overwriting(head);
        if (dice.one_in(12)) {
          dice.one_in(2) ? rig.batch.purge(dice.one_in(2) ? actuator : kEveryActuator)
                         : rig.batch.purge_own(actuator);
        } else if (dice.one_in(20)) {
          rig.batch.request(0, {});
        } else if (head.pace != Pace::until && dice.one_in(4)) {
          const auto rows = static_cast<std::uint32_t>(dice.whole(1, 9));
          std::vector<double> targets(2 * rows);
          for (double& target : targets) target = dice.real(-9.0, 9.0);
          std::vector<std::int64_t> times;
          if (head.pace == Pace::duration && rows > 1) {
            for (std::uint32_t row = 0; row < rows; ++row) {
              times.push_back((row == 0 ? 0 : times.back()) + dice.whole(0, 4 * kMillisecond));
            }
          }
          std::vector<std::uint64_t> mask;
          if (dice.one_in(3)) mask.push_back(static_cast<std::uint64_t>(dice.whole(0, 3)));
          rig.add_rows(actuator, head, rows, targets, times, mask);
        } else {
          rig.add(actuator, head, {dice.real(-9.0, 9.0), dice.real(-9.0, 9.0)});
        }
      }
      const std::uint32_t count = rig.batch.records();
      blocks[lane] += rig.batch.blocks();
      rig.fresh_start = dice.one_in(3);
      const BlockIndex batch = rig.send(lane);
      for (std::uint32_t i = 0; i <= count + 1; ++i) sent.push_back({lane, rig.sent + i, i == 0});
      if (dice.one_in(3)) rig.check(lane, batch, 3);
      if (dice.one_in(10)) {
        rig.controller.reject(lane, batch, Reason::late, 0, rig.next);
      } else {
        rig.controller.take(lane, batch, rig);
      }
      if (dice.one_in(15)) rig.controller.interrupt(1, rig.next - 1);
      if (dice.one_in(15)) rig.controller.purge_lane(lane, kEveryActuator, rig.next);
      for (std::int64_t i = dice.whole(0, 6); i > 0; --i) {
        for (std::uint32_t number = 0; number < 6; ++number) {
          rig.observe(8 * number, rig.desired(number) + dice.real(-0.1, 0.1));
        }
        rig.step();
      }
    }
    for (int i = 0; i < 4000 && (rig.controller.active() || rig.controller.pending()); ++i) {
      rig.step();
    }

    std::map<std::pair<std::uint32_t, CommandId>, std::vector<Status>> told;
    for (const StatusChange& change : rig.witness.changes) {
      told[{change.lane, change.id}].push_back(change.status);
    }
    ASSERT_EQ(told.size(), sent.size()) << "nothing is told of what was never sent, seed " << seed;
    for (const Sent& one : sent) {
      const auto& statuses = told[{one.lane, one.id}];
      if (one.batch) {
        ASSERT_EQ(statuses.size(), 1U) << seed;
        continue;
      }
      ASSERT_EQ(std::count_if(statuses.begin(), statuses.end(), is_end), 1) << seed;
      ASSERT_TRUE(is_end(statuses.back())) << seed;
      ASSERT_LE(statuses.size(), 2U) << seed;
      ASSERT_TRUE(statuses.size() == 1 || statuses[0] == Status::active) << seed;
    }
    ASSERT_TRUE(rig.all_blocks_back()) << seed;
    for (const auto& [lane, count] : blocks)
      ASSERT_EQ(rig.witness.freed_blocks[lane], count) << seed;
  }
}

TEST(ControllerProperty, AQueueHasNoIdleIterationAndEachTargetIsHitBitForBit) {
  for (std::uint64_t seed = 0; seed < 1500; ++seed) {
    Dice dice(seed);
    Rig rig(plain_robot(1, 2));
    std::vector<std::vector<double>> targets;
    const std::int64_t commands = dice.whole(1, 25);
    for (std::int64_t i = 0; i < commands; ++i) {
      RecordHead head = any_pace(dice, rig.next);
      if (head.pace == Pace::until) head = over(3);
      targets.push_back({dice.real(-9.0, 9.0), dice.real(-1e9, 1e9)});
      rig.add(0, head, targets.back());
    }
    const CommandId batch = rig.pulse();
    Iteration expected = 1;
    for (std::size_t i = 0; i < targets.size(); ++i) {
      const CommandId id = batch + 2 + i;
      do {
        rig.step();
        ASSERT_TRUE(rig.active()) << "no idle iteration, seed " << seed;
      } while (!is_end(rig.witness.changes.back().status) ||
               (rig.witness.changes.back().id != id && rig.witness.changes.back().id != batch + 1));
      const auto changes = rig.witness.of(id);
      ASSERT_EQ(changes.size(), 2U);
      ASSERT_EQ(changes[0].iteration, expected);
      expected = changes[1].iteration + 1;
      ASSERT_EQ(changes[1].status, Status::completed);
      for (std::uint32_t number = 0; number < 2; ++number) {
        ASSERT_EQ(std::bit_cast<std::uint64_t>(rig.desired(number)),
                  std::bit_cast<std::uint64_t>(targets[i][number]))
            << seed;
      }
    }
    rig.step();
    ASSERT_FALSE(rig.active());
  }
}

TEST(ControllerProperty, ALinearMotionNeverLeavesTheSpanOfItsEndsNorTurnsBack) {
  for (std::uint64_t seed = 0; seed < 4000; ++seed) {
    Dice dice(seed);
    Rig rig(plain_robot(1), 8);
    const double from = dice.real(-1.0, 1.0) * std::pow(10.0, dice.real(-300.0, 300.0));
    const double to =
        dice.one_in(4) ? from : dice.real(-1.0, 1.0) * std::pow(10.0, dice.real(-300.0, 300.0));
    rig.observe(0, from);
    rig.controller.restart(rig.observed.data(), nullptr, 0);
    const std::int64_t n = dice.whole(1, 40);
    rig.add(0, dice.one_in(2) ? over(n) : smoothly(over(n)), {to});
    rig.pulse();
    double before = from;
    for (std::int64_t i = 0; i < n; ++i) {
      rig.step();
      const double value = rig.desired();
      ASSERT_GE(value, std::min(from, to));
      ASSERT_LE(value, std::max(from, to));
      // monotone, but for the last bits
      const double slack = 1e-15 * std::max(std::abs(from), std::abs(to));
      ASSERT_TRUE(from <= to ? value >= before - slack : value <= before + slack);
      before = value;
    }
    ASSERT_EQ(rig.desired(), to);
  }
}

/// Largest third difference of rows.
double roughness(const std::vector<double>& rows) {
  double found = 0.0;
  for (std::size_t i = 3; i < rows.size(); ++i) {
    found = std::max(found, std::abs(rows[i] - 3.0 * (rows[i - 1] - rows[i - 2]) - rows[i - 3]));
  }
  return found;
}

// without limits of acceleration a motion that would leave its span stops first, in half of its
// time, a quarter, ... or at once; its velocity is continuous unless it stops at once
TEST(ControllerProperty, MinimumJerkContinuesItsVelocity) {
  int smooth = 0;
  for (std::uint64_t seed = 0; seed < 500; ++seed) {
    Dice dice(seed);
    Rig rig(plain_robot(1));
    std::vector<double> rows(3, 0.0);
    const std::int64_t n = dice.whole(400, 800);
    rig.add(0, smoothly(over(n)), {1.0});
    rig.pulse();
    const auto before = rig.run(static_cast<int>(dice.whole(1, n - 1)));
    rig.add(0, overwriting(smoothly(over(dice.whole(400, 800)))), {dice.real(-1.0, 1.0)});
    rig.pulse();
    rows.insert(rows.end(), before.begin(), before.end());
    const auto after = rig.run(900);
    rows.insert(rows.end(), after.begin(), after.end());
    ASSERT_LE(*std::max_element(rows.begin(), rows.end()), 1.0 + 1e-12) << "the former target";
    // 60 / 400^3 from rest; a stop in an eighth of the time makes it some hundred times that
    smooth += roughness(rows) < 3e-4 ? 1 : 0;
  }
  EXPECT_GT(smooth, 400);
}

TEST(ControllerProperty, ASpeedIsNeverExceeded) {
  for (std::uint64_t seed = 0; seed < 2000; ++seed) {
    Dice dice(seed);
    Rig rig(plain_robot(1));
    const double speed = std::pow(10.0, dice.real(0.0, 5.0));
    const double distance = dice.real(-100.0, 100.0);
    const bool smooth = dice.one_in(2);
    rig.add(0, smooth ? smoothly(at_speed(speed)) : at_speed(speed), {distance});
    const CommandId batch = rig.pulse();
    double before = 0.0;
    double peak = 0.0;
    for (int i = 0; i < 200'000 && rig.controller.active(); ++i) {
      rig.step();
      peak = std::max(peak, std::abs(rig.desired() - before));
      before = rig.desired();
    }
    ASSERT_LE(peak, speed * 1e-3 * (1.0 + 1e-9) + 1e-13) << seed;
    const auto n = static_cast<double>(rig.witness.last(batch + 2).iteration);
    const double needed = (smooth ? 1.875 : 1.0) * std::abs(distance) / (speed * 1e-3);
    ASSERT_LT(n, std::max(2.0, needed + 1.0 + 1e-6)) << "no longer than it must, seed " << seed;
  }
}

}  // namespace
}  // namespace o80::test
