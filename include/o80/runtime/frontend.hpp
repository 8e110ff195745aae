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
#include "o80/runtime/observation.hpp"

namespace o80 {

class BatchBuilder;
class CommandCheck;
class InlineRunner;
class LaneSender;
struct BatchRecord;
struct RecordHead;

/// A request that has begun and not ended.
struct RequestUnderWay {
  std::string name;
  Iteration since = -1;  // iteration in which it was taken
  std::string who;       // the process that sent it
  std::string progress;  // what the driver says of it
};

struct FrontendOptions {
  Timeout timeout = std::chrono::seconds(5);  // to wait for the backend
  Access access = Access::read_write;
  bool dead = false;              // attach also to a backend that is gone, to read its history
  KeepWaiting keep_waiting = {};  // asked in every wait; false ends it
};

class UntypedFrontend;
/// One frontend of a group, and its number of iterations.
using BurstMember = std::pair<UntypedFrontend*, std::int64_t>;

/// The side that commands and reads, in bytes.
///
/// Move-only. Takes a lane with its first pulse; a pure reader takes none.
///
/// Writer / Readers: any threads of one process.
class UntypedFrontend {
 public:
  /// Waits for the backend, up to the timeout. Throws TimeoutError, SegmentError, BackendFailed.
  explicit UntypedFrontend(const std::string& segment, const FrontendOptions& options = {});
  /// A frontend whose bursts run in its own thread.
  UntypedFrontend(const std::string& segment, std::shared_ptr<InlineRunner> runner);
  UntypedFrontend(UntypedFrontend&&) noexcept;
  UntypedFrontend& operator=(UntypedFrontend&&) noexcept;
  ~UntypedFrontend();

  const std::string& segment() const;
  const Schema& schema() const;
  const RowLayout& layout() const;
  std::shared_ptr<const Description> description() const;
  std::uint64_t epoch() const;
  bool bursting() const;
  /// [ns]
  std::int64_t period() const;
  Life life() const;
  std::uint32_t actuator(std::string_view name) const;
  std::uint32_t request_index(std::string_view name) const;
  /// Refuses what the robot cannot follow, as the verbs below do.
  const CommandCheck& command_check() const;

  // what the next pulse sends; each returns its place in the batch
  /// Adds a command. `mask` has a bit for each number of the state that is given; empty: all.
  std::uint32_t add_command(std::uint32_t actuator, std::span<const std::byte> state,
                            const CommandOptions& options = {},
                            std::span<const std::uint64_t> mask = {});
  /// One command for several actuators: they begin together when all their queues have come to it,
  /// take as many iterations as the slowest of them, and have one status. `states` holds their
  /// states one after the other, `masks` a mask for each, or nothing.
  std::uint32_t add_commands(std::span<const std::uint32_t> actuators,
                             std::span<const std::byte> states, const CommandOptions& options = {},
                             std::span<const std::uint64_t> masks = {});
  /// One command through `rows` states. With `times` (ends of the rows since its start [ns]),
  /// which needs no pace, or at options.pace for each row.
  std::uint32_t add_trajectory(std::uint32_t actuator, std::uint32_t rows,
                               std::span<const std::byte> states,
                               const CommandOptions& options = {.pace = iterations(1)},
                               std::span<const std::int64_t> times = {});
  /// One command through `rows` states for several actuators, as above; `states` holds the rows
  /// of the first actuator, then those of the second...
  std::uint32_t add_trajectories(std::span<const std::uint32_t> actuators, std::uint32_t rows,
                                 std::span<const std::byte> states,
                                 const CommandOptions& options = {.pace = iterations(1)},
                                 std::span<const std::int64_t> times = {});
  std::uint32_t add_purge(std::uint32_t actuator = kEveryActuator);
  /// Drops only what this frontend sent.
  std::uint32_t add_purge_own();
  std::uint32_t add_request(std::uint32_t request, std::span<const std::byte> payload);
  std::uint32_t add_take_control();
  std::uint32_t add_release_control();
  /// Records added and not pulsed.
  std::size_t added() const;
  void forget_added();

  /// Sends what was added as one batch. Throws LaneFull (nothing is sent, all stays added), NoLane,
  /// ReadOnly, BackendGone.
  Batch pulse(const PulseOptions& options = {}) { return pulse(options, 0); }
  /// Sends a batch of the caller's own making; what was added stays added.
  Batch pulse(BatchBuilder& batch);
  /// Sends what was added; bursting, lets the backend run until all of it has ended.
  Batch pulse_to_end(const PulseOptions& options = {});
  /// The same with a batch of the caller's own making; what was added stays added.
  Batch pulse_to_end(BatchBuilder& batch);
  /// Waits for the end of such a batch and returns the row of its last iteration.
  UntypedObservation wait_for_end(const Batch& batch, Timeout timeout,
                                  const KeepWaiting& keep_waiting = {}) const;
  /// The same, however it ended; that iteration, or -1 if the batch was rejected.
  Iteration wait_until_ended(const Batch& batch, Timeout timeout,
                             const KeepWaiting& keep_waiting = {}) const;
  /// Both at once.
  UntypedObservation pulse_and_wait(Timeout timeout, const PulseOptions& options = {},
                                    const KeepWaiting& keep_waiting = {});
  /// Sends what was added and lets a bursting backend run n iterations, from now on also if the
  /// batch is to be taken later: at an iteration of the burst, say.
  Burst start_burst(std::int64_t iterations, const PulseOptions& options = {});
  /// The same, and waits. When the wait ends without the last row (a timeout, `keep_waiting` is
  /// false) the rest of the burst is cancelled; so it is with the calls below and with
  /// pulse_and_wait.
  UntypedObservation burst(std::int64_t iterations, Timeout timeout,
                           const KeepWaiting& keep_waiting = {}, const PulseOptions& options = {});
  /// One iteration for each row that `rows` can hold, and all these rows; that of the last one.
  Iteration burst_rows(std::span<std::byte> rows, Timeout timeout,
                       const KeepWaiting& keep_waiting = {}, const PulseOptions& options = {});

  /// The requests that the driver serves over several iterations, oldest first.
  std::vector<RequestUnderWay> running_requests() const;

  // halts
  /// Halts the backend, whoever has control and whatever its lanes are doing; the number of the
  /// halt. Acts in the first iteration begun after it. Throws ReadOnly, BackendGone (also when the
  /// backend went meanwhile: its successor may not be halted).
  std::uint64_t halt(std::string_view reason);
  /// The halt that acts, or was asked for last (`iteration` is -1 until it acts); nothing if none.
  std::optional<Halt> halted() const;
  /// Clears halts up to this number: the robot starts afresh from where it is, in a row of its own.
  /// In real time it waits until that halt acts and the robot has come to rest. Needs a lane, but
  /// no control. Throws BackendHalted if it is refused (another halt came after it, the robot
  /// refuses, or still brakes and bursts), TimeoutError, NoLane, BackendGone.
  void resume(std::uint64_t number, Timeout timeout, const KeepWaiting& keep_waiting = {});
  /// Tells the backend's watchdog that this frontend lives, as a pulse or a wait for a batch does.
  void keep_alive();

  // observations
  /// Iteration of the newest row.
  Iteration published() const;
  Iteration oldest() const;
  UntypedObservation latest() const;
  /// Fills a row of this frontend's size; throws as latest().
  void latest(std::byte* row) const;
  /// Row k, as soon as it is there. Throws RowOverwritten, TimeoutError, BackendGone.
  UntypedObservation wait_for(Iteration k, Timeout timeout,
                              const KeepWaiting& keep_waiting = {}) const;
  void wait_for(Iteration k, std::byte* row, Timeout timeout,
                const KeepWaiting& keep_waiting = {}) const;
  /// As many of the rows first..last as there are.
  Rows history(Iteration first, Iteration last) const;
  /// The last n.
  Rows history(std::size_t n) const;
  /// The next row in sequence for a position of the caller's own: waits for row `position`; if it
  /// is overwritten, jumps to the oldest one there. Returns how many were missed.
  std::int64_t wait_for_next(Iteration& position, std::byte* row, Timeout timeout,
                             const KeepWaiting& keep_waiting = {}) const;

  /// Gives the lane back; every further use throws Closed. Sent motion goes on.
  void close();
  bool closed() const;
  std::shared_ptr<Link> link() const { return link_; }

 private:
  RecordHead checked_command(std::uint32_t actuator, std::span<const std::byte> state,
                             const CommandOptions& options,
                             std::span<const std::uint64_t> mask) const;
  std::size_t size_of_state(std::uint32_t actuator) const;
  void refuse_twice(std::span<const std::uint32_t> actuators) const;
  CommandOptions checked_trajectory(std::uint32_t actuator, std::uint32_t rows,
                                    std::span<const std::byte> states,
                                    const CommandOptions& options,
                                    std::span<const std::int64_t> times) const;
  Batch pulse(const PulseOptions& options, std::uint16_t flags);
  void wait_for_rest(std::uint64_t number, const Deadline& deadline,
                     const KeepWaiting& keep_waiting);
  Sent send(BatchBuilder& builder, const BatchRecord& record);
  static BatchRecord batch_of(const PulseOptions& options);
  Sent send_burst(std::int64_t iterations, const PulseOptions& options);
  friend std::vector<Burst> start_bursts(std::span<const BurstMember> group);
  void refuse_burst(std::int64_t iterations) const;
  void refuse_unless_ready(std::int64_t iterations);
  CommandId draw_ids(LaneSender& lane, std::uint64_t n, bool stays);
  void refuse_if_too_much(const BatchBuilder& builder) const;
  void refuse_if_too_many_wait(Iteration at, const LaneSender& lane);
  void refuse_if_full(const BatchBuilder& builder, const BatchRecord& wanted,
                      const LaneSender& lane) const;
  [[noreturn]] void missing(Iteration k) const;
  SegmentError damaged() const;

  std::shared_ptr<Link> link_;
};

/// Halts the backend of a segment, also one that is still starting; the number of the halt.
/// Throws TimeoutError if there is none in time, SegmentError, BackendGone.
std::uint64_t halt(const std::string& segment, std::string_view reason,
                   Timeout timeout = std::chrono::seconds(0), const KeepWaiting& keep_waiting = {});

/// Lets several backends run at once, each its number of iterations, and returns at once. Nothing
/// is granted unless all of them are alive, burst, and have a lane and room for what was added.
std::vector<Burst> start_bursts(std::span<const BurstMember> group);

/// The same, and waits for all: as UntypedFrontend::burst, for the group as a whole.
std::vector<UntypedObservation> burst(std::span<const BurstMember> group, Timeout timeout,
                                      const KeepWaiting& keep_waiting = {});
/// Waits for bursts that were started together; cancels what is left of them if it cannot.
std::vector<UntypedObservation> wait_for(std::span<const Burst> bursts, Timeout timeout,
                                         const KeepWaiting& keep_waiting = {});

}  // namespace o80
