#pragma once

#include <sys/types.h>

#include <array>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

#include "o80/base/time.hpp"
#include "o80/describe/layout.hpp"
#include "o80/describe/schema.hpp"
#include "o80/memory/halt.hpp"
#include "o80/memory/life.hpp"
#include "o80/runtime/request_server.hpp"

namespace o80 {

enum class Verb : std::uint8_t;

/// Everything about a backend that is not its robot.
struct BackendOptions {
  std::string segment;
  std::int64_t period = 0;            // [ns]; 0: the robot's own, or 1 ms
  bool bursting = false;              // stands still until a frontend asks for iterations
  std::uint64_t history = 0;          // rows kept; 0: as many as 16 MiB hold, 1e5 at most
  std::uint32_t lanes = 8;            // frontends that may command at once
  std::uint32_t lane_blocks = 16384;  // of 64 bytes, that one of them may have in flight
  mode_t permission = 0600;           // read: may observe; write: may command
  Stale stale = Stale::hold;
  /// Watchdog: iterations that a commander may show no life while something of it acts; 0: none.
  std::int64_t silence = 0;
  /// Late iterations within a second that halt; 0: any number.
  std::uint32_t max_overruns = 0;
  /// Runs although the backend before was halted, or died while commands acted (real time only).
  bool resume = false;
};

/// How the last period went; written by whoever paces the loop.
struct Timing {
  std::int64_t lateness = 0;   // [ns]
  std::uint32_t overruns = 0;  // so far
  std::uint32_t skipped = 0;   // so far
};

/// What `step` came back with.
enum class Step : std::uint8_t {
  run,       // an iteration is under way: the desired states are to be written
  standing,  // bursting, and nothing is granted
  ended      // a stop was asked for, or a request failed
};

/// The side that iterates, in bytes: `publish` row 0, then `step` and `publish` for ever.
///
/// Writer:   one thread, that of the loop; `ask_to_stop` any thread or signal handler.
/// Readers:  frontends of any process.
/// Realtime: step, publish and what lies between them; not construction, nor end.
class UntypedBackend {
 public:
  /// Takes the name and publishes the segment as starting. The schema gets period and clock from
  /// the options. Throws SegmentTaken, SegmentError, InvalidArgument.
  UntypedBackend(Schema schema, const BackendOptions& options, RequestServer* server = nullptr);
  UntypedBackend(const UntypedBackend&) = delete;
  UntypedBackend& operator=(const UntypedBackend&) = delete;
  /// Ends as stopped, unless it has ended.
  ~UntypedBackend();

  const Schema& schema() const noexcept;
  const RowLayout& layout() const noexcept;
  const std::string& name() const noexcept;

  /// The blocks of the row under way, to be filled before `publish`.
  std::byte* observed() noexcept;
  std::byte* extended() noexcept;
  /// Publishes the row under way; the first one is row 0 and makes the backend running. False, and
  /// nothing is published, if a number of row 0 is NaN or infinite: `failure` names it.
  bool publish() noexcept;

  /// Commands => desired. Bursting, `step` waits for a grant, `try_step` does not.
  Step step() noexcept;
  Step try_step() noexcept;
  /// Waits so long [ns] at most; `standing` if nothing was granted.
  Step step_within(std::int64_t at_most) noexcept;
  /// Between two iterations: what is left of the burst under way is not run.
  void cut_burst() noexcept;
  /// Before an end in order, instead of `step`: all commands end, the actuators brake. `run` while
  /// an iteration is to be written and published, `ended` when nothing moves any more.
  Step brake() noexcept;
  /// Commands, exclusive control or a motion act. For the thread of the loop.
  bool acts() const noexcept;
  const std::byte* desired() const noexcept;
  /// One bit an actuator: a command gave its desired state, or it brakes.
  const std::uint64_t* active() const noexcept;
  /// One bit an actuator: without a command, it comes to rest within its limits.
  const std::uint64_t* braking() const noexcept;
  /// The iteration under way; before the first `step`, 0.
  Iteration iteration() const noexcept;
  /// Time of the iteration under way, on the schema's clock [ns].
  std::int64_t time() const noexcept;
  void set_timing(const Timing& timing) noexcept;
  /// Around each call into the driver: observers see one that does not return.
  void enter(Verb verb) noexcept;
  void leave() noexcept;

  /// Halts: commands end, every actuator brakes, and nothing moves again until a frontend resumes.
  /// Acts in the first step begun after it. The same cause and text again are the same halt;
  /// another text is another halt. From any thread or signal handler.
  void halt(HaltCause cause, std::string_view text) noexcept;
  /// The halt that acts; number 0 if none does. For the thread of the loop.
  const Halt& halted() const noexcept;

  // requests that the server answered with `running`, by their place in the schema; for the thread
  // of the loop
  /// The request ends with the row under way: done, rejected or failed; or starts the robot afresh
  /// in the next step, and ends with the row of that. One that does not run: nothing happens.
  void end_request(std::uint32_t request, const Served& how) noexcept;
  /// What frontends see of the request while it runs.
  void show_progress(std::uint32_t request, std::string_view text) noexcept;
  /// It was answered `running` and has not ended: a halt ends it, unless it is served in halts.
  bool runs(std::uint32_t request) const noexcept;

  /// Ends the commands of an actuator as interrupted, in the iteration under way.
  void interrupt(std::uint32_t actuator) noexcept;

  /// Makes `step` end. From any thread or signal handler.
  void ask_to_stop() noexcept;
  bool stop_asked() const noexcept;
  /// Why `step` ended on its own: a failed request's text, a stale command's policy; or why row 0
  /// was refused.
  std::string_view failure() const noexcept;
  /// It ended because the robot could not begin afresh from its reading.
  bool unreadable() const noexcept;
  /// Tells frontends that no row will follow; `text` is the fault of a failed one.
  void end(State stopped_or_failed, std::string_view text = {}) noexcept;

 private:
  class Body;
  std::unique_ptr<Body> body_;
};

}  // namespace o80
