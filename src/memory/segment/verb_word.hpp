#pragma once

#include <cstdint>
#include <string_view>

#include "memory/segment/segment_layout.hpp"

namespace o80 {

/// A call from the loop into the driver.
enum class Verb : std::uint8_t { none, start, write, wait, read, request, halt, resume, stop };
std::string_view to_text(Verb verb) noexcept;

/// Stores which driver verb is being called, so that a hanging call can be found.
///
/// Writer:   the backend's thread.
/// Readers:  note_slow_verb, in the helper thread.
/// Realtime: yes; one store for each call.
class VerbWord {
 public:
  explicit VerbWord(const SegmentView& view) noexcept : counters_(&view.counters()) {}
  void enter(Verb verb) noexcept {
    calls_ += 0x100;
    counters_->verb.store(calls_ | static_cast<std::uint64_t>(verb), std::memory_order_relaxed);
  }
  void leave() noexcept { counters_->verb.store(calls_, std::memory_order_relaxed); }

 private:
  Counters* counters_;
  std::uint64_t calls_ = 0;
};

/// Notes since when the present driver verb runs. The helper thread calls it periodically.
void note_slow_verb(const SegmentView& view, std::int64_t now) noexcept;

/// A driver verb that has not returned, as noted by the helper thread.
struct SlowVerb {
  Verb verb = Verb::none;
  std::int64_t since = 0;  // time on the monotonic clock [ns]
};
SlowVerb slow_verb(const SegmentView& view) noexcept;

}  // namespace o80
