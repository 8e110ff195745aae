#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "o80/base/keep_waiting.hpp"
#include "o80/base/time.hpp"
#include "o80/control/command.hpp"
#include "o80/control/status.hpp"
#include "o80/runtime/observation.hpp"

namespace o80 {

class LaneSender;
struct Link;
struct Sent;

/// Status of one command or request, at the time of the read.
struct Handle {
  CommandId id = 0;
  Status status = Status::none;
  Reason reason = Reason::none;
  Iteration iteration = -1;  // iteration of the last change; -1 while queued
  /// With Reason::limits: number of iterations beyond the request, at most 65535.
  std::int64_t late = 0;
  std::string text;      // the reason in words
  std::string progress;  // of a running request: the driver's text
};

/// Latency from the capture of a decision's row to the batch. -1: not known, because that row is
/// of another clock, not before the batch, or no longer in the history.
struct DecisionLatency {
  Iteration iterations = -1;  // of this robot
  std::int64_t time = -1;     // [ns]

  bool operator==(const DecisionLatency&) const = default;
};

struct WaitOptions {
  bool check = true;  // throw NotCompleted if a command ended otherwise than completed
};

/// Commands, requests and purges sent by one pulse: wait for their end, or read their
/// statuses.
///
/// Copies refer to the same batch. End statuses are stored once read.
class Batch {
 public:
  Batch() = default;
  Batch(std::shared_ptr<Link> link, Sent sent);

  CommandId id() const { return id_; }
  std::size_t size() const { return records_; }
  bool empty() const { return records_ == 0; }
  /// Number of target values that the sender has clamped to their bounds.
  std::uint32_t clipped() const { return clipped_; }
  /// Status of the record with this index, in the order in which records were added.
  Handle handle(std::size_t place) const;
  std::vector<Handle> handles() const;
  /// True if every record has an end status.
  bool ended() const;
  /// The iteration in which the batch was taken; -1: not taken yet.
  Iteration first_iteration() const;
  /// Row by which the batch was decided, as sent with it.
  const std::optional<Seen>& seen() const { return seen_; }
  /// Time from the capture of that row to the first row in which the batch acts. Empty if the batch
  /// was sent without such a row, was rejected, or if that iteration is not published yet.
  std::optional<DecisionLatency> decision_latency() const;
  /// Number of iterations by which the rows of the batch's chunk are later than their own
  /// iterations, because the actuators were still; nothing before it was taken. `stood`: whether
  /// they were.
  struct Shift {
    std::int64_t iterations = 0;
    bool stood = false;
  };
  std::optional<Shift> shift() const;
  /// First row reached by the batch's chunk; nothing before the chunk begins. `needed`: iterations
  /// that limits need for the take-over, at most 4095, if it has fewer; else 0.
  struct TakeOver {
    std::uint32_t row = 0;
    std::int64_t needed = 0;
  };
  std::optional<TakeOver> take_over() const;
  /// The iteration in which the last record ended; -1 if some have not ended.
  Iteration last_iteration() const;
  /// The reason, in words, of a rejection of the whole batch; empty if not rejected.
  std::string rejection() const;
  Reason rejected_by() const;
  /// Waits until every record has an end status and, in real time, the row of that iteration is
  /// published. (A bursting backend may need another burst to publish it.)
  /// Throws NotCompleted, BackendHalted if a halt ended a record, TimeoutError, BackendGone,
  /// Cancelled. A record whose status is forgotten counts as completed.
  void wait(Timeout timeout, const KeepWaiting& keep_waiting = {},
            const WaitOptions& options = {}) const;

 private:
  friend class Burst;
  friend class UntypedFrontend;
  struct Kept;
  Handle ask(CommandId id) const;
  void wait_for_row(const Deadline& deadline, const KeepWaiting& keep_waiting) const;
  void throw_unless_completed() const;

  std::shared_ptr<Link> link_;
  std::shared_ptr<LaneSender> lane_;
  CommandId id_ = 0;
  std::uint32_t records_ = 0;
  std::uint32_t clipped_ = 0;
  std::optional<Seen> seen_;
  std::shared_ptr<Kept> kept_;
};

/// A burst that was requested.
class Burst {
 public:
  Burst() = default;
  Burst(std::shared_ptr<Link> link, Batch batch)
      : link_(std::move(link)), batch_(std::move(batch)) {}

  const Batch& batch() const { return batch_; }
  /// True if the last iteration is done or the batch was rejected.
  bool done() const;
  /// Ends the burst after the current iteration; a burst that has not begun runs no iteration.
  /// Commands sent with it stay queued. From any thread.
  void cancel() const;
  /// Waits until the last iteration of the burst is done; returns that iteration, or -1 if the
  /// batch was rejected. Throws TimeoutError, BackendGone, BackendHalted, Cancelled.
  Iteration wait_done(Timeout timeout, const KeepWaiting& keep_waiting = {}) const;
  /// Waits until the last iteration of the burst is done and returns the observation. May be
  /// called again after a timeout.
  /// Throws TimeoutError, BackendGone, BackendHalted, Cancelled, Error if the batch was rejected.
  UntypedObservation wait(Timeout timeout, const KeepWaiting& keep_waiting = {}) const;
  /// Throws, without waiting, if the burst cannot be completed any more: BackendHalted,
  /// BackendGone, Closed, Error if the batch was rejected.
  void throw_if_failed() const;

 private:
  LaneSender& lane() const { return *batch_.lane_; }

  std::shared_ptr<Link> link_;
  Batch batch_;
};

}  // namespace o80
