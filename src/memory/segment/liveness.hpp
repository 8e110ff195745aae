#pragma once

#include <cstdint>
#include <memory>
#include <vector>

#include "memory/segment/owned_segment.hpp"

namespace o80 {

enum class LaneState : std::uint8_t { free, alive, died, closed };

struct LaneLife {
  LaneState state = LaneState::free;
  std::uint64_t incarnation = 0;
  friend bool operator==(const LaneLife&, const LaneLife&) = default;
};

/// Neither movable nor copyable: knows for each lane of a segment whether its owner is alive.
///
/// One helper thread for each process queries the locks of all its segments every 20 ms. It does
/// not run on the processors of avoid_processors(). It has ordinary scheduling, unless a real-time
/// thread has constructed a LaneLiveness or called run_above(): then it runs one priority above
/// that thread, so that a busy loop cannot delay it.
///
/// Writer:   the helper thread.
/// Readers:  the backend's thread.
/// Realtime: changes(), rounds() and lane(), one load each.
class LaneLiveness {
 public:
  explicit LaneLiveness(const OwnedSegment& segment);
  LaneLiveness& operator=(LaneLiveness&&) = delete;
  ~LaneLiveness();

  /// Number of changes of all lanes so far: no lane has changed while this is unchanged.
  std::uint32_t changes() const noexcept;
  LaneLife lane(std::uint32_t i) const noexcept;
  /// Number of rounds of the helper thread. The loop scans all lanes when it has changed, in case a
  /// frontend has corrupted the bell.
  std::uint32_t rounds() const noexcept;
  /// Number of queries so far, one system call each; a lane without an owner is not queried.
  std::uint64_t queries() const noexcept;
  /// True from when a name of the segment's files was seen to lead elsewhere: no other process can
  /// find this backend any more. Checked every 100 ms.
  bool nameless() const noexcept;
  /// Queries all lanes now, in the calling thread. Not real-time.
  void refresh() noexcept;

  /// Excludes these processors for the helper thread, if others remain.
  static void avoid_processors(const std::vector<int>& processors);
  /// Runs the helper thread above real-time threads of this priority. Returns 0, or the error
  /// number with which that was refused: the helper then has that same priority, or none.
  static int run_above(int priority);

 private:
  friend class LivenessThread;
  struct Watched;
  std::unique_ptr<Watched> watched_;
};

}  // namespace o80
