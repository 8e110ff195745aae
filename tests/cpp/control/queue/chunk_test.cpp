// Chunks: rows of targets, each due in an iteration (docs/chunks.md).
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <functional>
#include <map>
#include <sstream>
#include <string>
#include <utility>

#include "cases.hpp"
#include "control/chunk_rig.hpp"

namespace o80::test {
namespace {

/// The worked examples, each in a line: the first iteration, place and speed before it, and words
/// of the chunk; what is told of it: when it `begins` and `ends`, the `row` with which its
/// take-over ends, by how much it is `late`, or that it is `rejected`; then iterations and where
/// the motion is in them, bit for bit behind an =.
constexpr auto kExamples = R"(
  101 0    0     smooth   ease 10 begins 101 ends 150 110 =0 120 =0.1 130 =0.3 140 =0.3 150 =0.2
  101 0    0     monotone ease 10 begins 101 ends 150 110 =0 120 =0.1 130 =0.3 140 =0.3 150 =0.2
  101 0    0     smooth   ease 10 105 -0.00625  115 0.0375  125 0.20625  135 0.31875  145 0.240625
  101 0    0     monotone ease 10 115 0.03125  125 0.21875  135 0.3  145 0.25  155 0.2
  117 0.05 0.01  smooth   ease 1  117 0.060403  118 0.072366  119 0.085763  120 0.1  125 0.205804
  117 0.05 0.01  monotone ease 1  117 0.060692  118 0.072679  119 0.085826  120 0.1  125 0.218304
  120 0.05 0.01  smooth   ease 1  120 0.1  121 0.137218
  120 0.05 0.01  monotone ease 1  120 0.1  121 0.138
  117 0.05 0.01  smooth   ease 10 row 2 117 0.060359  120 0.106058  125 0.225001  130 0.3
  117 0.05 0.01  monotone ease 10 117 0.062267  120 0.119971  125 0.238593  130 0.3
  147 0.25 -0.01 smooth   ease 10 ends 156 147 0.240095  150 0.21512  156 0.2
  147 0.25 -0.01 monotone ease 10 147 0.2405  150 0.218  156 0.2
  117 0.05 0.01  linear   ease 10 117 0.067857  124 0.192857  130 0.3
  117 0.05 0.01  hold     ease 10 117 0.1  120 0.1  121 0.3  140 0.3  141 0.2  154 0.2
# where all rows are late, it is rejected and the plan goes on
  150 0.05 0.01  smooth   ease 1 ends 150 150 =0.2
  151 0.05 0.01  smooth   ease 1 rejected 155 0.1
# a prefix that is frozen is not played: nothing changes before
  105 0.05 0.001 smooth   ease 10 first 3 begins 131 130 0.076 140 =0.3
  135 0.05 0.001 smooth   ease 10 first 3 begins 135 134 0.05 150 =0.2
  140 0.05 0.001 smooth   ease 10 first 3 strict begins 140
  141 0.05 0.001 smooth   ease 10 first 3 strict rejected
# standing still does not count
  451 0    0     smooth   ease 10 late 350 460 =0 470 =0.1 480 =0.3 490 =0.3 500 =0.2
  451 0    0     smooth   ease 10 first 3 late 350 460 =0 470 =0.1 480 =0.3 490 =0.3 500 =0.2
  451 0    0     smooth   ease 10 fixed rejected
# an anchor ahead waits
  101 0.05 0.0001 smooth  ease 10 anchor 400 begins 401 400 0.08 410 =0)";

// rules K5, K6, K7, K9
TEST(Chunk, IsPlayedAsInTheWorkedExamples) {
  const std::array profiles{Profile::smooth, Profile::monotone, Profile::linear, Profile::hold};
  std::istringstream lines(kExamples);
  for (std::string line; std::getline(lines, line);) {
    if (line.empty() || line[0] == '#') continue;
    SCOPED_TRACE(line);
    std::istringstream in(line);
    Iteration now = 0;
    double place = 0.0, speed = 0.0;
    std::string profile;
    in >> now >> place >> speed >> profile;
    ChunkHead head;
    std::map<std::string, Iteration> told;
    std::map<Iteration, std::string> places;
    for (std::string word; in >> word;) {
      const bool is_alone = word == "fixed" || word == "strict" || word == "rejected";
      if (std::isdigit(word[0]) != 0) {
        in >> places[std::stoll(word)];
      } else if (is_alone || !(in >> told[word])) {
        told[word] = 1;
      }
    }
    head.ease = static_cast<std::uint32_t>(told["ease"]);
    head.first = static_cast<std::uint32_t>(told["first"]);
    head.anchor = told["anchor"];
    head.fixed = static_cast<std::uint8_t>(told["fixed"]);
    head.reject_late = static_cast<std::uint8_t>(told["strict"]);
    ChunkRig rig;
    speed == 0.0 ? rig.run_to(now) : rig.reach(now, place, speed);
    const CommandId id = rig.example(
        head, *std::ranges::find(profiles, profile, [](Profile p) { return to_text(p); }));
    rig.run_to(520);
    EXPECT_NEAR(rig.at(now - 1), place, 1e-12);
    for (const auto& [iteration, wanted] : places) {
      const bool is_exact = wanted[0] == '=';
      EXPECT_NEAR(rig.at(iteration), std::stod(wanted.substr(is_exact ? 1 : 0)),
                  is_exact ? 0.0 : kDigits)
          << iteration;
    }
    const StatusChange end = rig.witness.last(id);
    EXPECT_EQ(end.status, told.contains("rejected") ? Status::rejected : Status::completed);
    EXPECT_EQ(end.reason, told.contains("rejected") ? Reason::late : Reason::none);
    const auto expect = [&](const char* word, Iteration found) {
      EXPECT_EQ(found, told.contains(word) ? told[word] : found) << word;
    };
    expect("begins", rig.witness.of(id).front().iteration);
    expect("ends", end.iteration);
    expect("late", rig.witness.of(id - 2).back().late);
    const StatusChange told_last = rig.witness.last(id - 1);
    const auto begun = BegunChunk::of(told_last.detail, told_last.late);
    expect("row", begun ? Iteration{begun->row} : -1);
    EXPECT_TRUE(rig.all_blocks_back() || told.contains("rejected")) << "the motion before goes on";
  }
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

TEST(Chunk, ATakeOverMayPassWhereItWasByAThirdOfItsSpeed) {
  for (const auto& [profile, wanted] :
       {std::pair(Profile::smooth, std::array{0.508954, 0.512768, 0.509102, 0.498016, 0.48125}),
        std::pair(Profile::monotone, std::array{0.5062, 0.5056, 0.4994, 0.4888, 0.475})}) {
    ChunkRig rig;
    rig.reach(101, 0.5, 0.01);
    rig.chunk({0.4, 0.3}, every(10, 2), {.anchor = 100, .ease = 10}, profile);
    rig.run_to(121);
    for (std::size_t i = 0; i < 5; ++i)
      EXPECT_NEAR(rig.at(101 + static_cast<Iteration>(i)), wanted[i], kDigits);
    EXPECT_EQ(rig.at(110), 0.4);
  }
}

// rule K2
TEST(Chunk, OneOverwritesAnotherFromItsPlan) {
  ChunkRig rig;
  rig.run_to(101);
  const CommandId first = rig.example({.ease = 10}, Profile::monotone);
  rig.run_to(117);  // the plan of the first: 116
  const CommandId second =
      rig.chunk({0.1, 0.5}, {20, 30}, {.anchor = 110, .ease = 10}, Profile::monotone);
  rig.run_to(145);
  EXPECT_EQ(rig.witness.last(first).status, Status::overwritten);
  EXPECT_EQ(rig.witness.last(first).iteration, 117);
  EXPECT_EQ(rig.witness.last(second).status, Status::completed);
  EXPECT_EQ(rig.at(130), 0.1);
  EXPECT_EQ(rig.at(140), 0.5);
  EXPECT_LT(std::abs(rig.at(117) - 2 * rig.at(116) + rig.at(115)), 0.002) << "no jump of velocity";
}

// rule K6
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

// rule K16
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

TEST(Chunk, NumbersThatCannotBeInterpolatedAreHeldFromTheFirstIteration) {
  ChunkRig rig(
      robot_of({scalar_field("place", Kind::float64), scalar_field("open", Kind::boolean)}));
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

TEST(Chunk, OfSeveralActuatorsOneThatIsTakenAwayLeavesTheOthers) {
  for (const Status status : {Status::overwritten, Status::purged}) {
    ChunkRig rig(plain_robot(3));
    rig.run_to(101);
    rig.add_chunk(kRows, every(10, 5), {.anchor = 100, .ease = 10}, Profile::monotone, {0, 1, 2});
    const BlockIndex chunk = rig.send();
    const CommandId id = record_id(rig.sent, 0);
    rig.pool.batch(chunk).ticket = 10;
    if (status == Status::purged) {
      rig.batch.purge(1);  // sent after it, and taken before
      const BlockIndex purge = rig.send(1);
      rig.pool.batch(purge).ticket = 11;
      rig.controller.take(1, purge, rig);
    }
    rig.controller.take(0, chunk, rig);
    rig.run_to(125);
    if (status == Status::overwritten) {
      rig.add(1, overwriting(over(2)), {7.0});
      rig.pulse();
    }
    rig.run_to(155);
    EXPECT_EQ(rig.desired(0), 0.2);
    EXPECT_EQ(rig.desired(1), status == Status::overwritten ? 7.0 : 0.0);
    EXPECT_EQ(rig.desired(2), 0.2);
    EXPECT_EQ(rig.witness.last(id).status, status);
    EXPECT_EQ(rig.witness.last(id).iteration, 150) << "told when the last one ends";
    EXPECT_TRUE(rig.all_blocks_back());
  }
}

TEST(Chunk, ThatBeginsAtOnceNeedsNoPlaceAmongThoseThatWait) {
  ChunkRig rig(plain_robot(2));
  rig.run_to(10);
  std::vector<CommandId> waiting;
  for (Iteration i = 0; i < 65; ++i) {
    waiting.push_back(rig.chunk({1.0}, {5}, {.anchor = 1000 + i}, Profile::monotone, {0}));
  }
  const CommandId at_once = rig.chunk({1.0}, {5}, {.anchor = 9}, Profile::monotone, {1});
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
  ChunkRig rig(robot_of({scalar_field("", Kind::int64)}));
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
  for (const Profile profile : {Profile::hold, Profile::smooth}) {
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

// rule K8
TEST(Chunk, EveryRowThatIsDueIsShown) {
  std::size_t exact = 0;
  for (unsigned seed = 0; seed < cases(200U); ++seed) {
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
  EXPECT_GT(exact, cases(10'000U));
}

// rule K3
TEST(Chunk, RowsThatAreLateChangeNoBit) {
  for (unsigned seed = 0; seed < 50; ++seed) {
    ChunkRig one;
    ChunkRig other;
    const auto rows = ChunkScript(seed).run(one, 800);
    const auto odd = ChunkScript(seed, 1e6).run(other, 800);
    EXPECT_EQ(bytes_of(rows), bytes_of(odd)) << seed;
  }
}

TEST(Chunk, LongOnesWithStatesOfManyNumbersFindTheirRows) {
  for (const std::uint32_t numbers : {1U, 2U, 5U, 6U, 11U}) {
    for (const std::size_t count : {1U, 7U, 8U, 9U, 128U, 129U, 2048U}) {
      ChunkRig rig(plain_robot(1, numbers), 60'000);
      std::vector<double> rows;
      for (std::size_t i = 0; i < count; ++i) {
        for (std::uint32_t k = 0; k < numbers; ++k)
          rows.push_back(static_cast<double>(i * (k + 1)));
      }
      const auto late = static_cast<Iteration>(count / 2);
      rig.run_to(late * 2 + 2);
      const CommandId id =
          rig.chunk(rows, every(2, count), {.anchor = 1, .ease = 1, .fixed = 1}, Profile::linear);
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
