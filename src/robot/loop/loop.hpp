#pragma once

#include <functional>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "memory/os/fork.hpp"
#include "memory/segment/verb_word.hpp"
#include "o80/runtime/backend.hpp"
#include "robot/driver/driver_instance.hpp"
#include "robot/loop/pacer.hpp"

namespace o80 {

/// How a loop ended.
struct Ended {
  bool in_order = true;
  std::string fault;  // empty if in order
};

/// The loop of a robot and its backend, in real time, bursting and inline: loop.cpp iterates,
/// loop_start.cpp begins, loop_answers.cpp passes on requests and halts.
/// See ARCHITECTURE.md#one-iteration.
///
/// Writer:   one thread; `ask_to_stop` any thread or signal handler.
/// Realtime: run, except for its end.
class Loop final : public RequestServer {
 public:
  /// Describes the robot, takes the segment's name, publishes the segment as starting.
  /// Throws SegmentTaken, SegmentError, InvalidArgument, DriverError.
  /// With `recorded`, the loop replays a run: see `replay`.
  Loop(std::unique_ptr<DriverInstance> robot, const BackendOptions& options,
       RecordedDecisions* recorded = nullptr);
  Loop& operator=(Loop&&) = delete;
  ~Loop();

  /// Starts the hardware, calls `set_up`, and publishes row 0, from which on the robot runs for
  /// others. If that fails, it stores the fault in the segment and throws DriverError.
  void start(const std::function<void()>& set_up = [] {});
  /// Iterates until the end, paced by the clock, the robot or bursts. Returns the fault of a driver
  /// instead of throwing it.
  Ended run() noexcept;
  /// Bursting only: runs at most `most` granted iterations in this thread; `Step::run` if more are
  /// granted.
  Step run_granted(std::uint32_t most) noexcept;
  /// Bursting only: as UntypedBackend::begin_direct; run_granted then runs the iterations.
  bool begin_direct(const DirectBurst& burst) noexcept {
    return !has_ended() && view_.finished == 0 && backend_.begin_direct(burst);
  }
  /// The current row. Between two iterations: the last one.
  const std::byte* row() noexcept { return backend_.observed() - backend_.layout().observed; }
  /// Runs the iterations of a recorded run up to this one, without waiting; `Step::ended` if the
  /// driver failed.
  Step replay(Iteration last) noexcept;
  /// Replay only: makes this the first iteration, instead of 0. Call it before `start`.
  void begin_at(Iteration first, const std::byte* desired = nullptr) noexcept {
    backend_.begin_at(first, desired);
  }
  /// Fills a slot of the driver for snapshots; false if it refuses.
  bool load_snapshot(std::uint32_t slot, std::span<const std::byte> bytes) noexcept {
    return robot_->load_snapshot(slot, bytes);
  }
  /// Serves the request `restore` without a fresh start: commands continue. Call it between
  /// two iterations; false if the driver refuses.
  bool restore(std::uint32_t slot) noexcept;
  /// Cancels the rest of the current burst.
  void cut_burst() noexcept { backend_.cut_burst(); }
  /// Stops the robot and ends the backend. Called by run() and the destructor.
  Ended stop() noexcept;

  void ask_to_stop() noexcept { backend_.ask_to_stop(); }
  /// The driver called exit() in this thread, in one of its functions: ends the backend as failed.
  void end_by_exit() noexcept;
  const UntypedBackend& backend() const noexcept { return backend_; }
  /// Names an anonymous segment. Call it between two iterations.
  void publish_as(const std::string& name) { backend_.publish_as(name); }
  std::string fault() const { return fault_; }

 private:
  Served serve(std::uint32_t request, std::span<const std::byte> payload) noexcept override;
  KeptState kept_state(std::uint32_t request, std::span<const std::byte> payload) noexcept override;
  bool read_fresh(FreshReading& reading) noexcept override;
  bool halt() noexcept override;
  Served resume() noexcept override;

  bool has_ended() const noexcept { return backend_.phase() == Phase::ended; }
  bool write() noexcept;
  bool read() noexcept;
  bool pace() noexcept;
  bool iterate() noexcept;
  void brake() noexcept;
  bool read_into_view() noexcept;
  void note_requests(const ReadingView& view) noexcept;
  void note_halt(const ReadingView& view) noexcept;
  bool read_first();
  bool begin();
  bool cannot_begin();
  /// Calls a function of the driver. Observers see which one has not returned
  /// (memory/segment/verb_word.hpp).
  template <class Call>
  auto calls(Verb verb, Call&& call) noexcept {
    backend_.enter(verb);
    const auto result = call();
    if (guard_.forked()) end_forked_child(robot_->table().name, to_text(verb));
    backend_.leave();
    return result;
  }
  bool failed(const char* verb) noexcept;
  bool failed(const char* verb, std::string_view why) noexcept;
  void hold_back() noexcept;

  static constexpr std::int64_t kLongestBraking = 1'000'000'000;  // [ns]

  std::unique_ptr<DriverInstance> robot_;
  ForkGuard guard_;
  UntypedBackend backend_;
  Pacer pacer_;
  const bool paced_;            // real time: by the clock or by the driver's wait()
  const bool accepts_reading_;  // in real time: of row 0
  std::string unread_;          // why a resume could not read
  std::string fault_;           // capacity reserved, so that run() does not allocate
  std::vector<std::uint64_t> interrupted_;
  std::vector<RequestReport> reports_;  // of each request
  bool reported_ = true;                // `reports_` must be filled before the next reading
  ReadingView view_{};
  std::uint32_t snapshot_;  // index of that request
};

}  // namespace o80
