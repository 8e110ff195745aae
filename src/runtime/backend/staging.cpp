#include "runtime/backend/staging.hpp"

#include <algorithm>
#include <cstddef>

namespace o80 {

Staging::Staging(LaneReceivers& lanes, BlockPool& pool, Controller& controller,
                 JournalAuthor& journal)
    : lanes_(lanes),
      pool_(pool),
      controller_(controller),
      journal_(journal),
      stages_(lanes.size()),
      tickets_(lanes.size(), kNoTicket),
      waiting_(pool.size()) {}

bool Staging::begin(std::uint32_t lane, std::uint32_t& budget) noexcept {
  constexpr auto kBatch = static_cast<std::uint64_t>(RecordKind::batch);
  LaneReceiver& from = lanes_[lane];
  const std::uint64_t kind = from.peek_word(offsetof(BatchRecord, kind)) & 0xFF;
  const auto blocks = static_cast<std::uint32_t>(from.peek_word(offsetof(BatchRecord, blocks)));
  if (kind != kBatch || blocks == 0 || blocks > from.available_of_one()) {
    // invalid blocks cost budget too, so that a flood of them cannot hold up the loop
    --budget;
    from.reset();
    return false;
  }
  Stage& stage = stages_[lane];
  stage.copying = true;
  stage.left = blocks;
  stage.chain = {};
  stage.sender = {kNoBlock, from.owner_of_next() == 0, from.next_is_of_dead(), from.incarnation()};
  // a ticket that was not drawn yet is invalid: use the ticket counter instead
  stage.ticket = std::min(from.peek_word(offsetof(BatchRecord, ticket)), lanes_.tickets_drawn());
  note_ticket(lane);
  return true;
}

bool Staging::advance(std::uint32_t lane, std::uint32_t& budget) noexcept {
  if (budget == 0) return false;
  Stage& stage = stages_[lane];
  if (!stage.copying && !begin(lane, budget)) return true;
  if (!copy_and_check(lane, budget)) return false;
  if (stage.copying) append(lane, complete(lane));
  return true;
}

/// False when the budget ended first. An invalid batch is dropped.
bool Staging::copy_and_check(std::uint32_t lane, std::uint32_t& budget) noexcept {
  Stage& stage = stages_[lane];
  if (stage.left > 0 && budget > 0) {
    const std::uint32_t first = stage.chain.blocks;
    const Waiting& sender = stage.sender;
    journal_.begin_blocks(lane, sender.sender_left ? 0 : sender.incarnation,
                          std::min(stage.left, budget));
    const bool valid = copy(lane, budget);
    if (stage.chain.blocks > 0) {
      journal_.end_blocks(lane, pool_.batch(stage.chain.first).id, first);
    }
    if (!valid) {
      drop(lane);
      return true;
    }
  }
  return stage.left == 0 && controller_.check(lane, stage.chain.first, budget);
}

/// Copies blocks of a batch into the pool and the journal; false if the batch is invalid.
bool Staging::copy(std::uint32_t lane, std::uint32_t& budget) noexcept {
  Stage& stage = stages_[lane];
  LaneReceiver& from = lanes_[lane];
  while (stage.left > 0 && budget > 0) {
    --budget;
    std::byte* const block = pool_.spare();
    if (block == nullptr || !from.take(block)) return false;
    const bool is_first = stage.chain.blocks == 0;
    if (is_first && !from.expects(load<BatchRecord>(block).id)) {
      from.free(1);
      return false;
    }
    pool_.append_spare(stage.chain);
    journal_.add_block(block);
    --stage.left;
  }
  return true;
}

/// Discards a batch that is invalid or whose lane was reset.
void Staging::drop(std::uint32_t lane) noexcept {
  Stage& stage = stages_[lane];
  if (stage.chain.blocks > 0) journal_.dropped(lane, pool_.batch(stage.chain.first).id);
  lanes_[lane].free(stage.chain.blocks);
  lanes_[lane].reset();
  pool_.release(stage.chain);
  stage.copying = false;
  note_ticket(lane);
}

/// Ends the copying of a batch; returns its first block.
BlockIndex Staging::complete(std::uint32_t lane) noexcept {
  Stage& stage = stages_[lane];
  const BlockIndex batch = stage.chain.first;
  // the sender may have changed the record since: use the ticket that was read first
  BatchRecord& record = pool_.batch(batch);
  record.ticket = stage.ticket;
  lanes_[lane].note_ids(record_id(record.id, std::min(record.records, stage.chain.blocks)));
  waiting_[batch] = stage.sender;
  stage.copying = false;
  note_ticket(lane);
  return batch;
}

void Staging::append(std::uint32_t lane, BlockIndex batch) noexcept {
  Stage& stage = stages_[lane];
  (stage.first == kNoBlock ? stage.first : waiting_[stage.last].next) = batch;
  stage.last = batch;
  note_ticket(lane);
}

// ------------------------------------------------------------------------------ express

bool Staging::next_is_express(std::uint32_t lane) const noexcept {
  // kind, late_now and flags are in the first word
  static_assert(offsetof(BatchRecord, flags) == 2);
  const std::uint64_t first = lanes_[lane].peek_word(offsetof(BatchRecord, kind));
  const auto blocks =
      static_cast<std::uint32_t>(lanes_[lane].peek_word(offsetof(BatchRecord, blocks)));
  return (first >> 16 & kExpress) != 0 && blocks <= 1 + kMaxExpressRecords;
}

std::optional<StagedBatch> Staging::express(std::uint32_t lane) noexcept {
  std::uint32_t budget = 4 * (1 + kMaxExpressRecords);  // enough for any express batch
  if (!begin(lane, budget) || !copy_and_check(lane, budget) || !stages_[lane].copying) {
    return std::nullopt;
  }
  const BlockIndex batch = complete(lane);
  if (overtakes(lane, batch)) return staged(lane, batch);
  append(lane, batch);
  return std::nullopt;
}

/// True if a batch that claims to be express is. A release of control does not overtake staged
/// batches of its lane, because these were sent under that control.
bool Staging::overtakes(std::uint32_t lane, BlockIndex batch) const noexcept {
  const BatchRecord& record = pool_.batch(batch);
  const Effort effort = controller_.effort(batch);
  return effort.express && record.at == kNow && record.burst == 0 &&
         (record.flags & kBurstUntilEnded) == 0 &&
         (!effort.releases || stages_[lane].first == kNoBlock);
}

// ------------------------------------------------------------------------------ staged

StagedBatch Staging::staged(std::uint32_t lane, BlockIndex batch) const noexcept {
  const BatchRecord& record = pool_.batch(batch);
  const Waiting& sender = waiting_[batch];
  return {.at = record.at,
          .ticket = record.ticket,
          .batch = batch,
          .lane = lane,
          .incarnation = sender.incarnation,
          .sender_left = sender.sender_left,
          .of_dead = sender.of_dead,
          .late_now = record.late_now != 0};
}

void Staging::pop(std::uint32_t lane) noexcept {
  Stage& stage = stages_[lane];
  stage.first = waiting_[stage.first].next;
  note_ticket(lane);
}

/// Updates the ticket of the lane's oldest batch that is half copied or staged.
void Staging::note_ticket(std::uint32_t lane) noexcept {
  const Stage& stage = stages_[lane];
  const bool was_begun = tickets_[lane] != kNoTicket;
  tickets_[lane] = stage.first != kNoBlock ? pool_.batch(stage.first).ticket
                   : stage.copying         ? stage.ticket
                                           : kNoTicket;
  const bool is_begun = tickets_[lane] != kNoTicket;
  begun_ += (is_begun ? 1U : 0U) - (was_begun ? 1U : 0U);
}

}  // namespace o80
