#pragma once

#include <cstdint>

#include "control/pool.hpp"
#include "control/record.hpp"

namespace o80 {

/// Result of a request or of a control order.
struct Outcome {
  Status status = Status::completed;  // or rejected; of a request that ends later, active
  Reason reason = Reason::none;
  std::uint8_t detail = 0;
};

/// Called by the controller while it takes a batch.
class BatchHandler {
 public:
  /// The iteration about to run; a fresh start inside request() may increase it.
  virtual Iteration iteration() const noexcept = 0;
  /// Serves a request; may call `Controller::restart`. `payload` holds the whole struct. The
  /// request ends with the iteration at which it began: that of the fresh row, if it made one. If
  /// the outcome is active, `Controller::end` ends the record later.
  virtual Outcome request(std::uint32_t lane, CommandId id, BlockIndex record, std::uint32_t index,
                          Cursor payload) noexcept = 0;
  virtual Outcome take_control(std::uint32_t lane) noexcept = 0;
  virtual Outcome release_control(std::uint32_t lane) noexcept = 0;
  /// Clears halts up to this number; may call `Controller::restart`, as a request may.
  /// `accepts`: whatever the readings are.
  virtual Outcome resume(std::uint32_t /*lane*/, CommandId /*id*/, std::uint64_t /*number*/,
                         bool /*accepts*/) noexcept {
    return {};
  }

 protected:
  ~BatchHandler() = default;
};

}  // namespace o80
