// What the loop's thread calls in an iteration: nothing of the heap, no lock, no exception, no
// text; of the system the one call that paces it, and one that wakes who waits.

#include <gmock/gmock.h>
#include <sys/syscall.h>

#include <array>
#include <atomic>
#include <numeric>
#include <thread>
#include <vector>

#include "iteration/watched_loop.hpp"
#include "memory/child_process.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

using ::testing::HasSubstr;

class WatchedLoopTest : public ManualBackendTest {
 protected:
  void SetUp() override {
    if (!kCallsAreIntercepted) GTEST_SKIP() << "a sanitizer makes calls of its own";
    if (!system_calls_are_counted()) GTEST_SKIP() << "this kernel lets no system call be counted";
  }
};

enum class Pacing : std::uint8_t { paced, bursting };

class IterationTest : public WatchedLoopTest, public ::testing::WithParamInterface<Pacing> {
 protected:
  static BackendOptions options() {
    BackendOptions options;
    options.bursting = GetParam() == Pacing::bursting;
    options.period = 500'000;
    return options;
  }
};

TEST_P(IterationTest, CallsNothingWithNothingToDo) {
  WatchedLoop loop(options());
  loop.go_on(200);
  loop.expect_a_clean_account();
  // who waits for the last of them is woken by that one
  if (!loop.bursting()) {
    EXPECT_LE(loop.account().wakes, 5);
  }
}

void send_every_pace(UntypedFrontend& frontend, Iteration now, double target) {
  using std::chrono::milliseconds;
  add(frontend, 0, target);
  add(frontend, 0, -target, {.pace = iterations(5), .profile = Profile::minimum_jerk});
  add(frontend, 1, target, {.pace = speed(500.0)});
  add(frontend, 1, 0, {.pace = speed(900.0), .profile = Profile::minimum_jerk});
  add(frontend, 2, target, {.pace = duration(milliseconds(3)), .start = Start::observed});
  add(frontend, 2, 0, {.pace = until(now + 30)});
  add(frontend, 3, target, {.pace = until(now / 2)});  // late
  add(frontend, 3, 0, {.pace = iterations(3), .mode = Mode::overwrite});
  frontend.pulse();
}

TEST_P(IterationTest, CallsNothingWithCommandsOfEveryPaceFromTwoFrontends) {
  WatchedLoop loop(options());
  UntypedFrontend one("subject");
  UntypedFrontend two("subject");
  for (int i = 0; i < 50; ++i) {
    send_every_pace(one, loop.keeper->published(), i % 7);
    send_every_pace(two, loop.keeper->published(), i % 5);
    add(two, 0, 1.0);
    two.pulse({.at = loop.keeper->published() + 20});
    add(one, 0, 1.0);
    const Batch late = one.pulse({.at = 0});
    loop.go_on(kBurst);
    EXPECT_EQ(late.handle(0).status, Status::rejected);
  }
  loop.expect_a_clean_account();
}

TEST_P(IterationTest, CallsNothingWithTrajectoriesThatTakeManyIterationsToCome) {
  WatchedLoop loop(options());
  constexpr std::uint32_t kRows = 10'000;
  std::vector<double> targets(kRows);
  std::iota(targets.begin(), targets.end(), 0.0);
  std::vector<std::int64_t> times(kRows);
  for (std::uint32_t i = 0; i < kRows; ++i) times[i] = std::int64_t{i + 1} * 500'000;
  UntypedFrontend one("subject");
  UntypedFrontend two("subject");
  for (int round = 0; round < 5; ++round) {
    one.add_trajectory(0, kRows, std::as_bytes(std::span(targets)));
    const Batch plain = one.pulse();
    two.add_trajectory(3, kRows, std::as_bytes(std::span(targets)), {}, times);
    const Batch timed = two.pulse();
    loop.go_on_until([&] {
      return plain.handle(0).status != Status::queued && timed.handle(0).status != Status::queued;
    });
    loop.go_on();
    one.add_purge_own();
    one.pulse();
    two.add_purge();
    two.pulse();
    loop.go_on_until([&] { return plain.ended() && timed.ended(); });
  }
  loop.expect_a_clean_account();
}

TEST_P(IterationTest, CallsNothingWhenFullQueuesArePurgedOverwrittenAndRefused) {
  BackendOptions full = options();
  full.lane_blocks = 4096;
  WatchedLoop loop(full);
  UntypedFrontend one("subject");
  UntypedFrontend two("subject");
  const auto fill = [&](UntypedFrontend& frontend, const CommandOptions& how, Iteration at = kNow) {
    for (int i = 0; i < 4000; ++i) add(frontend, static_cast<std::uint32_t>(i % 4), 1.0, how);
    return frontend.pulse({.at = at});
  };
  for (int way = 0; way < 5; ++way) {
    const Iteration far = loop.keeper->published() + 1'000'000;
    // of all one's, of all, by another frontend, by overwriting; late each, late as a whole
    std::vector<Batch> sent;
    sent.push_back(fill(one, {.pace = way == 3 ? until(1) : until(far)}));
    sent.push_back(fill(two, {.pace = until(far)}, way == 4 ? 1 : kNow));
    loop.go_on();
    if (way == 0) one.add_purge_own();
    if (way == 1) two.add_purge();
    for (std::uint32_t i = 0; way >= 2 && i < 4; ++i) {
      add(one, i, 2.0, {.mode = Mode::overwrite});
    }
    sent.push_back(one.pulse());
    loop.go_on();
    two.add_purge();
    sent.push_back(two.pulse());
    loop.go_on_until([&] {
      return std::ranges::all_of(sent, [](const Batch& batch) { return batch.ended(); });
    });
  }
  loop.expect_a_clean_account();
}

TEST_P(IterationTest, CallsNothingWithRequestsAndExclusiveControl) {
  WatchedLoop loop(options());
  UntypedFrontend one("subject");
  UntypedFrontend two("subject");
  for (std::uint32_t i = 0; i < 60; ++i) {
    // a fresh start has a row of its own: an even number of them keeps the bursts in step
    for (std::uint32_t again = 0; again < kBurst; ++again) {
      add_request(one, Nudge{i % 3});
      add(one, 0, 1.0, {.pace = iterations(2)});
    }
    one.add_take_control();
    one.pulse();
    add_request(two, Nudge{0});
    two.pulse();
    one.add_release_control();
    one.pulse();
    loop.go_on(kBurst);
  }
  loop.expect_a_clean_account();
}

TEST_P(IterationTest, WakesOneOfSixtyFourReadersAndWhoWaitsForABatch) {
  WatchedLoop loop(options());
  std::atomic<bool> done = false;
  std::atomic<int> read = 0;
  std::vector<std::thread> readers;
  UntypedFrontend shared("subject");
  for (int i = 0; i < 64; ++i) {
    readers.emplace_back([&] {
      UntypedObservation row(shared.description());
      Iteration position = shared.published() + 1;
      while (!done) {
        try {
          shared.wait_for_next(position, row.bytes(), std::chrono::milliseconds(20));
          ++read;
        } catch (const TimeoutError&) {
          continue;  // it stands still
        }
      }
    });
  }
  // two frontends wait for batches that end in one iteration
  std::vector<std::thread> commanders;
  std::atomic<int> commanding = 2;
  for (std::uint32_t actuator : {0U, 1U}) {
    commanders.emplace_back([&, actuator] {
      UntypedFrontend own("subject");
      for (int i = 0; i < 40; ++i) {
        const Iteration end = (own.published() / kBurst + 3) * kBurst;
        // on a busy machine it comes too late now and then
        send(own, actuator, 0.1 * i, {.pace = until(end)}).wait(kPatience, {}, {.check = false});
      }
      --commanding;
    });
  }
  loop.go_on_until([&] { return commanding == 0 && read > 1000; });
  done = true;
  for (std::thread& reader : readers) reader.join();
  for (std::thread& commander : commanders) commander.join();
  loop.expect_a_clean_account();
  EXPECT_GT(loop.account().wakes, 10);
}

TEST_P(IterationTest, CallsNothingWhileFrontendsComeGoAndDie) {
  BackendOptions short_lived = options();
  short_lived.stale = Stale::purge;
  WatchedLoop loop(short_lived);
  UntypedFrontend other("subject");
  for (int round = 0; round < 4; ++round) {
    StandingProcess child([](const StandingProcess::Stand& stand) {
      UntypedFrontend doomed("subject");
      UntypedFrontend second("subject");
      for (std::uint32_t i = 0; i < 3000; ++i) {
        add(doomed, i % 3, 1.0, {.pace = iterations(1'000'000)});
        add(second, i % 3, 2.0, {.pace = iterations(1'000'000)});
      }
      doomed.pulse();
      second.pulse();
      stand();
    });
    send(other, 0, 3.0);
    const auto active = [&] { return loop.keeper->latest().active(0); };
    loop.go_on_until(active);
    child.kill_now();
    loop.go_on_until([&] { return !active(); });
    UntypedFrontend passing("subject");
    send(passing, 1, 1.0);
    loop.go_on();
    passing.close();
    loop.go_on();
  }
  loop.expect_a_clean_account();
}

TEST_P(IterationTest, AFaultOfTheDriverMakesTheLoopCallNothingBeforeItIsStopped) {
  for (const bool throws : {false, true}) {
    WatchedLoop loop(options(), {{"fault_at", "100"}, {"throws", throws ? "true" : "false"}});
    EXPECT_THROW(loop.go_on(1'000'000), BackendFailed);
    EXPECT_THAT(loop.join().fault, HasSubstr(throws ? "failed in read: too cold" : "too hot"));
    const Calls& last = Subject::at_stop;
    EXPECT_EQ(last.system_calls(), 0U) << last.text();
    // what is thrown is the driver's own, with all that the language does for it
    EXPECT_EQ(last[Kind::exception], throws ? 2U : 0U) << last.text();
    if (!throws) {
      EXPECT_EQ(last.text(), "");
    }
    loop.expect_a_clean_account();
  }
}

INSTANTIATE_TEST_SUITE_P(Loops, IterationTest, ::testing::Values(Pacing::paced, Pacing::bursting),
                         [](const auto& instance) {
                           return instance.param == Pacing::paced ? "Paced" : "Bursting";
                         });

/// Bursts of every kind, which end where they like: only what no iteration may do is looked for.
TEST_F(WatchedLoopTest, BurstsTakeNothingFromTheHeapAndHoldNoLock) {
  BackendOptions options;
  options.bursting = true;
  WatchedLoop loop(options);
  UntypedFrontend one("subject");
  UntypedFrontend two("subject");
  const std::array<std::pair<UntypedFrontend*, std::int64_t>, 2> both{
      std::pair{&one, std::int64_t{3}}, std::pair{&two, std::int64_t{5}}};
  for (int i = 0; i < 100; ++i) {
    add(one, 0, i, {.pace = iterations(4)});
    one.pulse_and_wait(kPatience);
    burst(both, kPatience);
    add(two, 1, 1.0, {.pace = iterations(2)});
    two.burst(1, kPatience);
  }
  loop.stop();
  const Calls& all = loop.account().violation;
  EXPECT_EQ(all[Kind::heap] + all[Kind::lock] + all[Kind::exception] + all[Kind::text], 0U)
      << all.text();
}

}  // namespace
}  // namespace o80::test
