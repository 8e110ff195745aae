#include "control/receiving/record_check.hpp"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>

#include "control/rig.hpp"

namespace o80::test {
namespace {

Schema checked_robot() {
  Schema schema = plain_robot(2, 2);
  LabelRow label;
  label.name = NameText("open");
  label.value = 3;
  schema.labels.push_back(label);
  FieldRow grip = scalar_field("grip", Kind::enumeration);
  grip.size = 4;
  grip.labels = 1;
  const auto gripper = schema.add_type(
      "Gripper", {scalar_field("hot", Kind::boolean), grip, scalar_field("f", Kind::float32)});
  schema.add_actuators("gripper", gripper, 1, false);
  schema.add_request("shake", gripper, "shake it");
  return schema;
}

/// A batch of one record whose head or payload somebody has spoilt: what becomes of the record.
template <class Spoil>
StatusChange spoilt(RecordHead head, const std::vector<std::byte>& states, Spoil&& spoil,
                    const std::vector<std::uint64_t>& mask = {},
                    const std::vector<std::int64_t>& times = {}, std::uint32_t rows = 1) {
  Rig rig(checked_robot());
  rig.add(0, direct(), {7.0, 7.0});
  rig.batch.command(head, mask, times, rows, states);
  rig.add(1, direct(), {5.0, 5.0});
  std::vector<Block> blocks = rig.sealed();
  edit<RecordHead>(blocks[2], [&](RecordHead& sent) {
    spoil(sent, reinterpret_cast<double*>(blocks[2].bytes.data() + sizeof sent));
    head = sent;
  });
  rig.controller.take(0, rig.place(blocks), rig);
  rig.run(10);
  EXPECT_EQ(rig.witness.ends_of(3), 1U);
  EXPECT_EQ(rig.witness.status(3), Status::completed) << "the record before is no worse for it";
  EXPECT_EQ(rig.witness.ends_of(5), 1U);
  if (head.payload_bytes <= 16 && mask.empty() && times.empty()) {
    EXPECT_EQ(rig.witness.status(5), Status::completed) << "nor is the one behind";
  }
  EXPECT_EQ(rig.witness.status(2), Status::completed);
  EXPECT_TRUE(rig.all_blocks_back());
  return rig.witness.last(4);
}

template <class Spoil>
bool refused(RecordHead head, Spoil&& spoil) {
  const StatusChange change = spoilt(head, bytes_of<double>({1.0, 2.0}), spoil);
  return change.status == Status::rejected && change.reason == Reason::invalid;
}

TEST(RecordCheck, AProperRecordPasses) {
  EXPECT_FALSE(refused(over(1), [](RecordHead&, double*) {}));
  EXPECT_FALSE(refused(at_speed(1e5), [](RecordHead&, double*) {}));
}

TEST(RecordCheck, EveryFieldOutOfItsRangeIsRefused) {
  EXPECT_TRUE(refused(direct(), [](RecordHead& h, double*) { h.actuator = 3; }));
  EXPECT_TRUE(refused(direct(), [](RecordHead& h, double*) { h.actuator = kEveryActuator; }));
  EXPECT_TRUE(refused(direct(), [](RecordHead& h, double*) { h.mode = static_cast<Mode>(2); }));
  EXPECT_TRUE(refused(direct(), [](RecordHead& h, double*) { h.pace = static_cast<Pace>(5); }));
  EXPECT_TRUE(
      refused(direct(), [](RecordHead& h, double*) { h.profile = static_cast<Profile>(3); }));
  EXPECT_TRUE(refused(over(3), [](RecordHead& h, double*) { h.profile = Profile::as_sent; }));
  EXPECT_FALSE(refused(over(3), [](RecordHead& h, double*) { h.profile = Profile::monotone; }));
  EXPECT_TRUE(refused(direct(), [](RecordHead& h, double*) { h.profile = Profile::monotone; }));
  EXPECT_TRUE(refused(at_speed(1.0), [](RecordHead& h, double*) { h.profile = Profile::hold; }));
  EXPECT_TRUE(
      refused(over(3), [](RecordHead& h, double*) { h.profile = static_cast<Profile>(6); }));
  EXPECT_TRUE(refused(direct(), [](RecordHead& h, double*) { h.amount = -1; }));
  EXPECT_TRUE(refused(direct(), [](RecordHead& h, double*) { h.start = static_cast<Start>(2); }));
  EXPECT_TRUE(refused(direct(), [](RecordHead& h, double*) { h.masked = 1; }));
  EXPECT_TRUE(refused(direct(), [](RecordHead& h, double*) { h.masked = 2; }));
  EXPECT_TRUE(refused(direct(), [](RecordHead& h, double*) { h.id = 77; }));
  for (int kind = 0; kind < 256; ++kind) {
    if (kind == static_cast<int>(RecordKind::command)) continue;
    if (kind == static_cast<int>(RecordKind::mark)) continue;  // holds any bytes
    EXPECT_TRUE(
        refused(direct(), [&](RecordHead& h, double*) { h.kind = static_cast<RecordKind>(kind); }));
  }
}

TEST(RecordCheck, SizesThatDoNotFitAreRefused) {
  for (const std::uint32_t bytes : {0U, 8U, 15U, 17U, 100U, 1000U, 0x7FFFFFFFU, 0xFFFFFFFFU}) {
    EXPECT_TRUE(refused(direct(), [&](RecordHead& h, double*) { h.payload_bytes = bytes; }));
  }
  for (const std::uint32_t rows : {0U, 2U, 0x10000001U, 0xFFFFFFFFU}) {
    EXPECT_TRUE(refused(direct(), [&](RecordHead& h, double*) { h.rows = rows; }));
  }
}

TEST(RecordCheck, PacesThatNoOneCanKeepAreRefused) {
  constexpr auto kMin = std::numeric_limits<std::int64_t>::min();
  constexpr auto kMax = std::numeric_limits<std::int64_t>::max();
  for (const std::int64_t amount : {kMin, std::int64_t{-1}, kMax}) {
    EXPECT_TRUE(refused(over(1), [&](RecordHead& h, double*) { h.amount = amount; }));
    EXPECT_TRUE(refused(during(1), [&](RecordHead& h, double*) { h.amount = amount; }));
  }
  EXPECT_TRUE(refused(until(1), [&](RecordHead& h, double*) { h.amount = kMax; }));
  EXPECT_EQ(spoilt(until(1), bytes_of<double>({1.0, 2.0}),
                   [&](RecordHead& h, double*) { h.amount = kMin; })
                .reason,
            Reason::late);
  for (const double speed : {0.0, -1.0, std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    EXPECT_TRUE(refused(at_speed(1.0), [&](RecordHead& h, double*) { h.speed = speed; }));
  }
}

TEST(RecordCheck, TargetsThatAreNoNumbersAreRefused) {
  for (const double value : {std::nan(""), HUGE_VAL, -HUGE_VAL}) {
    EXPECT_TRUE(refused(direct(), [&](RecordHead&, double* state) { state[0] = value; }));
    EXPECT_TRUE(refused(direct(), [&](RecordHead&, double* state) { state[1] = value; }));
    // in the last row of many
    std::vector<double> rows(2 * 1000, 1.0);
    rows.back() = value;
    EXPECT_EQ(spoilt(
                  over(1), bytes_of(rows), [](RecordHead&, double*) {}, {}, {}, 1000)
                  .reason,
              Reason::invalid);
  }
}

TEST(RecordCheck, BooleansEnumerationsAndFloatsOfAStateAreLookedAt) {
  RecordHead head = direct();
  head.actuator = 2;
  struct Gripper {
    std::uint8_t hot = 1;
    std::int32_t grip = 3;
    float f = 1.0F;
  };
  const auto reason = [&](const Gripper& gripper) {
    return spoilt(head, bytes_of_one(gripper), [](RecordHead&, double*) {}).reason;
  };
  EXPECT_EQ(reason({}), Reason::none);
  EXPECT_EQ(reason({2, 3, 1.0F}), Reason::invalid);
  EXPECT_EQ(reason({1, 4, 1.0F}), Reason::invalid);
  EXPECT_EQ(reason({1, 3, NAN}), Reason::invalid);
}

TEST(RecordCheck, MasksOfNumbersThatAreNotThereAreRefused) {
  const auto nothing = [](RecordHead&, double*) {};
  const auto states = bytes_of<double>({1.0, 2.0});
  EXPECT_EQ(spoilt(direct(), states, nothing, {0b11}).status, Status::completed);
  EXPECT_EQ(spoilt(direct(), states, nothing, {0b00}).status, Status::completed);
  EXPECT_EQ(spoilt(direct(), states, nothing, {0b100}).reason, Reason::invalid);
}

TEST(RecordCheck, TimesThatRunBackwardsAreRefused) {
  const auto nothing = [](RecordHead&, double*) {};
  const auto states = bytes_of(std::vector<double>(6));
  const auto reason = [&](const std::vector<std::int64_t>& times) {
    return spoilt(during(0), states, nothing, {}, times, 3).reason;
  };
  EXPECT_EQ(reason({0, 1, 1}), Reason::none);
  EXPECT_EQ(reason({-1, 1, 2}), Reason::invalid);
  EXPECT_EQ(reason({3, 2, 4}), Reason::invalid);
  EXPECT_EQ(reason({0, 1, std::numeric_limits<std::int64_t>::max()}), Reason::invalid);
  EXPECT_EQ(spoilt(until(9), states, nothing, {}, {}, 3).reason, Reason::invalid);
}

TEST(RecordCheck, ABatchWhoseHeadIsGarbageIsRejectedWhole) {
  for (int spoil = 0; spoil < 5; ++spoil) {
    Rig rig(checked_robot());
    for (int i = 0; i < 3; ++i) rig.add(0, direct(), {7.0, 7.0});
    std::vector<Block> blocks = rig.sealed(0);
    edit<BatchRecord>(blocks[0], [&](BatchRecord& record) {
      if (spoil == 0) record.kind = RecordKind::command;
      if (spoil == 1) record.records = 0xFFFFFFFF;
      if (spoil == 2) record.records = 4;
      if (spoil == 3) record.blocks = 3;
      if (spoil == 4) record.blocks = 400;
    });
    rig.controller.take(0, rig.place(blocks), rig);
    rig.run(5);
    EXPECT_EQ(rig.witness.last(0).reason, Reason::invalid);
    EXPECT_EQ(rig.witness.last(1).status, Status::rejected);
    EXPECT_EQ(rig.witness.last(2).status, Status::rejected);
    EXPECT_EQ(rig.witness.changes.size(), 5U);
    EXPECT_EQ(rig.desired(), 0.0);
    EXPECT_TRUE(rig.all_blocks_back());
    EXPECT_EQ(rig.witness.freed_blocks[0], 4U);
  }
}

TEST(RecordCheck, ABatchWithFewerRecordsThanBlocksFreesThemAll) {
  Rig rig(checked_robot());
  for (int i = 0; i < 3; ++i) rig.add(0, direct(), {7.0, 7.0});
  std::vector<Block> blocks = rig.sealed(0);
  edit<BatchRecord>(blocks[0], [](BatchRecord& record) { record.records = 1; });
  rig.controller.take(0, rig.place(blocks), rig);
  rig.run(2);
  EXPECT_EQ(rig.witness.status(2), Status::completed);
  EXPECT_EQ(rig.witness.status(3), Status::none);
  EXPECT_TRUE(rig.all_blocks_back());
}

TEST(RecordCheck, MarksWithoutTextOrWithTooMuchAreRefused) {
  for (const std::uint32_t length : {0U, kMaxMarkBytes + 1}) {
    Rig rig(checked_robot());
    rig.batch.mark(std::string(kMaxMarkBytes, 'x'));
    std::vector<Block> blocks = rig.sealed();
    blocks.resize(blocks.size() + 1);
    edit<BatchRecord>(blocks[0], [&](BatchRecord& record) {
      record.blocks = static_cast<std::uint32_t>(blocks.size());
    });
    edit<RecordHead>(blocks[1], [&](RecordHead& head) { head.payload_bytes = length; });
    rig.controller.take(0, rig.place(blocks), rig);
    rig.run(2);
    EXPECT_EQ(rig.witness.last(3).reason, Reason::invalid) << length;
    EXPECT_TRUE(rig.all_blocks_back());
  }
}

}  // namespace
}  // namespace o80::test
