#pragma once

#include <cstdint>
#include <string_view>
#include <vector>

#include "memory/segment/liveness.hpp"
#include "runtime/backend/backend_core.hpp"
#include "runtime/backend/bursts.hpp"
#include "runtime/backend/control_holder.hpp"
#include "runtime/backend/halts.hpp"

namespace o80 {

/// The frontends that command: their deaths, their silence, and exclusive control.
/// See src/runtime/README.md#watchdog and src/memory/README.md#lanes.
///
/// Realtime: everything but construction.
class Commanders {
 public:
  Commanders(BackendCore& core, Bursts& bursts, Halts& halts, const BackendOptions& options);

  Stale policy() const noexcept { return stale_; }
  bool has_watchdog() const noexcept { return silence_ != 0; }

  /// Finds deaths, called off bursts and removed files.
  void poll_liveness() noexcept;
  /// Handles the death of a lane's owner, once for each incarnation.
  void on_owner_death(std::uint32_t lane, std::uint64_t incarnation) noexcept;
  bool is_of_dead(const StagedBatch& sent) const noexcept;

  /// A batch is a sign of life of its sender.
  void note_life(std::uint32_t lane) noexcept { last_life_[lane] = core_.current; }
  /// The watchdog: applies the policy to commanders that gave no sign of life for too long while
  /// they hold control or one of their commands acts.
  void watch_silence() noexcept {
    if (silence_ != 0) find_silent();
  }

  const ControlHolder& holder() const noexcept { return holder_; }
  /// Releases control if its holder has closed, has died, or no longer owns the lane.
  void watch_holder() noexcept {
    if (!holder_.is_nobody()) find_lost_holder();
  }
  /// `owner`: incarnation that sent the order; 0: it has left.
  void take_control(std::uint32_t lane, std::uint64_t owner) noexcept;
  void release_control(std::uint32_t lane, std::uint64_t owner) noexcept;

 private:
  void apply_policy(std::uint32_t lane, Reason reason) noexcept;
  void halt_unreachable() noexcept;
  void find_lost_holder() noexcept;
  void find_silent() noexcept;
  void count_missed() noexcept;

  BackendCore& core_;
  Bursts& bursts_;
  Halts& halts_;
  const Stale stale_;
  const std::int64_t silence_;  // [iterations], 0: no watchdog
  std::vector<LaneLife> lives_;
  std::vector<std::uint64_t> handled_deaths_;  // of each lane: the last one handled
  std::vector<Iteration> last_life_;           // of each lane: last sign of life of its owner
  std::uint32_t seen_changes_ = 0;
  std::uint32_t seen_rounds_ = 0;
  bool is_nameless_ = false;        // its files were removed, which has halted it
  std::uint32_t seen_skipped_ = 0;  // periods that the loop missed
  Iteration missed_periods_ = 0;    // of these, not yet counted by the watchdog
  Iteration missed_at_ = 0;         // row behind the first of them
  Iteration counted_periods_ = 0;   // those counted last
  ControlHolder holder_;
};

}  // namespace o80
