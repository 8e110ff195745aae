#include "runtime/frontend/sent_commands.hpp"

#include <gmock/gmock.h>

#include "control/sending/batch_builder.hpp"

namespace o80::test {
namespace {

/// A command for the first actuator in a batch of its own.
void note(SentCommands& sent, CommandId batch, Mode mode, Pace pace, Iteration at = kNow) {
  BatchBuilder builder;
  RecordHead head;
  head.mode = mode;
  head.pace = pace;
  const double target = 1.0;
  builder.command(head, std::as_bytes(std::span(&target, 1)));
  BatchRecord record;
  record.id = batch;
  record.at = at;
  sent.note(builder.seal(record), nullptr);
}

TEST(SentCommands, RememberTheActuatorsOfEachRecord) {
  BatchBuilder builder;
  const std::array<double, 2> targets{1.0, 2.0};
  const auto bytes = std::as_bytes(std::span(targets));
  RecordHead first, second;
  second.actuator = 1;
  const std::array<BatchBuilder::Member, 2> members{
      BatchBuilder::Member{first, {}, bytes.first(8)},
      BatchBuilder::Member{second, {}, bytes.last(8)}};
  builder.request(3, {});
  builder.group(members);
  builder.command(second, {}, {}, 2, bytes);
  SentCommands sent(2);
  std::vector<SentCommand> noted;
  sent.note(builder.seal({}), &noted);
  ASSERT_EQ(noted.size(), 4U);
  EXPECT_EQ(noted[0].kind, RecordKind::request);
  EXPECT_EQ(noted[0].index, 3);
  EXPECT_EQ(noted[1].place, 1U);
  EXPECT_EQ(noted[1].index, 0);
  EXPECT_EQ(noted[2].place, 1U);
  EXPECT_EQ(noted[2].index, 1);
  EXPECT_EQ(noted[3].place, 2U);
}

TEST(SentCommands, EachGivesWayToWhatMayEndItAsOverwritten) {
  const SentCommand paced{.gives_way = GivesWay::to_overwrite};
  const SentCommand set_point{.gives_way = GivesWay::to_direct};
  const SentCommand trajectory{.gives_way = GivesWay::to_any};
  SentCommands sent(2);
  note(sent, 10, Mode::queue, Pace::iterations);
  EXPECT_FALSE(sent.has_replaced(5, 1, paced));
  EXPECT_FALSE(sent.has_replaced(5, 1, set_point));
  EXPECT_TRUE(sent.has_replaced(5, 1, trajectory));
  note(sent, 20, Mode::queue, Pace::direct);
  EXPECT_FALSE(sent.has_replaced(5, 1, paced));
  EXPECT_TRUE(sent.has_replaced(5, 1, set_point));
  EXPECT_FALSE(sent.has_replaced(30, 1, set_point)) << "it is newer";
  note(sent, 40, Mode::overwrite, Pace::iterations);
  EXPECT_TRUE(sent.has_replaced(5, 1, paced));
  EXPECT_FALSE(sent.has_replaced(5, 1, {.index = 1})) << "of another actuator";
}

TEST(SentCommands, OneThatWaitsForItsIterationMayEndANewerOne) {
  SentCommands sent(1);
  note(sent, 10, Mode::overwrite, Pace::iterations, 7);
  EXPECT_TRUE(sent.has_replaced(20, 7, {}));
  EXPECT_FALSE(sent.has_replaced(20, 8, {}));
}

}  // namespace
}  // namespace o80::test
