#pragma once

#include <cstdint>
#include <span>

#include "control/batch/record.hpp"

namespace o80 {

/// How a record ends, or begins.
struct Outcome {
  Status status = Status::completed;  // of a request that ends later, active
  Reason reason = Reason::none;
  std::uint8_t detail = 0;
  std::int64_t late = 0;  // for `limits`: iterations more than requested
};

/// A change of the status of a record or a batch.
struct StatusChange {
  /// batch: it was taken or rejected; batch_end: its last record has ended; of_rejected: a record
  /// that ends because its whole batch was rejected; chunk: of its batch, or of the
  /// end of that, again (TakenChunk, BegunChunk).
  enum class Of : std::uint8_t { record, batch, batch_end, of_rejected, chunk };

  std::uint32_t lane = 0;
  CommandId id = 0;
  Status status = Status::none;
  Reason reason = Reason::none;
  std::uint8_t detail = 0;  // for `exclusive`: the lane that has control
  Iteration iteration = 0;
  Of of = Of::record;
  std::uint16_t late = 0;  // for `limits`: iterations more than requested, at most 65535
};

/// The begin of a chunk: with its rows, all that its plan depends on.
struct ChunkBegin {
  std::uint32_t lane = 0;
  CommandId id = 0;
  std::uint32_t row = 0;   // the first that is reached
  std::int64_t shift = 0;  // its rows are so many iterations later than they were sent for
  std::span<const ChunkStart> starts;  // of each number that moves
};

/// Receives status changes from the controller, and decides whether a follower may begin.
class StatusSink {
 public:
  virtual void changed(const StatusChange& change) noexcept = 0;
  virtual void begun(const ChunkBegin& /*chunk*/) noexcept {}
  /// Blocks of a lane were returned to the pool, by a record or a batch.
  virtual void freed(std::uint32_t lane, std::uint32_t blocks) noexcept = 0;
  /// Asked before an actuator that has followed while it waited for others begins their command
  /// `id` of `lane`. False: all its commands end as interrupted, with the reason `reading`.
  virtual bool may_begin(std::uint32_t /*actuator*/, std::uint32_t /*lane*/,
                         CommandId /*id*/) noexcept {
    return true;
  }

 protected:
  ~StatusSink() = default;
};

}  // namespace o80
