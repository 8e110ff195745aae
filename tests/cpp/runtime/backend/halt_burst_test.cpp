// Halts of a backend that bursts.

#include "runtime/trace.hpp"

namespace o80::test {
namespace {

using HaltBurstTest = ManualBackendTest;

void play_bursts(const std::string& script) { play({.segment = "pair", .bursting = true}, script); }

// rule H5
TEST_F(HaltBurstTest, AHaltEndsABurstAfterTheIterationUnderWay) {
  for (const std::string sent : {"a = to end", "a = burst 100"}) {
    play_bursts("0 to 100 over 100;" + sent + R"(; in 5 driver halts five; drive
      last 5; halted driver @6 why five; a halted  # in the next one, that has not begun)");
  }
  BurstingBackend bursting("pair", [](ManualBackend& manual) {
    manual.before_publish = [&manual] {
      if (manual.backend.iteration() == 5) manual.backend.halt(HaltCause::driver, "five");
    };
  });
  EXPECT_THAT(
      message_of<BackendHalted>([] { UntypedFrontend("pair").burst(100, kPatience); }),
      ::testing::AllOf(::testing::HasSubstr("ended in iteration 5"), ::testing::HasSubstr("five")));
}

// rule H7
TEST_F(HaltBurstTest, BurstsAreServedWhileHalted) {
  play_bursts(R"(halt; a = burst 3; drive; a done 3; row 3 halted; 0 to 1; b = burst 1; drive
    b rejected halted; last 3; r = resume 1; drive; r completed; running
    0 to 1; c = burst 1; drive; c done 5; 0 is 1)");
}

TEST_F(HaltBurstTest, AHaltIsSeenByABackendThatStandsStill) {
  play_bursts("0 to 9 over 9; burst 2; a = 0 to 3; halt; drive; a halted; a raises BackendHalted");
}

}  // namespace
}  // namespace o80::test
