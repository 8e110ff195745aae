// Which backends start halted because of how their predecessor ended.

#include <optional>

#include "memory/child_process.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

using HaltSuccessorTest = ManualBackendTest;

enum class Before { idle, acting, halted, requested, resumed, stopped, failed };

/// Leaves a backend in some state and dies.
void live_and_die(Before before, const StandingProcess::Stand& stand, bool bursting = false) {
  auto [manual, frontend] = StartedPair({.segment = "pair", .bursting = bursting});
  const auto iterate = [&] {
    if (bursting) frontend.start_burst(1);
    manual.iterate();
  };
  iterate();
  if (before == Before::acting) {
    send(frontend, 0, 100.0, {.pace = iterations(100)});
    iterate();
  }
  if (before == Before::halted || before == Before::resumed) {
    frontend.halt("me");
    iterate();
  }
  if (before == Before::resumed) {
    send_resume(frontend, 1);
    iterate();
    if (frontend.halted()) return;  // without a word
    iterate();
  }
  if (before == Before::requested) frontend.halt("me");
  if (before == Before::stopped) manual.backend.end(BackendState::stopped);
  if (before == Before::failed) manual.backend.end(BackendState::failed, "broken");
  stand();
}

std::optional<Halt> halt_of_successor(Before before, BackendOptions options = {.segment = "pair"},
                                      bool was_bursting = false) {
  StandingProcess([&](const auto& stand) { live_and_die(before, stand, was_bursting); }).kill_now();
  auto [manual, frontend] = StartedPair(options);
  const auto halt = frontend.halted();
  EXPECT_EQ(frontend.wait_for(0, kAtOnce).head().halted, halt ? 1U : 0U);
  if (halt) {
    const Batch batch = send(frontend, 0, 1.0);
    manual.run(1);
    EXPECT_EQ(batch.handle(0).status, Status::rejected);
  }
  return halt;
}

// rule H11
TEST_F(HaltSuccessorTest, OfABackendThatWasKilledWhileItActedStartsHalted) {
  const auto halt = halt_of_successor(Before::acting);
  ASSERT_TRUE(halt);
  EXPECT_EQ(halt->cause, HaltCause::predecessor);
  EXPECT_THAT(std::string(halt->reason()), HasSubstr("killed while commands were active"));
}

// rule H11
TEST_F(HaltSuccessorTest, OfAHaltedBackendStartsHalted) {
  for (const Before before : {Before::halted, Before::requested}) {
    const auto halt = halt_of_successor(before);
    ASSERT_TRUE(halt);
    EXPECT_EQ(halt->cause, HaltCause::predecessor);
    EXPECT_THAT(std::string(halt->reason()), HasSubstr("not resumed"));
  }
}

TEST_F(HaltSuccessorTest, OfAHaltedBackendWithoutARowStartsHaltedToo) {
  StandingProcess([](const auto& stand) { live_and_die(Before::halted, stand); }).kill_now();
  // this one does not live to publish a row
  StandingProcess([](const auto& stand) {
    ManualBackend manual;
    stand();
  }).kill_now();
  StartedBackend manual;
  EXPECT_TRUE(UntypedFrontend("pair").halted());
}

// rule H11
TEST_F(HaltSuccessorTest, OfAnyOtherBackendDoesNot) {
  EXPECT_FALSE(halt_of_successor(Before::idle));
  EXPECT_FALSE(halt_of_successor(Before::resumed));
  EXPECT_FALSE(halt_of_successor(Before::stopped));
  EXPECT_FALSE(halt_of_successor(Before::failed));
  EXPECT_FALSE(halt_of_successor(Before::halted, {.segment = "pair", .resume = true}));
  EXPECT_FALSE(halt_of_successor(Before::acting, {.segment = "pair", .resume = true}));
  EXPECT_FALSE(halt_of_successor(Before::acting, {.segment = "pair"}, true)) << "a simulation died";
}

}  // namespace
}  // namespace o80::test
