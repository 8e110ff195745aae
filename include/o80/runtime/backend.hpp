#pragma once

#include <sys/types.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>

#include "o80/base/time.hpp"
#include "o80/describe/layout.hpp"
#include "o80/describe/schema.hpp"
#include "o80/memory/halt.hpp"
#include "o80/memory/life.hpp"
#include "o80/runtime/provenance.hpp"
#include "o80/runtime/request_server.hpp"

namespace o80 {

class OwnedSegment;
enum class Verb : std::uint8_t;
struct DirectBurst;
class RecordedDecisions;

/// Options of a backend that do not depend on the robot.
struct BackendOptions {
  std::string segment;
  std::int64_t period = 0;            // [ns]; 0: the robot's own, or 1 ms
  bool bursting = false;              // runs only iterations requested by frontends
  std::uint64_t history = 0;          // rows of the history; 0: as many as 16 MiB hold, 1e5 at most
  std::uint32_t lanes = 8;            // frontends that may command at once
  std::uint32_t lane_blocks = 16384;  // blocks of 64 bytes in flight of each of them
  /// Size of the journal [bytes], rounded up to a power of two; -1: twice the largest batch; 0: no
  /// journal. `pulse` refuses a batch larger than half of it.
  std::int64_t journal = -1;
  mode_t permission = 0600;      // read: may observe; write: may command
  std::optional<Stale> stale{};  // nothing: halt with `silence`, else hold
  /// Watchdog: number of silent iterations after which `stale` applies to a commander with
  /// control or commands; 0: no watchdog (src/runtime/README.md#watchdog).
  std::int64_t silence = 0;
  Stale stale_policy() const noexcept {
    return stale.value_or(silence > 0 ? Stale::halt : Stale::hold);
  }
  /// Number of late iterations within a second that halts the backend; 0: no limit.
  std::uint32_t max_overruns = 0;
  /// Real time only: longest time between two rows without a halt [ns]. 0: no limit. -1: 20
  /// periods, and at least 0.1 s, for the loop of a robot with actuators that is not simulated;
  /// else no limit.
  std::int64_t gap = -1;
  /// Real time only: starts without a halt even if the previous backend of this name was halted, or
  /// was killed while commands acted.
  bool resume = false;
  /// Real time only: starts at the read position, even if the robot cannot have moved
  /// there.
  bool accept_reading = false;
  /// Provenance from the caller: the robot's options, library, files, further run options.
  /// The backend adds its options, the versions and the clock, and the robot's name if
  /// missing.
  Provenance provenance{};
  /// The segment has no name (`segment` is for messages): only this process can attach, until
  /// UntypedBackend::publish_as().
  bool anonymous = false;
  /// A driver's loop iterates and reads the robot: `gap` has a default, and readings
  /// of fresh starts are checked.
  bool has_loop = false;
};

/// Timing of the last period, set by the loop.
struct Timing {
  std::int64_t lateness = 0;   // [ns]
  std::uint32_t overruns = 0;  // so far
  std::uint32_t skipped = 0;   // so far
  bool missed = false;         // this iteration brought no reading
  std::int64_t next_due = 0;   // of the next iteration [ns]; 0: the clock does not pace the loop
};

/// Result of `step`.
enum class Step : std::uint8_t {
  run,       // an iteration has begun: write the desired states
  standing,  // bursting mode: no burst is granted
  ended      // the backend must end: see stop_asked() and failure()
};

/// Phase of a backend: its place between start and end (src/runtime/README.md#phases).
enum class Phase : std::uint8_t {
  starting,    // row 0 is not published yet
  ready,       // between two iterations
  iterating,   // from `step` to `publish`
  unreadable,  // a fresh start failed, for example by a NaN in its reading: no iteration follows
  stopping,    // all commands have ended; between two iterations before an end in order
  braking,     // from `brake` to `publish`
  ended        // no row follows
};

/// The side that iterates, in bytes. Call `publish` for row 0, then `step` and `publish` in turn.
///
/// Writer:   the loop's thread; `ask_to_stop` and `halt` any thread or signal handler.
/// Readers:  frontends in any process.
/// Realtime: everything but construction and end.
class UntypedBackend {
 public:
  /// Takes the name and publishes the segment as starting. Sets period and clock of the schema from
  /// the options. Throws SegmentTaken, SegmentError, InvalidArgument.
  /// With `recorded`, the backend replays a run: the recorded decisions replace frontends, and
  /// no call waits.
  UntypedBackend(Schema schema, const BackendOptions& options, RequestServer* server = nullptr,
                 RecordedDecisions* recorded = nullptr);
  UntypedBackend(const UntypedBackend&) = delete;
  UntypedBackend& operator=(const UntypedBackend&) = delete;
  /// Ends as stopped, or as failed if failure() is set, unless it has ended.
  ~UntypedBackend();

  const Schema& schema() const noexcept;
  const RowLayout& layout() const noexcept;
  const std::string& name() const noexcept;
  /// Provenance of the start, with the effective options.
  const Provenance& provenance() const noexcept;
  const OwnedSegment& segment() const noexcept;
  /// Names an anonymous segment, so that other processes can attach. Call it between two
  /// iterations. Throws SegmentTaken, SegmentError, InvalidArgument, Error if it has a name.
  void publish_as(const std::string& name);

  /// The observed and extended parts of the current row; fill them before `publish`.
  std::byte* observed() noexcept;
  std::byte* extended() noexcept;
  /// True if limits bound the motion between two readings.
  bool watches_readings() const noexcept;
  /// Checks the readings before row 0 in real time, one in each period; `again`: not the first.
  /// False if the robot cannot have moved there from the last one; `failure` names the number.
  bool judge_first(bool again) noexcept;
  /// Publishes the current row. The first one is row 0 and makes the backend running. Publishes
  /// nothing and returns false if a number of row 0 is NaN or infinite or, in real time, too
  /// far outside its bounds, or if the robot cannot have moved from row 0 to the next row; then
  /// the backend ends. `failure` names the number.
  bool publish() noexcept;

  /// Replay only: sets the first iteration (default 0), with these desired states instead of the
  /// observed ones; `desired` is read by the next `publish`. Call it before that.
  void begin_at(Iteration first, const std::byte* desired = nullptr) noexcept;
  /// Begins an iteration: commands => desired. In bursting mode `step` waits for a burst,
  /// `try_step` does not.
  Step step() noexcept;
  Step try_step() noexcept;
  /// As `step`, but waits for at most `at_most` [ns]; then returns `standing`.
  Step step_within(std::int64_t at_most) noexcept;
  /// Inline group only: grants the next iterations, with targets for them, like a batch. False
  /// if a batch is needed, because others command or a journal is written. Call between two
  /// iterations; the memory of the targets must outlive those iterations.
  bool begin_direct(const DirectBurst& burst) noexcept;
  /// Cancels the rest of the current burst. Call it between two iterations.
  void cut_burst() noexcept;
  /// Call it instead of `step` before an end in order: all commands end, the actuators brake. `run`
  /// while an iteration must be written and published, `ended` when all actuators are at rest.
  Step brake() noexcept;
  /// True if commands, exclusive control or a running request act. For the thread of the loop.
  bool acts() const noexcept;
  const std::byte* desired() const noexcept;
  /// One bit for each actuator: a command or braking gave its desired state.
  const std::uint64_t* active() const noexcept;
  /// First (order 1) or second difference, to the previous iteration, of the number at this offset
  /// of the desired block; 0 for an inactive actuator, and for numbers that do not move.
  double difference(std::uint32_t offset, std::uint32_t order) const noexcept;
  /// One bit for each actuator: set while it brakes to rest within its limits, without a command.
  const std::uint64_t* braking() const noexcept;
  /// Phase of the backend. For the thread of the loop.
  Phase phase() const noexcept;
  /// The current iteration; 0 before the first `step`.
  Iteration iteration() const noexcept;
  /// Time of the current iteration, on the schema's clock [ns].
  std::int64_t time() const noexcept;
  void set_timing(const Timing& timing) noexcept;
  /// Call before and after each call of the driver: observers detect a call that does not return.
  void enter(Verb verb) noexcept;
  void leave() noexcept;

  /// Halts: commands end, every actuator brakes, and nothing moves again until a frontend resumes.
  /// In force from the first step begun after it. The same cause and text again are the same halt;
  /// another text is another halt. From any thread or signal handler (src/runtime/README.md#halts).
  void halt(HaltCause cause, std::string_view text) noexcept;
  /// The halt in force; its number is 0 if there is none. For the thread of the loop.
  const Halt& halted() const noexcept;

  // Requests that the server answered with `running`; `request` is the index in the schema. For the
  // thread of the loop.
  /// Ends a request with the current row as done, rejected or failed. `start_afresh` makes a fresh
  /// start in the next step and ends the request with the row of that start. No effect on a
  /// request that does not run.
  void end_request(std::uint32_t request, const Served& how) noexcept;
  /// Sets the progress text that frontends read while the request runs.
  void show_progress(std::uint32_t request, std::string_view text) noexcept;
  /// True if the request was answered `running` and has not ended. A halt ends it, unless it is
  /// served during halts.
  bool runs(std::uint32_t request) const noexcept;
  /// True if any request runs.
  bool runs_any() const noexcept;

  /// Ends the commands of an actuator as interrupted, in the current iteration.
  void interrupt(std::uint32_t actuator) noexcept;

  /// Makes `step` return `ended`. From any thread or signal handler.
  void ask_to_stop() noexcept;
  bool stop_asked() const noexcept;
  /// Reason for which `step` returned `ended` without ask_to_stop() (a failed request or fresh
  /// start, the policy `stop`), or for which row 0 was refused; empty if there is none.
  std::string_view failure() const noexcept;
  /// Ends the backend, and reports to frontends that no row follows. `text`: fault of a failed one.
  void end(BackendState stopped_or_failed, std::string_view text = {}) noexcept;

 private:
  class Body;
  std::unique_ptr<Body> body_;
};

}  // namespace o80
