#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "memory/owned_segment.hpp"

namespace o80 {

enum class LaneState : std::uint8_t { free, alive, died, closed };

struct LaneLife {
  LaneState state = LaneState::free;
  std::uint64_t incarnation = 0;
  friend bool operator==(const LaneLife&, const LaneLife&) = default;
};

/// Move-only: knows for each lane of a segment whether its owner lives.
///
/// One helper thread a process asks the kernel for all segments every 20 ms, off the processors
/// that `avoid_processors` names. Ordinary scheduling, unless a real-time thread made a
/// LaneLiveness or called `run_above`: then one priority above it, so that no busy loop keeps
/// deaths unnoticed.
///
/// Writer:   the helper thread.
/// Readers:  the backend's thread.
/// Realtime: changes(), rounds() and lane(), one load each.
class LaneLiveness {
 public:
  explicit LaneLiveness(const OwnedSegment& segment);
  LaneLiveness(LaneLiveness&&) noexcept;
  LaneLiveness& operator=(LaneLiveness&&) = delete;
  ~LaneLiveness();

  /// Counts changes: nothing to look at while it stands still.
  std::uint32_t changes() const noexcept;
  LaneLife lane(std::uint32_t i) const noexcept;
  /// Counts how often the helper has looked. Signals that any frontend could spoil are checked
  /// when it has moved.
  std::uint32_t rounds() const noexcept;
  /// Counts the questions to the kernel, a system call each: none about a lane without an owner.
  std::uint64_t queries() const noexcept;
  /// Asks now, in the calling thread. Not for the loop.
  void refresh() noexcept;

  /// Takes the helper off these processors, if others remain.
  static void avoid_processors(const std::vector<int>& processors);
  /// Puts the helper above real-time threads of this priority. Returns 0, or the error number with
  /// which the machine refused: the helper then has that priority itself, or none.
  static int run_above(int priority);

 private:
  friend class LivenessThread;
  struct Watched;
  std::unique_ptr<Watched> watched_;
};

}  // namespace o80
