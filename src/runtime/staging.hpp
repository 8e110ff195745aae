#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "control/controller.hpp"
#include "control/pool.hpp"
#include "memory/lane_receiver.hpp"
#include "runtime/schedule.hpp"

namespace o80 {

/// Copies batches from the lanes into the pool and has them checked there, each lane by itself.
///
/// A lane's staged batches wait in the order in which they were sent until they are popped.
///
/// Writer:   the backend's thread.
/// Realtime: everything but construction; every step is paid from a budget.
class Staging {
 public:
  Staging(LaneReceivers& lanes, BlockPool& pool, Controller& controller);

  /// Goes on with a lane's next batch, for `budget` blocks, which it takes off. True when that
  /// batch is staged, or was garbage; false when the budget ended before.
  bool go_on(std::uint32_t lane, std::uint32_t& budget) noexcept;
  /// The lane's next block begins a batch.
  bool is_between_batches(std::uint32_t lane) const noexcept { return !stages_[lane].copying; }
  /// The lane's next batch says that it is express; to be asked between batches, if there is one.
  bool next_is_express(std::uint32_t lane) const noexcept;
  /// Copies and checks that batch whole. Gives it, if it may be taken before the lane's others;
  /// else it waits behind them.
  std::optional<StagedBatch> express(std::uint32_t lane) noexcept;

  /// Something is copied in part, or staged and not popped.
  bool busy() const noexcept { return begun_ != 0; }
  /// The tickets of the lanes' oldest batches that were begun and not popped, or kNoTicket.
  std::span<const std::uint64_t> tickets() const noexcept { return tickets_; }
  bool has_staged(std::uint32_t lane) const noexcept { return stages_[lane].first != kNoBlock; }
  /// The oldest of them.
  StagedBatch front(std::uint32_t lane) const noexcept { return staged(lane, stages_[lane].first); }
  void pop(std::uint32_t lane) noexcept;

 private:
  /// What is known of a staged batch beside its record, by its first block.
  struct Waiting {
    BlockIndex next = kNoBlock;
    bool had_left = false;
    bool of_dead = false;
    std::uint64_t incarnation = 0;
  };
  struct Stage {
    // the batch under way
    bool copying = false;
    std::uint32_t left = 0;  // blocks to copy
    BlockChain chain;
    Waiting sender;
    std::uint64_t ticket = 0;
    // those that are complete
    BlockIndex first = kNoBlock;
    BlockIndex last = kNoBlock;
  };

  bool begin(std::uint32_t lane, std::uint32_t& budget) noexcept;
  void drop(std::uint32_t lane, std::uint32_t blocks_outside) noexcept;
  BlockIndex complete(std::uint32_t lane) noexcept;
  void append(std::uint32_t lane, BlockIndex batch) noexcept;
  bool copy_and_check(std::uint32_t lane, std::uint32_t& budget) noexcept;
  bool overtakes(std::uint32_t lane, BlockIndex batch) const noexcept;
  StagedBatch staged(std::uint32_t lane, BlockIndex batch) const noexcept;
  void note_ticket(std::uint32_t lane) noexcept;

  LaneReceivers& lanes_;
  BlockPool& pool_;
  Controller& controller_;
  std::vector<Stage> stages_;
  std::vector<std::uint64_t> tickets_;
  std::vector<Waiting> waiting_;  // one for each block
  std::uint32_t begun_ = 0;       // lanes with a ticket
};

}  // namespace o80
