#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <vector>

#include "control/queue/controller.hpp"
#include "control/receiving/pool.hpp"
#include "memory/ring/lane_receiver.hpp"
#include "runtime/backend/schedule.hpp"
#include "runtime/journal/journal_author.hpp"

namespace o80 {

/// Copies batches from the lanes into the pool, where the controller checks them, and into the
/// journal. Lanes are independent of each other.
///
/// The staged batches of a lane wait in the order in which they were sent until they are popped.
///
/// Writer:   the backend's thread.
/// Realtime: everything but construction; each step takes its cost off a budget.
class Staging {
 public:
  Staging(LaneReceivers& lanes, BlockPool& pool, Controller& controller, JournalAuthor& journal);

  /// Copies and checks the next batch of a lane and takes its blocks off `budget`. True when that
  /// batch is staged or was dropped as invalid; false when the budget ended first.
  bool advance(std::uint32_t lane, std::uint32_t& budget) noexcept;
  /// True if no batch of this lane is half copied.
  bool is_between_batches(std::uint32_t lane) const noexcept { return !stages_[lane].copying; }
  /// True if the next batch of the lane claims to be express. Call only between batches, if the
  /// lane has one.
  bool next_is_express(std::uint32_t lane) const noexcept;
  /// Copies and checks the whole express batch. Returns it if it may overtake the staged batches of
  /// its lane; otherwise it is staged behind them.
  std::optional<StagedBatch> express(std::uint32_t lane) noexcept;

  /// True if a batch is half copied, or staged and not popped.
  bool busy() const noexcept { return begun_ != 0; }
  /// For each lane the ticket of its oldest batch that is half copied or staged, or kNoTicket.
  std::span<const std::uint64_t> tickets() const noexcept { return tickets_; }
  bool has_staged(std::uint32_t lane) const noexcept { return stages_[lane].first != kNoBlock; }
  /// The oldest staged batch of a lane.
  StagedBatch front(std::uint32_t lane) const noexcept { return staged(lane, stages_[lane].first); }
  void pop(std::uint32_t lane) noexcept;

 private:
  /// Data of a staged batch that are not in its record; indexed by its first block.
  struct Waiting {
    BlockIndex next = kNoBlock;
    bool sender_left = false;
    bool of_dead = false;
    std::uint64_t incarnation = 0;
  };
  struct Stage {
    // the batch being copied
    bool copying = false;
    std::uint32_t left = 0;  // blocks to copy
    BlockChain chain;
    Waiting sender;
    std::uint64_t ticket = 0;
    // the complete batches
    BlockIndex first = kNoBlock;
    BlockIndex last = kNoBlock;
  };

  bool begin(std::uint32_t lane, std::uint32_t& budget) noexcept;
  void drop(std::uint32_t lane) noexcept;
  BlockIndex complete(std::uint32_t lane) noexcept;
  void append(std::uint32_t lane, BlockIndex batch) noexcept;
  bool copy_and_check(std::uint32_t lane, std::uint32_t& budget) noexcept;
  bool copy(std::uint32_t lane, std::uint32_t& budget) noexcept;
  bool overtakes(std::uint32_t lane, BlockIndex batch) const noexcept;
  StagedBatch staged(std::uint32_t lane, BlockIndex batch) const noexcept;
  void note_ticket(std::uint32_t lane) noexcept;

  LaneReceivers& lanes_;
  BlockPool& pool_;
  Controller& controller_;
  JournalAuthor& journal_;
  std::vector<Stage> stages_;
  std::vector<std::uint64_t> tickets_;
  std::vector<Waiting> waiting_;  // one for each block
  std::uint32_t begun_ = 0;       // lanes with a ticket
};

}  // namespace o80
