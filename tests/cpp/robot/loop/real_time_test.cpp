#include "o80/robot/real_time.hpp"

#include <sched.h>
#include <sys/resource.h>

#include <memory>
#include <thread>

#include "memory/child_process.hpp"
#include "robot/fake_driver.hpp"

namespace o80::test {
namespace {

using ::testing::IsEmpty;

/// In a thread of its own, so that nothing stays set.
std::vector<std::string> set_up(const RealTimeOptions& options) {
  std::vector<std::string> refused;
  std::thread([&] { refused = set_up_real_time(options); }).join();
  return refused;
}

TEST(RealTime, AsksForNothingUnlessTold) { EXPECT_THAT(set_up({}), IsEmpty()); }

TEST(RealTime, NamesTheProcessorThatIsNotThereBesideOneThatIs) {
  std::thread([] {
    const int here = sched_getcpu();
    RealTimeOptions options;
    options.processors = {1000, here};
    EXPECT_THAT(set_up_real_time(options),
                ElementsAre(AllOf(HasSubstr("processors 1000 were refused (the others are used)"),
                                  HasSubstr("lscpu"))));
    cpu_set_t allowed;
    ASSERT_EQ(sched_getaffinity(0, sizeof allowed, &allowed), 0);
    EXPECT_EQ(CPU_COUNT(&allowed), 1);
    EXPECT_TRUE(CPU_ISSET(here, &allowed));
  }).join();
}

/// Page faults of this thread while something runs.
template <class Work>
long faults_in(Work&& work) {
  rusage before{};
  rusage after{};
  getrusage(RUSAGE_THREAD, &before);
  work();
  getrusage(RUSAGE_THREAD, &after);
  return after.ru_minflt - before.ru_minflt + after.ru_majflt - before.ru_majflt;
}

__attribute__((noinline)) void use_stack() {
  volatile char some[128 << 10];
  for (std::size_t i = 0; i < sizeof some; i += 4096) some[i] = 1;
}

TEST(RealTime, TouchesTheStackBeforehand) {
#if defined(O80_TEST_SANITIZED) || defined(O80_TEST_EMULATOR)
  GTEST_SKIP() << "a sanitizer has stacks of its own, an emulator too";
#endif
  std::thread([] {
    set_up_real_time({});
    EXPECT_EQ(faults_in(use_stack), 0);
  }).join();
  std::thread([] {
    RealTimeOptions nothing;
    nothing.stack = 0;
    set_up_real_time(nothing);
    EXPECT_GT(faults_in(use_stack), 16) << "the count counts";
  }).join();
}

class RealTimeLoop : public FakeDriverTest {};

TEST_F(RealTimeLoop, MeetsNoPageForTheFirstTimeInAnIteration) {
#if defined(O80_TEST_SANITIZED) || defined(O80_TEST_EMULATOR)
  GTEST_SKIP() << "a sanitizer has pages of its own, an emulator too";
#endif
  const auto loop = started({}, {.segment = "fake", .bursting = true, .history = 20'000});
  UntypedFrontend frontend("fake");
  // a batch and a burst, so that code and data have been used once; the history and lane have not
  send(frontend, 0, 1.0, {.pace = iterations(3)});
  add_request(frontend, Poke{1});
  frontend.start_burst(1);
  loop->run_granted(kAll);

  std::thread([&] {
    set_up_real_time({});
    frontend.start_burst(5);
    loop->run_granted(kAll);
    // a whole lane, the whole history
    for (int i = 0; i < 16'000; ++i) add(frontend, i % 2, 1.0, {.pace = direct()});
    frontend.start_burst(25'000);
    EXPECT_EQ(faults_in([&] { loop->run_granted(kAll); }), 0);
  }).join();
  EXPECT_GT(frontend.oldest(), 0);
}

TEST(RealTime, SaysHowToGetWhatTheMachineRefuses) {
  RealTimeOptions elsewhere;
  elsewhere.processors = {1000};
  EXPECT_THAT(set_up(elsewhere),
              ElementsAre(AllOf(HasSubstr("processors 1000 were refused"), HasSubstr("taskset"))));
  RealTimeOptions options;
  options.policy = RealTimeOptions::Policy::fifo;
  options.priority = 1000;  // which no machine grants
  EXPECT_THAT(set_up(options), ElementsAre(AllOf(HasSubstr("real-time priority 1000 was refused"),
                                                 HasSubstr("--rtprio=99"))));
}

TEST(RealTime, SaysThatNoHigherPriorityThanTheLoopsIsLeftForTheHelper) {
  RealTimeOptions options;
  options.policy = RealTimeOptions::Policy::fifo;
  options.priority = 20;
  ChildProcess child([&](const ChildProcess::Ready&) {
    const rlimit limit{20, 20};
    if (setrlimit(RLIMIT_RTPRIO, &limit) != 0 || setuid(65534) != 0) _exit(77);
    const std::vector<std::string> refused = set_up_real_time(options);
    if (sched_getscheduler(0) != SCHED_FIFO) _exit(77);
    const bool said =
        refused.size() == 1 &&
        refused[0].find("real-time priority 21 was refused to the helper thread") == 0 &&
        refused[0].find("rtprio") != std::string::npos;
    _exit(said ? 0 : 1);
  });
  const int code = child.wait();
  if (code == 77) GTEST_SKIP() << "no user may be given a real-time priority here; make rt runs it";
  EXPECT_EQ(code, 0);
}

}  // namespace
}  // namespace o80::test
