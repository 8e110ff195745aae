#include "control/receiving/ledger.hpp"

namespace o80 {

void Ledger::enter(std::uint32_t lane, BlockIndex block, const BlockChain& spare,
                   std::uint32_t missing_from, std::uint32_t groups, Iteration iteration) noexcept {
  open_groups_ += groups;
  undecided_groups_ += groups;
  TakenBatch& taken = take(lane, block, spare, pool_.batch(block).records, iteration);
  report(lane, taken.id, {Status::active}, iteration, StatusChange::Of::batch);
  if (missing_from >= taken.records) return;
  taken.told = missing_from;
  taken.reason = Reason::invalid;
  append(block);
}

void Ledger::reject(std::uint32_t lane, BlockIndex block, const Outcome& outcome,
                    Iteration iteration) noexcept {
  // do not trust the count of records: there are at most as many as blocks
  BlockChain spare = pool_.chain(block);
  spare.first = pool_.next(block);
  --spare.blocks;
  const std::uint32_t records = std::min(pool_.batch(block).records, spare.blocks);
  TakenBatch& taken = take(lane, block, spare, records, iteration);
  taken.end = Status::rejected;
  taken.reason = outcome.reason;
  taken.detail = outcome.detail;
  taken.reported_as = outcome.status;
  taken.told = 0;
  report(lane, taken.id, {Status::rejected, outcome.reason, outcome.detail}, iteration,
         StatusChange::Of::batch);
  if (records > 0) append(block);
  close(block, iteration);
}

void Ledger::activate(BlockIndex record, Iteration iteration, const Outcome& outcome) noexcept {
  const RecordHead& head = pool_.head(record);
  CommandId id = head.id;
  if (is_member(head)) {
    const BlockIndex group = CommandGroups::head_of(head);
    if (groups_.at(group).active != 0) return;
    groups_.at(group).active = 1;
    id = pool_.head(group).id;
    if (head.rows == 1 || head.pace == Pace::chunk) {
      groups_.at(group).decided = 1;
      --undecided_groups_;
    }
  }
  report(lane_of(record), id, outcome, iteration, StatusChange::Of::record);
}

void Ledger::end(BlockIndex record, const Outcome& outcome, Iteration iteration) noexcept {
  const RecordHead& head = pool_.head(record);
  const CommandId id = head.id;
  const bool of_group = is_member(head);
  const BlockIndex group = CommandGroups::head_of(head);
  const BlockIndex block = head.own[Own::kBatch];
  const auto blocks = static_cast<std::uint32_t>(blocks_of(head.payload_bytes));
  const std::uint32_t lane = batch(block).lane;
  if (!of_group) report(lane, id, outcome, iteration, StatusChange::Of::record);
  pool_.release(record, head.own[Own::kLast], blocks);
  sink_.freed(lane, blocks);
  if (of_group) return member_ended(group, outcome, iteration);
  ended(block, iteration);
}

void Ledger::member_ended(BlockIndex record, const Outcome& outcome, Iteration iteration) noexcept {
  CommandGroup& group = groups_.at(record);
  group.last_end = std::max(group.last_end, iteration);
  // the first end that is not completed; else the limit that a member took longer for, if it knows
  const bool is_completed = outcome.status == Status::completed;
  if (group.end == Status::none &&
      (!is_completed || (outcome.reason == Reason::limits && (group.detail & 7U) == 0))) {
    if (!is_completed) group.end = outcome.status;
    group.reason = outcome.reason;
    group.detail = outcome.detail;
  }
  groups_.note_late(record, outcome.late);
  if (--group.open > 0) return;
  --open_groups_;
  const CommandGroup of = group;
  if (of.decided == 0) --undecided_groups_;
  end(record,
      {of.end == Status::none ? Status::completed : of.end, of.reason, of.detail,
       groups_.late(record)},
      of.last_end);
}

void Ledger::ended(BlockIndex block, Iteration iteration) noexcept {
  TakenBatch& taken = batch(block);
  taken.last_end = std::max(taken.last_end, iteration);
  if (--taken.open > 0) return;

  Outcome outcome{taken.end, Reason::none, taken.of_chunk, taken.late_of_chunk};
  if (taken.end == Status::rejected) outcome = {taken.end, taken.reason, taken.detail};
  report(taken.lane, taken.id + 1, outcome, taken.last_end, StatusChange::Of::batch_end);
  sink_.freed(taken.lane, 1 + taken.spare.blocks);
  pool_.release(taken.spare);
  pool_.release(block, block, 1);
}

std::uint32_t Ledger::report_ends(std::uint32_t most) noexcept {
  std::uint32_t budget = most;
  while (true) {
    // the present list
    while (group_.record != kNoBlock) {
      if (budget == 0) return most;
      const BlockIndex record = group_.record;
      group_.record = pool_.head(record).own[Own::kNext];
      end(record, group_.outcome, group_.iteration);
      --budget;
    }
    if (first_ == kNoBlock) return most - budget;
    if (budget == 0) return most;

    // the next list: records without blocks of a batch, or dropped records
    const BlockIndex group = first_;
    if (is_batch(group)) {
      TakenBatch& taken = batch(group);
      const auto of =
          taken.end == Status::rejected ? StatusChange::Of::of_rejected : StatusChange::Of::record;
      for (; taken.told < taken.records && budget > 0; ++taken.told, --taken.open, --budget) {
        report(taken.lane, record_id(taken.id, taken.told),
               {taken.reported_as, taken.reason, taken.detail}, taken.taken_at, of);
      }
      // keeps the batch open until all are reported
      if (taken.told < taken.records) return most;
      first_ = link(group);
      ++taken.open;
      ended(group, taken.taken_at);
    } else {
      first_ = link(group);
      const RecordHead& head = pool_.head(group);
      group_ = {group,
                {static_cast<Status>(head.rows >> 8), static_cast<Reason>(head.rows & 0xFF)},
                head.amount};
    }
  }
}

}  // namespace o80
