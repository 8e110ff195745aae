#pragma once

#include <array>
#include <atomic>
#include <cstdint>
#include <string_view>

#include "memory/segment/halt_word.hpp"
#include "runtime/backend/backend_core.hpp"
#include "runtime/backend/bursts.hpp"
#include "runtime/backend/error_watch.hpp"
#include "runtime/backend/overrun_limit.hpp"
#include "runtime/backend/readings.hpp"

namespace o80 {

/// Progress of the halt in force.
enum class HaltStage : std::uint8_t {
  none,         // none is in force
  unexplained,  // the driver has halted; the requester has not written its reason yet
  explained,    // the driver has halted, the reason is known
  resumed       // the driver has resumed, but another halt was requested meanwhile
};

/// Requests halts on behalf of this backend, begins those that anybody requested, and ends them.
/// See src/runtime/README.md#halts.
///
/// Writer:   the backend's thread; request() any.
/// Realtime: everything but construction.
class Halts {
 public:
  Halts(BackendCore& core, Bursts& bursts, Readings& readings, const BackendOptions& options);

  /// True while a halt is in force.
  bool acts() const noexcept { return latch_.acts(); }
  const Halt& halt() const noexcept { return latch_.halt(); }
  /// Requests a halt. A driver may repeat a halt with each reading: the same text again is the same
  /// halt and keeps its number for `resume`; another text is another halt.
  void request(HaltCause cause, std::string_view text) noexcept;

  /// Begins a halt that was requested, and ends the scheduled batches that it or the watchdog has
  /// set aside.
  void watch() noexcept {
    if (latch_.poll()) {
      begin();
    } else if (stage_ == HaltStage::unexplained) {
      complete_reason();
    }
    if (core_.schedule.has_aside()) end_scheduled();
  }
  /// Begins a halt that was requested since the step has begun.
  void begin_if_requested() noexcept {
    if (latch_.poll()) begin();
  }
  /// True if halts permit the batch. Otherwise ends it: as halted if it was sent before the halt,
  /// as rejected if it was sent while the halt is in force.
  bool admitted_during_halt(const StagedBatch& sent) noexcept;
  /// The order of tickets was lost: no batch was sent before the last halt.
  void forget_tickets() noexcept { below_ = 0; }

  // what halts by itself
  bool has_error_limits() const noexcept { return !errors_.empty(); }
  /// Halts if the published row exceeds an error limit.
  void watch_errors() noexcept {
    if (!acts()) find_excess();
  }
  /// Halts if the loop stood still since the row before. A request that makes a fresh start may
  /// take its time.
  void watch_gaps(bool fresh) noexcept {
    if (gaps_.is_on()) find_gap(fresh);
  }
  void set_timing(const Timing& now) noexcept;

  // the end of a halt
  /// Why a halt of this number cannot be resumed; empty: it can.
  ShortText<200> refusal(std::uint64_t number) const noexcept;
  /// After the driver has resumed. False if another halt was requested meanwhile.
  bool clear() noexcept;

 private:
  void begin() noexcept;
  void complete_reason() noexcept;
  void end_scheduled() noexcept;
  void find_excess() noexcept;
  void find_gap(bool fresh) noexcept;

  BackendCore& core_;
  Bursts& bursts_;
  Readings& readings_;
  HaltLatch latch_;
  HaltStage stage_ = HaltStage::none;
  // for each cause: hash of the text of the last halt that this process requested; 0: none since
  // a resume
  std::array<std::atomic<std::uint64_t>, kHaltCauses> requested_{};
  std::uint64_t below_ = 0;  // batches with lower tickets were sent before the last halt
  ErrorWatch errors_;
  OverrunLimit overruns_;
  GapLimit gaps_;
};

/// Ends a scheduled batch whose sender has become silent since; false if it has not.
inline bool ends_for_silence(BackendCore& core, const StagedBatch& sent) noexcept {
  if (!sent.silent) return false;
  core.end_batch(sent, Reason::silence, 0, Status::purged);
  return true;
}

}  // namespace o80
