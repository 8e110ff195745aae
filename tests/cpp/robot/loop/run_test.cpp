#include "o80/robot/run.hpp"

#include <linux/capability.h>
#include <linux/securebits.h>
#include <sched.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <array>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <map>

#include "memory/child_process.hpp"
#include "o80/base/time.hpp"
#include "o80/memory/segment_list.hpp"
#include "robot/fake_driver.hpp"

namespace o80::test {
namespace {

using ::testing::Contains;
using ::testing::Not;
using ::testing::Pair;

/// A processor that this process may use.
int usable_processor() {
  cpu_set_t allowed;
  sched_getaffinity(0, sizeof allowed, &allowed);
  int first = 0;
  while (!CPU_ISSET(first, &allowed)) ++first;
  return first;
}

/// Of a process [kB].
long locked_memory(pid_t pid) {
  std::ifstream status("/proc/" + std::to_string(pid) + "/status");
  for (std::string word; status >> word;) {
    long locked = 0;
    if (word == "VmLck:" && status >> locked) return locked;
  }
  return -1;
}

class RunTest : public FakeDriverTest {
 protected:
  static std::vector<std::string> two_joints(std::vector<std::string> flags = {}) {
    flags.insert(flags.begin(), {kRunProgram, kTwoJoints});
    return flags;
  }
};

/// Runs a table as a process would, in this one.
int run_here(const RobotTable& table, std::vector<std::string> words) {
  words.insert(words.begin(), "program");
  std::vector<char*> arguments;
  for (std::string& word : words) arguments.push_back(word.data());
  arguments.push_back(nullptr);
  return run(table, static_cast<int>(words.size()), arguments.data());
}
/// The same, with what it says.
Outcome outcome_of(const RobotTable& table, const std::vector<std::string>& words) {
  ::testing::internal::CaptureStdout();
  ::testing::internal::CaptureStderr();
  Outcome outcome{.code = run_here(table, words), .out = {}, .err = {}};
  outcome.out = ::testing::internal::GetCapturedStdout();
  outcome.err = ::testing::internal::GetCapturedStderr();
  return outcome;
}

/// A stepper motor and a switch, that is done at once.
struct Stepper {
  struct Axis {
    std::int32_t position = 0;
    bool powered = false;
  };
  struct Config {};
  using Actuators = std::array<Axis, 1>;
  explicit Stepper(const Config&) {}
  void start() {}
  void write(const Desired<Stepper>&) {}
  void read(Reading<Stepper>& reading) { reading.finish(); }
  void stop() noexcept {}
};
O80_DESCRIBE(Stepper::Config);
O80_DESCRIBE(Stepper::Axis, (position, "[steps]"), powered);

TEST_F(RunTest, SaysAtItsStartWhichNumbersAHaltStopsInOneIteration) {
  const Outcome outcome = outcome_of(*robot_table<Stepper>("stepper"), {});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, AllOf(HasSubstr("no acceleration limit on"), HasSubstr("position"),
                                 Not(HasSubstr("powered"))));
}

/// Whether threads of this process may have the policy fifo.
bool is_fifo_allowed() {
  bool is_allowed = false;
  std::thread([&] {
    const sched_param parameter{80};
    is_allowed = sched_setscheduler(0, SCHED_FIFO, &parameter) == 0;
  }).join();
  return is_allowed;
}

/// Spins in iteration 3 until its thread is an ordinary one (or for too long), and is done in
/// iteration 5.
struct Spinning {
  struct Config {};
  using Actuators = std::array<Stepper::Axis, 1>;
  explicit Spinning(const Config&) {}
  void start() { EXPECT_EQ(policy(), SCHED_OTHER) << "the loop only"; }
  void write(const Desired<Spinning>& desired) {
    if (desired.iteration() == 2) policy_before = policy();
    const std::int64_t end = monotonic_now() + 30'000'000'000;
    while (desired.iteration() == 3 && policy() == SCHED_FIFO && monotonic_now() < end) {
    }
  }
  void read(Reading<Spinning>& reading) {
    if (reading.iteration() == 5) reading.finish();
  }
  void stop() noexcept {}

  static int policy() { return sched_getscheduler(0) & ~SCHED_RESET_ON_FORK; }
  static inline int policy_before = -1;  // of the thread of the loop in iteration 2
};
O80_DESCRIBE(Spinning::Config);

TEST_F(RunTest, WithPolicyAutoALoopThatDoesNotSleepBecomesAnOrdinaryThreadAndGoesOn) {
  cpu_set_t allowed;
  sched_getaffinity(0, sizeof allowed, &allowed);
  if (!is_fifo_allowed() || CPU_COUNT(&allowed) < 2)
    GTEST_SKIP() << "this process may not use the policy fifo, or has one processor";
  ChildProcess child([&](const auto&) {
    const auto [code, out, err] =
        outcome_of(*robot_table<Spinning>("spinning"), {"--policy", "auto"});
    EXPECT_EQ(code, 0);
    EXPECT_EQ(Spinning::policy_before, SCHED_FIFO);
    EXPECT_EQ(Spinning::policy(), SCHED_OTHER);
    EXPECT_THAT(out, HasSubstr("policy auto: fifo, as long as"));
    EXPECT_THAT(err, HasSubstr("lost its real-time priority"));
    if (HasFailure()) throw std::runtime_error("failed");
  });
  EXPECT_EQ(child.wait(), 0);
}

TEST_F(RunTest, WithPolicyAutoSimulatedRobotsAndPythonsAreOrdinaryThreads) {
  for (const bool simulated : {true, false}) {
    FakeDriver::simulated = simulated;
    const Outcome outcome = outcome_of(table(), {"--policy", "auto", "--finish-at", "1"});
    EXPECT_EQ(outcome.code, 0);
    EXPECT_THAT(outcome.out, HasSubstr("policy auto: other"));
    EXPECT_EQ(sched_getscheduler(0), SCHED_OTHER);
  }
}

TEST_F(RunTest, SaysWhereThePolicyFifoIsAllowedUnlessOneIsChosen) {
  const bool is_allowed = is_fifo_allowed();
  const auto says_so = [](const RobotTable& table, const std::vector<std::string>& words) {
    const Outcome outcome = outcome_of(table, words);
    EXPECT_EQ(outcome.code, 0);
    return outcome.out.find("allows --policy fifo") != std::string::npos;
  };
  const RobotTable& of_the_world = *robot_table<Stepper>("stepper");
  EXPECT_EQ(says_so(of_the_world, {}), is_allowed);
  EXPECT_EQ(sched_getscheduler(0), SCHED_OTHER);
  EXPECT_FALSE(says_so(of_the_world, {"--policy", "other"}));
  EXPECT_FALSE(says_so(table(), {"--finish-at", "1"})) << "simulated";
}

/// All that end a process and can be caught; those of failed writes are ignored.
std::vector<int> ending_signals() {
  std::vector<int> numbers{SIGHUP,  SIGINT,    SIGQUIT, SIGILL,  SIGTRAP, SIGABRT, SIGBUS,
                           SIGFPE,  SIGUSR1,   SIGSEGV, SIGUSR2, SIGALRM, SIGTERM, SIGSTKFLT,
                           SIGXCPU, SIGVTALRM, SIGPROF, SIGIO,   SIGPWR,  SIGSYS};
  for (int number = SIGRTMIN; number <= SIGRTMAX; number += 15) numbers.push_back(number);
  return numbers;
}

// rule H12
TEST_F(RunTest, RunsARobotLibraryUntilASignalStopsItInOrder) {
#ifdef O80_TEST_SANITIZED
  GTEST_SKIP() << "a sanitizer has handlers of its own";
#endif
  for (const int signal : ending_signals()) {
    SCOPED_TRACE(strsignal(signal));
    Program program(two_joints({"--frequency", "500"}));
    ASSERT_TRUE(program.says("two_joints runs on segment 'two_joints', 500 Hz"));
    UntypedFrontend frontend("two_joints", {.timeout = kPatience});
    frontend.wait_for(5, kPatience);
    program.signal(signal);
    const Outcome outcome = program.end();
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    EXPECT_EQ(outcome.err, "");
    EXPECT_THROW(frontend.wait_for(1'000'000, kPatience), BackendStopped);
    EXPECT_EQ(directory_.files(), 0U) << "nothing is left behind";
  }
}

TEST_F(RunTest, ALibraryThatCallsExitStopsTheRobotFirst) {
  for (const bool in_the_loop : {true, false}) {
    ChildProcess child([&](const auto&) {
      FakeDriver::on_write = [&](const Desired<FakeDriver>& desired) {
        if (desired.iteration() != 3) return;
        if (in_the_loop) std::exit(5);               // NOLINT(concurrency-mt-unsafe)
        std::thread([] { std::exit(5); }).detach();  // NOLINT(concurrency-mt-unsafe)
      };
      run_here(table(), {"--frequency", "1000"});
      pause_for_ever();
    });
    EXPECT_EQ(child.wait(), 5);
    if (in_the_loop) {
      EXPECT_THAT(
          message_of<BackendFailed>([] { UntypedFrontend("fake", {.timeout = kPatience}); }),
          HasSubstr("called exit()"));
    }
    // in order: its files are removed, or say that it has stopped
    for (const SegmentEntry& entry : list_segments())
      EXPECT_EQ(entry.life, in_the_loop ? Life::failed : Life::stopped);
    clean_dead();
  }
}

// rule W10
TEST_F(RunTest, HaltsItselfWhenItsFilesAreRemovedAndIsStillFoundAndStopped) {
  Program program(two_joints({"--frequency", "500"}));
  ASSERT_TRUE(program.says("runs on segment"));
  UntypedFrontend frontend("two_joints", {.timeout = kPatience});
  send(frontend, 0, 1.0, {.pace = iterations(1'000'000'000)});
  for (const auto& file : std::filesystem::directory_iterator(directory_.path()))
    std::filesystem::remove(file.path());
  // a halt acts before its reason is written
  while (frontend.halted().value_or(Halt{}).cause != HaltCause::unreachable)
    std::this_thread::yield();
  EXPECT_THAT(std::string(frontend.halted()->reason()),
              HasSubstr("kill " + std::to_string(program.pid())));

  Program second(two_joints());
  const Outcome refused = second.end();
  EXPECT_EQ(refused.code, 1);
  EXPECT_THAT(refused.err, HasSubstr("(pid " + std::to_string(program.pid())));
  EXPECT_THAT(message_of<TimeoutError>(
                  [] { UntypedFrontend("two_joints", {.timeout = std::chrono::milliseconds(0)}); }),
              AllOf(HasSubstr("files were removed"), Not(HasSubstr("Did you mean"))));
  const std::vector<SegmentEntry> found = list_segments();
  ASSERT_EQ(found.size(), 1U);
  EXPECT_EQ(found[0].pid, program.pid());

  program.signal(SIGTERM);
  EXPECT_EQ(program.end().code, 0);
}

TEST_F(RunTest, ASignalEndsEvenALongPeriodAtOnce) {
  Program program(two_joints({"--frequency", "0.001"}));
  ASSERT_TRUE(program.says("runs on segment"));
  program.signal(SIGINT);
  EXPECT_EQ(program.end().code, 0);
}

TEST_F(RunTest, OneThatIsAskedToStopWhileItStartsEndsAtOnce) {
  FakeDriver::on_read = [](Reading<FakeDriver>& reading) {
    if (reading.iteration() == 0) raise(SIGTERM);
  };
  const std::int64_t begin = monotonic_now();
  EXPECT_EQ(run_here(table(), {}), 0);
  EXPECT_LT(monotonic_now() - begin, 5'000'000'000) << "it waits 5 s for a backend that may come";
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
}

TEST_F(RunTest, StopsWhenItsInputEndsIfToldSo) {
  Program program(two_joints({"--until-eof"}));
  ASSERT_TRUE(program.says("runs on segment"));
  program.close_input();
  EXPECT_EQ(program.end().code, 0);
  EXPECT_EQ(directory_.files(), 0U);
}

// rule O11
TEST_F(RunTest, ASecondOneOfTheNameDoesNotEvenConstructItsDriver) {
  ManualBackend owner({.segment = "fake"});
  const Outcome outcome = outcome_of(table(), {});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("already has a backend"));
  EXPECT_EQ(FakeDriver::calls.constructed, 0);
}

TEST_F(RunTest, LeavesTheFaultOfAConstructorForWhoWaitsToAttach) {
  for (const auto& [fails, why] :
       {std::pair("construct", "no cable"), std::pair("describe", "no plan")}) {
    std::thread waiter([why] {
      EXPECT_THAT(
          message_of<BackendFailed>([] { UntypedFrontend("fake", {.timeout = kPatience}); }),
          HasSubstr(why));
    });
    const Outcome outcome = outcome_of(table(), {"--fails", fails, "--gain", "3"});
    EXPECT_EQ(outcome.code, 1);
    EXPECT_THAT(outcome.err, HasSubstr(why));
    waiter.join();
    EXPECT_EQ(directory_.files(), 2U) << "they stay to be read";
    const UntypedFrontend dead("fake", {.access = Access::read_only, .dead = true});
    EXPECT_EQ(dead.provenance().robot, "fake");
    EXPECT_THAT(dead.provenance().options, Contains(Pair("gain", "3")));
    std::filesystem::remove(directory_.file_of("fake"));
  }
}

TEST_F(RunTest, RunsInItsOwnMainAndFinishesInOrder) {
  const Outcome outcome = outcome_of(table(), {"--finish-at", "3", "--frequency", "5000"});
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.out, HasSubstr("fake runs on segment"));
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
  EXPECT_EQ(FakeDriver::calls.destroyed, 1);
  struct sigaction now{};
  sigaction(SIGINT, nullptr, &now);
  EXPECT_EQ(now.sa_handler, SIG_DFL) << "signals are as they were";
}

TEST_F(RunTest, ARobotOfItsOwnMainIsCalledAsItsProgram) {
  EXPECT_STREQ(program_name("build/bin/arm"), "arm");
  EXPECT_STREQ(program_name("arm"), "arm");
}

TEST_F(RunTest, SaysWhatIsWrongWithItsFlags) {
  Program program(two_joints({"--frequency", "never"}));
  const Outcome outcome = program.end();
  EXPECT_EQ(outcome.code, 2);
  EXPECT_THAT(outcome.err,
              HasSubstr("--frequency must be a number from 0.001 to 1000000 [1/s], got 'never'"));
  EXPECT_EQ(outcome.out, "");
  EXPECT_EQ(directory_.files(), 0U) << "nobody waits for a typing error";
  Program helped(two_joints({"--help"}));
  const Outcome help = helped.end();
  EXPECT_EQ(help.code, 0);
  EXPECT_THAT(help.out, AllOf(HasSubstr("--reach number"), HasSubstr("--frequency number")));
}

/// In a process that is about to become another program: nothing of root is left, nor of ulimit.
void drop_privileges() {
  const rlimit none{0, 0};
  setrlimit(RLIMIT_RTPRIO, &none);
  setenv("DBUS_SYSTEM_BUS_ADDRESS", "unix:path=/nowhere", 1);  // without RealtimeKit
  setrlimit(RLIMIT_MEMLOCK, &none);
  prctl(PR_SET_SECUREBITS, SECBIT_NOROOT);
  for (int capability = 0; capability < 64; ++capability) prctl(PR_CAPBSET_DROP, capability);
  __user_cap_header_struct header{_LINUX_CAPABILITY_VERSION_3, 0};
  const __user_cap_data_struct nothing[2] = {};
  syscall(SYS_capset, &header, nothing);
}

TEST_F(RunTest, WithoutAnyPrivilegeItSaysHowToGetThemAndRunsOn) {
#ifdef O80_TEST_SANITIZED
  GTEST_SKIP() << "a sanitizer locks no memory";
#endif
  Program program(two_joints({"--policy", "fifo", "--priority", "42", "--lock-memory", "--cpus",
                              std::to_string(usable_processor()) + ",1000"}),
                  drop_privileges);
  ASSERT_TRUE(program.says("runs on segment"));
  UntypedFrontend("two_joints", {.timeout = kPatience}).wait_for(5, kPatience);
  EXPECT_EQ(sched_getscheduler(program.pid()), SCHED_OTHER);
  EXPECT_EQ(locked_memory(program.pid()), 0);
  program.signal(SIGTERM);
  const Outcome outcome = program.end();
  EXPECT_EQ(outcome.code, 0);
  EXPECT_THAT(outcome.err,
              AllOf(HasSubstr("o80: real-time priority 42 was refused"),
                    HasSubstr("; RealtimeKit granted none ("), HasSubstr("--rtprio=99"),
                    HasSubstr("o80: locked memory was refused"), HasSubstr("--memlock=unlimited"),
                    HasSubstr("o80: processors 1000 were refused (the others are used)")));
}

TEST_F(RunTest, PolicyPriorityProcessorAndLockedMemoryAreWhatWasAskedFor) {
#ifdef O80_TEST_SANITIZED
  GTEST_SKIP() << "a sanitizer locks no memory";
#endif
  const int processor = usable_processor();
  for (const auto& [name, policy] : {std::pair("fifo", SCHED_FIFO), std::pair("rr", SCHED_RR)}) {
    Program program(two_joints({"--policy", name, "--priority", "42", "--lock-memory", "--cpus",
                                std::to_string(processor)}));
    ASSERT_TRUE(program.says("runs on segment"));
    const int got = sched_getscheduler(program.pid());
    sched_param parameter{};
    sched_getparam(program.pid(), &parameter);
    cpu_set_t processors;
    sched_getaffinity(program.pid(), sizeof processors, &processors);
    const long locked = locked_memory(program.pid());
    program.signal(SIGTERM);
    const Outcome outcome = program.end();
    EXPECT_EQ(CPU_COUNT(&processors), 1);
    EXPECT_TRUE(CPU_ISSET(processor, &processors));
    if (!outcome.err.empty()) GTEST_SKIP() << "the machine refuses: " << outcome.err;
    EXPECT_EQ(got, policy);
    EXPECT_EQ(parameter.sched_priority, 42);
    EXPECT_GT(locked, 16 << 10) << "[kB] with all of the history";
  }
}

TEST_F(RunTest, ReportsAFaultAndEndsWithAFailure) {
  const Outcome outcome = outcome_of(table(), {"--fails", "read", "--frequency", "5000"});
  EXPECT_EQ(outcome.code, 1);
  EXPECT_THAT(outcome.err, HasSubstr("failed in read: went blind"));
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
}

/// Calls of each kind that the loop's thread made while strace looked on; empty if it may not.
std::map<std::string, int> system_calls(const std::string& log) {
  std::map<std::string, int> calls;
  std::ifstream file(log);
  for (std::string line; std::getline(file, line);) {
    if (const auto bracket = line.find('('); bracket != std::string::npos) {
      ++calls[line.substr(0, bracket)];
    }
  }
  return calls;
}

using RunTestWithTools = RunTest;  // strace

TEST_F(RunTestWithTools, MakesOneSystemCallAnIterationTheOneThatPacesIt) {
#ifdef O80_TEST_SANITIZED
  GTEST_SKIP() << "a sanitizer makes calls of its own";
#endif
#if defined(O80_TEST_EMULATOR)
  GTEST_SKIP() << "so does an emulator";
#endif
  if (std::system("strace -o /dev/null true > /dev/null 2>&1") != 0) {  // NOLINT(cert-env33-c)
    GTEST_SKIP() << "strace is not there or may not trace";
  }
  Program program(two_joints({"--frequency", "1000"}));
  ASSERT_TRUE(program.says("runs on segment"));
  UntypedFrontend frontend("two_joints", {.timeout = kPatience});
  frontend.wait_for(10, kPatience);

  // the loop runs in the program's first thread, which alone is traced
  const std::string log = directory_.path() + "/calls";
  Program strace({"/usr/bin/strace", "-o", log, "-p", std::to_string(program.pid())});
  while (!std::filesystem::exists(log) || std::filesystem::file_size(log) == 0) {
    std::this_thread::yield();
  }
  const Iteration first = frontend.published();
  for (int i = 0; i < 100; ++i) {
    send(frontend, 0, 0.01 * i, {.pace = iterations(3)});
    frontend.wait_for(first + 3 * i, kPatience);
  }
  strace.signal(SIGINT);
  strace.end();
  const Iteration last = frontend.published();
  program.signal(SIGTERM);
  EXPECT_EQ(program.end().code, 0);

  std::map<std::string, int> calls = system_calls(log);
  const int paced = calls["clock_nanosleep"];
  const int woken = calls["futex"];
  calls.erase("clock_nanosleep");
  calls.erase("futex");
  EXPECT_GT(paced, 100);
  EXPECT_LE(paced, last + 1) << "at most one an iteration";
  EXPECT_LE(woken, paced) << "and one to wake who waits";
  calls.erase("restart_syscall");  // the one in which it was found
  EXPECT_THAT(calls, ::testing::IsEmpty()) << "of any other kind";
}

}  // namespace
}  // namespace o80::test
