#include "control/batch_plan.hpp"

#include <algorithm>
#include <utility>

namespace o80 {
namespace {

// words that a plan writes into `BatchRecord::own`, besides kFirstStep. Its work is stored in
// `BatchRecord::blocks`: the pool knows the count of blocks as well.
constexpr std::size_t kMissingFrom = 1;
constexpr std::size_t kSpareFirst = 2;
constexpr std::size_t kTraits = 3;
constexpr std::size_t kSpareBlocks = 4;

// bits of kTraits
constexpr std::uint32_t kRequests = 0x7F;  // number of requests
constexpr std::uint32_t kFree = 1U << 7;
constexpr std::uint32_t kIsExpress = 1U << 8;
constexpr std::uint32_t kReleases = 1U << 9;
constexpr std::uint32_t kMoves = 1U << 10;
constexpr std::uint32_t kFirstGroupBit = 11;  // above: number of groups

constexpr std::uint32_t kBatchWork = 6;  // work of a batch; copying a block is 1

}  // namespace

BatchPlanner::BatchPlanner(const Schema& schema, RecordCheck::Layouts layouts, BlockPool& pool,
                           std::uint32_t lanes)
    : pool_(pool),
      check_(schema, std::move(layouts)),
      actuators_(static_cast<std::uint32_t>(schema.actuators.size())),
      lanes_(lanes),
      targets_(std::size_t{lanes} * actuators_),
      listed_(std::size_t{lanes} * actuators_),
      tails_(pool.size(), kNoBlock),
      known_(pool.size(), Known::nothing) {
  for (const RequestRow& request : schema.requests)
    while_halted_.push_back(request.while_halted != 0);
}

void BatchPlanner::begin(Lane& lane, BlockIndex batch) noexcept {
  lane.batch = batch;
  lane.cursor = pool_.next(batch);
  lane.begun = false;
  lane.last_step = kNoBlock;
  lane.place = 0;
  lane.blocks = 1;
  lane.effort = {.work = kBatchWork, .express = true};
  lane.control_orders = 0;
  lane.free = 0;
  lane.group = kNoBlock;
  lane.groups = 0;
  begin_part(lane);
  pool_.batch(batch).own = {kNoBlock, 0, kNoBlock, 0, 0};
}

bool BatchPlanner::check(std::uint32_t lane_index, BlockIndex batch,
                         std::uint32_t& budget) noexcept {
  if (known_[batch] != Known::nothing) return true;
  Lane& lane = lanes_[lane_index];
  const BatchRecord& record = pool_.batch(batch);
  if (lane.batch != batch) {
    if (record.kind != RecordKind::batch || record.records >= record.blocks ||
        record.blocks != pool_.chain(batch).blocks) {
      known_[batch] = Known::garbage;
      return true;
    }
    begin(lane, batch);
  }
  while (lane.place < record.records && lane.cursor != kNoBlock) {
    if (budget == 0 || !check_record(lane_index, budget)) return false;
  }
  complete(lane_index, budget);
  return true;
}

void BatchPlanner::complete(std::uint32_t lane_index, std::uint32_t& budget) noexcept {
  if (lanes_[lane_index].group != kNoBlock) fail_group(lane_index, budget);  // incomplete
  end_part(lane_index, budget);
  Lane& lane = lanes_[lane_index];
  const BlockChain chain = pool_.chain(lane.batch);
  BatchRecord& record = pool_.batch(lane.batch);
  const bool is_express = lane.effort.express && lane.place == record.records;
  const bool bursts = record.burst != 0 || (record.flags & kBurstUntilEnded) != 0;
  const bool is_free = lane.free > 0 && lane.free == record.records && !bursts;
  record.own[kMissingFrom] = lane.place;
  record.own[kSpareFirst] = lane.cursor;
  record.own[kTraits] = lane.effort.requests | (is_express ? kIsExpress : 0) |
                        (lane.effort.releases ? kReleases : 0) | (lane.effort.moves ? kMoves : 0) |
                        (is_free ? kFree : 0) | lane.groups << kFirstGroupBit;
  record.own[kSpareBlocks] = chain.blocks - lane.blocks;
  record.blocks = lane.effort.work;
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
    // it gets the remaining blocks
    lane.verdict = Verdict::invalid;
    lane.record_blocks = there;
    lane.last = chain.last;
    return;
  }
  lane.record_blocks = static_cast<std::uint32_t>(claimed);
  const bool is_wanted = (head.kind == RecordKind::member) == (lane.group != kNoBlock);
  if (!is_wanted || head.id != record_id(pool_.batch(lane.batch).id, lane.place)) {
    lane.verdict = Verdict::invalid;
    lane.to_walk = lane.record_blocks - 1;
    return;
  }
  lane.verdict = check_.begin(pool_, lane.cursor, lane.progress);
  if (lane.verdict != Verdict::unfinished) stop_reading(lane);
}

/// After the check of a record: computes how many blocks remain to its end.
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
  const bool fits =
      lane.group == kNoBlock ? !is_one_too_many(lane, head) : fits_group(lane_index, head);
  if (lane.verdict == Verdict::valid && !fits) lane.verdict = Verdict::invalid;
  if (lane.group != kNoBlock) {
    lane.group_blocks += lane.record_blocks;
    if (lane.verdict == Verdict::invalid) {
      fail_group(lane_index, budget);
    } else {
      add_member(lane);
      if (lane.members_left == 0) complete_group(lane_index, budget);
    }
    go_on_behind(lane);
    return true;
  }
  if (lane.verdict == Verdict::invalid) {
    head.kind = RecordKind::invalid_list;
    head.id = record_id(pool_.batch(lane.batch).id, lane.place);
    head.payload_bytes =
        static_cast<std::uint32_t>(lane.record_blocks * kBlockBytes - sizeof(RecordHead));
  }
  if (is_timed(head)) note_rows(head, lane.progress.rows);
  head.own = {kNoBlock, lane.batch, lane.last, kNoBlock};
  if (head.kind == RecordKind::group) {
    begin_group(lane);
  } else {
    add(lane_index, lane.cursor, budget);
    ++lane.place;
  }
  go_on_behind(lane);
  return true;
}

void BatchPlanner::go_on_behind(Lane& lane) noexcept {
  lane.cursor = pool_.next(lane.last);
  lane.begun = false;
  lane.blocks += lane.record_blocks;
}

// ------------------------------------------------------------------------------ groups

void BatchPlanner::begin_group(Lane& lane) noexcept {
  lane.group = lane.cursor;
  lane.first_member = lane.last_member = kNoBlock;
  lane.members_left = pool_.head(lane.cursor).rows;
  lane.group_blocks = 1;
}

/// True if a member has the options of its group, and an actuator that no other member has.
bool BatchPlanner::fits_group(std::uint32_t lane_index, const RecordHead& head) noexcept {
  if (head.actuator >= actuators_) return false;
  const Lane& lane = lanes_[lane_index];
  const RecordHead& group = pool_.head(lane.group);
  Target& to = target(lane_index, head.actuator);
  const bool is_new = std::exchange(to.group, lane.group) != lane.group;
  const bool is_first = lane.first_member == kNoBlock;
  const bool same_rows = is_first || head.rows == pool_.head(lane.first_member).rows;
  return is_new && same_rows && head.mode == group.mode && head.pace == group.pace &&
         head.profile == group.profile && head.start == group.start && head.amount == group.amount;
}

void BatchPlanner::add_member(Lane& lane) noexcept {
  RecordHead& head = pool_.head(lane.cursor);
  head.kind = RecordKind::command;
  if (is_timed(head)) note_rows(head, lane.progress.rows);
  head.id = kMemberMark | lane.group;
  head.own = {kNoBlock, lane.batch, lane.last, kNoBlock};
  (lane.first_member == kNoBlock ? lane.first_member
                                 : pool_.head(lane.last_member).own[Own::kNextStep]) = lane.cursor;
  lane.last_member = lane.cursor;
  --lane.members_left;
}

/// Adds the members of a complete group, which go to their queues like other commands.
void BatchPlanner::complete_group(std::uint32_t lane_index, std::uint32_t& budget) noexcept {
  Lane& lane = lanes_[lane_index];
  CommandGroup group;
  group.open = static_cast<std::uint16_t>(pool_.head(lane.group).rows);
  CommandGroups(pool_).at(lane.group) = group;
  for (BlockIndex member = lane.first_member; member != kNoBlock;) {
    const BlockIndex record = member;
    member = std::exchange(pool_.head(record).own[Own::kNextStep], kNoBlock);
    add(lane_index, record, budget);
    spend(budget, 1);
  }
  lane.group = kNoBlock;
  ++lane.groups;
  ++lane.place;
}

/// Replaces an invalid group by one invalid record with all its blocks read so far.
void BatchPlanner::fail_group(std::uint32_t lane_index, std::uint32_t& budget) noexcept {
  Lane& lane = lanes_[lane_index];
  RecordHead& head = pool_.head(lane.group);
  head.kind = RecordKind::invalid_list;
  head.payload_bytes =
      static_cast<std::uint32_t>(lane.group_blocks * kBlockBytes - sizeof(RecordHead));
  head.own = {kNoBlock, lane.batch, lane.last, kNoBlock};
  const BlockIndex group = std::exchange(lane.group, kNoBlock);
  add(lane_index, group, budget);
  ++lane.place;
}

/// True if the record exceeds the limits of a batch. pulse() refuses such a batch, but a frontend
/// can write its lane directly.
bool BatchPlanner::is_one_too_many(Lane& lane, const RecordHead& head) const noexcept {
  switch (head.kind) {
    case RecordKind::request:
    case RecordKind::resume:
      return lane.effort.requests >= kMostRequests;
    case RecordKind::take_control:
    case RecordKind::release_control:
      return ++lane.control_orders > kMostControlOrders;
    default:
      return false;
  }
}

// ------------------------------------------------------------------------------ what was planned

Effort BatchPlanner::effort(BlockIndex batch) const noexcept {
  if (known_[batch] != Known::plan) return {.work = kBatchWork};
  const BatchRecord& record = pool_.batch(batch);
  const std::uint32_t traits = record.own[kTraits];
  return {record.blocks,
          traits & kRequests,
          (traits & kIsExpress) != 0,
          (traits & kReleases) != 0,
          (traits & kMoves) != 0,
          (traits & kFree) != 0};
}

std::optional<Plan> BatchPlanner::plan(BlockIndex batch) noexcept {
  const Known known = std::exchange(known_[batch], Known::nothing);
  if (known != Known::plan) return std::nullopt;
  const auto& own = pool_.batch(batch).own;
  const BlockIndex last = pool_.chain(batch).last;
  return Plan{own[kFirstStep],
              own[kMissingFrom],
              {own[kSpareFirst], last, own[kSpareBlocks]},
              own[kTraits] >> kFirstGroupBit};
}

void BatchPlanner::forget(std::uint32_t lane, BlockIndex batch) noexcept {
  known_[batch] = Known::nothing;
  if (lanes_[lane].batch == batch) lanes_[lane].batch = kNoBlock;
}

}  // namespace o80
