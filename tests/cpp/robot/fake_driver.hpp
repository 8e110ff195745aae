#pragma once

#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <functional>
#include <iterator>
#include <sstream>
#include <string>
#include <utility>
#include <vector>

#include "o80/robot/make_table.hpp"
#include "o80/robot/plant_requests.hpp"
#include "places.hpp"
#include "robot/loop/loop.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {

/// A request that the fake driver serves as it is told to.
struct Poke {
  std::uint32_t how = 0;  // 0 done, 1 rejected, 2 fresh start, 3 failed, 4 throws, 5 runs
};
O80_DESCRIBE(Poke, how);

/// How often the parts of a fake driver were called.
struct FakeDriverCalls {
  int constructed = 0, started = 0, written = 0, read = 0, stopped = 0, destroyed = 0, halted = 0,
      resumed = 0;
};

/// A driver whose every step can be made to fail; it counts what is called.
class FakeDriver {
 public:
  enum class Fails : std::uint8_t {
    never,
    construct,
    describe,
    start,
    first_read,
    write,
    read,
    fault,
    odd,
    halt
  };
  struct Config {
    Fails fails = Fails::never;
    double gain = 1.5;
    int finish_at = -1;
  };
  struct Sensors {
    double seen = 0;
  };
  using Actuators = std::array<double, 2>;
  using Extended = Sensors;
  using Requests = o80::Requests<Poke>;

  static inline FakeDriverCalls calls;
  static inline std::function<void(const Desired<FakeDriver>&)> on_write;
  static inline std::function<void(Reading<FakeDriver>&)> on_read;
  static inline std::function<Served()> on_resume;
  static inline Limits limits;
  static inline bool simulated = true;
  static inline std::int64_t own_gap = 0;  // [ns]; 0: by default

  explicit FakeDriver(const Config& config) : config_(config) {
    if (config.fails == Fails::construct) throw std::runtime_error("no cable");
    ++calls.constructed;
  }
  ~FakeDriver() { ++calls.destroyed; }

  void describe(Schema& schema) const {
    if (config_.fails == Fails::describe) throw std::runtime_error("no plan");
    schema.actuator(0).name("left");
    schema.actuator(1).name("right");
    schema.actuator(0).limits(limits);
    schema.head.of_the_world = simulated ? 2 : 3;  // also in bursts
    if (own_gap > 0) schema.gap(own_gap);
  }
  void start() {
    ++calls.started;
    if (config_.fails == Fails::start) throw std::runtime_error("no power");
  }
  void write(const Desired<FakeDriver>& desired) {
    ++calls.written;
    if (on_write) on_write(desired);
    if (config_.fails == Fails::write && desired.iteration() == 3) {
      throw std::runtime_error("wire cut");
    }
    now_ = desired.states;
  }
  void read(Reading<FakeDriver>& reading) {
    ++calls.read;
    reading.observed = now_;
    reading.extended.seen = static_cast<double>(calls.read);
    if (config_.fails == Fails::first_read) throw std::runtime_error("blind");
    if (on_read) on_read(reading);
    if (reading.iteration() == 3) {
      if (config_.fails == Fails::read) throw std::runtime_error("went blind");
      if (config_.fails == Fails::fault) reading.fault("too hot");
      if (config_.fails == Fails::odd) throw 42;  // NOLINT(hicpp-exception-baseclass)
    }
    if (reading.iteration() == config_.finish_at) reading.finish();
  }
  Served on(const Poke& poke) {
    switch (poke.how) {
      case 0:
        return Served::done();
      case 1:
        return Served::rejected("not now");
      case 2:
        now_ = {7, 8};
        return Served::start_afresh();
      case 3:
        return Served::failed("poked too hard");
      case 5:
        return Served::running("feels the poke");
      default:
        throw std::runtime_error("ouch");
    }
  }
  void halt() {
    ++calls.halted;
    if (config_.fails == Fails::halt) throw std::runtime_error("no brake");
  }
  Served resume() {
    ++calls.resumed;
    if (on_resume) return on_resume();
    return Served::done();
  }
  void stop() noexcept { ++calls.stopped; }

 private:
  Config config_;
  std::array<double, 2> now_{};
};
O80_DESCRIBE_ENUM(FakeDriver::Fails, never, construct, describe, start, first_read, write, read,
                  fault, odd, halt);
O80_DESCRIBE(FakeDriver::Config, (fails, "when"), (gain, "of nothing [1/s]"), finish_at);
O80_DESCRIBE(FakeDriver::Sensors, seen);

/// More iterations than any test asks for.
inline constexpr std::uint32_t kAll = 1'000'000;

/// A test with fake drivers whose calls are not counted yet.
class FakeDriverTest : public ManualBackendTest {
 protected:
  FakeDriverTest() {
    FakeDriver::calls = {};
    FakeDriver::on_write = {};
    FakeDriver::on_read = {};
    FakeDriver::on_resume = {};
    FakeDriver::limits = {};
    FakeDriver::simulated = true;
    FakeDriver::own_gap = 0;
  }
  static const RobotTable& table() { return *robot_table<FakeDriver>("fake"); }
  static std::unique_ptr<DriverInstance> driver(const OptionValues& options = {}) {
    return std::make_unique<DriverInstance>(table(), options);
  }
  static std::unique_ptr<Loop> started(const OptionValues& options = {},
                                       const BackendOptions& backend = {.segment = "fake",
                                                                        .bursting = true}) {
    auto loop = std::make_unique<Loop>(driver(options), backend);
    loop->start();
    return loop;
  }
};

inline Batch poke(UntypedFrontend& frontend, std::uint32_t how) {
  add_request(frontend, Poke{how});
  return frontend.pulse();
}

/// What a program did.
struct Outcome {
  int code = -1;  // or minus the signal that ended it
  std::string out;
  std::string err;
};

/// A program that runs beside the test, with pipes to all of its ends.
class Program {
 public:
  /// `before` is called in its process before the program begins there.
  explicit Program(std::vector<std::string> words, const std::function<void()>& before = {}) {
    for (auto& ends : pipes_) {
      if (pipe(ends) != 0) throw Error("no pipe");
    }
#ifdef O80_TEST_EMULATOR
    // of another instruction set: run by what runs this test
    if (words[0].starts_with(kPrefix)) {
      std::istringstream emulator(O80_TEST_EMULATOR);
      words.insert(words.begin(), std::istream_iterator<std::string>(emulator), {});
    }
#endif
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    pid_ = fork();
    if (pid_ == 0) {
      dup2(pipes_[0][0], 0);
      dup2(pipes_[1][1], 1);
      dup2(pipes_[2][1], 2);
      for (auto& ends : pipes_) ::close(ends[0]), ::close(ends[1]);
      if (before) before();
      execvp(arguments[0], arguments.data());
      _exit(127);
    }
    ::close(std::exchange(pipes_[0][0], -1));
    ::close(std::exchange(pipes_[1][1], -1));
    ::close(std::exchange(pipes_[2][1], -1));
  }
  Program& operator=(Program&&) = delete;
  ~Program() {
    if (pid_ > 0) {
      ::kill(pid_, SIGKILL);
      waitpid(pid_, nullptr, 0);
    }
    for (auto& ends : pipes_) {
      for (const int end : ends) {
        if (end >= 0) ::close(end);
      }
    }
  }

  pid_t pid() const { return pid_; }
  void signal(int which) const { ::kill(pid_, which); }
  void close_input() { ::close(std::exchange(pipes_[0][1], -1)); }
  /// Reads its output up to a line that holds a word; false if it ended first.
  bool says(const std::string& word) {
    char byte = 0;
    std::string line;
    while (::read(pipes_[1][0], &byte, 1) == 1) {
      out_ += byte;
      line += byte;
      if (byte != '\n') continue;
      if (line.find(word) != std::string::npos) return true;
      line.clear();
    }
    return false;
  }
  /// Waits for its end.
  Outcome end() {
    Outcome outcome;
    outcome.out = out_ + rest(1);
    outcome.err = rest(2);
    int status = 0;
    waitpid(std::exchange(pid_, -1), &status, 0);
    outcome.code = WIFEXITED(status) ? WEXITSTATUS(status) : -WTERMSIG(status);
    return outcome;
  }

 private:
  std::string rest(int which) const {
    std::string text;
    char some[512];
    ssize_t got = 0;
    while ((got = ::read(pipes_[which][0], some, sizeof some)) > 0) {
      text.append(some, static_cast<std::size_t>(got));
    }
    return text;
  }

  int pipes_[3][2];
  pid_t pid_ = -1;
  std::string out_;
};

inline const std::string kRunProgram = kPrefix + "/bin/o80-run";
inline const std::string kTwoJoints = kPrefix + "/lib/o80/robots/two_joints.so";

}  // namespace o80::test
