#pragma once

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "o80/base/error.hpp"
#include "o80/runtime/batch.hpp"
#include "o80/runtime/observation.hpp"

namespace o80 {

/// Commands or requests of a batch ended otherwise than completed, or the whole batch was rejected.
///
/// Commands overwritten by a later command of the same frontend are not included.
class NotCompleted : public Error {
 public:
  /// A command or request that did not complete.
  struct End {
    Handle handle;                       // its status, reason and text
    std::vector<std::string> actuators;  // names; empty for a request
  };

  NotCompleted(const std::string& text, std::vector<End> ends, UntypedObservation observation)
      : Error(text),
        what_(std::make_shared<const What>(What{std::move(ends), std::move(observation)})) {}

  const std::vector<End>& ends() const noexcept { return what_->ends; }
  /// Row of the batch's last iteration; the newest row if that one is not available.
  const UntypedObservation& observation() const noexcept { return what_->observation; }

 private:
  struct What {
    std::vector<End> ends;
    UntypedObservation observation;
  };
  std::shared_ptr<const What> what_;  // shared, because copying an exception must not throw
};

}  // namespace o80
