// Plans of chunks that run out of rows (docs/chunks.md#a-policy-that-hangs).
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <functional>
#include <random>

#include "cases.hpp"
#include "control/chunk_rig.hpp"

namespace o80::test {
namespace {

// rule K11
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
  for (unsigned seed = 0; seed < cases(60U); ++seed) {
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
        const CommandId id = rig.chunk(rows, due, head, Profile::monotone, {actuator}, lane);
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
  EXPECT_GT(marks, cases(2000U));
}

}  // namespace
}  // namespace o80::test
