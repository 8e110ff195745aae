#pragma once

#include <cstdint>
#include <vector>

#include "memory/segment/queue_word.hpp"
#include "runtime/backend/backend_core.hpp"
#include "runtime/backend/bursts.hpp"
#include "runtime/backend/commanders.hpp"
#include "runtime/backend/halts.hpp"
#include "runtime/backend/readings.hpp"
#include "runtime/backend/staging.hpp"
#include "runtime/backend/work_share.hpp"

namespace o80 {

/// How batches reach the controller from the lanes, within the budget of an iteration.
/// See ARCHITECTURE.md#a-commands-way and src/control/README.md#order.
///
/// Realtime: everything but construction.
class Intake {
 public:
  /// `handler` serves requests and orders of batches.
  Intake(BackendCore& core, Bursts& bursts, Readings& readings, Halts& halts,
         Commanders& commanders, BatchHandler& handler);

  void begin_iteration() noexcept { share_ = {}; }
  /// Batches that were sent for this iteration, or for one that a fresh start jumped over.
  void take_due() noexcept {
    if (!core_.schedule.empty()) take_all_due();
  }
  /// Batches in the lanes.
  void take_new() noexcept;
  /// The decision was made in a recorded run, or by admit().
  void take_decided(const StagedBatch& sent) noexcept;
  void reject_all(Reason reason) noexcept;

  /// True if a batch is half copied, or staged and not taken.
  bool busy() const noexcept { return staging_.busy(); }
  /// Incarnation that sent the batch being taken; 0: it has left.
  std::uint64_t owner() const noexcept { return owner_; }

 private:
  void take_all_due() noexcept;
  bool take_in_order() noexcept;
  void take_express() noexcept;
  void stage_ahead() noexcept;
  bool stage(std::uint32_t lane, std::uint32_t& budget) noexcept;
  bool take_staged(std::uint32_t lane) noexcept;
  void accept(const StagedBatch& sent) noexcept;
  bool admit(const StagedBatch& sent) noexcept;
  void take(const StagedBatch& sent) noexcept;

  BackendCore& core_;
  Bursts& bursts_;
  Readings& readings_;
  Halts& halts_;
  Commanders& commanders_;
  BatchHandler& handler_;
  Staging staging_;
  WorkShare share_;
  QueueWord queue_;
  std::uint32_t ahead_from_ = 0;              // last lane that was staged ahead
  std::vector<std::uint32_t> express_lanes_;  // by ticket
  std::uint64_t owner_ = 0;
};

}  // namespace o80
