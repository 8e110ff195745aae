#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "memory/segment_layout.hpp"
#include "o80/base/time.hpp"
#include "o80/memory/halt.hpp"

// The halt of a backend: a counter that anybody who may write raises, and the reasons beside it.
// It needs no lane: a halt is asked for with one atomic addition, whatever the lanes are doing.

namespace o80 {

/// Asks for a halt; its number. It acts from the addition on, even if the asker is killed before it
/// has written the reason.
///
/// Writer:   any thread of any process that maps the bell for writing, also in a signal handler.
/// Readers:  HaltLatch.
/// Realtime: yes; a system call if the backend sleeps.
std::uint64_t ask_for_halt(const SegmentView& view, HaltCause cause, std::string_view who,
                           std::string_view text) noexcept;

/// The backend's side: notices halts, and shows the one that acts to everybody.
///
/// Any change of the counter counts as a halt, also one that no honest process makes.
///
/// Writer:   the backend's thread.
/// Readers:  shown_halt, in any process.
/// Realtime: yes; one load when there is nothing new.
class HaltLatch {
 public:
  explicit HaltLatch(const SegmentView& view) noexcept;

  /// True if a halt was asked for since the last look; it is then the one that acts.
  bool look() noexcept;
  /// The halt that acts; number 0 if none does.
  const Halt& halt() const noexcept { return halt_; }
  bool acts() const noexcept { return halt_.number != 0; }
  /// Shows the halt that acts, in this iteration; to be repeated until it is true: a reason may
  /// come after its halt.
  bool show(Iteration iteration) noexcept;
  /// The halt that acts is over, unless another was asked for: then false.
  bool clear() noexcept;

 private:
  SegmentView view_;
  std::uint64_t seen_ = 0;  // the counter at the last look
  Halt halt_;
};

/// The halt that acts as the backend shows it; nothing if none does. A read-only mapping is enough.
std::optional<Halt> shown_halt(const SegmentView& view) noexcept;

/// The same, or the halt that was asked for since and does not act yet (`iteration` is -1). Needs a
/// mapping of the bell.
std::optional<Halt> asked_halt(const SegmentView& view) noexcept;

}  // namespace o80
