#include "iteration/interception.hpp"

#include <gmock/gmock.h>
#include <semaphore.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <shared_mutex>
#include <stdexcept>
#include <thread>
#include <vector>

#include "memory/os/futex.hpp"

namespace o80::test {
namespace {

/// What this thread calls in a piece of code.
template <class Code>
Calls calls_in(Code&& code) {
  const Calls before = calls_so_far();
  {
    const Watched watch;
    code();
  }
  return calls_so_far() - before;
}

class InterceptionTest : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!kCallsAreIntercepted) GTEST_SKIP() << "a sanitizer stands there already";
  }
};

TEST_F(InterceptionTest, PlainArithmeticCallsNothing) {
  std::atomic<int> sum = 0;
  const Calls found = calls_in([&] {
    for (int i = 0; i < 1000; ++i) sum += i;
  });
  EXPECT_EQ(found.text(), "");
  EXPECT_EQ(sum, 499500);
}

TEST_F(InterceptionTest, TheHeapIsSeenByEveryDoor) {
  EXPECT_EQ(calls_in([] { std::vector<int>(100).at(5) = 1; })[Kind::heap], 2U);
  struct alignas(64) Wide {
    char bytes[64];
  };
  EXPECT_EQ(calls_in([] { std::vector<Wide>(3).at(1).bytes[0] = 1; })[Kind::heap], 2U);
  void* volatile kept = nullptr;
  EXPECT_EQ(calls_in([&] {
              kept = std::malloc(10);
              kept = std::realloc(kept, 1000);
              std::free(kept);
              kept = std::calloc(10, 10);
              std::free(kept);
              kept = std::aligned_alloc(64, 64);
              std::free(kept);
            })[Kind::heap],
            7U);
}

TEST_F(InterceptionTest, LocksAreSeen) {
  std::mutex mutex;
  EXPECT_EQ(calls_in([&] { const std::scoped_lock lock(mutex); })[Kind::lock], 1U);
  EXPECT_EQ(calls_in([&] {
              if (mutex.try_lock()) mutex.unlock();
            })[Kind::lock],
            1U);
  std::shared_mutex shared;
  EXPECT_EQ(calls_in([&] { const std::shared_lock lock(shared); })[Kind::lock], 1U);
  std::condition_variable_any some;
  EXPECT_GE(calls_in([&] { some.notify_all(); })[Kind::lock], 1U);
  std::condition_variable condition;
  std::unique_lock lock(mutex);
  EXPECT_GE(calls_in([&] { condition.wait_for(lock, std::chrono::microseconds(1)); })[Kind::lock],
            1U);
  sem_t semaphore;
  sem_init(&semaphore, 0, 1);
  EXPECT_EQ(calls_in([&] {
              sem_wait(&semaphore);
              sem_post(&semaphore);
            })[Kind::lock],
            2U);
  sem_destroy(&semaphore);
}

TEST_F(InterceptionTest, ExceptionsAreSeen) {
  const auto fail = [] {
    try {
      throw std::runtime_error("no");
    } catch (const std::runtime_error&) {
    }
  };
  EXPECT_EQ(calls_in(fail)[Kind::exception], 2U) << "memory for it, and the throw";
}

TEST_F(InterceptionTest, TextsAreSeen) {
  char line[40];
  const char* volatile format = "%d";
  EXPECT_EQ(calls_in([&] { std::snprintf(line, sizeof line, format, 5); })[Kind::text], 2U);
  EXPECT_STREQ(line, "5");
}

TEST_F(InterceptionTest, SystemCallsAreSeenAndMade) {
  if (!system_calls_are_counted()) GTEST_SKIP() << "this kernel does not let them be counted";
  const Calls found = calls_in([] {
    const timespec blink{0, 1000};
    nanosleep(&blink, nullptr);
    getppid();
    getppid();
  });
  EXPECT_EQ(found.system[SYS_getppid], 2U);
  EXPECT_EQ(found.system_calls(), 3U) << found.text();

  long parent = 0;
  std::atomic<std::uint32_t> word = 7;
  const Calls futex = calls_in([&] {
    parent = syscall(SYS_getppid);
    futex_wait(word, 7, 1000);
    futex_wake(word, 1);
    futex_wake(word, 1);
  });
  EXPECT_EQ(parent, getppid()) << "the caller gets the answer";
  EXPECT_EQ(futex.waits, 1U);
  EXPECT_EQ(futex.wakes, 2U);
}

TEST_F(InterceptionTest, OtherThreadsAreNotSeen) {
  std::atomic<int> turn = 0;
  std::thread other([&] {
    while (turn == 0) std::this_thread::yield();
    std::vector<int>(100).at(5) = 1;
    turn = 2;
  });
  const Calls found = calls_in([&] {
    turn = 1;
    while (turn == 1) {
    }
  });
  other.join();
  EXPECT_EQ(found.text(), "");
}

}  // namespace
}  // namespace o80::test
