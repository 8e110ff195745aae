#pragma once

#include <cstddef>
#include <vector>

#include "control/status_sink.hpp"
#include "memory/lane_receiver.hpp"
#include "runtime/decision_journal.hpp"

namespace o80 {

/// Reports statuses to their lanes and to the journal. The journal gets no begin of a command that
/// ends in the same iteration, unless the changes of others come between the two. An end that comes
/// during a step is reported after its row is published, so that no command is reported as
/// completed by a backend that dies before.
///
/// Writer:   the backend's thread.
/// Realtime: everything but construction.
class StatusOutbox {
 public:
  /// `most`: most ends of commands in one step.
  StatusOutbox(LaneReceivers& lanes, DecisionJournal& journal, std::size_t most)
      : lanes_(lanes), journal_(journal) {
    waiting_.reserve(most);
  }

  void begin_step() noexcept { stepping_ = true; }
  void end_step() noexcept {
    note_begin();
    stepping_ = false;
  }
  void put(const StatusChange& change) noexcept;
  /// Reports the ends of the last step. Call it after the row is published.
  void report_row() noexcept;
  /// Reports them if the row will never be published: completed commands as purged (stopped).
  void report_no_row() noexcept;

 private:
  void note_begin() noexcept;
  void report(const StatusChange& change) noexcept;

  LaneReceivers& lanes_;
  DecisionJournal& journal_;
  std::vector<StatusChange> waiting_;
  /// The last command that began in this step, until it is known whether its end follows at once:
  /// then the journal gets only the end. Unused if `id` is 0, which no command has.
  StatusChange begun_;
  bool stepping_ = false;
};

}  // namespace o80
