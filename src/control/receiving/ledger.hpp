#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <new>

#include "control/batch/chunk.hpp"
#include "control/batch/record.hpp"
#include "control/receiving/command_group.hpp"
#include "control/receiving/pool.hpp"
#include "control/receiving/status_sink.hpp"

namespace o80 {

/// Words of `RecordHead::own` that the backend uses.
struct Own {
  static constexpr std::size_t kNext = 0;   // next record of the same list
  static constexpr std::size_t kBatch = 1;  // first block of its batch
  static constexpr std::size_t kLast = 2;   // last block of the record
  // one word with three uses at different times
  static constexpr std::size_t kNextStep = 3;     // next step of the plan; next member of a group
  static constexpr std::size_t kTurn = 3;         // turn in a queue (LaneLists)
  static constexpr std::size_t kNextDropped = 3;  // next list of dropped records
};

/// Tracks taken batches: reports each end status exactly once, and returns the blocks to the pool.
///
/// Realtime: everything but construction. drop() is O(1), report_ends() goes in bounded portions.
class Ledger {
 public:
  Ledger(BlockPool& pool, StatusSink& sink) : pool_(pool), sink_(sink), groups_(pool) {}

  /// Number of commands of several actuators that were taken and have not ended.
  std::uint32_t open_groups() const noexcept { return open_groups_; }
  /// Those whose members still have to agree on their begin or the iterations of a waypoint.
  std::uint32_t undecided_groups() const noexcept { return undecided_groups_; }
  CommandGroups& groups() noexcept { return groups_; }

  /// Enters a batch as taken. It ends after close() and the end of all its records. `spare`: its
  /// unused blocks. Records from index `missing_from` on have none: report_ends() rejects them.
  void enter(std::uint32_t lane, BlockIndex batch, const BlockChain& spare,
             std::uint32_t missing_from, std::uint32_t groups, Iteration iteration) noexcept;
  /// Call it after the last step of the batch.
  void close(BlockIndex batch, Iteration iteration) noexcept { ended(batch, iteration); }
  /// Rejects a whole batch that was not taken; its records get the status of `outcome`.
  void reject(std::uint32_t lane, BlockIndex batch, const Outcome& outcome,
              Iteration iteration) noexcept;

  /// A command, or a member of a group, has begun. Reason::limits: it takes longer than requested.
  void activate(BlockIndex record, Iteration iteration,
                const Outcome& outcome = {Status::active}) noexcept;
  /// Tells what was decided of a chunk, by the active status of its batch (TakenChunk).
  void note_decided(BlockIndex record, const TakenChunk& chunk, Iteration iteration) noexcept {
    const TakenBatch& of = batch(pool_.head(record).own[Own::kBatch]);
    report(of.lane, of.id, {Status::active, Reason::none, chunk.detail(), chunk.shift & 0xFFFF},
           iteration, StatusChange::Of::chunk);
  }
  /// Tells what was decided when it begins, by the status of the end of its batch (BegunChunk).
  void note_begun(BlockIndex record, const BegunChunk& chunk, Iteration iteration) noexcept {
    TakenBatch& of = batch(pool_.head(record).own[Own::kBatch]);
    of.of_chunk = chunk.detail();
    of.late_of_chunk = chunk.late();
    report(of.lane, of.id + 1, {Status::active, Reason::none, of.of_chunk, of.late_of_chunk},
           iteration, StatusChange::Of::chunk);
  }
  /// A record has ended; reported at once. A group is reported when its last member has ended, with
  /// the first end status that is not completed.
  void end(BlockIndex record, const Outcome& outcome, Iteration iteration) noexcept;
  /// A list of records has ended, without details; reported by report_ends().
  void drop(BlockIndex first, const Outcome& outcome, Iteration iteration) noexcept {
    if (first == kNoBlock) return;
    // store the common end in the first record, whose command is not needed any more
    RecordHead& head = pool_.head(first);
    head.amount = iteration;
    head.rows = static_cast<std::uint32_t>(outcome.status) << 8 |
                static_cast<std::uint32_t>(outcome.reason);
    append(first);
  }

  /// Reports at most `budget` end statuses; returns how many.
  std::uint32_t report_ends(std::uint32_t budget) noexcept;
  bool pending() const noexcept { return group_.record != kNoBlock || first_ != kNoBlock; }

  std::uint32_t lane_of(BlockIndex record) noexcept {
    return batch(pool_.head(record).own[Own::kBatch]).lane;
  }

 private:
  /// Replaces the BatchRecord in the first block of a batch that was taken.
  struct TakenBatch {
    RecordKind kind = RecordKind::batch;
    Status end = Status::completed;  // end status of the batch
    Reason reason = Reason::none;    // reason for the records without blocks
    std::uint8_t detail = 0;
    std::uint32_t records = 0;
    CommandId id = 0;
    Iteration last_end = 0;
    Iteration taken_at = 0;
    std::uint32_t open = 0;  // records that have not ended, plus 1 until close()
    std::uint32_t told = 0;  // index of the next record without blocks to report
    BlockIndex next_group = kNoBlock;
    std::uint32_t lane = 0;
    BlockChain spare;
    Status reported_as = Status::rejected;  // end status of the records without blocks
    std::uint8_t of_chunk = 0;              // BegunChunk
    std::uint16_t late_of_chunk = 0;
  };
  static_assert(sizeof(TakenBatch) <= kBlockBytes);
  /// A list of records with a common end.
  struct Group {
    BlockIndex record = kNoBlock;
    Outcome outcome;
    Iteration iteration = 0;
  };

  TakenBatch& batch(BlockIndex block) noexcept {
    return *std::launder(reinterpret_cast<TakenBatch*>(pool_.bytes(block)));
  }
  TakenBatch& take(std::uint32_t lane, BlockIndex block, const BlockChain& spare,
                   std::uint32_t records, Iteration iteration) noexcept {
    TakenBatch taken;
    taken.records = taken.told = records;
    taken.id = pool_.batch(block).id;
    taken.last_end = taken.taken_at = iteration;
    taken.open = records + 1;
    taken.lane = lane;
    taken.spare = spare;
    return *new (pool_.bytes(block)) TakenBatch(taken);
  }
  void ended(BlockIndex batch, Iteration iteration) noexcept;
  bool is_batch(BlockIndex group) noexcept {
    return static_cast<RecordKind>(*pool_.bytes(group)) == RecordKind::batch;
  }
  BlockIndex& link(BlockIndex group) noexcept {
    return is_batch(group) ? batch(group).next_group : pool_.head(group).own[Own::kNextDropped];
  }
  void append(BlockIndex group) noexcept {
    link(group) = kNoBlock;
    (first_ == kNoBlock ? first_ : link(last_)) = group;
    last_ = group;
  }
  void member_ended(BlockIndex group, const Outcome& outcome, Iteration iteration) noexcept;
  void report(std::uint32_t lane, CommandId id, const Outcome& outcome, Iteration iteration,
              StatusChange::Of of) noexcept {
    // as much of a delay as a status can hold
    const auto late = static_cast<std::uint16_t>(std::min<std::int64_t>(outcome.late, 0xFFFF));
    sink_.changed({lane, id, outcome.status, outcome.reason, outcome.detail, iteration, of, late});
  }

  BlockPool& pool_;
  StatusSink& sink_;
  CommandGroups groups_;
  std::uint32_t open_groups_ = 0;
  std::uint32_t undecided_groups_ = 0;
  Group group_;                  // the list whose end statuses are being reported
  BlockIndex first_ = kNoBlock;  // waiting lists: dropped records, or batches with missing records
  BlockIndex last_ = kNoBlock;   // the last waiting list
};

}  // namespace o80
