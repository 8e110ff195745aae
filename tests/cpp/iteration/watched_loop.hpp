#pragma once

// A loop whose every iteration is watched, and the account of what it called.

#include <gtest/gtest.h>
#include <sys/syscall.h>

#include <array>
#include <cstdint>
#include <memory>
#include <optional>
#include <stdexcept>
#include <thread>
#include <utility>

#include "iteration/interception.hpp"
#include "o80/robot/make_table.hpp"
#include "robot/loop/loop.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {

inline constexpr Iteration kBurst = 8;  // every burst of these tests ends at a multiple of it

/// What the iterations of one loop called.
///
/// Writer: the loop's thread, at marks in its driver. Readers: the test, once the loop has ended.
struct Account {
  // write to read: the pace lies between; read to write: publish and step
  enum class Part : std::uint8_t { pacing, telling };

  bool bursting = false;
  Calls mark;
  std::int64_t sleeps = 0;
  std::int64_t wakes = 0;
  std::int64_t violations = 0;
  Calls violation;  // the first
  Iteration violated_in = 0;

  void close(Part part, Iteration iteration) noexcept {
    const Calls& now = calls_so_far();
    const Calls found = now - mark;
    mark = now;
    sleeps += found.system[SYS_clock_nanosleep];
    wakes += found.wakes;
    if (allowed(part, iteration, found)) return;
    if (violations++ > 0) return;
    violation = found;
    violated_in = iteration;
  }

  bool allowed(Part part, Iteration iteration, const Calls& found) const noexcept {
    for (const std::uint32_t count : found.of) {
      if (count > 0) return false;
    }
    const std::uint32_t slept = found.system[SYS_clock_nanosleep];
    const std::uint32_t futexes = found.system[SYS_futex];
    // a bursting backend stands still between two bursts: it tells what is left, lets others run,
    // and sleeps
    const bool stood = part == Part::telling && bursting && iteration % kBurst == 0;
    const std::uint32_t yields = stood ? found.system[SYS_sched_yield] : 0;
    if (found.system_calls() != slept + futexes + yields) return false;
    if (part == Part::pacing) return futexes == 0 && slept <= (bursting ? 0 : 1);
    return slept == 0 && (stood || found.waits == 0) && found.wakes <= (stood ? 2 : 1);
  }
};

struct Nudge {
  std::uint32_t how = 0;  // 0 done, 1 rejected, 2 fresh start
};
O80_DESCRIBE(Nudge, how);

/// Four joints that are where they are asked to be; tells the account where an iteration stands.
class Subject {
 public:
  struct Config {
    int fault_at = -1;
    bool throws = false;
  };
  using Actuators = std::array<double, 4>;
  struct Sensors {
    std::array<double, 8> forces{};
  };
  using Extended = Sensors;
  using Requests = o80::Requests<Nudge>;

  static inline Account* account = nullptr;
  static inline Calls at_stop;

  explicit Subject(const Config& config) : config_(config) {}
  void describe(Schema& schema) const {
    schema.simulated();
    schema.actuator(1).limits({.minimum = -10.0, .maximum = 10.0, .speed = 1000.0});
    schema.actuator(2).when_idle(WhenIdle::follow);
  }
  void start() {}
  void write(const Desired<Subject>& desired) {
    if (account != nullptr) account->close(Account::Part::telling, desired.iteration() - 1);
    now_ = desired.states;
  }
  void read(Reading<Subject>& reading) {
    // before row 0 nobody watches; the row of a fresh start is told from within a step
    const auto part = std::exchange(fresh_, false) ? Account::Part::telling : Account::Part::pacing;
    const Iteration row = reading.iteration() - (part == Account::Part::telling ? 1 : 0);
    if (account != nullptr && reading.iteration() > 0) account->close(part, row);
    reading.observed = now_;
    reading.extended.forces[0] = now_[0];
    if (reading.iteration() % 97 == 0) reading.interrupt(3);
    if (reading.iteration() != config_.fault_at) return;
    if (config_.throws) throw std::runtime_error("too cold");
    reading.fault("too hot");
  }
  Served on(const Nudge& nudge) {
    if (nudge.how == 1) return Served::rejected("not now");
    fresh_ = nudge.how == 2;
    return fresh_ ? Served::start_afresh() : Served::done();
  }
  void stop() noexcept {
    if (account != nullptr) at_stop = calls_so_far() - account->mark;
  }

 private:
  Config config_;
  Actuators now_{};
  bool fresh_ = false;
};
O80_DESCRIBE(Subject::Config, fault_at, throws);
O80_DESCRIBE(Subject::Sensors, forces);

/// A loop in a thread of its own, watched from its first iteration to its last.
class WatchedLoop {
 public:
  explicit WatchedLoop(BackendOptions options, const OptionValues& values = {})
      : bursting_(options.bursting),
        loop_(std::make_unique<DriverInstance>(*robot_table<Subject>("subject"), values),
              with_defaults(options)) {
    account_.bursting = bursting_;
    Subject::account = &account_;
    Subject::at_stop = {};
    loop_.start();
    thread_ = std::thread([this] {
      account_.mark = calls_so_far();
      const Watched watch;
      ended_ = loop_.run();
    });
    keeper.emplace("subject");
  }
  WatchedLoop& operator=(WatchedLoop&&) = delete;
  ~WatchedLoop() {
    stop();
    Subject::account = nullptr;
  }

  /// Lets some iterations pass.
  void go_on(Iteration iterations = 5 * kBurst) {
    if (bursting_) {
      for (Iteration i = 0; i < iterations; i += kBurst) keeper->burst(kBurst, kPatience);
    } else {
      try {
        keeper->wait_for(keeper->published() + iterations, kPatience);
      } catch (const RowOverwritten&) {  // on a busy machine more than that have passed
      }
    }
  }
  template <class Done>
  void go_on_until(Done&& done) {
    for (int i = 0; i < 1'000'000 && !done(); ++i) go_on(kBurst);
    ASSERT_TRUE(done());
  }
  Ended stop() {
    loop_.ask_to_stop();
    return join();
  }
  Ended join() {
    if (thread_.joinable()) thread_.join();
    return ended_;
  }
  bool bursting() const { return bursting_; }
  const Account& account() const { return account_; }

  /// Once it has ended: nothing was called that may not be, in any of its iterations.
  void expect_a_clean_account() {
    EXPECT_GT(keeper->oldest(), 0) << "the history was full";
    stop();
    EXPECT_EQ(account_.violations, 0)
        << "at first in iteration " << account_.violated_in << ": " << account_.violation.text();
    if (!bursting_) {
      EXPECT_GT(account_.sleeps, 0);
    }
  }

 private:
  static BackendOptions with_defaults(BackendOptions options) {
    options.segment = "subject";
    options.history = 64;
    return options;
  }

  bool bursting_;
  Account account_;
  Loop loop_;
  Ended ended_;
  std::thread thread_;

 public:
  std::optional<UntypedFrontend> keeper;
};

}  // namespace o80::test
