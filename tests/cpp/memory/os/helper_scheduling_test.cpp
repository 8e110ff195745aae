#include <gtest/gtest.h>
#include <pthread.h>
#include <sched.h>
#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <filesystem>
#include <fstream>
#include <mutex>
#include <thread>

#include "memory/child_process.hpp"
#include "memory/os/fork.hpp"
#include "memory/ring/lane_sender.hpp"
#include "memory/segment/liveness.hpp"
#include "memory/segments.hpp"

namespace o80 {
namespace {

bool become_real_time(int policy, int priority) {
  sched_param parameter{};
  parameter.sched_priority = priority;
  return sched_setscheduler(0, policy, &parameter) == 0;
}

struct Scheduling {
  int policy;
  int priority;
  friend bool operator==(const Scheduling&, const Scheduling&) = default;
};

/// Of the helper of this process, which names its thread itself.
Scheduling scheduling_of_helper() {
  while (true) {
    for (const auto& thread : std::filesystem::directory_iterator("/proc/self/task")) {
      std::string name;
      std::getline(std::ifstream(thread.path() / "comm"), name);
      if (name != "o80-liveness") continue;
      const pid_t id = std::stoi(thread.path().filename());
      sched_param parameter{};
      sched_getparam(id, &parameter);
      return {sched_getscheduler(id), parameter.sched_priority};
    }
    std::this_thread::yield();
  }
}

constexpr int kNotGranted = 77;

/// The child goes on as an ordinary user with a limit.
void become_limited_to_priority(rlim_t priority) {
  const rlimit limit{priority, priority};
  if (setrlimit(RLIMIT_RTPRIO, &limit) != 0 || setuid(65534) != 0) _exit(kNotGranted);
}

void expect_that_all_held_in_child(const std::function<int()>& body) {
  const int code = in_child(body);
  if (code == kNotGranted) GTEST_SKIP() << "no user may be given a limit here; make rt runs it";
  EXPECT_EQ(code, 0);
}

/// Runs in a forked child, whose helper is a fresh one.
class HelperSchedulingTest : public SegmentTest {
 protected:
  void expect_in_child(Scheduling expected, const std::function<void()>& set_up) {
    EXPECT_EQ(in_child([&] {
                set_up();
                const OwnedSegment segment = running_segment();
                const LaneLiveness liveness(segment);
                const Scheduling seen = scheduling_of_helper();
                if (seen != expected)
                  ADD_FAILURE() << "policy " << seen.policy << ", priority " << seen.priority;
                return seen == expected ? 0 : 1;
              }),
              0);
  }
  void SetUp() override {
    bool granted = false;
    std::thread([&] { granted = become_real_time(SCHED_FIFO, 10); }).join();
    if (!granted) GTEST_SKIP() << "real-time priorities are not granted here";
  }
};

TEST_F(HelperSchedulingTest, RunsOneAboveTheThreadThatMakesABackend) {
  expect_in_child({SCHED_FIFO, 11}, [] { ASSERT_TRUE(become_real_time(SCHED_FIFO, 10)); });
  expect_in_child({SCHED_FIFO, 8}, [] { ASSERT_TRUE(become_real_time(SCHED_RR, 7)); });
}

TEST_F(HelperSchedulingTest, RunsOneAboveAnyThreadItIsToldOf) {
  expect_in_child({SCHED_FIFO, 13}, [] {
    EXPECT_EQ(LaneLiveness::run_above(12), 0);
    EXPECT_EQ(LaneLiveness::run_above(3), 0);
  });
  const OwnedSegment segment = running_segment(small_spec("other"));
  const LaneLiveness liveness(segment);
  EXPECT_EQ(LaneLiveness::run_above(40), 0);
  EXPECT_EQ(scheduling_of_helper(), (Scheduling{SCHED_FIFO, 41}));
}

TEST_F(HelperSchedulingTest, SharesTheHighestPriorityThereIs) {
  expect_in_child({SCHED_FIFO, 99}, [] { EXPECT_EQ(LaneLiveness::run_above(99), 0); });
}

TEST_F(HelperSchedulingTest, SharesThePriorityOfTheLoopWhereNoHigherOneIsGranted) {
  expect_that_all_held_in_child([] {
    const OwnedSegment segment = running_segment();
    const LaneLiveness liveness(segment);
    become_limited_to_priority(20);
    if (LaneLiveness::run_above(20) != EPERM) return 3;
    return scheduling_of_helper() == Scheduling{SCHED_FIFO, 20} ? 0 : 4;
  });
}

TEST_F(HelperSchedulingTest, SaysWhatWillBeRefusedWhileThereIsNoBackend) {
  expect_that_all_held_in_child([] {
    become_limited_to_priority(20);
    return LaneLiveness::run_above(19) == 0 && LaneLiveness::run_above(20) == EPERM ? 0 : 4;
  });
}

TEST_F(HelperSchedulingTest, IsAnOrdinaryThreadAmongOrdinaryThreads) {
  expect_in_child({SCHED_OTHER, 0}, [] { ASSERT_TRUE(become_real_time(SCHED_OTHER, 0)); });
}

/// A thread that never sleeps on each processor, at the lowest real-time priority.
class BusyProcessors {
 public:
  BusyProcessors() {
    cpu_set_t allowed;
    sched_getaffinity(0, sizeof allowed, &allowed);
    for (int i = 0; i < CPU_SETSIZE; ++i)
      if (CPU_ISSET(i, &allowed)) threads_.emplace_back([this, i] { spin_on(i); });
    while (busy_.load() < threads_.size()) std::this_thread::yield();
  }
  BusyProcessors& operator=(BusyProcessors&&) = delete;
  ~BusyProcessors() {
    over_ = true;
    for (std::thread& thread : threads_) thread.join();
  }

 private:
  void spin_on(int processor) {
    cpu_set_t only;
    CPU_ZERO(&only);
    CPU_SET(processor, &only);
    sched_setaffinity(0, sizeof only, &only);
    ++busy_;  // before the test's own thread, which spins too, keeps this one from it
    become_real_time(SCHED_FIFO, 1);
    while (!over_) {
    }
  }

  std::atomic<bool> over_{false};
  std::atomic<std::size_t> busy_{0};
  std::vector<std::thread> threads_;
};

/// These prove nothing where ordinary threads run all the same: on a machine that grants them a
/// share of each second (sched_rt_runtime_us). `make rt` runs them where it grants none.
class BusyMachineTest : public HelperSchedulingTest {
 protected:
  void SetUp() override {
    const int policy = sched_getscheduler(0);
    if (policy != SCHED_FIFO && policy != SCHED_RR)
      GTEST_SKIP() << "for a real-time machine: `make rt`";
  }
};

TEST_F(BusyMachineTest, NoticesADeathWhileARealTimeThreadSpinsOnEachProcessor) {
  const OwnedSegment segment = running_segment();
  StandingProcess owner([](const StandingProcess::Stand& stand) {
    const AttachedSegment attached = attach();
    const LaneSender sender(attached);
    stand();
  });
  const LaneLiveness liveness(segment);
  ASSERT_EQ(liveness.lane(0).state, LaneState::alive);
  const BusyProcessors busy;
  owner.kill_now();
  while (liveness.lane(0).state != LaneState::died) std::this_thread::yield();
}

TEST_F(BusyMachineTest, GoesOnWhileAnOrdinaryThreadThatHoldsItsLockGetsNoProcessor) {
  const OwnedSegment segment = running_segment();
  const LaneLiveness liveness(segment);
  std::atomic<bool> held{false};
  std::atomic<bool> let_go{false};
  std::thread ordinary([&] {
    const std::lock_guard lock(fork_mutex());
    held = true;
    become_real_time(SCHED_OTHER, 0);
    while (!let_go) {
    }
  });
  while (!held) std::this_thread::yield();
  {
    const BusyProcessors busy;
    let_go = true;
    const std::uint32_t rounds = liveness.rounds();
    while (liveness.rounds() - rounds < 2) std::this_thread::yield();
  }
  ordinary.join();
}

}  // namespace
}  // namespace o80
