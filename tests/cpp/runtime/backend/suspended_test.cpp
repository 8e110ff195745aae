// Who is suspended is not dead: waits end by their timeouts, nothing of his is taken, and he goes
// on where he was.

#include <signal.h>

#include "memory/child_process.hpp"
#include "memory/segment/liveness.hpp"
#include "o80/base/time.hpp"
#include "o80/memory/segment_list.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

class SuspendedTest : public ManualBackendTest {};

constexpr Timeout kShort = std::chrono::milliseconds(60);  // more than a slice of a wait

void go_on(const ChildProcess& child) { ::kill(child.pid(), SIGCONT); }

void pause_for_a_millisecond() {
  const timespec millisecond{.tv_sec = 0, .tv_nsec = 1'000'000};
  nanosleep(&millisecond, nullptr);
}

void be_a_backend(bool bursting, const ChildProcess::Ready& ready) {
  StartedBackend manual({.segment = "pair", .bursting = bursting});
  ready();
  if (bursting) return manual.serve_bursts();
  while (true) {
    manual.iterate();
    pause_for_a_millisecond();
  }
}

TEST_F(SuspendedTest, ABackendEndsWaitsByTheirTimeoutsAndIsNeverCalledDead) {
  ReadyProcess backend([](const auto& ready) { be_a_backend(false, ready); });
  UntypedFrontend frontend("pair");
  UntypedFrontend reader("pair", {.access = Access::read_only});
  const Batch batch = send(frontend, 0, 1.0, {.pace = iterations(1'000'000)});
  frontend.wait_for(3, kPatience);
  backend.stop_and_wait_until_stopped();

  const Iteration last = frontend.published();
  Iteration position = last + 1;
  std::vector<std::byte> row(frontend.layout().size);
  EXPECT_THROW(frontend.wait_for(last + 1, kShort), TimeoutError);
  EXPECT_THROW(reader.wait_for(last + 1, kShort), TimeoutError);
  EXPECT_THROW(frontend.wait_for_next(position, row.data(), kShort), TimeoutError);
  EXPECT_THROW(batch.wait(kShort), TimeoutError);
  add(frontend, 1, 1.0);
  EXPECT_THROW(frontend.pulse_and_wait(kShort), TimeoutError);
  EXPECT_EQ(frontend.life(), Life::running);
  EXPECT_EQ(frontend.published(), last);
  EXPECT_NO_THROW(frontend.latest());
  EXPECT_NO_THROW(UntypedFrontend("pair").history(3)) << "others can attach and read";

  // what was sent meanwhile waits for it
  const Batch sent = send(frontend, 1, 2.0, {.mode = Mode::overwrite});
  go_on(backend);
  sent.wait(kPatience);
  EXPECT_EQ(sent.handle(0).status, Status::completed);
  EXPECT_GT(frontend.published(), last);
}

TEST_F(SuspendedTest, ABackendThatBurstsEndsABurstByItsTimeoutAndRunsItLater) {
  ReadyProcess backend([](const auto& ready) { be_a_backend(true, ready); });
  UntypedFrontend frontend("pair");
  ASSERT_EQ(frontend.burst(2, kPatience).iteration(), 2);
  backend.stop_and_wait_until_stopped();
  const Burst burst = frontend.start_burst(3);
  EXPECT_THROW(burst.wait(kShort), TimeoutError);
  EXPECT_EQ(frontend.life(), Life::running);
  go_on(backend);
  EXPECT_EQ(burst.wait(kPatience).iteration(), 5);
}

TEST_F(SuspendedTest, ABackendKeepsItsName) {
  ReadyProcess backend([](const auto& ready) { be_a_backend(false, ready); });
  backend.stop_and_wait_until_stopped();
  EXPECT_THAT(message_of<SegmentTaken>([] { ManualBackend(); }),
              HasSubstr("pid " + std::to_string(backend.pid())));
  EXPECT_THROW(clean("pair"), SegmentTaken);
  EXPECT_TRUE(clean_dead().empty());
  EXPECT_EQ(list_segments().at(0).life, Life::running);
  UntypedFrontend frontend("pair");
  go_on(backend);
  frontend.wait_for(frontend.published() + 3, kPatience);
}

/// Takes control or not, and sends a movement of many iterations.
void be_a_commander(bool with_control, const ChildProcess::Ready& ready) {
  UntypedFrontend frontend("pair", {.timeout = kPatience});
  if (with_control) frontend.add_take_control();
  add(frontend, 0, 100.0, {.pace = iterations(100)});
  const Batch batch = frontend.pulse();
  ready();
  batch.wait(kPatience);
  if (batch.handle(with_control ? 1 : 0).status != Status::completed) _exit(4);
  if (!with_control) return;
  frontend.add_release_control();
  frontend.pulse_and_wait(kPatience);
}

/// Until the helper thread of this process must have asked who lives, twice over.
void let_the_helper_ask() {
  const OwnedSegment segment = OwnedSegment::create(
      {.name = "watch", .schema = {}, .row_bytes = 8, .rows = 1, .lanes = 1, .lane_blocks = 1});
  const LaneLiveness watch(segment);
  const std::uint32_t before = watch.rounds();
  // not spinning: at a real-time priority that keeps the helper's own timer from it
  while (watch.rounds() - before < 4) pause_for_a_millisecond();
}

TEST_F(SuspendedTest, AFrontendKeepsItsLaneAndItsCommandsLiveOnWhateverThePolicyForTheDead) {
  for (const Stale stale : {Stale::hold, Stale::purge, Stale::stop}) {
    // the movement of the child begins with the first iteration after its pulse
    StartedBackend manual({.segment = "pair", .lanes = 1, .stale = stale});
    ReadyProcess commander([](const auto& ready) { be_a_commander(false, ready); });
    manual.run(10);
    commander.stop_and_wait_until_stopped();
    let_the_helper_ask();

    UntypedFrontend other("pair");
    EXPECT_DOUBLE_EQ(desired(other.latest()), 10.0);
    add(other, 1, 1.0);
    EXPECT_THAT(message_of<NoLane>([&] { other.pulse(); }),
                HasSubstr("pid " + std::to_string(commander.pid())));
    manual.run(90);
    EXPECT_EQ(desired(other.latest()), 100.0);
    EXPECT_EQ(manual.backend.failure(), "");

    // and it learns of it when it goes on
    go_on(commander);
    EXPECT_EQ(commander.wait(), 0);
  }
}

TEST_F(SuspendedTest, AHolderOfControlKeepsItUntilItLetsGo) {
  StartedBackend manual;
  ReadyProcess commander([](const auto& ready) { be_a_commander(true, ready); });
  manual.run(10);
  commander.stop_and_wait_until_stopped();
  let_the_helper_ask();

  UntypedFrontend other("pair");
  const Batch refused = send(other, 1, 1.0);
  manual.run(90);
  EXPECT_THAT(refused.rejection(), HasSubstr("pid " + std::to_string(commander.pid())));
  go_on(commander);
  manual.run_until([&] {
    const Batch batch = send(other, 1, 2.0);
    manual.run(1);
    return batch.rejection().empty();
  });
  EXPECT_EQ(commander.wait(), 0);
}

TEST_F(SuspendedTest, AFrontendInABurstDelaysNobodyOnceItsBurstIsDone) {
  BurstingBackend bursting;
  ReadyProcess frontend([](const ChildProcess::Ready& ready) {
    UntypedFrontend own("pair", {.timeout = kPatience});
    const Burst burst = own.start_burst(1000);
    ready();
    burst.wait(kPatience);
  });
  frontend.stop_and_wait_until_stopped();
  UntypedFrontend other("pair");
  EXPECT_EQ(other.burst(1, kPatience).iteration(), 1001);
  go_on(frontend);
  EXPECT_EQ(frontend.wait(), 0);
}

}  // namespace
}  // namespace o80::test
