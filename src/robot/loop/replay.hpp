#pragma once

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "o80/runtime/journal.hpp"
#include "robot/driver/driver_instance.hpp"
#include "robot/loop/loop.hpp"
#include "runtime/journal/recorded_decisions.hpp"

namespace o80 {

/// Repeats a recorded run: the same robot with the same options, whose backend obeys the recorded
/// decisions at their iterations. Its rows are in a segment of its own, as those of any robot.
/// See src/runtime/README.md#replay.
///
/// Writer: one thread.
class Replay {
 public:
  /// `options`: those of the recorded run, with another segment name. Throws as Loop, and
  /// DriverError, before the robot is started, if it may be hardware.
  Replay(std::unique_ptr<DriverInstance> robot, const BackendOptions& options);

  /// Begins at this iteration instead of row 0: `run` first publishes the row before it, which
  /// shows the start state, and obeys the decisions of this iteration and later ones. Call it
  /// before `add` and `run`.
  void begin_at(Iteration first) noexcept;
  /// The same where nothing acts: with the desired states of the recorded row before it, and the
  /// state of the robot that `load_snapshot` put into this slot. Throws InvalidArgument.
  void begin_at_rest(Iteration first, std::span<const std::byte> before, std::uint32_t slot);
  /// Fills a slot of the driver with a recorded snapshot. Throws DriverError if it refuses.
  void load_snapshot(std::uint32_t slot, std::span<const std::byte> bytes);
  /// Adds the next entry of the recorded journal. Add all of an iteration before it runs. Throws
  /// InvalidArgument for an entry that no backend writes.
  void add(const JournalEntry& entry);
  /// Runs one iteration for each time, the first of them the first row [ns]. False if the driver
  /// failed or has ended: see fault(). The last row must not be followed by a decision of the same
  /// iteration.
  bool run(std::span<const std::int64_t> times);

  const std::optional<DecisionMismatch>& mismatch() const noexcept { return recorded_.mismatch(); }
  /// The failure of the driver, or empty.
  std::string fault() const;
  const std::string& segment() const noexcept { return loop_.backend().name(); }
  /// The iteration that runs next.
  Iteration next() const noexcept { return loop_.backend().iteration(); }

 private:
  RecordedDecisions recorded_;
  Loop loop_;
  std::vector<std::byte> desired_;
  std::optional<std::uint32_t> restored_;  // the slot that is loaded before the first iteration
  bool started_ = false;
};

}  // namespace o80
