#include "o80/control/batch_plan.hpp"

#include <utility>

namespace o80 {
namespace {

/// What a plan writes into `BatchRecord::own`.
constexpr std::size_t kSteps = 0;
constexpr std::size_t kMissingFrom = 1;
constexpr std::size_t kSpareFirst = 2;
constexpr std::size_t kSpareLast = 3;
constexpr std::size_t kSpareBlocks = 4;

BatchRecord& record_of(BlockPool& pool, BlockIndex batch) noexcept {
  return *reinterpret_cast<BatchRecord*>(pool.bytes(batch));
}

}  // namespace

BatchPlanner::BatchPlanner(const Schema& schema, RecordCheck::Layouts layouts, BlockPool& pool,
                           std::uint32_t lanes)
    : pool_(pool),
      check_(schema, std::move(layouts)),
      actuators_(static_cast<std::uint32_t>(schema.actuators.size())),
      lanes_(lanes),
      open_(std::size_t{lanes} * actuators_),
      tails_(pool.size(), kNoBlock),
      known_(pool.size(), Known::nothing) {}

void BatchPlanner::begin(Lane& lane, BlockIndex batch) noexcept {
  lane.batch = batch;
  lane.cursor = pool_.next(batch);
  lane.begun = false;
  lane.last_step = kNoBlock;
  lane.invalid = kNoBlock;
  lane.place = 0;
  lane.blocks = 1;
  ++lane.epoch;
  record_of(pool_, batch).own = {kNoBlock, 0, kNoBlock, kNoBlock, 0};
}

bool BatchPlanner::check(std::uint32_t lane_index, BlockIndex batch,
                         std::uint32_t budget) noexcept {
  if (known_[batch] != Known::nothing) return true;
  Lane& lane = lanes_[lane_index];
  if (lane.batch != batch) begin(lane, batch);
  const BatchRecord& record = pool_.batch(batch);
  if (record.kind != RecordKind::batch || record.records >= record.blocks ||
      record.blocks != pool_.chain(batch).blocks) {
    lane.batch = kNoBlock;
    known_[batch] = Known::garbage;
    return true;
  }
  while (lane.place < record.records && lane.cursor != kNoBlock) {
    if (budget == 0 || !check_record(lane_index, budget)) return false;
  }
  complete(lane);
  return true;
}

void BatchPlanner::complete(Lane& lane) noexcept {
  const BlockChain chain = pool_.chain(lane.batch);
  BatchRecord& record = record_of(pool_, lane.batch);
  record.own[kMissingFrom] = lane.place;
  record.own[kSpareFirst] = lane.cursor;
  record.own[kSpareLast] = chain.last;
  record.own[kSpareBlocks] = chain.blocks - lane.blocks;
  known_[lane.batch] = Known::plan;
  lane.batch = kNoBlock;
}

void BatchPlanner::begin_record(Lane& lane) noexcept {
  using Verdict = RecordCheck::Verdict;
  const RecordHead& head = pool_.head(lane.cursor);
  const BlockChain chain = pool_.chain(lane.batch);
  const std::uint64_t claimed = blocks_of(head.payload_bytes);
  const std::uint32_t there = chain.blocks - lane.blocks;
  lane.begun = true;
  lane.last = lane.cursor;
  lane.to_walk = 0;
  if (claimed > there) {
    // it has what is left
    lane.verdict = Verdict::invalid;
    lane.record_blocks = there;
    lane.last = chain.last;
    return;
  }
  lane.record_blocks = static_cast<std::uint32_t>(claimed);
  if (head.id != record_id(pool_.batch(lane.batch).id, lane.place)) {
    lane.verdict = Verdict::invalid;
    lane.to_walk = lane.record_blocks - 1;
    return;
  }
  lane.verdict = check_.begin(pool_, lane.cursor, lane.progress);
  if (lane.verdict != Verdict::unfinished) stop_reading(lane);
}

/// The check is done: the record ends where it has read to, or so many blocks later.
void BatchPlanner::stop_reading(Lane& lane) noexcept {
  const Cursor& payload = lane.progress.payload;
  const std::uint64_t here = kBlockBytes - payload.offset();
  const std::uint64_t behind = payload.left() > here ? payload.left() - here : 0;
  lane.last = payload.block();
  lane.to_walk = static_cast<std::uint32_t>((behind + kBlockBytes - 1) / kBlockBytes);
}

bool BatchPlanner::check_record(std::uint32_t lane_index, std::uint32_t& budget) noexcept {
  using Verdict = RecordCheck::Verdict;
  Lane& lane = lanes_[lane_index];
  if (!lane.begun) {
    begin_record(lane);
    --budget;
  }
  if (lane.verdict == Verdict::unfinished) {
    lane.verdict = check_.go_on(pool_, lane.cursor, lane.progress, budget);
    if (lane.verdict == Verdict::unfinished) return false;
    stop_reading(lane);
  }
  for (; lane.to_walk > 0; --lane.to_walk, --budget) {
    if (budget == 0) return false;
    lane.last = pool_.next(lane.last);
  }
  RecordHead& head = pool_.head(lane.cursor);
  if (lane.verdict == Verdict::invalid) {
    head.kind = kInvalidRecord;
    head.id = record_id(pool_.batch(lane.batch).id, lane.place);
    head.payload_bytes =
        static_cast<std::uint32_t>(lane.record_blocks * kBlockBytes - sizeof(RecordHead));
  }
  if (is_timed(head)) note_rows(head, lane.progress.rows);
  head.own = {kNoBlock, lane.batch, lane.last, kNoBlock};
  add(lane_index, lane.cursor);
  lane.cursor = pool_.next(lane.last);
  lane.begun = false;
  lane.blocks += lane.record_blocks;
  ++lane.place;
  return true;
}

void BatchPlanner::add(std::uint32_t lane_index, BlockIndex record) noexcept {
  Lane& lane = lanes_[lane_index];
  const RecordHead& head = pool_.head(record);
  if (head.kind == kInvalidRecord) {
    if (lane.invalid != kNoBlock) return join(lane.invalid, record);
    lane.invalid = record;
  } else if (head.kind == RecordKind::command) {
    OpenList& list = open(lane_index, head.actuator);
    if (head.mode == Mode::queue && list.epoch == lane.epoch) return join(list.first, record);
    list = {record, lane.epoch};
  } else if (head.kind == RecordKind::purge && head.actuator != kEveryActuator) {
    open(lane_index, head.actuator).epoch = 0;
  } else {
    ++lane.epoch;  // nothing that comes later may be taken before it
  }
  add_step(lane, record);
}

void BatchPlanner::add_step(Lane& lane, BlockIndex record) noexcept {
  tails_[record] = record;
  if (lane.last_step == kNoBlock) {
    record_of(pool_, lane.batch).own[kSteps] = record;
  } else {
    pool_.head(lane.last_step).own[Own::kOther] = record;
  }
  lane.last_step = record;
}

void BatchPlanner::join(BlockIndex list, BlockIndex record) noexcept {
  pool_.head(tails_[list]).own[Own::kNext] = record;
  tails_[list] = record;
}

std::optional<Plan> BatchPlanner::plan(BlockIndex batch) noexcept {
  const Known known = std::exchange(known_[batch], Known::nothing);
  if (known != Known::plan) return std::nullopt;
  const auto& own = pool_.batch(batch).own;
  return Plan{
      own[kSteps], own[kMissingFrom], {own[kSpareFirst], own[kSpareLast], own[kSpareBlocks]}};
}

void BatchPlanner::forget(std::uint32_t lane, BlockIndex batch) noexcept {
  known_[batch] = Known::nothing;
  if (lanes_[lane].batch == batch) lanes_[lane].batch = kNoBlock;
}

}  // namespace o80
