// Chunks with numbers, bytes and company that they must survive.
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <functional>
#include <limits>

#include "cases.hpp"
#include "control/chunk_rig.hpp"

namespace o80::test {
namespace {

TEST(ChunkHostile, WhatCannotBeIsInvalidAndNothingIsLost) {
  const auto in_chunk = [](auto change) {
    return [change](std::vector<Block>& blocks) { edit<ChunkHead>(blocks[2], change); };
  };
  const auto in_member = [](auto change) {
    return [change](std::vector<Block>& blocks) { edit<RecordHead>(blocks[3], change); };
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
    rig.add_chunk(kRows, every(10, 5), {.anchor = 9, .ease = 10}, Profile::smooth);
    std::vector<Block> blocks = rig.sealed();
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

/// Chunks of three lanes for overlapping actuators of different types, among all else that there
/// is.
// rule S1
TEST(ChunkHostile, AmongCommandsPurgesHaltsAndFreshStartsEachEndsOnce) {
  for (unsigned seed = 0; seed < cases(60U); ++seed) {
    Dice dice(seed);
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
          const T value = static_cast<T>(dice.whole(0, 1));
          std::memcpy(state.data() + place.offset, &value, sizeof value);
        });
      }
      return state;
    };
    std::vector<std::pair<CommandId, std::uint32_t>> sent;
    for (int turn = 0; turn < 250; ++turn) {
      const auto lane = static_cast<std::uint32_t>(dice.whole(0, 2));
      const CommandId batch = rig.used_ids[lane] + 1;
      for (std::int64_t records = dice.whole(0, 4); records > 0; --records) {
        const std::int64_t what = dice.whole(0, 9);
        if (what == 0) {
          rig.batch.purge(static_cast<std::uint16_t>(dice.whole(0, 5)));
        } else if (what == 1) {
          rig.batch.purge_own(kEveryActuator);
        } else if (what < 5) {
          const auto actuator = static_cast<std::uint32_t>(dice.whole(0, 5));
          RecordHead head = dice.whole(0, 1) == 0 ? direct() : over(dice.whole(1, 9));
          if (dice.whole(0, 2) == 0) head = overwriting(head);
          head.actuator = static_cast<std::uint16_t>(actuator);
          rig.batch.command(head, state_of(actuator));
        } else {
          std::vector<std::vector<std::byte>> rows;
          std::vector<BatchBuilder::Member> members;
          std::vector<const StateLayout*> of;
          const auto count = static_cast<std::size_t>(dice.whole(1, 20));
          const auto profile =
              std::array{Profile::smooth, Profile::monotone, Profile::linear,
                         Profile::hold}[static_cast<std::size_t>(dice.whole(0, 3))];
          rows.reserve(6);
          const auto some = static_cast<std::uint64_t>(dice.whole(1, 7));
          for (std::uint32_t i = 0; i < 6; ++i) {
            if (dice.whole(0, 2) == 0) continue;
            rows.emplace_back();
            for (std::size_t k = 0; k < count; ++k) {
              const auto state = state_of(i);
              rows.back().insert(rows.back().end(), state.begin(), state.end());
            }
            RecordHead head;
            head.actuator = static_cast<std::uint16_t>(i);
            head.profile = profile;
            const bool is_masked = i > 3 && dice.whole(0, 1) == 0;
            members.push_back(
                {head, std::span(is_masked ? &some : nullptr, is_masked ? 1 : 0), rows.back()});
            of.push_back(&layouts[i]);
          }
          if (members.empty()) continue;
          const ChunkHead head{.anchor = rig.next - dice.whole(-40, 20),
                               .plan = static_cast<std::uint64_t>(dice.whole(0, 1)),
                               .ease = static_cast<std::uint32_t>(dice.whole(0, 12)),
                               .first = static_cast<std::uint32_t>(
                                   dice.whole(0, static_cast<std::int64_t>(count) - 1)),
                               .fixed = static_cast<std::uint8_t>(dice.whole(0, 1)),
                               .reject_late = static_cast<std::uint8_t>(dice.whole(0, 1)),
                               .final = static_cast<std::uint8_t>(dice.whole(0, 1))};
          rig.batch.chunk(members, head, every(static_cast<std::uint32_t>(dice.whole(1, 9)), count),
                          of);
        }
      }
      for (std::uint32_t i = 0; i < rig.batch.records(); ++i) {
        sent.emplace_back(record_id(batch, i), lane);
      }
      const BlockIndex first = rig.send(lane);
      rig.pool.batch(first).ticket = static_cast<std::uint64_t>(turn + dice.whole(0, 3));
      while (dice.whole(0, 3) != 0 &&
             !rig.check(lane, first, static_cast<std::uint32_t>(dice.whole(1, 30)))) {
        rig.step();
      }
      rig.controller.take(lane, first, rig);
      const std::int64_t event = dice.whole(0, 40);
      if (event == 0) rig.controller.halt(rig.next);
      if (event == 1) rig.controller.restart(rig.observed.data(), nullptr, rig.next++);
      if (event == 2)
        rig.controller.interrupt(static_cast<std::uint32_t>(dice.whole(0, 5)), rig.next);
      if (event == 3) {
        rig.controller.purge_lane(static_cast<std::uint32_t>(dice.whole(0, 2)), kEveryActuator,
                                  rig.next, Reason::dead_frontend);
      }
      for (std::int64_t i = dice.whole(0, 12); i > 0; --i) {
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

}  // namespace
}  // namespace o80::test
