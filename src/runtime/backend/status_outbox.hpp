#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "control/receiving/status_sink.hpp"
#include "memory/ring/lane_receiver.hpp"
#include "memory/ring/status_word.hpp"
#include "runtime/journal/journal_author.hpp"

namespace o80 {

/// Reports statuses to their lanes and to the journal. The begin of a command that ends in the same
/// iteration is not reported, unless the changes of others come between the two. An end that comes
/// during a step is reported after its row is published, so that no command is reported as
/// completed by a backend that dies before.
///
/// Writer:   the backend's thread.
/// Realtime: everything but construction.
class StatusOutbox {
 public:
  /// `most`: most ends of commands in one step.
  StatusOutbox(LaneReceivers& lanes, JournalAuthor& journal, std::size_t most)
      : lanes_(lanes), journal_(journal) {
    waiting_.reserve(most);
  }

  void begin_step() noexcept { stepping_ = true; }
  void end_step() noexcept {
    report_begin();
    stepping_ = false;
  }
  void put(const StatusChange& change) noexcept;
  /// Reports the ends of the last step. Call it after the row is published.
  void report_row() noexcept {
    if (!waiting_.empty()) report_waiting();
  }
  /// Reports them if the row will never be published: completed commands as purged (stopped).
  void report_no_row() noexcept;

 private:
  /// The same change of consecutive ids.
  struct Run {
    CommandId first_id = 0;
    std::uint64_t word = 0;  // a packed StatusWord
    std::uint32_t count = 0;
    std::uint32_t lane = 0;
    std::uint16_t late = 0;   // StatusChange::late
    bool of_records = false;  // the journal has the others in the entries of their batch
  };

  void wait(const Run& end) noexcept;
  void report_waiting() noexcept;
  void report_begin() noexcept {
    if (begun_.count != 0) report_the_begin();
  }
  void report_the_begin() noexcept;
  void report_now(const Run& run, bool ends) noexcept;
  void note(const Run& run) noexcept {
    if (run.of_records) journal_.statuses(run.lane, {run.first_id, run.count, run.word});
  }
  void report(const Run& run, bool ends) noexcept;

  LaneReceivers& lanes_;
  JournalAuthor& journal_;
  std::vector<Run> waiting_;  // ends
  /// The last command that began in this step, until it is known whether its end follows at once.
  /// Unused if `count` is 0.
  Run begun_;
  bool stepping_ = false;
};

}  // namespace o80
