#pragma once

#include <gmock/gmock.h>

#include <array>
#include <chrono>
#include <functional>
#include <optional>
#include <string>
#include <thread>
#include <vector>

#include "control/sending/batch_builder.hpp"
#include "memory/private_directory.hpp"
#include "message_of.hpp"
#include "o80/robot/plant_requests.hpp"
#include "o80/runtime/backend.hpp"
#include "o80/runtime/frontend.hpp"
#include "o80/runtime/journal.hpp"
#include "o80/runtime/robot_types.hpp"
#include "runtime/frontend/link.hpp"

namespace o80::test {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

/// A request that is always rejected, with a reason.
struct Refuse {};
O80_DESCRIBE(Refuse);
/// A request that breaks the robot.
struct Break {};
O80_DESCRIBE(Break);
/// A request that runs until the test ends it.
struct Home {};
O80_DESCRIBE(Home);
/// The same, for one that moves nothing: it continues in a halt.
struct Calibrate {
  static constexpr bool kWhileHalted = true;
};
O80_DESCRIBE(Calibrate);

/// Two joints that are where they are asked to be; the extended value counts what they did.
struct Pair {
  struct Effort {
    double total = 0;
  };
  using Actuators = std::array<double, 2>;
  using Extended = Effort;
  using Requests = o80::Requests<Reset, Snapshot, Restore, Refuse, Break, Home, Calibrate>;
};
O80_DESCRIBE(Pair::Effort, total);

inline constexpr Timeout kAtOnce = std::chrono::nanoseconds(0);
/// Long enough for any machine; no test waits for it to pass.
inline constexpr Timeout kPatience = std::chrono::seconds(60);

/// A backend driven by hand, iteration after iteration, with no clock.
class ManualBackend : private RequestServer {
 public:
  virtual ~ManualBackend() = default;
  ManualBackend& operator=(ManualBackend&&) = delete;

  explicit ManualBackend(const BackendOptions& options = {.segment = "pair"},
                         const std::function<void(Schema&)>& describe = {})
      : backend(schema_of(describe), options, this) {}

  /// Row 0.
  ManualBackend& start() {
    publish();
    return *this;
  }
  /// One iteration; what it came back with.
  Step iterate() {
    const Step step = backend.try_step();
    if (step == Step::run) finish();
    return step;
  }
  void run(int iterations) {
    for (int i = 0; i < iterations; ++i) ASSERT_EQ(iterate(), Step::run) << i;
  }
  /// Bursting: until it stands still or ends.
  Step drive() {
    Step step = Step::run;
    while (step == Step::run) step = iterate();
    return step;
  }
  /// Iterates until something is true.
  void run_until(const std::function<bool()>& done) {
    for (int i = 0; i < 1'000'000 && !done(); ++i) {
      iterate();
      std::this_thread::yield();
    }
    ASSERT_TRUE(done());
  }
  /// Waits for grants, as a loop does, until the end.
  void serve_bursts() {
    while (backend.step() == Step::run) finish();
  }
  Iteration last() const { return backend.iteration() - 1; }

  std::array<double, 2> now{};
  std::array<double, 2> offset{};  // of each reading
  double total = 0;
  std::function<void()> before_publish;
  std::function<void()> on_refuse;  // while a request `refuse` is served
  int homed = 0;                    // requests `home` that were served
  int fresh_starts = 0;
  UntypedBackend backend;
  // what a request `snapshot` gives to the journal
  std::uint32_t kept_slot = 0;
  std::vector<std::byte> kept;

 private:
  struct State {
    std::array<double, 2> now{};
    double total = 0;
  };

  static Schema schema_of(const std::function<void(Schema&)>& describe) {
    Schema schema;
    schema.head.robot = NameText("pair");
    describe_types<Pair>(schema);
    schema.actuator(0).name("shoulder");
    schema.actuator(1).name("elbow");
    if (describe) describe(schema);
    return schema;
  }
  void finish() {
    const auto desired = unpack<std::array<double, 2>>(backend.desired());
    for (std::size_t i = 0; i < 2; ++i) total += desired[i] - now[i];
    now = desired;
    if (before_publish) before_publish();
    publish();
  }
  std::array<double, 2> reading() const { return {now[0] + offset[0], now[1] + offset[1]}; }
  void publish() {
    pack(reading(), backend.observed());
    pack(total, backend.extended());
    backend.publish();
  }
  KeptState kept_state(std::uint32_t request,
                       std::span<const std::byte> /*payload*/) noexcept override {
    return request == 1 ? KeptState{kept_slot, kept} : KeptState{};  // Snapshot
  }
  Served serve(std::uint32_t request, std::span<const std::byte> payload) noexcept override {
    switch (request) {
      case 0:
        now = {static_cast<double>(unpack<Reset>(payload.data()).seed), 0};
        total = 0;
        return Served::start_afresh();
      case 1:
        kept_ = {now, total};
        return Served::done();
      case 2:
        now = kept_.now;
        total = kept_.total;
        return Served::start_afresh();
      case 3:
        if (on_refuse) on_refuse();
        return Served::rejected("it does not want to");
      case 5:
        ++homed;
        return Served::running("looks for the index of joint 1");
      case 6:
        return Served::running();
      default:
        return Served::failed("the arm fell off");
    }
  }
  bool read_fresh(FreshReading& reading) noexcept override {
    pack(this->reading(), reading.observed);
    pack(total, reading.extended);
    ++fresh_starts;
    return true;
  }

  State kept_;
};

/// One whose row 0 is out.
class StartedBackend final : public ManualBackend {
 public:
  explicit StartedBackend(const BackendOptions& options = {.segment = "pair"},
                          const std::function<void(Schema&)>& describe = {})
      : ManualBackend(options, describe) {
    start();
  }
};

/// A started backend and a frontend of it: `auto [manual, frontend] = StartedPair();`
struct StartedPair {
  explicit StartedPair(const BackendOptions& options = {.segment = "pair"},
                       const std::function<void(Schema&)>& describe = {})
      : manual(options, describe) {}

  StartedBackend manual;
  UntypedFrontend frontend{"pair"};
};

/// A manual backend that serves bursts in a thread of its own.
class BurstingBackend {
 public:
  explicit BurstingBackend(const std::string& segment = "pair",
                           const std::function<void(ManualBackend&)>& prepare = {},
                           const std::function<void(Schema&)>& describe = {})
      : manual({.segment = segment, .bursting = true}, describe) {
    if (prepare) prepare(manual);
    manual.start();
    thread_ = std::thread([this] { manual.serve_bursts(); });
  }
  BurstingBackend& operator=(BurstingBackend&&) = delete;
  ~BurstingBackend() { stop(); }
  /// The thread has ended; the segment is still there.
  void stop() {
    manual.backend.ask_to_stop();
    if (thread_.joinable()) thread_.join();
  }

  ManualBackend manual;

 private:
  std::thread thread_;
};

inline std::uint32_t add(UntypedFrontend& frontend, std::uint32_t actuator, double target,
                         const CommandOptions& options = {}) {
  return frontend.add_command(actuator, std::as_bytes(std::span(&target, 1)), options);
}
inline Batch send(UntypedFrontend& frontend, std::uint32_t actuator, double target,
                  const CommandOptions& options = {}) {
  add(frontend, actuator, target, options);
  return frontend.pulse();
}
/// As Frontend.resume() sends it, not waited for.
inline Batch send_resume(UntypedFrontend& frontend, std::uint64_t number, bool accepts = false) {
  BatchBuilder builder;
  builder.resume(number, accepts);
  return frontend.pulse(builder);
}
template <class Request>
std::uint32_t add_request(UntypedFrontend& frontend, const Request& request = {}) {
  std::array<std::byte, sizeof(Request)> bytes{};
  pack(request, bytes.data());
  return frontend.add_request(frontend.request_index(request_name<Request>()), bytes);
}

inline double desired(const UntypedObservation& row, std::uint32_t actuator = 0) {
  return unpack<double>(row.desired() + actuator * 8);
}
inline double observed(const UntypedObservation& row, std::uint32_t actuator = 0) {
  return unpack<double>(row.observed() + actuator * 8);
}
/// One actuator's desired states, of rows that are there.
inline std::vector<double> desired(const UntypedFrontend& frontend, Iteration first, Iteration last,
                                   std::uint32_t actuator = 0) {
  std::vector<double> states;
  for (Iteration i = first; i <= last; ++i) {
    states.push_back(desired(frontend.wait_for(i, kAtOnce), actuator));
  }
  return states;
}

inline std::vector<JournalEntry> all_of(Journal& journal) {
  std::vector<JournalEntry> entries;
  for (JournalEntry entry; journal.next(entry);) entries.push_back(entry);
  return entries;
}

/// A test with its own folder of segments.
class ManualBackendTest : public ::testing::Test {
 protected:
  PrivateDirectory directory_;
};

/// A started backend, a commander, and a frontend that may only observe.
class ObservedBackendTest : public ManualBackendTest {
 protected:
  explicit ObservedBackendTest(const BackendOptions& options = {.segment = "pair"})
      : manual(options) {}

  StartedBackend manual;
  UntypedFrontend commander{"pair"};
  UntypedFrontend observer{"pair", {.access = Access::read_only}};
};

}  // namespace o80::test
