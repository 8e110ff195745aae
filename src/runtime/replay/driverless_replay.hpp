#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>

#include "o80/runtime/backend.hpp"
#include "runtime/journal/recorded_decisions.hpp"

namespace o80 {

/// Repeats what the backend of a recorded run did, without its driver: it reads the observed and
/// extended values of the recorded rows, obeys the recorded decisions, also those of the driver
/// (halts, interrupts, fresh starts), and computes the desired states. So a run on hardware can be
/// compared up to what o80 itself did (src/runtime/README.md#replay).
///
/// Types that interpolate in C++ (`blend`) need the driver's code: their desired states differ.
///
/// Writer: one thread.
class DriverlessReplay final : private RequestServer {
 public:
  /// `schema` and `options`: those of the recorded run, with another segment name. Throws as
  /// UntypedBackend.
  DriverlessReplay(Schema schema, const BackendOptions& options);

  /// Begins with the fresh start of this row instead of row 0: `run` first publishes the row before
  /// it, and obeys the decisions from the entry of the fresh start on. Call it before `add` and
  /// `run`.
  void begin_at(Iteration first) noexcept;
  /// Begins with this row, in which nothing acts: `run` first publishes it, with its recorded
  /// desired states.
  void begin_at_rest(Iteration row) noexcept;
  /// Adds the next entry of the recorded journal. Add all of an iteration before it runs. Throws
  /// InvalidArgument for an entry that no backend writes.
  void add(const JournalEntry& entry);
  /// Runs one iteration for each of these recorded rows, which are consecutive; the first has the
  /// iteration next(). False if the backend has ended: see fault(). The last row must not be
  /// followed by a decision of the same iteration. Throws InvalidArgument if the rows are no rows
  /// of this robot.
  bool run(std::span<const std::byte> rows);

  const std::optional<DecisionMismatch>& mismatch() const noexcept { return recorded_.mismatch(); }
  /// Why the backend has ended, or empty.
  std::string fault() const { return std::string(backend_.failure()); }
  const std::string& segment() const noexcept { return backend_.name(); }
  /// The iteration that runs next.
  Iteration next() const noexcept { return backend_.iteration(); }

 private:
  // RequestServer: RecordedDecisions decides on requests before they get here
  Served serve(std::uint32_t request, std::span<const std::byte> payload) noexcept override;
  bool read_fresh(FreshReading& reading) noexcept override;

  const std::byte* row_of(Iteration iteration) const noexcept;
  bool publish() noexcept;

  RecordedDecisions recorded_{RecordedDecisions::Driver::recorded};
  UntypedBackend backend_;
  std::span<const std::byte> rows_{};  // those that run now
  Iteration first_ = 0;                // iteration of the first of them
  Iteration start_ = 0;                // first iteration of the replay
  bool started_ = false;
  bool at_rest_ = false;  // in the row start_
};

}  // namespace o80
