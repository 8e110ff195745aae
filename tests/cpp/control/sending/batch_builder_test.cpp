#include "control/sending/batch_builder.hpp"

#include <gtest/gtest.h>

#include <cstring>
#include <set>

#include "control/rig.hpp"

namespace o80::test {
namespace {

RecordHead head_in(const Block& block) {
  RecordHead head;
  std::memcpy(&head, block.bytes.data(), sizeof head);
  return head;
}

TEST(BatchBuilder, NumbersItsRecordsAfterTheBatch) {
  BatchBuilder builder;
  EXPECT_TRUE(builder.empty());
  EXPECT_EQ(builder.command(direct(), bytes_of_one(1.0)), 0U);
  EXPECT_EQ(builder.command(direct(), {}, {}, 10, bytes_of(std::vector<double>(10))), 1U);
  EXPECT_EQ(builder.purge(kEveryActuator), 2U);
  BatchRecord record;
  record.id = 40;
  record.at = 7;
  record.ticket = 99;
  const auto blocks = builder.seal(record);

  ASSERT_EQ(blocks.size(), 1U + 1U + 2U + 1U);
  BatchRecord written;
  std::memcpy(&written, blocks[0].bytes.data(), sizeof written);
  EXPECT_EQ(written.kind, RecordKind::batch);
  EXPECT_EQ(written.records, 3U);
  EXPECT_EQ(written.blocks, 5U);
  EXPECT_EQ(written.ticket, 99U);
  EXPECT_EQ(written.at, 7);
  EXPECT_EQ(head_in(blocks[1]).id, 42U);
  EXPECT_EQ(head_in(blocks[2]).id, 43U);
  EXPECT_EQ(head_in(blocks[2]).rows, 10U);
  EXPECT_EQ(head_in(blocks[4]).id, 44U);
  EXPECT_EQ(head_in(blocks[4]).kind, RecordKind::purge);
}

TEST(BatchBuilder, IsEmptyAgainWhenCleared) {
  BatchBuilder builder;
  builder.take_control();
  builder.clear();
  EXPECT_TRUE(builder.empty());
  EXPECT_EQ(builder.blocks(), 1U);
  EXPECT_EQ(builder.seal({}).size(), 1U);
}

TEST(BatchBuilder, WhatWasSeenIsABlockBehindItsRecordsThatTheyDoNotCount) {
  BatchBuilder builder;
  builder.purge(kEveryActuator);
  builder.set_seen(Seen{.epoch = 5, .iteration = 7, .time = 9, .clock = Clock::simulated});
  EXPECT_EQ(builder.blocks(), 3U);
  EXPECT_EQ(builder.records(), 1U);
  const auto blocks = builder.seal({});

  ASSERT_EQ(blocks.size(), 3U);
  BatchRecord written;
  std::memcpy(&written, blocks[0].bytes.data(), sizeof written);
  EXPECT_EQ(written.records, 1U);
  EXPECT_EQ(written.blocks, 3U);
  EXPECT_TRUE((written.flags & kExpress) != 0) << "a purge is as fast with it";
  EXPECT_EQ(head_in(blocks[2]).kind, RecordKind::seen);
  builder.clear();
  EXPECT_EQ(builder.seal({}).size(), 1U);
}

template <class Enum>
void every_value_has_its_own_text(Enum last) {
  std::set<std::string_view> texts;
  for (int i = 0; i <= static_cast<int>(last); ++i) {
    EXPECT_TRUE(texts.insert(to_text(static_cast<Enum>(i))).second);
  }
  EXPECT_EQ(texts.count("unknown"), 0U);
  EXPECT_EQ(to_text(static_cast<Enum>(200)), "unknown");
}

TEST(Record, EveryWordHasItsText) {
  every_value_has_its_own_text(Mode::overwrite);
  every_value_has_its_own_text(Pace::fastest);
  every_value_has_its_own_text(Profile::minimum_jerk);
  every_value_has_its_own_text(Start::observed);
  every_value_has_its_own_text(Status::halted);
  every_value_has_its_own_text(Reason::reading);
}

}  // namespace
}  // namespace o80::test
