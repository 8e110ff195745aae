#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

#include "memory/segment/segment_layout.hpp"
#include "o80/base/time.hpp"
#include "o80/memory/halt.hpp"

// Halts: a counter that each requester increments, and slots for the reasons. A request is one
// atomic addition and needs no lane. The protocol is in src/runtime/README.md#halts.

namespace o80 {

/// Requests a halt and returns its number. The request is valid from the addition on, even if this
/// process is killed before it has written the reason.
///
/// Writer:   any thread of any process that maps the bell for writing, also in a signal handler.
/// Readers:  HaltLatch.
/// Realtime: yes; a system call if the backend sleeps.
std::uint64_t request_halt(const SegmentView& view, HaltCause cause, std::string_view who,
                           std::string_view text) noexcept;

/// Sets the counter to the number of a recorded halt, with its reason: for a replay, whose backend
/// gets halts from nowhere else.
void put_halt(const SegmentView& view, std::uint64_t number, HaltCause cause, std::string_view who,
              std::string_view text) noexcept;

/// "iteration 7 (halt 3, cause frontend, requested by pid 5 (python)): why", of a halt in force.
std::string halt_text(const Halt& halt);

/// The backend's side: finds requested halts, and shows the halt in force to all processes.
///
/// Any change of the counter counts as a halt, also an invalid one (a decrease).
///
/// Writer:   the backend's thread.
/// Readers:  shown_halt, in any process.
/// Realtime: yes; one load when there is nothing new.
class HaltLatch {
 public:
  explicit HaltLatch(const SegmentView& view) noexcept;

  /// True if a halt was requested since the last call; it is in force from now on.
  bool poll() noexcept {
    const std::uint64_t requested =
        view_.bell().halts.load(std::memory_order_seq_cst);  // sync halts
    if (requested == seen_) return false;
    latch(requested);
    return true;
  }
  /// The halt in force; its number is 0 if there is none.
  const Halt& halt() const noexcept { return halt_; }
  bool acts() const noexcept { return halt_.number != 0; }
  /// Shows the halt in force. Call it in each iteration until it returns true: the requester writes
  /// the reason after the request.
  bool show(Iteration iteration) noexcept;
  /// Clears the halt in force; false, without an effect, if another halt was requested meanwhile.
  bool clear() noexcept;

 private:
  void latch(std::uint64_t requested) noexcept;

  SegmentView view_;
  std::uint64_t seen_ = 0;  // the counter at the last poll()
  Halt halt_;
};

/// The halt in force, as the backend shows it; empty if there is none. A read-only mapping is
/// enough.
std::optional<Halt> shown_halt(const SegmentView& view) noexcept;

/// The newest requested halt; its `iteration` is -1 until it is in force. Needs a mapping of the
/// bell.
std::optional<Halt> requested_halt(const SegmentView& view) noexcept;

}  // namespace o80
