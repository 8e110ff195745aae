// Chunks: rows of targets, each due in an iteration (docs/chunks.md).
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <random>

#include "control/rig.hpp"

namespace o80::test {
namespace {

/// The worked examples: rows due in 110, 120, 130, 140, 150.
const std::vector<double> kRows{0.0, 0.1, 0.3, 0.3, 0.2};
constexpr double kDigits = 5e-7;
constexpr double kNoLimit = std::numeric_limits<double>::infinity();

std::vector<std::uint32_t> every(std::uint32_t step, std::size_t rows) {
  std::vector<std::uint32_t> due;
  for (std::uint32_t i = 1; i <= rows; ++i) due.push_back(i * step);
  return due;
}

/// A robot that runs to an iteration, takes a chunk there, and shows what came of it.
class ChunkRig : public Rig {
 public:
  using Rig::Rig;
  explicit ChunkRig() : Rig(plain_robot(1)) {}

  void run_to(Iteration iteration) {
    while (next < iteration) {
      step();
      rows.resize(static_cast<std::size_t>(next), std::nan(""));
      rows.back() = desired();
    }
  }
  /// Desired in an iteration that was run by run_to().
  double at(Iteration iteration) const { return rows[static_cast<std::size_t>(iteration)]; }
  /// Moves so that the iteration before `now` is at this place, with this speed [1/iteration].
  void reach(Iteration now, double place, double speed) {
    run_to(now - 6);
    if (speed == 0.0) {
      add(0, over(1), {place});
    } else {
      add(0, over(1), {place - 5 * speed});
      pulse();
      step();
      add(0, over(1000), {place + 995 * speed});
    }
    pulse();
    run_to(now);
  }
  /// Sends a chunk for the actuators, each with the same rows; returns the id of its record.
  CommandId chunk(const std::vector<double>& values, const std::vector<std::uint32_t>& due,
                  const ChunkHead& head, Profile profile = Profile::cubic,
                  const std::vector<std::uint32_t>& actuators = {0}, std::uint32_t lane = 0) {
    const std::uint32_t place = add_chunk(values, due, head, profile, actuators);
    return record_id(pulse(lane), place);
  }
  /// Adds it to the batch; returns its place there.
  std::uint32_t add_chunk(const std::vector<double>& values, const std::vector<std::uint32_t>& due,
                          const ChunkHead& head, Profile profile,
                          const std::vector<std::uint32_t>& actuators) {
    const auto bytes = bytes_of(values);
    std::vector<BatchBuilder::Member> members;
    std::vector<const StateLayout*> layouts;
    for (const std::uint32_t actuator : actuators) {
      RecordHead of;
      of.actuator = static_cast<std::uint16_t>(actuator);
      of.profile = profile;
      members.push_back({of, {}, bytes});
      layouts.push_back(&layout);
    }
    return batch.chunk(members, head, due, layouts);
  }
  /// One of the worked examples.
  CommandId example(ChunkHead head, Profile profile = Profile::cubic) {
    if (head.anchor == 0) head.anchor = 100;
    return chunk(kRows, every(10, kRows.size()), head, profile);
  }

  std::vector<double> rows;
  StateLayout layout{schema, schema.actuators[0].type};
};

TEST(Chunk, FromRestItReachesEachRowInItsIteration) {
  ChunkRig rig;
  rig.run_to(101);
  const CommandId id = rig.example({.ease = 10});
  rig.run_to(160);
  const std::vector<std::pair<Iteration, double>> wanted{
      {110, 0.0}, {115, 0.03125}, {120, 0.1},  {125, 0.21875}, {130, 0.3},
      {135, 0.3}, {140, 0.3},     {145, 0.25}, {150, 0.2},     {155, 0.2}};
  for (const auto& [iteration, value] : wanted) EXPECT_NEAR(rig.at(iteration), value, 1e-12);
  for (std::size_t i = 0; i < kRows.size(); ++i) {
    EXPECT_EQ(rig.at(110 + 10 * static_cast<Iteration>(i)), kRows[i]) << "bit for bit";
  }
  EXPECT_EQ(rig.witness.last(id).status, Status::completed);
  EXPECT_EQ(rig.witness.last(id).iteration, 150);
  EXPECT_EQ(rig.witness.of(id).front().iteration, 101);
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(Chunk, LateRowsAreSkippedAndTheMotionGoesOn) {
  ChunkRig rig;
  rig.reach(117, 0.05, 0.01);
  rig.example({.ease = 1});
  rig.run_to(130);
  EXPECT_NEAR(rig.at(116), 0.05, 1e-12);
  const std::vector<std::pair<Iteration, double>> wanted{
      {117, 0.060692}, {118, 0.072679}, {119, 0.085826}, {120, 0.1}, {125, 0.218304}};
  for (const auto& [iteration, value] : wanted) EXPECT_NEAR(rig.at(iteration), value, kDigits);
}

TEST(Chunk, ARowThatIsDueInTheFirstIterationIsInTime) {
  ChunkRig rig;
  rig.reach(120, 0.05, 0.01);
  rig.example({.ease = 1});
  rig.run_to(123);
  EXPECT_EQ(rig.at(120), 0.1);
  EXPECT_NEAR(rig.at(121), 0.138, 1e-12);  // from slope 0.04 to that at row 2, 0
}

TEST(Chunk, TheTakeOverPassesRowsThatAreDueTooSoon) {
  ChunkRig rig;
  rig.reach(117, 0.05, 0.01);
  rig.example({.ease = 10});
  rig.run_to(131);
  const std::vector<std::pair<Iteration, double>> wanted{
      {117, 0.062267}, {120, 0.119971}, {125, 0.238593}, {130, 0.3}};
  for (const auto& [iteration, value] : wanted) EXPECT_NEAR(rig.at(iteration), value, kDigits);
}

TEST(Chunk, WhereNoRowIsDueAfterTheTakeOverItGoesToTheLast) {
  ChunkRig rig;
  rig.reach(147, 0.25, -0.01);
  const CommandId id = rig.example({.ease = 10});
  rig.run_to(160);
  EXPECT_NEAR(rig.at(147), 0.2405, 1e-9);
  EXPECT_NEAR(rig.at(150), 0.218, 1e-9);
  EXPECT_EQ(rig.at(156), 0.2);
  EXPECT_EQ(rig.witness.last(id).iteration, 156);
}

TEST(Chunk, WhereAllRowsAreLateItIsRejectedAndThePlanGoesOn) {
  for (const bool rejected : {false, true}) {
    ChunkRig rig;
    rig.reach(rejected ? 151 : 150, 0.05, 0.01);
    const CommandId id = rig.example({.ease = 1});
    rig.run_to(160);
    EXPECT_EQ(rig.witness.last(id).status, rejected ? Status::rejected : Status::completed);
    if (rejected) {
      EXPECT_EQ(rig.witness.last(id).reason, Reason::late);
      EXPECT_NEAR(rig.at(155), 0.05 + 0.01 * 5, 1e-12);
    } else {
      EXPECT_EQ(rig.at(150), 0.2);
    }
  }
}

TEST(Chunk, TheFrozenPrefixIsNotPlayed) {
  struct Case {
    Iteration now, begins, exact;
    double row;
  };
  for (const Case& each : {Case{105, 131, 140, 0.3}, Case{135, 135, 150, 0.2}}) {
    ChunkRig rig;
    rig.reach(each.now, 0.05, 0.001);
    const CommandId id = rig.example({.ease = 10, .first = 3});
    rig.run_to(160);
    EXPECT_EQ(rig.witness.of(id).front().iteration, each.begins);
    EXPECT_NEAR(rig.at(each.begins - 1), 0.05 + 0.001 * static_cast<double>(each.begins - each.now),
                1e-12)
        << "nothing changes before";
    EXPECT_EQ(rig.at(each.exact), each.row);
  }
  for (const Iteration now : {140, 141}) {
    ChunkRig rig;
    rig.reach(now, 0.05, 0.001);
    const CommandId id = rig.example({.ease = 10, .first = 3, .reject_late = 1});
    rig.step();
    EXPECT_EQ(rig.witness.last(id).status, now == 140 ? Status::active : Status::rejected);
  }
}

TEST(Chunk, StandingStillDoesNotCount) {
  for (const std::uint32_t first : {0U, 3U}) {
    ChunkRig rig;
    rig.run_to(451);
    const CommandId id = rig.example({.ease = 10, .first = first});
    const CommandId batch = id - 2;
    rig.run_to(505);
    for (std::size_t i = 0; i < kRows.size(); ++i) {
      EXPECT_EQ(rig.at(460 + 10 * static_cast<Iteration>(i)), kRows[i]);
    }
    EXPECT_EQ(rig.witness.of(batch).back().late, 350);
  }
  ChunkRig rig;
  rig.run_to(451);
  const CommandId id = rig.example({.ease = 10, .fixed = 1});
  EXPECT_EQ(rig.witness.last(id).reason, Reason::late);
}

TEST(Chunk, AfterAPlanThatEndedItGoesOnWhereThatStopped) {
  ChunkRig rig;
  rig.run_to(126);
  rig.add(0, over(5), {0.4});  // 126 to 130
  rig.pulse();
  rig.run_to(161);
  const CommandId id = rig.example({.ease = 1});
  rig.run_to(185);
  EXPECT_EQ(rig.witness.of(id - 2).back().late, 30);
  EXPECT_EQ(rig.at(170), 0.3);  // rows 0 to 2 were due before: their share was played
  EXPECT_EQ(rig.at(180), 0.2);
}

TEST(Chunk, AnAnchorAheadWaits) {
  ChunkRig rig;
  rig.reach(101, 0.05, 0.0001);
  const CommandId id = rig.example({.anchor = 400, .ease = 10});
  rig.run_to(415);
  EXPECT_EQ(rig.witness.of(id).front().iteration, 401);
  EXPECT_NEAR(rig.at(400), 0.05 + 0.0001 * 300, 1e-12);
  EXPECT_EQ(rig.at(410), 0.0);
}

TEST(Chunk, ATakeOverMayPassWhereItWasByAThirdOfItsSpeed) {
  ChunkRig rig;
  rig.reach(101, 0.5, 0.01);
  rig.chunk({0.4, 0.3}, every(10, 2), {.anchor = 100, .ease = 10});
  rig.run_to(121);
  const std::vector<double> wanted{0.5062, 0.5056, 0.4994, 0.4888, 0.475};
  for (std::size_t i = 0; i < wanted.size(); ++i) {
    EXPECT_NEAR(rig.at(101 + static_cast<Iteration>(i)), wanted[i], 1e-9);
  }
  EXPECT_EQ(rig.at(110), 0.4);
}

TEST(Chunk, RowsMayBeHeldOrJoinedByLines) {
  ChunkRig held;
  held.reach(117, 0.05, 0.01);
  held.example({.ease = 10}, Profile::hold);
  held.run_to(155);
  for (Iteration i = 117; i <= 120; ++i) EXPECT_EQ(held.at(i), 0.1);
  for (Iteration i = 121; i <= 140; ++i) EXPECT_EQ(held.at(i), 0.3);
  for (Iteration i = 141; i < 155; ++i) EXPECT_EQ(held.at(i), 0.2);

  ChunkRig lines;
  lines.reach(117, 0.05, 0.01);
  lines.example({.ease = 10}, Profile::linear);
  lines.run_to(131);
  EXPECT_NEAR(lines.at(117), 0.067857, kDigits);
  EXPECT_NEAR(lines.at(124), 0.192857, kDigits);
  EXPECT_EQ(lines.at(130), 0.3);
}

TEST(Chunk, OneOverwritesAnotherFromItsPlan) {
  ChunkRig rig;
  rig.run_to(101);
  const CommandId first = rig.example({.ease = 10});
  rig.run_to(117);  // the plan of the first: 116
  const double place = rig.at(116);
  const CommandId second = rig.chunk({0.1, 0.5}, {20, 30}, {.anchor = 110, .ease = 10});
  rig.run_to(145);
  EXPECT_EQ(rig.witness.last(first).status, Status::overwritten);
  EXPECT_EQ(rig.witness.last(first).iteration, 117);
  EXPECT_EQ(rig.witness.last(second).status, Status::completed);
  EXPECT_EQ(rig.at(130), 0.1);
  EXPECT_EQ(rig.at(140), 0.5);
  // at 116 the first is six tenths of the way from 0 to 0.1, and its slopes there are 0 and 0.015
  const double u = 0.6;
  const double slope = 0.01 * 6 * u * (1 - u) + 0.015 * u * (3 * u - 2);
  const double m = 14.0;
  const double w = 1.0 / m;
  const double next = place * (1 + 2 * w) * (1 - w) * (1 - w) + 0.1 * w * w * (3 - 2 * w) +
                      m * slope * w * (1 - w) * (1 - w) -
                      m * 2 * (0.1 - place) / m * w * w * (1 - w);
  EXPECT_LT(std::abs(rig.at(117) - next), 0.003);
  EXPECT_LT(std::abs(rig.at(117) - 2 * rig.at(116) + rig.at(115)), 0.002) << "no jump of velocity";
}

TEST(Chunk, RejectionsNameTheirReasonAndLeaveThePlan) {
  ChunkRig rig;
  rig.run_to(101);
  rig.example({.plan = 1, .ease = 10});
  rig.run_to(105);
  EXPECT_EQ(rig.witness.last(rig.example({.anchor = 99, .plan = 1, .ease = 10})).reason,
            Reason::older);
  const CommandId of_another_plan = rig.example({.anchor = 99, .plan = 2, .ease = 10});
  rig.step();
  EXPECT_EQ(rig.witness.last(of_another_plan).status, Status::active);
  rig.controller.restart(rig.observed.data(), nullptr, rig.next);
  rig.run_to(107);
  EXPECT_EQ(rig.witness.last(rig.example({.anchor = 104, .ease = 10})).reason, Reason::fresh_start);
  rig.run_to(120);
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(Chunk, APurgeAHaltAnOverwriteAndAFreshStartEndOneThatWaits) {
  const std::vector<std::function<void(ChunkRig&)>> ends{
      [](ChunkRig& rig) {
        rig.batch.purge(kEveryActuator);
        rig.pulse();
      },
      [](ChunkRig& rig) {
        rig.batch.purge_own(0);
        rig.pulse();
      },
      [](ChunkRig& rig) { rig.controller.halt(rig.next); },
      [](ChunkRig& rig) { rig.controller.interrupt(0, rig.next); },
      [](ChunkRig& rig) { rig.controller.purge_lane(0, kEveryActuator, rig.next); },
      [](ChunkRig& rig) { rig.controller.restart(rig.observed.data(), nullptr, rig.next); },
      [](ChunkRig& rig) {
        rig.add(0, overwriting(over(3)), {0.0});
        rig.pulse();
      },
      [](ChunkRig& rig) { rig.example({.anchor = 120, .plan = 1, .ease = 1}); },
  };
  for (std::size_t i = 0; i < ends.size(); ++i) {
    ChunkRig rig;
    rig.run_to(101);
    const CommandId id = rig.chunk({9.0}, {10}, {.anchor = 150, .ease = 10});
    EXPECT_TRUE(rig.controller.active());
    EXPECT_TRUE(rig.controller.acts(0));
    EXPECT_FALSE(rig.controller.shows_all());
    rig.run_to(111);
    ends[i](rig);
    rig.run_to(240);
    EXPECT_EQ(rig.witness.ends_of(id), 1U) << i;
    EXPECT_NE(rig.witness.status(id), Status::completed) << i;
    for (Iteration row = 101; row < 240; ++row) EXPECT_LT(rig.at(row), 1.0) << i;
    EXPECT_TRUE(rig.all_blocks_back()) << i;
  }
}

TEST(Chunk, OfSeveralActuatorsOneThatIsOverwrittenLeavesTheOthers) {
  ChunkRig rig(plain_robot(3));
  rig.run_to(101);
  const CommandId id =
      rig.chunk(kRows, every(10, 5), {.anchor = 100, .ease = 10}, Profile::cubic, {0, 1, 2});
  rig.run_to(125);
  rig.add(1, overwriting(over(2)), {7.0});
  rig.pulse();
  rig.run_to(155);
  EXPECT_EQ(rig.desired(0), 0.2);
  EXPECT_EQ(rig.desired(1), 7.0);
  EXPECT_EQ(rig.desired(2), 0.2);
  EXPECT_EQ(rig.witness.last(id).status, Status::overwritten);
  EXPECT_EQ(rig.witness.last(id).iteration, 150) << "told when the last one ends";
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(Chunk, NumbersThatCannotBeInterpolatedAreHeldFromTheFirstIteration) {
  Schema schema;
  schema.head.robot = NameText("robot");
  schema.head.period = kMillisecond;
  const auto type = schema.add_type(
      "Hand", {scalar_field("place", Kind::float64), scalar_field("open", Kind::boolean)});
  schema.add_actuators("hand", type, 1);
  ChunkRig rig(std::move(schema));
  struct Hand {
    double place;
    bool open;
    std::array<char, 7> pad{};
  };
  static_assert(sizeof(Hand) == 16);
  ASSERT_EQ(rig.layout.size(), 16U);
  rig.run_to(101);
  std::vector<double> rows;
  for (int i = 0; i < 20; ++i) {
    const Hand hand{0.1 * i, i % 2 == 0};
    double both[2]{};
    std::memcpy(both, &hand, sizeof hand);
    rows.insert(rows.end(), both, both + 2);
  }
  rig.chunk(rows, every(5, 20), {.anchor = 80, .ease = 30, .fixed = 1});
  for (Iteration now = 101; now <= 180; ++now) {
    rig.run_to(now + 1);
    const Iteration row = (now - 80 + 4) / 5 - 1;  // acts from the iteration after the row before
    EXPECT_EQ(rig.desired_as<bool>(8), row % 2 == 0) << now;
  }
  EXPECT_DOUBLE_EQ(rig.desired(), 1.9);
}

TEST(Chunk, APurgeThatOvertakesItEndsTheActuatorsThatItIsFor) {
  ChunkRig rig(plain_robot(3));
  rig.run_to(101);
  rig.add_chunk(kRows, every(10, 5), {.anchor = 100, .ease = 10}, Profile::cubic, {0, 1, 2});
  const BlockIndex chunk = rig.send();
  const CommandId id = record_id(rig.sent, 0);
  rig.pool.batch(chunk).ticket = 10;
  rig.batch.purge(1);
  const BlockIndex purge = rig.send(1);
  rig.pool.batch(purge).ticket = 11;
  rig.controller.take(1, purge, rig);
  rig.controller.take(0, chunk, rig);
  rig.run_to(155);
  EXPECT_EQ(rig.desired(0), 0.2);
  EXPECT_EQ(rig.desired(1), 0.0);
  EXPECT_EQ(rig.desired(2), 0.2);
  EXPECT_EQ(rig.witness.last(id).status, Status::purged);
  EXPECT_EQ(rig.witness.last(id).iteration, 150);
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(Chunk, ThatBeginsAtOnceNeedsNoPlaceAmongThoseThatWait) {
  ChunkRig rig(plain_robot(2));
  rig.run_to(10);
  std::vector<CommandId> waiting;
  for (Iteration i = 0; i < 65; ++i) {
    waiting.push_back(rig.chunk({1.0}, {5}, {.anchor = 1000 + i}, Profile::cubic, {0}));
  }
  const CommandId at_once = rig.chunk({1.0}, {5}, {.anchor = 9}, Profile::cubic, {1});
  rig.run_to(20);
  EXPECT_EQ(rig.witness.last(waiting.back()).reason, Reason::full);
  EXPECT_EQ(rig.witness.status(at_once), Status::completed);
  rig.run_to(1100);
  EXPECT_EQ(rig.witness.status(waiting[63]), Status::completed);
  EXPECT_TRUE(rig.all_blocks_back());
}

/// Where limits do not act, they change nothing: the plan that has just ended is at rest.
TEST(Chunk, AfterTheLastRowThePlanRestsWithLimitsOrWithout) {
  std::vector<std::vector<double>> shown;
  for (const bool limited : {false, true}) {
    Schema schema = plain_robot(1);
    if (limited) schema.actuator(0).limits({.speed = 1e6, .acceleration = 1e12});
    ChunkRig rig(std::move(schema));
    rig.run_to(101);
    rig.chunk({0.1, 0.5}, every(3, 2), {.anchor = 100, .ease = 1});
    rig.run_to(107);
    EXPECT_EQ(rig.at(106), 0.5);
    rig.chunk({0.0, 0.5}, every(10, 2), {.anchor = 106, .ease = 1});
    rig.run_to(130);
    EXPECT_LE(*std::ranges::max_element(rig.rows.begin() + 107, rig.rows.end()), 0.5);
    shown.emplace_back(rig.rows.begin() + 101, rig.rows.end());
  }
  EXPECT_EQ(shown[0], shown[1]);
}

TEST(Chunk, HeldRowsOf64BitsAreHeld) {
  Schema schema;
  schema.head.robot = NameText("robot");
  schema.head.period = kMillisecond;
  schema.add_actuators("wheel", schema.add_type("int64", {scalar_field("", Kind::int64)}), 1);
  ChunkRig rig(std::move(schema));
  rig.run_to(101);
  const std::vector<std::int64_t> rows{(std::int64_t{1} << 60) + 1, -20, 7};
  std::vector<double> bits(rows.size());
  std::memcpy(bits.data(), rows.data(), bytes_of(rows).size());
  rig.chunk(bits, every(5, 3), {.anchor = 100}, Profile::hold);
  for (Iteration now = 101; now <= 115; ++now) {
    rig.run_to(now + 1);
    EXPECT_EQ(rig.desired_as<std::int64_t>(0), rows[static_cast<std::size_t>((now - 101) / 5)])
        << now;
  }
}

TEST(Chunk, HeldRowsOfATypeThatBlendsAreHeld) {
  for (const Profile profile : {Profile::hold, Profile::cubic}) {
    Schema schema = plain_robot(1);
    schema.hooks[0].blend = [](void* out, const void* from, const void* to, double share) {
      const double begin = *static_cast<const double*>(from);
      *static_cast<double*>(out) = begin + share * (*static_cast<const double*>(to) - begin);
    };
    ChunkRig rig(std::move(schema));
    rig.run_to(101);
    rig.chunk({1.0, 3.0}, every(4, 2), {.anchor = 100, .ease = 1}, profile);
    rig.run_to(110);
    for (Iteration now = 101; now <= 108; ++now) {
      const double row = now <= 104 ? 1.0 : 3.0;
      const auto n = static_cast<double>(now - 100);
      const double between = now <= 104 ? n / 4.0 : 1.0 + (n - 4.0) / 2.0;
      EXPECT_EQ(rig.at(now), profile == Profile::hold ? row : between) << now;
    }
  }
}

TEST(Chunk, AStatusTellsItsShiftOrItIsLate) {
  constexpr Iteration kLast = TakenChunk::kMostShift + 1;  // the last iteration that can be told
  for (const Iteration now : {Iteration{70'001}, kLast, kLast + 1}) {
    ChunkRig rig;
    rig.next = now;
    const CommandId id = rig.chunk(kRows, every(10, 5), {.anchor = 0}) - 2;
    const std::vector<StatusChange> told = rig.witness.of(id);
    EXPECT_FALSE(TakenChunk::of(told[0].detail, told[0].late)) << "of the batch alone";
    ASSERT_EQ(told.size(), now > kLast ? 1U : 2U);
    if (now > kLast) {
      EXPECT_EQ(rig.witness.last(id + 2).reason, Reason::late);
    } else {
      EXPECT_EQ(TakenChunk::of(told[1].detail, told[1].late).value().shift, now - 1);
    }
  }
}

/// Random scripts of chunks: what was due is shown, nothing that was skipped matters.
class ChunkScript {
 public:
  struct Sent {
    Iteration anchor;
    std::vector<std::uint32_t> due;
    std::vector<double> rows;
    ChunkHead head;
    CommandId id = 0;
    Iteration taken = 0;
  };
  explicit ChunkScript(unsigned seed, double odd = 0.0) : dice_(seed), odd_(odd) {}

  std::vector<double> run(ChunkRig& rig, Iteration last) {
    Iteration at = 1;
    while (at < last) {
      rig.run_to(at);
      const auto pick = [&](int low, int high) {
        return std::uniform_int_distribution<int>(low, high)(dice_);
      };
      if (pick(0, 9) == 0) {
        rig.batch.purge(kEveryActuator);
        rig.pulse();
      }
      Sent sent;
      sent.anchor = std::max<Iteration>(0, at - pick(-5, 40));
      const int rows = pick(1, 40);
      const double step = pick(0, 2) == 0 ? 50.0 / 3.0 : pick(1, 25);
      for (int i = 1; i <= rows; ++i) {
        sent.due.push_back(static_cast<std::uint32_t>(std::floor(i * step + 0.5)));
      }
      double value = rig.desired();
      for (int i = 0; i < rows; ++i) {
        value += std::uniform_real_distribution<double>(-0.1, 0.1)(dice_);
        sent.rows.push_back(value);
      }
      sent.head.anchor = sent.anchor;
      sent.head.ease = static_cast<std::uint32_t>(pick(1, 25));
      sent.head.first = static_cast<std::uint32_t>(std::min(pick(0, 6), rows - 1));
      sent.head.fixed = static_cast<std::uint8_t>(pick(0, 3) == 0);
      sent.taken = at;
      for (std::size_t i = 0; i < sent.rows.size() && odd_ != 0.0; ++i) {
        // rows that cannot be reached any more
        if (sent.anchor + sent.due[i] < at && sent.head.fixed == 1) sent.rows[i] = odd_;
      }
      sent.id = rig.chunk(sent.rows, sent.due, sent.head);
      all.push_back(sent);
      at += pick(1, 60);
    }
    rig.run_to(last + 1200);
    return rig.rows;
  }
  std::vector<Sent> all;

 private:
  std::mt19937 dice_;
  double odd_;
};

TEST(Chunk, EveryRowThatIsDueIsShown) {
  std::size_t exact = 0;
  for (unsigned seed = 0; seed < 200; ++seed) {
    ChunkRig rig;
    ChunkScript script(seed);
    script.run(rig, 1500);
    for (std::size_t i = 0; i < script.all.size(); ++i) {
      const ChunkScript::Sent& sent = script.all[i];
      const std::vector<StatusChange> told = rig.witness.of(sent.id);
      ASSERT_EQ(rig.witness.ends_of(sent.id), 1U);
      if (told.front().status != Status::active) continue;
      const std::int64_t shift = [&] {
        for (const StatusChange& each : rig.witness.of(sent.id - 2)) {
          if (each.late > 0) return TakenChunk::of(each.detail, each.late)->shift;
        }
        return std::int64_t{0};
      }();
      const Iteration begins = told.front().iteration;
      const Iteration ends = told.back().iteration;
      EXPECT_EQ(begins >= sent.taken, true);
      for (std::size_t k = 0; k < sent.rows.size(); ++k) {
        const Iteration due = sent.anchor + shift + sent.due[k];
        const bool counts = due >= begins + static_cast<Iteration>(sent.head.ease) - 1;
        if (!counts || due > ends || (due == ends && told.back().status != Status::completed))
          continue;
        ASSERT_EQ(rig.at(due), sent.rows[k]) << "seed " << seed << ", row " << k;
        ++exact;
      }
    }
    EXPECT_TRUE(rig.all_blocks_back());
  }
  EXPECT_GT(exact, 10'000U);
}

TEST(Chunk, RowsThatAreLateChangeNoBit) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    ChunkRig one;
    ChunkRig other;
    const auto rows = ChunkScript(seed).run(one, 800);
    const auto odd = ChunkScript(seed, 1e6).run(other, 800);
    EXPECT_EQ(bytes_of(rows), bytes_of(odd)) << seed;
  }
}

// ------------------------------------------------------------------------------ starved plans

TEST(Chunk, APlanIsStarvedFromTheIterationAfterItsLastRowUntilItEndsOrGoesOn) {
  const auto none = [](ChunkRig&) {};
  const auto close = [](ChunkRig& rig, std::uint64_t plan, std::uint32_t lane) {
    rig.batch.close_plan(plan);
    rig.pulse(lane);
  };
  struct Case {
    ChunkHead head;
    std::function<void(ChunkRig&)> at_120, at_155;
    std::vector<Iteration> starved;  // from the first one up to before the second
  };
  const ChunkHead open{.plan = 7, .ease = 10};
  const ChunkHead final{.plan = 7, .ease = 10, .final = 1};
  const std::vector<Case> cases{
      {open, none, none, {151, 200}},
      {final, none, none, {}},
      {open, [&](ChunkRig& rig) { close(rig, 7, 0); }, none, {}},
      {open, [&](ChunkRig& rig) { close(rig, 0, 0); }, none, {}},
      {open, [&](ChunkRig& rig) { close(rig, 8, 0); }, none, {151, 200}},
      {open, [&](ChunkRig& rig) { close(rig, 7, 1); }, none, {151, 200}},
      {open, none, [&](ChunkRig& rig) { close(rig, 7, 0); }, {151, 155}},
      {open,
       none,
       [&](ChunkRig& rig) { rig.example({.anchor = 154, .plan = 7, .final = 1}); },
       {151, 155}},
      {open,
       none,  // it waits, but its rows are ahead
       [&](ChunkRig& rig) { rig.example({.anchor = 170, .plan = 7, .final = 1}); },
       {151, 155}},
      {open,
       none,
       [&](ChunkRig& rig) {
         rig.example({.anchor = 170, .plan = 7});
         close(rig, 7, 0);
       },
       {151, 155}},
      {open,
       none,
       [](ChunkRig& rig) {
         rig.add(0, over(3), {1.0});
         rig.pulse(1);
       },
       {151, 155}},
      {open, none, [](ChunkRig& rig) { rig.controller.purge_lane(0, 0, rig.next); }, {151, 155}},
      {open, none, [](ChunkRig& rig) { rig.controller.purge_lane(1, 0, rig.next); }, {151, 200}},
      {open, none, [](ChunkRig& rig) { rig.controller.halt(rig.next); }, {151, 155}},
  };
  for (std::size_t i = 0; i < cases.size(); ++i) {
    const Case& each = cases[i];
    ChunkRig rig;
    rig.run_to(101);
    rig.example(each.head);
    std::vector<Iteration> found;
    bool before = false;
    for (Iteration now = 101; now < 230; ++now) {
      if (now == 120) each.at_120(rig);
      if (now == 155) each.at_155(rig);
      rig.run_to(now + 1);
      if (now < 200 && rig.starved() != before) found.push_back(now);
      before = rig.starved();
      EXPECT_TRUE(!rig.starved() || rig.controller.acts(0)) << "for the watchdog";
    }
    if (found.size() % 2 == 1) found.push_back(200);
    EXPECT_EQ(found, each.starved) << i;
    EXPECT_EQ(rig.controller.starvations(), each.starved.empty() ? 0 : 1) << i;
    EXPECT_EQ(rig.at(150), 0.2) << i;
    EXPECT_EQ(rig.controller.acts(0), rig.starved()) << i;
    EXPECT_EQ(rig.controller.shows_all(), !rig.starved()) << "where a replay may begin";
    EXPECT_TRUE(rig.all_blocks_back());
  }
}

TEST(Chunk, TheEndOfAPlanDoesNotOvertakeItsChunks) {
  BatchBuilder batch;
  batch.purge_own(kEveryActuator);
  const auto is_express = [&] {
    std::uint16_t flags = 0;
    const std::byte* const record = batch.seal(BatchRecord()).front().bytes.data();
    std::memcpy(&flags, record + offsetof(BatchRecord, flags), sizeof flags);
    return (flags & kExpress) != 0;
  };
  EXPECT_TRUE(is_express());
  batch.close_plan(1);
  EXPECT_FALSE(is_express());
  ChunkRig rig;  // nor does it if a sender says so
  rig.batch.close_plan(1);
  const BlockIndex first = rig.send();
  rig.check(0, first, 100);
  EXPECT_EQ(rig.controller.effort(first).express, 0U);
  EXPECT_EQ(rig.controller.effort(first).free, 1U) << "it needs no control";
}

/// Random scripts of three lanes on three actuators; the mark is what a list of all that was sent
/// says: the record that began last there is an open chunk that is completed, and none waits.
TEST(Chunk, TheMarkOfAStarvedPlanIsWhatTheScriptSays) {
  struct Sent {
    CommandId id;
    std::uint32_t lane, actuator;
    bool open;  // a chunk, and neither the last of its plan nor ended by something else
    std::uint64_t plan;
  };
  std::size_t marks = 0;
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 dice(seed);
    const auto pick = [&](int low, int high) {
      return std::uniform_int_distribution<int>(low, high)(dice);
    };
    Schema schema = plain_robot(3);
    schema.actuator(1).limits({.speed = 20.0, .acceleration = 1e4});
    schema.actuators[2].when_idle = WhenIdle::follow;
    ChunkRig rig(std::move(schema));
    std::vector<Sent> all;
    std::int64_t starvations = 0;
    std::array<bool, 3> before{};
    const auto close = [&](auto&& is_meant) {
      for (Sent& each : all) each.open = each.open && !is_meant(each);
    };
    const auto state_of = [&](const Sent& sent) {
      Iteration began = -1;
      Iteration ended = -1;
      Status status = Status::none;
      for (const StatusChange& each : rig.witness.of(sent.id, sent.lane)) {
        (each.status == Status::active ? began : ended) = each.iteration;
        status = each.status;
      }
      return std::tuple{began, ended, status};
    };
    const auto check = [&] {
      const Iteration now = rig.next - 1;
      bool begins = false;
      for (std::uint32_t actuator = 0; actuator < 3; ++actuator) {
        const Sent* last = nullptr;
        Iteration last_began = -1;
        bool acts = false;
        for (const Sent& each : all) {
          const auto [began, ended, status] = state_of(each);
          if (each.actuator != actuator) continue;
          acts = acts || ended < 0 || (ended == now && status == Status::completed);
          if (began > last_began) last = &each;
          last_began = std::max(began, last_began);
        }
        const bool wanted = !acts && last != nullptr && last->open &&
                            std::get<2>(state_of(*last)) == Status::completed;
        ASSERT_EQ(rig.starved(actuator), wanted) << seed << ", " << now << ", " << actuator;
        if (wanted) {
          ASSERT_TRUE(rig.controller.acts(last->lane));
        }
        begins = begins || (wanted && !before[actuator]);
        before[actuator] = wanted;
        marks += wanted ? 1 : 0;
      }
      starvations += begins ? 1 : 0;
      ASSERT_EQ(rig.controller.starvations(), starvations) << seed;
    };
    for (int turn = 0; turn < 50; ++turn) {
      const auto lane = static_cast<std::uint32_t>(pick(0, 2));
      const auto actuator = static_cast<std::uint32_t>(pick(0, 2));
      const auto plan = static_cast<std::uint64_t>(pick(1, 2));
      const int what = pick(0, 15);
      const auto is_here = [&](const Sent& each) { return each.actuator == actuator; };
      const auto is_own = [&](const Sent& each) { return each.lane == lane; };
      if (what < 8) {
        const bool final = pick(0, 3) == 0;
        std::vector<double> rows(static_cast<std::size_t>(pick(1, 4)));
        for (double& row : rows) row = pick(-5, 5) * 1e-2;
        const ChunkHead head{.anchor = rig.next - 1 - pick(-6, 6),
                             .plan = plan,
                             .ease = static_cast<std::uint32_t>(pick(1, 4)),
                             .final = static_cast<std::uint8_t>(final)};
        const auto due = every(static_cast<std::uint32_t>(pick(1, 3)), rows.size());
        const CommandId id = rig.chunk(rows, due, head, Profile::cubic, {actuator}, lane);
        const bool is_rejected = rig.witness.status(id, lane) == Status::rejected;
        if (head.anchor < rig.next && !is_rejected) close(is_here);  // it begins
        all.push_back({id, lane, actuator, !final, plan});
      } else if (what < 11) {
        const RecordHead head = over(pick(1, 5));
        const bool overwrites = pick(0, 1) == 0;
        const std::uint32_t place =
            rig.add(actuator, overwrites ? overwriting(head) : head, {pick(-5, 5) * 1e-2});
        if (overwrites) close(is_here);
        all.push_back({record_id(rig.pulse(lane), place), lane, actuator, false, 0});
      } else if (what < 13) {
        const bool every_plan = pick(0, 2) == 0;
        rig.batch.close_plan(every_plan ? 0 : plan);
        rig.pulse(lane);
        close([&](const Sent& each) { return is_own(each) && (every_plan || each.plan == plan); });
      } else if (what == 13) {
        rig.batch.purge(static_cast<std::uint16_t>(actuator));
        rig.pulse(lane);
        close(is_here);
      } else if (what == 14) {
        rig.batch.purge_own(kEveryActuator);
        rig.pulse(lane);
        close(is_own);
      } else if (const int event = pick(0, 2); event == 0) {
        rig.controller.halt(rig.next);
        close([](const Sent&) { return true; });
      } else if (event == 1) {
        rig.controller.interrupt(actuator, rig.next);
        close(is_here);
      } else {
        rig.controller.restart(rig.observed.data(), nullptr, rig.next++);
        close([](const Sent&) { return true; });
      }
      for (int i = pick(0, 1) == 0 ? 0 : pick(1, 20); i > 0; --i) {
        rig.step();
        ASSERT_NO_FATAL_FAILURE(check());
      }
    }
  }
  EXPECT_GT(marks, 2000U);
}

// ------------------------------------------------------------------------------ limits

Schema limited_robot(const Limits& limits) {
  Schema schema = plain_robot(1);
  schema.actuator(0).limits(limits);
  return schema;
}

/// [per iteration] at a millisecond.
Limits limits_of(double speed, double acceleration, double jerk = kNoLimit) {
  return {.minimum = -10.0,
          .maximum = 10.0,
          .speed = speed,
          .acceleration = acceleration,
          .jerk = jerk};
}

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

TEST(ChunkLimits, RowsWithinBoundsWithATakeOverOutsideAreClampedAndReached) {
  Schema schema = plain_robot(1);
  schema.actuator(0).limits({.minimum = 0.0, .maximum = 0.505});
  ChunkRig rig(std::move(schema));
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

/// Random chunks under random limits: all differences within them, all ends at the last row.
TEST(ChunkLimits, RandomScriptsStayWithinLimitsAndEndAtTheirLastRow) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 dice(seed);
    const auto draw = [&](double low, double high) {
      return std::exp(std::uniform_real_distribution<double>(std::log(low), std::log(high))(dice));
    };
    const double speed = draw(0.1, 10.0);
    const double acceleration = draw(1.0, 100.0);
    const double jerk = seed % 2 == 0 ? draw(10.0, 10'000.0) : kNoLimit;
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

// ------------------------------------------------------------------------------ trajectories

/// A trajectory is a chunk that is anchored where its queue reaches it.
TEST(Trajectory, ItsRowsArePlayedAsThoseOfAChunk) {
  for (unsigned seed = 0; seed < 200; ++seed) {
    std::mt19937 dice(seed);
    const auto pick = [&](std::int64_t low, std::int64_t high) {
      return std::uniform_int_distribution<std::int64_t>(low, high)(dice);
    };
    const auto place = [&] { return std::uniform_real_distribution<double>(-1.0, 1.0)(dice); };
    const bool limited = seed % 2 == 1;
    const auto robot = [&] {
      return limited ? limited_robot(limits_of(5.0, 40.0, 2000.0)) : plain_robot(1);
    };
    const auto profile = std::array{Profile::cubic, Profile::linear, Profile::hold}[seed % 3];
    // under limits the span of 16 rows is known in the first iteration
    const auto rows = static_cast<std::uint32_t>(pick(1, limited ? 16 : 30));
    if (profile == Profile::linear && rows == 1) continue;  // a command
    std::vector<double> targets;
    for (std::uint32_t i = 0; i < rows; ++i)
      targets.push_back(i > 0 && pick(0, 4) == 0 ? targets.back() : place());
    const std::int64_t each = pick(1, 25);
    std::vector<std::uint32_t> due = every(static_cast<std::uint32_t>(each), rows);
    std::vector<std::int64_t> times;
    const bool is_timed = rows > 1 && pick(0, 1) == 0;
    for (std::uint32_t i = 0; is_timed && i < rows; ++i) {
      due[i] = (i == 0 ? 0 : due[i - 1]) + static_cast<std::uint32_t>(pick(1, 30));
      // rounded halves up
      times.push_back(due[i] * kMillisecond + pick(-kMillisecond / 2, kMillisecond / 2 - 1));
    }
    // behind a motion that goes on, or one that has ended
    const Iteration start = 60;
    const std::int64_t before = pick(20, 80);
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

TEST(Trajectory, ACurveThroughAParabolaHasItsSlopes) {
  // Steffen's slope of three points is that of their parabola
  ChunkRig rig;
  rig.run_to(100);
  std::vector<double> targets;
  const auto parabola = [](double t) { return 1e-4 * t * t; };
  for (int i = 1; i <= 10; ++i) targets.push_back(parabola(10.0 * i));
  rig.add_rows(
      0,
      [] {
        RecordHead head = over(10);
        head.profile = Profile::cubic;
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

/// Any rows and profiles, as far apart as a double allows, one motion taking over from another.
TEST(Trajectory, HugeRowsStayFinite) {
  constexpr std::array kValues{-1.7e308, 1.7e308, 0.0, 1e-300};
  for (unsigned seed = 0; seed < 1000; ++seed) {
    std::mt19937 dice(seed);
    const auto pick = [&](std::uint32_t below) {
      return static_cast<std::uint32_t>(
          std::uniform_int_distribution<int>(0, static_cast<int>(below) - 1)(dice));
    };
    Rig rig(seed % 4 == 0 ? limited_robot(limits_of(5.0, 40.0, 2000.0)) : plain_robot(1));
    for (int i = 0; i < 4; ++i) {
      constexpr std::array kProfiles{Profile::cubic, Profile::linear, Profile::hold,
                                     Profile::minimum_jerk};
      RecordHead head = over(1 + pick(5));
      head.profile = kProfiles[pick(4)];
      if (pick(3) > 0) head = overwriting(head);
      std::vector<double> rows(1 + pick(9));
      for (double& row : rows) row = kValues[pick(4)];
      rig.add_rows(0, head, static_cast<std::uint32_t>(rows.size()), rows);
      rig.pulse();
      for (std::uint32_t n = 1 + pick(30); n > 0; --n) {
        rig.step();
        ASSERT_TRUE(std::isfinite(rig.desired())) << seed;
      }
    }
  }
}

// ------------------------------------------------------------------------------ hostile

TEST(ChunkHostile, HugeNumbersStayFinite) {
  for (const Profile profile : {Profile::cubic, Profile::linear, Profile::hold}) {
    ChunkRig rig;
    rig.run_to(10);
    const double huge = 1.7e308;
    rig.chunk({huge, -huge, huge, 0.0, -huge}, every(3, 5), {.anchor = 9, .ease = 2}, profile);
    rig.run_to(15);
    rig.chunk({-huge, huge, 1.0}, {4, 5, 30}, {.anchor = 14, .ease = 1}, profile);
    rig.run_to(60);
    for (Iteration i = 10; i < 60; ++i) ASSERT_TRUE(std::isfinite(rig.at(i))) << i;
    EXPECT_EQ(rig.desired(), 1.0);
  }
}

TEST(ChunkHostile, WhatCannotBeIsInvalidAndNothingIsLost) {
  const auto in_chunk = [](auto change) {
    return [change](std::vector<Block>& blocks) {
      ChunkHead chunk;
      std::memcpy(&chunk, blocks[2].bytes.data(), sizeof chunk);
      change(chunk);
      std::memcpy(blocks[2].bytes.data(), &chunk, sizeof chunk);
    };
  };
  const auto in_member = [](auto change) {
    return [change](std::vector<Block>& blocks) {
      RecordHead head;
      std::memcpy(&head, blocks[3].bytes.data(), sizeof head);
      change(head);
      std::memcpy(blocks[3].bytes.data(), &head, sizeof head);
    };
  };
  const auto in_note = [](std::size_t i, std::uint32_t due) {
    return [=](std::vector<Block>& blocks) {  // head, lists, list, note
      std::memcpy(blocks[6].bytes.data() + offsetof(RowNote, due) + 4 * i, &due, sizeof due);
    };
  };
  std::vector<std::function<void(std::vector<Block>&)>> changes{
      in_chunk([](ChunkHead& chunk) { chunk.rows = 4; }),
      in_chunk([](ChunkHead& chunk) { chunk.rows = 0; }),
      in_chunk([](ChunkHead& chunk) { chunk.rows = 0xFFFFFFFF; }),
      in_chunk([](ChunkHead& chunk) { chunk.ease = 0; }),
      in_chunk([](ChunkHead& chunk) { chunk.ease = 0xFFFFFFFF; }),
      in_chunk([](ChunkHead& chunk) { chunk.first = 5; }),
      in_chunk([](ChunkHead& chunk) { chunk.fixed = 2; }),
      in_chunk([](ChunkHead& chunk) { chunk.final = 2; }),
      in_chunk([](ChunkHead& chunk) { chunk.anchor = kMaxIterations + 1; }),
      in_chunk([](ChunkHead& chunk) { chunk.anchor = std::numeric_limits<Iteration>::min(); }),
      in_chunk([](ChunkHead& chunk) { chunk.anchor = kMaxIterations; }),
      in_member([](RecordHead& head) { head.rows = 6; }),
      in_member([](RecordHead& head) { head.rows = 0xFFFFFFFF; }),
      in_member([](RecordHead& head) { head.payload_bytes -= 8; }),
      in_member([](RecordHead& head) { head.profile = Profile::minimum_jerk; }),
      in_member([](RecordHead& head) { head.mode = Mode::queue; }),
      in_member([](RecordHead& head) { head.kind = RecordKind::command; }),
      in_note(0, 0),
      in_note(1, 10),
      in_note(2, 5),
      in_note(4, 0xFFFFFFFF),
      [](std::vector<Block>& blocks) {
        const double nan = std::nan("");
        std::memcpy(blocks[7].bytes.data() + 16, &nan, sizeof nan);
      },
  };
  for (std::size_t i = 0; i < changes.size(); ++i) {
    ChunkRig rig;
    rig.run_to(10);
    const auto bytes = bytes_of(kRows);
    RecordHead head;
    const std::vector<BatchBuilder::Member> members{{head, {}, bytes}};
    const std::vector<const StateLayout*> layouts{&rig.layout};
    rig.batch.chunk(members, {.anchor = 9, .ease = 10}, every(10, 5), layouts);
    BatchRecord record;
    record.id = 1;
    const auto sealed = rig.batch.seal(record);
    std::vector<Block> blocks(sealed.begin(), sealed.end());
    ASSERT_EQ(blocks.size(), 8U);
    changes[i](blocks);
    const BlockIndex first = rig.place(blocks);
    for (int k = 0; k < 100 && !rig.check(0, first, 1); ++k) {
    }
    rig.controller.take(0, first, rig);
    rig.run_to(100);
    EXPECT_EQ(rig.witness.ends_of(3), 1U) << i;
    EXPECT_EQ(rig.witness.status(3), Status::rejected) << i;
    EXPECT_EQ(rig.desired(), 0.0) << i;
    EXPECT_TRUE(rig.all_blocks_back()) << i;
  }
}

TEST(ChunkHostile, RandomBytesAreSafe) {
  std::mt19937 dice(7);
  for (int round = 0; round < 3000; ++round) {
    ChunkRig rig(plain_robot(2));
    rig.run_to(10);
    std::vector<double> rows;
    const auto count = static_cast<std::size_t>(1 + dice() % 60);
    for (std::size_t i = 0; i < count; ++i) rows.push_back(static_cast<double>(i % 7));
    const auto bytes = bytes_of(rows);
    std::vector<BatchBuilder::Member> members(2);
    members[0].states = members[1].states = bytes;
    members[1].head.actuator = 1;
    const std::vector<const StateLayout*> layouts{&rig.layout, &rig.layout};
    rig.batch.chunk(members, {.anchor = 9, .ease = 10}, every(1 + dice() % 9, count), layouts);
    BatchRecord record;
    record.id = 1;
    const auto sealed = rig.batch.seal(record);
    std::vector<Block> blocks(sealed.begin(), sealed.end());
    for (unsigned k = 1 + dice() % 4; k > 0; --k) {
      // heads and notes more often than rows
      Block& block = blocks[1 + dice() % std::min<std::size_t>(blocks.size() - 1, 9)];
      block.bytes[dice() % kBlockBytes] = static_cast<std::byte>(dice());
    }
    const BlockIndex first = rig.place(blocks);
    for (int k = 0; k < 2000 && !rig.check(0, first, 1); ++k) {
    }
    rig.controller.take(0, first, rig);
    for (int k = 0; k < 40; ++k) rig.step();
    rig.controller.purge(kEveryActuator, rig.next);
    for (int k = 0; k < 3; ++k) rig.step();
    ASSERT_EQ(rig.witness.ends_of(3), 1U) << round;
    ASSERT_TRUE(rig.all_blocks_back()) << round;
    ASSERT_TRUE(std::isfinite(rig.desired(0)) && std::isfinite(rig.desired(1))) << round;
  }
}

/// Chunks of three lanes for overlapping actuators of different types, among all else that there
/// is.
TEST(ChunkHostile, AmongCommandsPurgesHaltsAndFreshStartsEachEndsOnce) {
  for (unsigned seed = 0; seed < 60; ++seed) {
    std::mt19937 dice(seed);
    const auto pick = [&](int low, int high) {
      return std::uniform_int_distribution<int>(low, high)(dice);
    };
    Schema schema = plain_robot(1);
    const auto hand = schema.add_type(
        "Hand", {scalar_field("place", Kind::float32), scalar_field("open", Kind::boolean),
                 scalar_field("count", Kind::int64)});
    schema.add_actuators("joint", schema.actuators[0].type, 3);
    schema.add_actuators("hand", hand, 2);
    schema.actuator(1).limits(
        {.minimum = -2.0, .maximum = 2.0, .speed = 5.0, .acceleration = 50.0});
    schema.actuators[2].when_idle = WhenIdle::follow;
    Rig rig(std::move(schema), 3000);
    std::vector<StateLayout> layouts;
    for (std::uint32_t i = 0; i < 6; ++i) {
      layouts.emplace_back(rig.schema, rig.schema.actuators[i].type);
    }
    const auto state_of = [&](std::uint32_t actuator) {
      std::vector<std::byte> state(layouts[actuator].size());
      for (std::uint32_t i = 0; i < layouts[actuator].numbers().size(); ++i) {
        const NumberPlace& place = layouts[actuator].numbers()[i];
        visit_number(place.kind, [&]<class T>(T) {
          const T value = static_cast<T>(pick(0, 1));
          std::memcpy(state.data() + place.offset, &value, sizeof value);
        });
      }
      return state;
    };
    std::vector<std::pair<CommandId, std::uint32_t>> sent;
    for (int turn = 0; turn < 250; ++turn) {
      const auto lane = static_cast<std::uint32_t>(pick(0, 2));
      const CommandId batch = rig.used_ids[lane] + 1;
      for (int records = pick(0, 4); records > 0; --records) {
        const int what = pick(0, 9);
        if (what == 0) {
          rig.batch.purge(static_cast<std::uint16_t>(pick(0, 5)));
        } else if (what == 1) {
          rig.batch.purge_own(kEveryActuator);
        } else if (what < 5) {
          const auto actuator = static_cast<std::uint32_t>(pick(0, 5));
          RecordHead head = pick(0, 1) == 0 ? direct() : over(pick(1, 9));
          if (pick(0, 2) == 0) head = overwriting(head);
          head.actuator = static_cast<std::uint16_t>(actuator);
          rig.batch.command(head, state_of(actuator));
        } else {
          std::vector<std::vector<std::byte>> rows;
          std::vector<BatchBuilder::Member> members;
          std::vector<const StateLayout*> of;
          const auto count = static_cast<std::size_t>(pick(1, 20));
          const auto profile =
              std::array{Profile::cubic, Profile::linear, Profile::hold}[dice() % 3];
          rows.reserve(6);
          const auto some = static_cast<std::uint64_t>(pick(1, 7));
          for (std::uint32_t i = 0; i < 6; ++i) {
            if (pick(0, 2) == 0) continue;
            rows.emplace_back();
            for (std::size_t k = 0; k < count; ++k) {
              const auto state = state_of(i);
              rows.back().insert(rows.back().end(), state.begin(), state.end());
            }
            RecordHead head;
            head.actuator = static_cast<std::uint16_t>(i);
            head.profile = profile;
            const bool is_masked = i > 3 && pick(0, 1) == 0;
            members.push_back(
                {head, std::span(is_masked ? &some : nullptr, is_masked ? 1 : 0), rows.back()});
            of.push_back(&layouts[i]);
          }
          if (members.empty()) continue;
          const ChunkHead head{
              .anchor = rig.next - pick(-40, 20),
              .plan = static_cast<std::uint64_t>(pick(0, 1)),
              .ease = static_cast<std::uint32_t>(pick(1, 12)),
              .first = static_cast<std::uint32_t>(pick(0, static_cast<int>(count) - 1)),
              .fixed = static_cast<std::uint8_t>(pick(0, 1)),
              .reject_late = static_cast<std::uint8_t>(pick(0, 1)),
              .final = static_cast<std::uint8_t>(pick(0, 1))};
          rig.batch.chunk(members, head, every(static_cast<std::uint32_t>(pick(1, 9)), count), of);
        }
      }
      for (std::uint32_t i = 0; i < rig.batch.records(); ++i) {
        sent.emplace_back(record_id(batch, i), lane);
      }
      const BlockIndex first = rig.send(lane);
      rig.pool.batch(first).ticket = static_cast<std::uint64_t>(turn + pick(0, 3));
      while (pick(0, 3) != 0 && !rig.check(lane, first, static_cast<std::uint32_t>(pick(1, 30)))) {
        rig.step();
      }
      rig.controller.take(lane, first, rig);
      const int event = pick(0, 40);
      if (event == 0) rig.controller.halt(rig.next);
      if (event == 1) rig.controller.restart(rig.observed.data(), nullptr, rig.next++);
      if (event == 2) rig.controller.interrupt(static_cast<std::uint32_t>(pick(0, 5)), rig.next);
      if (event == 3) {
        rig.controller.purge_lane(static_cast<std::uint32_t>(pick(0, 2)), kEveryActuator, rig.next,
                                  Reason::dead_frontend);
      }
      for (int i = pick(0, 12); i > 0; --i) {
        rig.step();
        for (std::uint32_t k = 0; k < 6; ++k) {
          ASSERT_EQ(layouts[k].first_not_finite(rig.controller.desired() +
                                                rig.schema.actuators[k].offset),
                    StateLayout::kNoNumber);
        }
      }
    }
    for (int i = 0; i < 2000 && rig.controller.active(); ++i) rig.step();
    for (int i = 0; i < 3; ++i) rig.step();
    EXPECT_FALSE(rig.controller.active()) << seed;
    for (const auto& [id, lane] : sent) ASSERT_EQ(rig.witness.ends_of(id, lane), 1U) << seed;
    EXPECT_TRUE(rig.all_blocks_back()) << seed;
  }
}

TEST(Chunk, LongOnesWithStatesOfManyNumbersFindTheirRows) {
  for (const std::uint32_t numbers : {1U, 2U, 5U, 6U, 11U}) {
    for (const std::size_t count : {1U, 7U, 8U, 9U, 128U, 129U, 2048U}) {
      ChunkRig rig(plain_robot(1, numbers), 60'000);
      const StateLayout layout(rig.schema, rig.schema.actuators[0].type);
      std::vector<double> rows;
      for (std::size_t i = 0; i < count; ++i) {
        for (std::uint32_t k = 0; k < numbers; ++k)
          rows.push_back(static_cast<double>(i * (k + 1)));
      }
      const auto bytes = bytes_of(rows);
      const std::vector<BatchBuilder::Member> members{{{}, {}, bytes}};
      const std::vector<const StateLayout*> layouts{&layout};
      const auto late = static_cast<Iteration>(count / 2);
      rig.run_to(late * 2 + 2);
      rig.batch.chunk(members, {.anchor = 1, .ease = 1, .fixed = 1}, every(2, count), layouts);
      const CommandId id = rig.pulse() + 2;
      for (Iteration row = late; row < static_cast<Iteration>(count); ++row) {
        while (rig.next <= 1 + 2 * (row + 1)) rig.step();
        for (std::uint32_t k = 0; k < numbers; ++k) {
          ASSERT_EQ(rig.desired(k), static_cast<double>(row) * (k + 1))
              << numbers << ' ' << count << ' ' << row;
        }
      }
      EXPECT_EQ(rig.witness.status(id), Status::completed);
      EXPECT_TRUE(rig.all_blocks_back());
    }
  }
}

}  // namespace
}  // namespace o80::test
