#pragma once

#include <memory>
#include <string>
#include <vector>

#include "memory/fork.hpp"
#include "o80/runtime/backend.hpp"
#include "robot/pacer.hpp"
#include "robot/robot.hpp"

namespace o80 {

/// How a loop ended.
struct Ended {
  bool in_order = true;
  std::string fault;  // empty if in order
};

/// The one loop: a robot and its backend, in every way of pacing.
///
/// Writer:   one thread; `ask_to_stop` any thread or signal handler.
/// Realtime: run, but for its end.
class Loop final : public RequestServer {
 public:
  /// Takes the name, describes the robot, publishes the segment as starting.
  /// Throws SegmentTaken, SegmentError, InvalidArgument, DriverError.
  Loop(std::unique_ptr<Robot> robot, const BackendOptions& options);
  Loop(const Loop&) = delete;
  Loop& operator=(const Loop&) = delete;
  ~Loop();

  /// Starts the hardware and publishes row 0; if that fails, the fault stands in the segment and
  /// DriverError is thrown.
  void start();
  /// Iterates until the end, at the period or by bursts. Never throws a driver's fault.
  Ended run() noexcept;
  /// Bursting only: iterates in this thread until nothing is granted, at most so often; `run` if
  /// more is granted.
  Step run_granted(std::uint32_t most) noexcept;
  /// What is left of the burst under way is not run.
  void cut_burst() noexcept { backend_.cut_burst(); }
  /// Stops the robot and tells the frontends. Called by run() and the destructor.
  Ended stop() noexcept;

  void ask_to_stop() noexcept { backend_.ask_to_stop(); }
  const UntypedBackend& backend() const noexcept { return backend_; }
  std::string fault() const { return fault_; }

 private:
  Served serve(std::uint32_t request, std::span<const std::byte> payload) noexcept override;
  bool read_fresh(FreshReading& reading) noexcept override;
  bool halt() noexcept override;
  Served resume() noexcept override;

  bool write() noexcept;
  bool read() noexcept;
  bool pace() noexcept;
  bool iterate() noexcept;
  void brake() noexcept;
  bool read_into(ReadingView& view) noexcept;
  void note_requests(const ReadingView& view) noexcept;
  void note_halt(const ReadingView& view) noexcept;
  bool begin();
  /// Calls into the driver; observers see which verb has not returned.
  template <class Call>
  auto calls(Verb verb, Call&& call) noexcept {
    backend_.enter(verb);
    const auto result = call();
    backend_.leave();
    return result;
  }
  bool failed(const char* verb) noexcept;
  bool failed(const char* verb, std::string_view why) noexcept;
  bool failed_to_wait() noexcept;

  std::unique_ptr<Robot> robot_;
  ForkGuard guard_;
  UntypedBackend backend_;
  Pacer pacer_;
  bool paced_;             // by the clock
  bool braking_ = false;   // before the end
  bool finished_ = false;  // the driver said so
  bool ended_ = false;
  std::string fault_;  // reserved before the loop runs
  std::vector<std::uint64_t> interrupted_;
  std::vector<RequestReport> reports_;  // of each request
};

}  // namespace o80
