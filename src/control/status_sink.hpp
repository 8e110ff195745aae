#pragma once

#include <cstdint>

#include "control/record.hpp"

namespace o80 {

/// A record or a batch has changed its status.
struct StatusChange {
  std::uint32_t lane = 0;
  CommandId id = 0;
  Status status = Status::none;
  Reason reason = Reason::none;
  std::uint8_t detail = 0;  // of exclusive: the lane that has control
  Iteration iteration = 0;
};

/// Where the controller tells what became of commands and batches.
class StatusSink {
 public:
  virtual void changed(const StatusChange& change) noexcept = 0;
  /// So many blocks of a lane went back to the pool: of a record, or a batch's own.
  virtual void freed(std::uint32_t lane, std::uint32_t blocks) noexcept = 0;

 protected:
  ~StatusSink() = default;
};

}  // namespace o80
