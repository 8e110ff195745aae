#include "robot/group/worker_pool.hpp"

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <fstream>
#include <string>
#include <thread>
#include <vector>

#include "o80/base/error.hpp"

namespace o80::test {
namespace {

const auto kNothing = [] {};

TEST(WorkerPoolTest, DoesEachTaskOfEachCallOnce) {
  for (const std::size_t workers : {0U, 1U, 2U, 5U}) {
    WorkerPool pool(workers);
    std::vector<int> done(200);  // not atomic: the pool orders the tasks and its caller
    int calls = 0;
    for (std::uint32_t count = 0; count <= done.size(); ++count) {
      const auto task = [&](std::uint32_t i) { ++done[i]; };
      pool.run(count, task, kNothing);
      ++calls;
      for (std::uint32_t i = 0; i < done.size(); ++i) {
        // task i was there in the calls with more than i tasks
        ASSERT_EQ(done[i], i < count ? calls - static_cast<int>(i) - 1 : 0) << workers;
      }
    }
  }
}

TEST(WorkerPoolTest, DoesShortCallsOneAfterTheOther) {
  // a worker that comes late to one call must not take a task of the next
  WorkerPool pool(3);
  std::uint64_t sum = 0;
  for (std::uint64_t call = 0; call < 20'000; ++call) {
    std::uint64_t results[3] = {};
    const auto task = [&](std::uint32_t i) { results[i] = call + i; };
    pool.run(1 + call % 3, task, kNothing);
    for (const std::uint64_t result : results) sum += result;
  }
  std::uint64_t expected = 0;
  for (std::uint64_t call = 0; call < 20'000; ++call) {
    for (std::uint64_t i = 0; i <= call % 3; ++i) expected += call + i;
  }
  EXPECT_EQ(sum, expected);
}

TEST(WorkerPoolTest, GivesATaskToTheSameThreadInEveryCall) {
  // every task waits for all others, so no thread has time for the task of another one
  WorkerPool pool(3);
  std::vector<std::thread::id> first;
  for (int call = 0; call < 100; ++call) {
    std::atomic<int> arrived{0};
    std::vector<std::thread::id> threads(4);
    const auto task = [&](std::uint32_t i) {
      threads[i] = std::this_thread::get_id();
      ++arrived;
      while (arrived < 4) std::this_thread::yield();
    };
    pool.run(4, task, kNothing);
    if (first.empty()) first = threads;
    ASSERT_EQ(threads, first) << "in call " << call;
  }
  EXPECT_EQ(first[0], std::this_thread::get_id());
}

TEST(WorkerPoolTest, LooksAroundWhileItWaitsForAWorker) {
  WorkerPool pool(1);
  const std::thread::id caller = std::this_thread::get_id();
  std::atomic<bool> worker_has_one{false};
  std::atomic<int> looks{0};
  const auto task = [&](std::uint32_t) {
    if (std::this_thread::get_id() == caller) {
      while (!worker_has_one) std::this_thread::yield();
      return;
    }
    worker_has_one = true;
    while (looks < 3) std::this_thread::yield();
  };
  pool.run(2, task, [&] { ++looks; });
  EXPECT_GE(looks, 3);
}

TEST(WorkerPoolTest, LeavesSignalsToTheThreadsOfTheProgram) {
  WorkerPool pool(1);
  std::atomic<int> arrived{0};
  const std::thread::id caller = std::this_thread::get_id();
  int open_signals = -1;
  const auto task = [&](std::uint32_t) {
    if (std::this_thread::get_id() != caller) {
      sigset_t blocked;
      pthread_sigmask(SIG_BLOCK, nullptr, &blocked);
      open_signals = 0;
      for (const int signal : {SIGINT, SIGTERM, SIGHUP, SIGALRM, SIGCHLD}) {
        open_signals += sigismember(&blocked, signal) == 1 ? 0 : 1;
      }
    }
    ++arrived;
    while (arrived < 2) std::this_thread::yield();
  };
  pool.run(2, task, kNothing);
  EXPECT_EQ(open_signals, 0);
}

TEST(WorkerPoolTest, WaitsForNoWorkerInAChildThatWasForkedWithinACall) {
  WorkerPool pool(2);
  const std::thread::id caller = std::this_thread::get_id();
  std::atomic<pid_t> child{-1};
  const auto task = [&](std::uint32_t) {
    // the workers still run when the caller looks around
    while (std::this_thread::get_id() != caller && child == -1) std::this_thread::yield();
  };
  const auto look = [&] {
    if (child != -1) return;
    child = fork();
    if (child == 0) alarm(20);  // ends a child that waits
  };
  pool.run(3, task, look);
  if (child == 0) _exit(7);
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, W_EXITCODE(7, 0));
}

TEST(WorkerPoolTest, EndsTheThreadsThatItHasStartedIfTheOthersCannotBe) {
#ifdef O80_TEST_SANITIZED
  GTEST_SKIP() << "needs a limit of memory, which a sanitizer does not survive";
#endif
  const pid_t child = fork();
  if (child == 0) {
    // memory for the stacks of a few threads
    rlim_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    const rlim_t most = pages * static_cast<rlim_t>(sysconf(_SC_PAGESIZE)) + (28U << 20);
    const rlimit limit{most, most};
    setrlimit(RLIMIT_AS, &limit);
    std::string why;
    try {
      const WorkerPool pool(100);
    } catch (const Error& error) {
      why = error.what();
    }
    sigset_t blocked;
    pthread_sigmask(SIG_BLOCK, nullptr, &blocked);
    const bool is_said = why.find("of 100 threads") != std::string::npos;
    _exit(is_said && sigismember(&blocked, SIGINT) == 0 ? 7 : 1);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(status, W_EXITCODE(7, 0));
}

TEST(WorkerPoolTest, LeavesItsThreadsToTheParentInAForkedChild) {
  auto pool = std::make_unique<WorkerPool>(2);
  const pid_t child = fork();
  if (child == 0) {
    pool.reset();
    _exit(7);
  }
  int status = -1;
  ASSERT_EQ(waitpid(child, &status, 0), child);
  EXPECT_EQ(WEXITSTATUS(status), 7);
  std::atomic<int> done{0};
  const auto task = [&](std::uint32_t) { ++done; };
  pool->run(10, task, kNothing);
  EXPECT_EQ(done, 10);
}

}  // namespace
}  // namespace o80::test
