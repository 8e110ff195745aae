#pragma once

#include <cstddef>
#include <cstdint>

#include "control/command_group.hpp"
#include "control/pool.hpp"
#include "control/record.hpp"
#include "control/status_sink.hpp"

namespace o80 {

/// What the backend writes into `RecordHead::own` of the records it has taken.
struct Own {
  static constexpr std::size_t kNext = 0;   // record in a queue, or among the dropped
  static constexpr std::size_t kBatch = 1;  // to which it belongs
  static constexpr std::size_t kLast = 2;   // block of the record
  // one word, read in one sense at a time
  static constexpr std::size_t kNextStep = 3;     // of a plan; of a group: the next member
  static constexpr std::size_t kTurn = 3;         // of what is queued (LaneLists)
  static constexpr std::size_t kNextDropped = 3;  // list of dropped records
};

/// Keeps account of taken batches: tells every end exactly once and gives the blocks back.
///
/// Realtime: everything but construction. Dropping is O(1); `report_ends` tells the statuses bit by
/// bit.
class Ledger {
 public:
  Ledger(BlockPool& pool, StatusSink& sink) : pool_(pool), sink_(sink), groups_(pool) {}

  /// Commands of several actuators that were taken and have not ended.
  std::uint32_t open_groups() const noexcept { return open_groups_; }
  /// Those of them whose members still have to agree: on when to begin, or on the
  /// iterations of each row.
  std::uint32_t undecided_groups() const noexcept { return undecided_groups_; }
  CommandGroups& groups() noexcept { return groups_; }

  /// Enters a batch as taken; it stays open until `close` and until all its records have ended.
  /// `spare` are its blocks that no record uses.
  void enter(std::uint32_t lane, BlockIndex batch, const BlockChain& spare, std::uint32_t groups,
             Iteration iteration) noexcept;
  /// Ends the records from `place` on, which have no blocks, as rejected; told by `report_ends`.
  void reject_from(BlockIndex batch, std::uint32_t place, Reason reason, std::uint8_t detail,
                   Iteration iteration) noexcept;
  /// The batch gets no more records.
  void close(BlockIndex batch, Iteration iteration) noexcept { ended(batch, iteration); }
  /// Ends a whole batch that was never taken; its records are told by `report_ends`, as `status`.
  void reject(std::uint32_t lane, BlockIndex batch, Reason reason, std::uint8_t detail,
              Iteration iteration, Status status = Status::rejected) noexcept;

  /// A command has begun; of several actuators, one of its members.
  void activate(BlockIndex record, Iteration iteration) noexcept;
  /// A record has ended: told at once. That of a group when its last member has ended, with the
  /// first end that is not completed.
  void end(BlockIndex record, Status status, Reason reason, std::uint8_t detail,
           Iteration iteration) noexcept;
  /// A list of records has ended: told by `report_ends`.
  void drop(BlockIndex first, Status status, Reason reason, Iteration iteration) noexcept;

  /// Tells at most `budget` ends; how many it has told.
  std::uint32_t report_ends(std::uint32_t budget) noexcept;
  bool pending() const noexcept { return group_.record != kNoBlock || first_ != kNoBlock; }

  std::uint32_t lane_of(BlockIndex record) const noexcept;

 private:
  struct TakenBatch;
  struct Group {
    BlockIndex record = kNoBlock;
    Status status = Status::none;
    Reason reason = Reason::none;
    Iteration iteration = 0;
  };

  TakenBatch& batch(BlockIndex block) noexcept;
  void ended(BlockIndex batch, Iteration iteration) noexcept;
  void append(BlockIndex group) noexcept;
  BlockIndex& link(BlockIndex group) noexcept;
  void member_ended(BlockIndex group, Status status, Reason reason, std::uint8_t detail,
                    Iteration iteration) noexcept;
  bool tell_rejected(BlockIndex batch, std::uint32_t& budget) noexcept;

  BlockPool& pool_;
  StatusSink& sink_;
  CommandGroups groups_;
  std::uint32_t open_groups_ = 0;
  std::uint32_t undecided_groups_ = 0;
  Group group_;                  // whose ends are being told
  BlockIndex first_ = kNoBlock;  // of the groups that wait: dropped records, or a batch's missing
  BlockIndex last_ = kNoBlock;
};

}  // namespace o80
