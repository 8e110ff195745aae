#pragma once

#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "o80/base/keep_waiting.hpp"
#include "o80/base/time.hpp"
#include "o80/control/status.hpp"
#include "o80/runtime/observation.hpp"

namespace o80 {

class LaneSender;
struct Link;
struct Sent;

/// What became of one command or request.
struct Handle {
  CommandId id = 0;
  Status status = Status::none;
  Reason reason = Reason::none;
  Iteration iteration = -1;  // at which the status changed; -1 while it is queued
  std::string text;          // of a rejection: why, in words
  std::string progress;      // of a request that runs: what the driver says of it
};

/// What one pulse sent: to be waited for, and asked what became of it.
///
/// Copies mean the same batch. Statuses once seen as ended are kept.
class Batch {
 public:
  Batch() = default;
  Batch(std::shared_ptr<Link> link, Sent sent);

  CommandId id() const { return id_; }
  std::size_t size() const { return records_; }
  bool empty() const { return records_ == 0; }
  /// What became of the record at this place (in the order in which they were added).
  Handle handle(std::size_t place) const;
  std::vector<Handle> handles() const;
  /// Every record has an end status.
  bool ended() const;
  /// The iteration at which the batch was taken; -1 if it was not yet.
  Iteration first_iteration() const;
  /// The iteration at which the last of its commands ended; -1 if it has not yet.
  Iteration last_iteration() const;
  /// Why the batch as a whole was rejected, in words; empty if it was not.
  std::string rejection() const;
  Reason rejected_by() const;
  /// Waits until every record has an end status and, in real time, the row of that iteration is
  /// there (a bursting backend may stand still before it).
  /// Throws TimeoutError, BackendGone, Cancelled.
  void wait(Timeout timeout, const KeepWaiting& keep_waiting = {}) const;

 private:
  friend class Burst;
  friend class UntypedFrontend;
  struct Kept;
  Handle ask(CommandId id) const;

  std::shared_ptr<Link> link_;
  std::shared_ptr<LaneSender> lane_;
  CommandId id_ = 0;
  std::uint32_t records_ = 0;
  std::shared_ptr<Kept> kept_;
};

/// A burst under way.
class Burst {
 public:
  Burst() = default;
  Burst(std::shared_ptr<Link> link, Batch batch)
      : link_(std::move(link)), batch_(std::move(batch)) {}

  const Batch& batch() const { return batch_; }
  /// Its last iteration is done, or its batch was rejected.
  bool done() const;
  /// The backend stands still again after the iteration under way; a burst that has not begun runs
  /// none. What was sent with it stays queued. From any thread.
  void cancel() const;
  /// Waits until the last iteration of the burst is done; its row, or -1 if the batch was rejected.
  /// Throws TimeoutError, BackendGone, Cancelled.
  Iteration wait_done(Timeout timeout, const KeepWaiting& keep_waiting = {}) const;
  /// Waits for the last iteration of the burst and returns its row. It may be waited for again
  /// after a timeout.
  /// Throws TimeoutError, BackendGone, Cancelled, Error if the batch was rejected.
  UntypedObservation wait(Timeout timeout, const KeepWaiting& keep_waiting = {}) const;
  /// Throws what `wait` would throw for a burst that can no longer be done: BackendHalted,
  /// BackendGone, Closed, Error if its batch was rejected. Does not wait.
  void throw_if_failed() const;

 private:
  LaneSender& lane() const { return *batch_.lane_; }

  std::shared_ptr<Link> link_;
  Batch batch_;
};

}  // namespace o80
