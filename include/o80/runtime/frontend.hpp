#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "o80/base/error.hpp"
#include "o80/base/keep_waiting.hpp"
#include "o80/base/time.hpp"
#include "o80/control/command.hpp"
#include "o80/memory/access.hpp"
#include "o80/memory/halt.hpp"
#include "o80/memory/life.hpp"
#include "o80/runtime/batch.hpp"
#include "o80/runtime/move.hpp"
#include "o80/runtime/not_completed.hpp"
#include "o80/runtime/observation.hpp"
#include "o80/runtime/preview.hpp"
#include "o80/runtime/provenance.hpp"

namespace o80 {

class BatchBuilder;
class CommandCheck;
class InlineRunner;
class LaneSender;
class UntypedBackend;
struct BatchRecord;
struct RecordHead;

/// Request that has begun and not ended.
struct RequestUnderWay {
  std::string name;
  Iteration since = -1;  // iteration in which it was taken
  std::string who;       // the process that sent it
  std::string progress;  // the driver's text
};

struct FrontendOptions {
  Timeout timeout = std::chrono::seconds(5);  // longest wait for the backend
  Access access = Access::read_write;
  bool dead = false;              // attach also to an ended backend, to read the history
  bool starting = false;          // attach also before row 0 is published
  KeepWaiting keep_waiting = {};  // called during the wait for the backend; false ends the wait
};

class UntypedFrontend;
/// One frontend of a group, and its number of iterations.
using BurstMember = std::pair<UntypedFrontend*, std::int64_t>;

/// The side that commands and reads, in bytes.
///
/// Move-only. Acquires a lane with its first pulse; a frontend that only reads needs none.
///
/// Writer / Readers: any threads of one process.
class UntypedFrontend {
 public:
  /// Waits for the backend, up to the timeout. Throws TimeoutError, SegmentError, BackendFailed.
  explicit UntypedFrontend(const std::string& segment, const FrontendOptions& options = {});
  /// Frontend of an inline robot, whose segment may have no name: bursts run in the calling thread.
  UntypedFrontend(const UntypedBackend& backend, std::shared_ptr<InlineRunner> runner);
  UntypedFrontend(UntypedFrontend&&) noexcept;
  UntypedFrontend& operator=(UntypedFrontend&&) noexcept;
  ~UntypedFrontend();

  const std::string& segment() const;
  const Schema& schema() const;
  const RowLayout& layout() const;
  std::shared_ptr<const Description> description() const;
  std::uint64_t epoch() const;
  /// Provenance of the backend. Throws SegmentError if that part of the segment is damaged.
  Provenance provenance() const;
  bool bursting() const;
  /// [ns]
  std::int64_t period() const;
  Life life() const;
  std::uint32_t actuator(std::string_view name) const;
  std::uint32_t request_index(std::string_view name) const;
  /// Checks of the functions below: whether the robot can execute a command.
  const CommandCheck& command_check() const;

  // The add functions append to the next pulse and return the index in its batch.
  /// Adds a command. `mask` has a bit for each given number of the state; empty: all.
  std::uint32_t add_command(std::uint32_t actuator, std::span<const std::byte> state,
                            const CommandOptions& options = {},
                            std::span<const std::uint64_t> mask = {});
  /// Adds one command for several actuators. They begin together, when the command is next in all
  /// queues, take as many iterations as the slowest, and have one status. `states` holds their
  /// states one after the other, `masks` a mask for each, or nothing.
  std::uint32_t add_commands(std::span<const std::uint32_t> actuators,
                             std::span<const std::byte> states, const CommandOptions& options = {},
                             std::span<const std::uint64_t> masks = {});
  /// Computes the effect of a command of add_commands that begins after the newest row: number of
  /// iterations, delay against the request and its reason, and the desired states in each
  /// iteration, bit for bit, because the loop's own code computes them. Sends nothing and needs
  /// no lane.
  ///
  /// The motion begins at the desired states of that row; doubles with acceleration limits also
  /// with the velocity and acceleration of the last three rows, other numbers at rest. Running and
  /// queued commands are ignored. Throws InvalidArgument as add_commands, for a past `until`, for
  /// more than a million iterations, for state types that interpolate in C++ (`blend`), and for
  /// numbers with the bound of an integral, which depends on future observations.
  Preview preview(std::span<const std::uint32_t> actuators, std::span<const std::byte> states,
                  const CommandOptions& options = {},
                  std::span<const std::uint64_t> masks = {}) const;
  /// Preview from rest, after `row`: a row of the history, or one with other desired states.
  Preview preview_from(const UntypedObservation& row, std::span<const std::uint32_t> actuators,
                       std::span<const std::byte> states, const CommandOptions& options = {},
                       std::span<const std::uint64_t> masks = {}) const;
  /// Adds one command through `rows` states: at `times` (of reaching each row, since the start
  /// [ns], each in its own iteration; options.pace is then ignored), or with options.pace for
  /// each row. The profile is smooth (a curve through the rows), or linear at a speed, unless
  /// options.profile is given.
  std::uint32_t add_trajectory(std::uint32_t actuator, std::uint32_t rows,
                               std::span<const std::byte> states,
                               const CommandOptions& options = {.pace = iterations(1)},
                               std::span<const std::int64_t> times = {});
  /// Adds a trajectory of several actuators; `states` holds all rows of the first one, then all
  /// rows of the second, and so on. `masks` as in add_commands(), each for all rows of an actuator.
  std::uint32_t add_trajectories(std::span<const std::uint32_t> actuators, std::uint32_t rows,
                                 std::span<const std::byte> states,
                                 const CommandOptions& options = {.pace = iterations(1)},
                                 std::span<const std::int64_t> times = {},
                                 std::span<const std::uint64_t> masks = {});
  /// Adds rows of set-points of several actuators, one row an iteration; the last one remains
  /// in force. `states` as in add_trajectories().
  void add_set_points(std::span<const std::uint32_t> actuators, std::uint32_t rows,
                      std::span<const std::byte> states, Mode mode = Mode::queue);
  /// Adds a chunk (docs/chunks.md): rows for fixed iterations, which overwrite the actuators'
  /// motions. `due`: iterations after the anchor, rising from 1, one for each row. `states`
  /// and `masks` as in add_trajectories(). Throws InvalidArgument.
  std::uint32_t add_chunk(std::span<const std::uint32_t> actuators,
                          std::span<const std::uint32_t> due, std::span<const std::byte> states,
                          const ChunkOptions& options, std::span<const std::uint64_t> masks = {}) {
    return add_chunk(own_builder(), actuators, due, states, options, masks);
  }
  /// As add_chunk, for a separate batch.
  std::uint32_t add_chunk(BatchBuilder& batch, std::span<const std::uint32_t> actuators,
                          std::span<const std::uint32_t> due, std::span<const std::byte> states,
                          const ChunkOptions& options, std::span<const std::uint64_t> masks);
  /// Adds to the batch's count of target values that were clamped to their bounds.
  void note_clipped(std::size_t numbers);
  /// Declares that no chunk of this plan follows (ChunkOptions::plan; 0: all plans of this
  /// frontend): the end of the rows is then no starvation. Changes no motion.
  std::uint32_t add_close_plan(std::uint64_t plan = 0);
  std::uint32_t add_purge(std::uint32_t actuator = kEveryActuator);
  /// Drops only commands of this frontend.
  std::uint32_t add_purge_own();
  std::uint32_t add_request(std::uint32_t request, std::span<const std::byte> payload);
  /// Adds a note to the journal, of 1 to 976 bytes in UTF-8, at the iteration in which the batch is
  /// taken. Moves nothing and needs no control. Throws InvalidArgument.
  std::uint32_t add_mark(std::string_view text);
  std::uint32_t add_take_control();
  std::uint32_t add_release_control();
  /// Number of records that were added and not sent.
  std::size_t added() const;
  void forget_added();

  /// Sends the added records as one batch. Throws LaneFull (nothing is sent, all records stay
  /// added), NoLane, ReadOnly, BackendGone.
  Batch pulse(const PulseOptions& options = {});
  /// Sends the records of `batch`; added records stay added.
  Batch pulse(BatchBuilder& batch, const std::optional<Seen>& seen = {});
  /// As `pulse`; also makes a bursting backend run until all records have ended.
  Batch pulse_to_end(const PulseOptions& options = {});
  /// As pulse_to_end for the records of `batch`; added records stay added.
  Batch pulse_to_end(BatchBuilder& batch, const std::optional<Seen>& seen = {});
  /// Waits for the end of a batch of pulse_to_end and returns the row of its last iteration (of an
  /// empty batch: the newest row). Throws as Batch::wait; BackendGone also for an empty batch.
  UntypedObservation wait_for_end(const Batch& batch, Timeout timeout,
                                  const KeepWaiting& keep_waiting = {},
                                  const WaitOptions& options = {}) const;
  /// Waits for the end of a batch, with any result, and returns its iteration, or -1 if
  /// rejected.
  Iteration wait_until_ended(const Batch& batch, Timeout timeout,
                             const KeepWaiting& keep_waiting = {}) const;
  /// pulse_to_end and wait_for_end.
  UntypedObservation pulse_and_wait(Timeout timeout, const PulseOptions& options = {},
                                    const KeepWaiting& keep_waiting = {},
                                    const WaitOptions& wait = {});

  /// Sends one command for these actuators at once, waits for its end, and waits until they are
  /// observed within the tolerance of their targets; returns the row in which they were. Needs no
  /// pulse: added records stay added. `states` and `masks` as in add_commands. A bursting backend
  /// runs until then, and `timeout` is robot time (iterations x period), so that a script always
  /// ends alike; each iteration may take as long on the clock.
  /// Throws NotReached after the timeout, NotCompleted if the command ended otherwise than
  /// completed, BackendHalted, InvalidArgument, and the exceptions of pulse.
  UntypedObservation move_to(std::span<const std::uint32_t> actuators,
                             std::span<const std::byte> states, const MoveOptions& options,
                             Timeout timeout, std::span<const std::uint64_t> masks = {},
                             const KeepWaiting& keep_waiting = {});
  /// First part of move_to: sends the command.
  Move start_move(std::span<const std::uint32_t> actuators, std::span<const std::byte> states,
                  const MoveOptions& options, std::span<const std::uint64_t> masks = {});
  /// Second part of move_to: waits.
  UntypedObservation wait_for_move(const Move& move, Timeout timeout,
                                   const KeepWaiting& keep_waiting = {});

  /// Sends the added records and requests n iterations. The burst starts now, even if the batch is
  /// scheduled (`at`) for a later iteration of the burst.
  Burst start_burst(std::int64_t iterations, const PulseOptions& options = {});
  /// start_burst and wait. If the wait ends without the last row (timeout, `keep_waiting` returned
  /// false), the rest of the burst is cancelled, also in burst_rows and pulse_and_wait.
  UntypedObservation burst(std::int64_t iterations, Timeout timeout,
                           const KeepWaiting& keep_waiting = {}, const PulseOptions& options = {});
  /// Bursts one iteration for each row that `rows` can hold, fills `rows`, and returns the
  /// iteration of the last row.
  Iteration burst_rows(std::span<std::byte> rows, Timeout timeout,
                       const KeepWaiting& keep_waiting = {}, const PulseOptions& options = {});

  /// Running requests of the driver, oldest first.
  std::vector<RequestUnderWay> running_requests() const;

  // halts: see src/runtime/README.md#halts
  /// Halts the backend and returns the number of the halt. Needs no lane and no control. In force
  /// from the first iteration begun after it. Throws ReadOnly, and BackendGone also if the backend
  /// ended meanwhile: its successor may not be halted.
  std::uint64_t halt(std::string_view reason);
  /// The halt in force, or the last requested one (with `iteration` -1 until in force).
  std::optional<Halt> halted() const;
  /// Clears halts up to this number; the robot makes a fresh start. False, without an effect, if
  /// the backend is not halted. In real time it first waits
  /// until the halt is in force and the robot is at rest. Needs a lane, but no control. Throws
  /// BackendHalted if refused (a newer halt exists, the robot refuses, it cannot have moved to the
  /// read position unless you `accept_reading`, or, in bursting mode, it still brakes),
  /// TimeoutError, NoLane, BackendGone.
  bool resume(std::uint64_t number, Timeout timeout, const KeepWaiting& keep_waiting = {},
              bool accept_reading = false);
  /// Sends a sign of life to the backend's watchdog, like a pulse or a wait for a batch.
  void keep_alive();

  // observations
  /// Iteration of the newest row.
  Iteration published() const;
  Iteration oldest() const;
  UntypedObservation latest() const;
  /// Fills a row of this frontend's size; throws as latest().
  void latest(std::byte* row) const;
  /// Row k; waits until it is published. Throws RowOverwritten, TimeoutError, BackendGone.
  UntypedObservation wait_for(Iteration k, Timeout timeout,
                              const KeepWaiting& keep_waiting = {}) const;
  void wait_for(Iteration k, std::byte* row, Timeout timeout,
                const KeepWaiting& keep_waiting = {}) const;
  /// Returns the rows from first to last that the history holds.
  Rows history(Iteration first, Iteration last) const;
  /// The last n rows.
  Rows history(std::size_t n) const;
  /// The newest iteration at or before a time [ns]; the one before the oldest if all are later.
  Iteration iteration_at(std::int64_t time) const;
  /// The row of that iteration. Throws RowOverwritten if all rows in the history are later.
  UntypedObservation at_time(std::int64_t time) const;
  /// Returns the rows between two times [ns], both included, that the history holds.
  Rows history_between(std::int64_t first, std::int64_t last) const;
  /// Reads rows in sequence: waits for row `position`, or takes the oldest row if that one is
  /// overwritten, and moves `position` past it. Returns the number of rows that were skipped.
  std::int64_t wait_for_next(Iteration& position, std::byte* row, Timeout timeout,
                             const KeepWaiting& keep_waiting = {}) const;

  /// Releases the lane. Sent commands continue. Later calls throw Closed.
  void close();
  bool closed() const;
  std::shared_ptr<Link> link() const { return link_; }

 private:
  BatchBuilder& own_builder();
  void wait_for_rest(std::uint64_t number, const Deadline& deadline,
                     const KeepWaiting& keep_waiting);
  UntypedObservation first_row_of(const Move& move, const Deadline& deadline,
                                  const KeepWaiting& keep_waiting) const;
  UntypedObservation burst_to(const Move& move, Timeout timeout, const KeepWaiting& keep_waiting);
  void wait_for_latest(std::byte* row) const;

  std::shared_ptr<Link> link_;
};

/// Row of a frontend's segment, for wait_for_first.
struct RowWish {
  const UntypedFrontend* frontend;
  Iteration row;
};
/// Waits, in one sleep, until at least one of these rows is published; returns the indices of the
/// published ones. Throws TimeoutError, BackendGone if a segment ended without its row, Closed,
/// Cancelled.
std::vector<std::size_t> wait_for_first(std::span<const RowWish> wishes, Timeout timeout,
                                        const KeepWaiting& keep_waiting = {});

/// Halts the backend of a segment, also one that is still starting; returns the number of the halt.
/// Throws TimeoutError if there is no backend within `timeout`, SegmentError, BackendGone.
std::uint64_t halt(const std::string& segment, std::string_view reason,
                   Timeout timeout = std::chrono::seconds(0), const KeepWaiting& keep_waiting = {});

/// Starts bursts of several backends that run at the same time; does not wait. No burst starts
/// unless all backends are alive, bursting, and have a lane with room for the added records.
/// `seen`: row by which all of them were decided.
std::vector<Burst> start_bursts(std::span<const BurstMember> group,
                                const std::optional<Seen>& seen = {});

/// start_bursts and wait_for.
std::vector<UntypedObservation> burst(std::span<const BurstMember> group, Timeout timeout,
                                      const KeepWaiting& keep_waiting = {});
/// Waits for bursts that were started together and returns the last row of each. An exception
/// cancels the rest of all of them.
std::vector<UntypedObservation> wait_for(std::span<const Burst> bursts, Timeout timeout,
                                         const KeepWaiting& keep_waiting = {});

}  // namespace o80
