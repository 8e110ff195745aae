// One command for several actuators, as a frontend adds it and a backend carries it out.

#include <array>
#include <vector>

#include "runtime/trace.hpp"

namespace o80::test {
namespace {

constexpr std::array<std::uint32_t, 2> kBoth{0, 1};

std::uint32_t add_both(UntypedFrontend& frontend, double shoulder, double elbow,
                       const CommandOptions& options = {}) {
  const std::array<double, 2> targets{shoulder, elbow};
  return frontend.add_commands(kBoth, std::as_bytes(std::span(targets)), options);
}

class GroupCommandTest : public ManualBackendTest {};

// rule C21
TEST_F(GroupCommandTest, IsOneRecordWithOneStatus) {
  play(R"(a = 0,1 to 2 4 over 2; run 1; a active @1; run 1; a completed @2; a ended 2
    0 rows 1: 1 2; 1 rows 1: 2 4)");
}

TEST_F(GroupCommandTest, ATrajectoryIsOneToo) {
  auto [manual, frontend] = StartedPair();
  const std::array<double, 6> rows{1, 2, 3, 10, 20, 30};
  frontend.add_trajectories(kBoth, 3, std::as_bytes(std::span(rows)));
  const Batch batch = frontend.pulse();
  EXPECT_EQ(batch.size(), 1U);
  manual.run(3);
  EXPECT_THAT(desired(frontend, 1, 3), ElementsAre(1, 2, 3));
  EXPECT_THAT(desired(frontend, 1, 3, 1), ElementsAre(10, 20, 30));
  EXPECT_EQ(batch.handle(0).status, Status::completed);
}

TEST_F(GroupCommandTest, IsRefusedWholeWithTheReason) {
  auto [manual, frontend] = StartedPair({.segment = "pair"}, [](Schema& schema) {
    schema.actuator(1).limits({.minimum = -1, .maximum = 1, .speed = 10});
  });
  const auto refusal = [&](std::vector<std::uint32_t> actuators, std::vector<double> targets,
                           const CommandOptions& options = {.pace = iterations(2)}) {
    return message_of<InvalidArgument>(
        [&] { frontend.add_commands(actuators, std::as_bytes(std::span(targets)), options); });
  };
  EXPECT_THAT(refusal({}, {}), HasSubstr("at least one actuator"));
  EXPECT_THAT(refusal({0, 2}, {0.5, 0.5}), HasSubstr("shoulder (0), elbow (1)"));
  EXPECT_THAT(refusal({1, 0, 1}, {0.5, 0.5, 0.5}), AllOf(HasSubstr("'elbow'"), HasSubstr("twice")));
  EXPECT_THAT(refusal({0, 1}, {0.5, 1.5}), HasSubstr("elbow"));
  EXPECT_THAT(refusal({0, 1}, {std::nan(""), 0.5}), HasSubstr("shoulder"));
  EXPECT_THAT(refusal({0, 1}, {0.5, 0.5}, {.pace = speed(11)}), HasSubstr("elbow"));
  EXPECT_THAT(refusal({0, 1}, {0.5, 0.5}, {.pace = fastest()}), HasSubstr("shoulder"));
  EXPECT_THAT(refusal({0, 1}, {0.5}), AllOf(HasSubstr("2 actuators"), HasSubstr("16 bytes")));
  EXPECT_THAT(refusal({0, 1}, {0.5, 0.5, 0.5}), AllOf(HasSubstr("24"), HasSubstr("16 bytes")));
  EXPECT_EQ(frontend.added(), 0U);
  EXPECT_EQ(refusal({1, 0}, {0.5, 2.0}), "");
}

// rule C13
TEST_F(GroupCommandTest, MovesSmoothlyIfOneOfItsActuatorsDoesByDefault) {
  auto [manual, frontend] = StartedPair({.segment = "pair"}, [](Schema& schema) {
    schema.actuator(1).limits({.speed = 1e6, .acceleration = 1e9});
  });
  add_both(frontend, 1.0, 1.0, {.pace = iterations(4)});
  frontend.pulse();
  manual.run(4);
  EXPECT_EQ(desired(frontend, 1, 4), desired(frontend, 1, 4, 1)) << "one way for both";
  EXPECT_LT(desired(frontend.wait_for(1, kAtOnce)), 0.25) << "a minimum jerk begins at rest";
}

TEST_F(GroupCommandTest, FillsItsLaneAsItsBlocksSay) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .lane_blocks = 64});
  // a block for the batch, then three for each: its head and two members
  for (int i = 0; i < 20; ++i) add_both(frontend, i, i);
  EXPECT_THAT(message_of<LaneFull>([&] { frontend.pulse(); }), HasSubstr("takes 61 blocks"));
  frontend.forget_added();
  for (int round = 0; round < 20; ++round) {
    for (int i = 0; i < 19; ++i) add_both(frontend, i, i);
    const Batch batch = frontend.pulse();
    manual.run(19);
    ASSERT_TRUE(batch.ended());
    ASSERT_EQ(batch.handle(18).status, Status::completed);
  }
}

// ------------------------------------------------------------------------------ losing members

TEST_F(GroupCommandTest, EndsAtOnceWhenAllItsMembersDo) {
  for (const std::string end :
       {"halt; run 1; a halted @3; a.1 halted @3", "b = purge; run 1; a purged @3; a.1 purged @3",
        "b = 0,1 to 1 1 overwrite; run 1; a overwritten @3; a.1 overwritten"}) {
    play("0,1 to 8 8 over 8; 0,1 to 9 9 over 8; a = pulse; run 2;" + end + "; a ended 3");
  }
}

// rule C22
TEST_F(GroupCommandTest, ContinuesWithoutADroppedMember) {
  for (const std::string end : {"in 2 interrupt 1; run 1; a active; run 3; a interrupted @5",
                                "run 1; b = purge 1; run 1; a active; run 2; a purged @5",
                                "run 1; b = 1 to 1 over 1 overwrite; run 3; a overwritten @5"}) {
    play("a = 0,1 to 5 5 over 5; run 1;" + end + "; 0 is 5; run 1; a ended 5");
  }
}

TEST_F(GroupCommandTest, BeginsWithAllItsMembersOrWithoutOneThatWasDropped) {
  play(R"(1 to 9 over 100; 0,1 to 2 2 over 2; a = pulse; run 3; 0 is 0; b = purge 1; run 2; 0 is 2
    a.1 purged)");
}

TEST_F(GroupCommandTest, TakesAsLongAsTheLimitsOfItsSlowestMember) {
  play({.segment = "pair"}, R"(a = 0,1 to 1 1 over 2; run 5; 0 is 0.5; 1 is 0.5; run 5; 0 is 1
    1 is 1; a completed limits @10)",
       [](Schema& schema) { schema.actuator(1).limits({.speed = 100.0}); });
}

TEST_F(GroupCommandTest, DurationsOfItsMembersOweTheSameRounding) {
  play(R"(0 to 1 for 1.4; 1 to 1 over 1  # an iteration, 0.4 owed
    0,1 to 2 2 for 2.2; a = pulse; run 4; a.2 completed @4; 0 is 2; 1 is 2)");
}

TEST_F(GroupCommandTest, IsLateWhenItsMembersAre) {
  play("0 to 5 over 5; 0,1 to 9 9 until 3; a = pulse; run 8; 0 is 5; 1 is 0; a.1 rejected late");
}

TEST_F(GroupCommandTest, EndsWithItsFrontendIfToldSo) {
  play({.segment = "pair", .stale = Stale::purge, .silence = 5},
       "a = 0,1 to 100 100 over 100; run 20; a purged silence");
}

// ------------------------------------------------------------------------------ bursting

TEST_F(GroupCommandTest, ABurstUntilItsEndRunsUntilItsLastMemberHasEnded) {
  play_bursts("0 to 3 over 3; 0,1 to 4 2 over 2; a = to end; drive; a ended 5; last 5");
}

TEST_F(GroupCommandTest, BeginsAtTheSameIterationHoweverLongTheBackendStoodBefore) {
  // one queue waits behind a dropped member of a group; reporting its drop takes several iterations
  std::string many;
  for (int i = 0; i < 5000; ++i) many += "1 to 1 over 1e6;";
  for (const std::string stands : {"", "drive;"}) {
    play_bursts(many + "0,1 to 5 5; a = pulse; burst 20; b = purge 1;" + stands + "burst 20;" +
                stands + "0 rows 20: 0 5");
  }
}

}  // namespace
}  // namespace o80::test
