#pragma once

#include <limits>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "o80/base/error.hpp"
#include "o80/control/command.hpp"
#include "o80/runtime/batch.hpp"
#include "o80/runtime/observation.hpp"

namespace o80 {

/// Options of `move_to`: the command's options, and the tolerances.
struct MoveOptions {
  CommandOptions command = {};
  /// Largest distance of each observed number from its target [its unit]. Must be given.
  double tolerance = std::numeric_limits<double>::quiet_NaN();
  /// Instead of `tolerance`: one for each number of each actuator, in order [its unit]; infinity
  /// for a number that is not checked. Numbers that the command omits are never checked.
  std::vector<double> tolerances = {};
};

/// Number that was observed too far from its target.
struct Miss {
  std::string actuator;
  std::string field;  // empty if the state is a plain number
  double target = 0;
  double observed = 0;
  double distance = 0;  // NaN if `observed` is
  double tolerance = 0;
  std::string unit;  // of all four
};

/// Motion sent by UntypedFrontend::start_move.
class Move {
 public:
  const Batch& batch() const { return batch_; }

 private:
  friend class UntypedFrontend;
  class Goal;

  Batch batch_;
  std::shared_ptr<const Goal> goal_;
};

/// The robot was not within the tolerance of its targets in time.
class NotReached : public TimeoutError {
 public:
  NotReached(const std::string& text, Batch batch, std::vector<Miss> misses,
             UntypedObservation observation)
      : TimeoutError(text),
        what_(std::make_shared<const What>(
            What{std::move(batch), std::move(misses), std::move(observation)})) {}

  /// The commands of the move; those that have not ended continue.
  const Batch& batch() const noexcept { return what_->batch; }
  /// Numbers outside of the tolerance; none if only the commands had not ended.
  const std::vector<Miss>& misses() const noexcept { return what_->misses; }
  /// The row in which they were observed.
  const UntypedObservation& observation() const noexcept { return what_->observation; }

 private:
  struct What {
    Batch batch;
    std::vector<Miss> misses;
    UntypedObservation observation;
  };
  std::shared_ptr<const What> what_;  // shared, because copying an exception must not throw
};

}  // namespace o80
