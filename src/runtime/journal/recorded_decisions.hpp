#pragma once

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "o80/base/time.hpp"
#include "o80/describe/schema.hpp"
#include "o80/memory/halt.hpp"
#include "o80/runtime/journal.hpp"

namespace o80 {

/// A decision of the driver that the replay has not repeated.
struct DecisionMismatch {
  Iteration iteration = -1;
  std::string decision;  // "halt", "interrupt of elbow", "fresh start"
  std::string recorded;
  std::string replayed;
};

/// The decisions and row times of a recorded run. A backend that replays it obeys them instead of
/// its lanes, watchdog and clock. What the driver decides again (halts, interrupts, fresh starts)
/// is compared with them; without a driver it is obeyed too (src/runtime/README.md#replay).
///
/// Writer: the thread of the replay.
class RecordedDecisions {
 public:
  /// Where the decisions of the driver come from.
  enum class Driver : std::uint8_t {
    runs,     // it runs, and decides again: compared with the recording
    recorded  // there is none: the recorded decisions are obeyed
  };
  explicit RecordedDecisions(Driver driver = Driver::runs) : driver_(driver) {}
  bool has_driver() const noexcept { return driver_ == Driver::runs; }

  // the recording
  /// Adds the next entry of the journal. Entries that follow from others are left out. Throws
  /// InvalidArgument for an entry that no backend of this robot, with so many lanes, writes: the
  /// recording may be damaged, or from a stranger.
  void add(const JournalEntry& entry, const Schema& schema, std::uint32_t lanes);
  /// The times of the rows from iteration `first` on [ns].
  void set_times(Iteration first, std::span<const std::int64_t> times);

  // the backend
  std::int64_t time(Iteration iteration) const noexcept;
  /// The next decision, if it acts in this iteration or before; else null.
  const JournalEntry* next(Iteration iteration) const noexcept;
  JournalEntry take();
  /// True if the next decision is of this kind; takes it.
  bool confirms(JournalKind kind);

  // without a driver
  /// The answer of the recorded driver to a request, as far as desired states depend on it: whether
  /// it made a fresh start.
  bool made_fresh_start(Iteration iteration, std::uint32_t lane, CommandId request) noexcept;
  /// True if the robot makes a fresh start before the batches of this iteration: a request that ran
  /// has ended.
  bool begins_with_fresh_start(Iteration iteration) const noexcept;
  /// True if idle actuators follow from the fresh start on that is made now.
  bool fresh_start_follows() const noexcept {
    return !entries_.empty() && entries_.front().kind == JournalKind::fresh_start &&
           entries_.front().follows;
  }
  /// The next actuator that was interrupted in this iteration, before its step or after it.
  /// `interrupt` removes it.
  std::optional<std::uint16_t> interrupt_due(Iteration iteration, bool before_step) const noexcept;

  // the driver of the replay
  void fresh_start(Iteration iteration);
  void interrupt(Iteration iteration, std::uint16_t actuator, std::string_view name);
  /// The driver or an error limit asks for a halt.
  void ask_to_halt(HaltCause cause, std::string_view text);
  /// The recorded halt that is obeyed now.
  void compare_halt(const JournalEntry& halt);
  /// Call it when all decisions before a step were obeyed: no requested halt may be left.
  void end_decisions(Iteration iteration);
  /// A recorded decision that the driver should have caused and has not.
  void not_repeated(const JournalEntry& entry);

  /// The first one, if any.
  const std::optional<DecisionMismatch>& mismatch() const noexcept { return mismatch_; }

 private:
  struct RequestedHalt {
    HaltCause cause;
    std::string text;
  };
  /// A request of a batch, and the next one of the same batch.
  struct Sent {
    Iteration iteration = -1;  // of its first status
    CommandId next = 0;        // 0: none
  };
  using RequestKey = std::pair<std::uint32_t, CommandId>;  // lane, id
  void note(Iteration iteration, std::string decision, std::string recorded, std::string replayed);
  void note_requests(const JournalEntry& entry);

  Driver driver_;
  std::map<RequestKey, Sent> requests_;  // without a driver: those that are not served yet
  std::deque<JournalEntry> entries_;
  Iteration first_time_ = 0;
  std::vector<std::int64_t> times_;
  std::vector<RequestedHalt> requested_;
  bool stops_ = false;  // the recorded backend ends in order
  std::optional<DecisionMismatch> mismatch_;
};

}  // namespace o80
