// A new backend of a name whose owner was killed, stopped or failed: at once, and everybody who is
// attached learns what became of the old one.

#include <time.h>

#include <algorithm>
#include <fstream>

#include "memory/child_process.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

class TakeOverTest : public ManualBackendTest {};

void run_until_killed(const StandingProcess::Stand& stand) {
  StartedBackend manual;
  manual.run(5);
  stand();
}

/// What the frontend says of its backend, whichever verb meets it first.
template <class Gone>
void expect_every_verb_says(UntypedFrontend& frontend, const std::string& what) {
  const auto names_it = AllOf(HasSubstr("'pair'"), HasSubstr(what), HasSubstr("attach"));
  const auto wait = [&] { frontend.wait_for(1'000'000, kPatience); };
  EXPECT_THAT(message_of<Gone>(wait), names_it);
  EXPECT_THAT(message_of<Gone>([&] { send(frontend, 0, 1.0); }), names_it);
  frontend.forget_added();
  EXPECT_NO_THROW(frontend.latest()) << "what there is can be read";
}

TEST_F(TakeOverTest, SaysWhatBecameOfTheOldBackendByNameAndPid) {
  StandingProcess killed(run_until_killed);
  UntypedFrontend first("pair");
  const std::string pid = "pid " + std::to_string(killed.pid());
  killed.kill_now();
  expect_every_verb_says<BackendKilled>(first, pid + ") was killed");

  {
    StartedBackend second;
    expect_every_verb_says<BackendSuperseded>(first, pid + ") is gone and a new one has its name");
    UntypedFrontend of_second("pair");
    second.backend.end(BackendState::failed, "the elbow is too hot");
    expect_every_verb_says<BackendFailed>(of_second, "failed: the elbow is too hot");
    second.backend.end(BackendState::stopped);
  }
  StartedBackend third;
  UntypedFrontend of_third("pair");
  third.backend.end(BackendState::stopped);
  expect_every_verb_says<BackendStopped>(of_third, "has stopped");
}

TEST_F(TakeOverTest, LetsAFrontendAttachAgainInItsOwnPlace) {
  StandingProcess killed(run_until_killed);
  UntypedFrontend arm("pair");
  const Batch old = send(arm, 0, 5.0);
  killed.kill_now();
  EXPECT_THROW(old.wait(kPatience), BackendKilled);

  StartedBackend next;
  EXPECT_THROW(old.wait(kPatience), BackendSuperseded);
  arm = UntypedFrontend("pair");
  const Batch batch = send(arm, 0, 1.0);
  next.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::completed);
  EXPECT_EQ(desired(arm.latest()), 1.0);
  EXPECT_THROW(old.wait(kAtOnce), BackendSuperseded) << "a batch stays that of its backend";
}

/// Time that this thread has slept [s]. Time in which it waited for a processor is not counted, so
/// that other programs do not change it.
double seconds_slept() {
  timespec wall;
  clock_gettime(CLOCK_MONOTONIC, &wall);
  double ran = 0.0, waited = 0.0;  // [ns]
  std::ifstream("/proc/thread-self/schedstat") >> ran >> waited;
  return static_cast<double>(wall.tv_sec) +
         1e-9 * (static_cast<double>(wall.tv_nsec) - ran - waited);
}

TEST_F(TakeOverTest, WaitsForNoPeriodOfThoseWhoWatch) {
  // a slice of 50 ms or a round of the helper would be in every attempt
  constexpr int kAttempts = 50;
  double shortest = 1.0;
  for (int i = 0; i < kAttempts && shortest > 0.02; ++i) {
    StandingProcess killed(run_until_killed);
    killed.kill_now();
    const double before = seconds_slept();
    StartedBackend next({.segment = "pair", .history = 100, .lane_blocks = 64});
    shortest = std::min(shortest, seconds_slept() - before);
  }
  EXPECT_LT(shortest, 0.02);
}

}  // namespace
}  // namespace o80::test
