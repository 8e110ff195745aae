#include "control/ledger.hpp"

#include <algorithm>
#include <new>
#include <utility>

namespace o80 {

/// Replaces the BatchRecord in the first block of a batch that was taken.
struct Ledger::TakenBatch {
  RecordKind kind = RecordKind::batch;
  Status end = Status::completed;  // end status of the batch
  Reason reason = Reason::none;    // reason for the records without blocks
  std::uint8_t detail = 0;
  std::uint32_t records = 0;
  CommandId id = 0;
  Iteration last_end = 0;
  Iteration rejected_at = 0;
  std::uint32_t open = 0;  // records that have not ended, plus 1 until close()
  std::uint32_t told = 0;  // index of the next record without blocks to report
  BlockIndex next_group = kNoBlock;
  std::uint32_t lane = 0;
  BlockChain spare;
  Status told_as = Status::rejected;  // end status of the records without blocks
};

namespace {

/// As much of a delay as a status can tell.
std::uint16_t told(std::int64_t late) noexcept {
  return static_cast<std::uint16_t>(std::min<std::int64_t>(late, 0xFFFF));
}

}  // namespace

Ledger::TakenBatch& Ledger::batch(BlockIndex block) noexcept {
  static_assert(sizeof(TakenBatch) <= kBlockBytes);
  return *std::launder(reinterpret_cast<TakenBatch*>(pool_.bytes(block)));
}

std::uint32_t Ledger::lane_of(BlockIndex record) const noexcept {
  const BlockIndex block = pool_.head(record).own[Own::kBatch];
  return std::launder(reinterpret_cast<const TakenBatch*>(pool_.bytes(block)))->lane;
}

void Ledger::enter(std::uint32_t lane, BlockIndex block, const BlockChain& spare,
                   std::uint32_t groups, Iteration iteration) noexcept {
  open_groups_ += groups;
  undecided_groups_ += groups;
  const BatchRecord record = pool_.batch(block);
  TakenBatch taken;
  taken.records = record.records;
  taken.id = record.id;
  taken.last_end = iteration;
  taken.open = record.records + 1;
  taken.told = record.records;
  taken.lane = lane;
  taken.spare = spare;
  new (pool_.bytes(block)) TakenBatch(taken);
  sink_.changed(
      {lane, taken.id, Status::active, Reason::none, 0, iteration, StatusChange::Of::batch});
}

void Ledger::reject_from(BlockIndex block, std::uint32_t place, Reason reason, std::uint8_t detail,
                         Iteration iteration) noexcept {
  TakenBatch& taken = batch(block);
  if (place >= taken.records) return;
  taken.told = place;
  taken.reason = reason;
  taken.detail = detail;
  taken.rejected_at = iteration;
  append(block);
}

void Ledger::reject(std::uint32_t lane, BlockIndex block, Reason reason, std::uint8_t detail,
                    Iteration iteration, Status status) noexcept {
  // do not trust the count of records: there are at most as many as blocks
  BlockChain spare = pool_.chain(block);
  spare.first = pool_.next(block);
  --spare.blocks;
  const BatchRecord record = pool_.batch(block);
  TakenBatch taken;
  taken.end = Status::rejected;
  taken.reason = reason;
  taken.detail = detail;
  taken.records = std::min(record.records, spare.blocks);
  taken.id = record.id;
  taken.last_end = iteration;
  taken.open = taken.records + 1;
  taken.lane = lane;
  taken.spare = spare;
  taken.told_as = status;
  new (pool_.bytes(block)) TakenBatch(taken);
  sink_.changed(
      {lane, taken.id, Status::rejected, reason, detail, iteration, StatusChange::Of::batch});
  reject_from(block, 0, reason, detail, iteration);
  close(block, iteration);
}

void Ledger::activate(BlockIndex record, Iteration iteration, Reason reason, std::uint8_t detail,
                      std::int64_t late) noexcept {
  const RecordHead& head = pool_.head(record);
  CommandId id = head.id;
  if (is_member(head)) {
    const BlockIndex group = CommandGroups::head_of(head);
    if (groups_.at(group).active != 0) return;
    groups_.at(group).active = 1;
    id = pool_.head(group).id;
    if (head.rows == 1) {
      groups_.at(group).decided = 1;
      --undecided_groups_;
    }
  }
  sink_.changed({lane_of(record), id, Status::active, reason, detail, iteration,
                 StatusChange::Of::record, told(late)});
}

void Ledger::end(BlockIndex record, Status status, Reason reason, std::uint8_t detail,
                 Iteration iteration, std::int64_t late) noexcept {
  const RecordHead& head = pool_.head(record);
  const CommandId id = head.id;
  const bool of_group = is_member(head);
  const BlockIndex group = CommandGroups::head_of(head);
  const BlockIndex block = head.own[Own::kBatch];
  const auto blocks = static_cast<std::uint32_t>(blocks_of(head.payload_bytes));
  const std::uint32_t lane = batch(block).lane;
  if (!of_group) {
    sink_.changed(
        {lane, id, status, reason, detail, iteration, StatusChange::Of::record, told(late)});
  }
  pool_.release(record, head.own[Own::kLast], blocks);
  sink_.freed(lane, blocks);
  if (of_group) return member_ended(group, status, reason, detail, iteration, late);
  ended(block, iteration);
}

void Ledger::member_ended(BlockIndex record, Status status, Reason reason, std::uint8_t detail,
                          Iteration iteration, std::int64_t late) noexcept {
  CommandGroup& group = groups_.at(record);
  group.last_end = std::max(group.last_end, iteration);
  if (status != Status::completed && group.end == Status::none) {
    group.end = status;
    group.reason = reason;
    group.detail = detail;
  }
  // longer than asked: keep which limit it was, if a member knows
  if (status == Status::completed && reason == Reason::limits && group.end == Status::none &&
      (group.detail & 7U) == 0) {
    group.reason = reason;
    group.detail = detail;
  }
  groups_.note_late(record, late);
  if (--group.open > 0) return;
  --open_groups_;
  const CommandGroup of = group;
  if (of.decided == 0) --undecided_groups_;
  end(record, of.end == Status::none ? Status::completed : of.end, of.reason, of.detail,
      of.last_end, groups_.late(record));
}

void Ledger::ended(BlockIndex block, Iteration iteration) noexcept {
  TakenBatch& taken = batch(block);
  taken.last_end = std::max(taken.last_end, iteration);
  if (--taken.open > 0) return;

  const Reason reason = taken.end == Status::rejected ? taken.reason : Reason::none;
  const std::uint8_t detail = taken.end == Status::rejected ? taken.detail : std::uint8_t{0};
  sink_.changed({taken.lane, taken.id + 1, taken.end, reason, detail, taken.last_end,
                 StatusChange::Of::batch_end});
  sink_.freed(taken.lane, 1 + taken.spare.blocks);
  pool_.release(taken.spare);
  pool_.release(block, block, 1);
}

BlockIndex& Ledger::link(BlockIndex group) noexcept {
  const auto kind = static_cast<RecordKind>(*pool_.bytes(group));
  return kind == RecordKind::batch ? batch(group).next_group
                                   : pool_.head(group).own[Own::kNextDropped];
}

void Ledger::append(BlockIndex group) noexcept {
  link(group) = kNoBlock;
  (first_ == kNoBlock ? first_ : link(last_)) = group;
  last_ = group;
}

void Ledger::drop(BlockIndex first, Status status, Reason reason, Iteration iteration) noexcept {
  if (first == kNoBlock) return;
  // store the common end in the first record, whose command is not needed any more: amount =
  // iteration, rows = status << 8 | reason
  RecordHead& head = pool_.head(first);
  head.amount = iteration;
  head.rows = static_cast<std::uint32_t>(status) << 8 | static_cast<std::uint32_t>(reason);
  append(first);
}

bool Ledger::tell_rejected(BlockIndex block, std::uint32_t& budget) noexcept {
  TakenBatch& taken = batch(block);
  const auto of =
      taken.end == Status::rejected ? StatusChange::Of::of_rejected : StatusChange::Of::record;
  while (taken.told < taken.records && budget > 0) {
    sink_.changed({taken.lane, record_id(taken.id, taken.told), taken.told_as, taken.reason,
                   taken.detail, taken.rejected_at, of});
    ++taken.told;
    --taken.open;
    --budget;
  }
  return taken.told == taken.records;
}

std::uint32_t Ledger::report_ends(std::uint32_t most) noexcept {
  std::uint32_t budget = most;
  while (true) {
    // the present list
    while (group_.record != kNoBlock) {
      if (budget == 0) return most;
      const BlockIndex record = group_.record;
      group_.record = pool_.head(record).own[Own::kNext];
      end(record, group_.status, group_.reason, 0, group_.iteration);
      --budget;
    }
    if (first_ == kNoBlock) return most - budget;
    if (budget == 0) return most;

    // the next list: records without blocks of a batch, or dropped records
    const BlockIndex group = first_;
    if (static_cast<RecordKind>(*pool_.bytes(group)) == RecordKind::batch) {
      // keeps the batch open until all are reported
      if (!tell_rejected(group, budget)) return most - budget;
      first_ = link(group);
      ++batch(group).open;
      ended(group, batch(group).rejected_at);
    } else {
      first_ = link(group);
      const RecordHead& head = pool_.head(group);
      group_ = {group, static_cast<Status>(head.rows >> 8), static_cast<Reason>(head.rows & 0xFF),
                head.amount};
    }
  }
}

}  // namespace o80
