#include "control/batch_plan.hpp"

#include <algorithm>
#include <bit>
#include <utility>

namespace o80 {
namespace {

constexpr std::uint32_t kBatchWork = 6;  // work of a batch; copying a block is 1

}  // namespace

BatchPlanner::BatchPlanner(const Schema& schema, const Layouts& layouts, BlockPool& pool,
                           std::uint32_t lanes)
    : pool_(pool),
      check_(schema, layouts),
      lanes_(lanes),
      tails_(pool.size(), kNoBlock),
      known_(pool.size(), Known::nothing) {
  for (Lane& lane : lanes_) {
    lane.listed.reserve(schema.actuators.size());
    lane.targets.resize(schema.actuators.size());
  }
  for (const RequestRow& request : schema.requests)
    while_halted_.push_back(request.while_halted != 0);
}

bool BatchPlanner::check(std::uint32_t lane_index, BlockIndex batch,
                         std::uint32_t& budget) noexcept {
  if (known_[batch] != Known::nothing) return true;
  Lane& lane = lanes_[lane_index];
  BatchRecord& record = pool_.batch(batch);
  if (lane.batch != batch) {
    if (record.kind != RecordKind::batch || record.records >= record.blocks ||
        record.blocks != pool_.chain(batch).blocks) {
      known_[batch] = Known::garbage;
      return true;
    }
    static_cast<Batch&>(lane) = {};
    lane.batch = batch;
    lane.cursor = pool_.next(batch);
    lane.work = kBatchWork;
    begin_part(lane);
  }
  lane.budget = budget;
  bool goes_on = true;
  while (goes_on && lane.place < record.records && lane.cursor != kNoBlock) {
    goes_on = lane.budget > 0 && check_record(lane);
  }
  if (goes_on) complete(lane, record);
  budget = lane.budget;
  return goes_on;
}

/// Stores the plan in `BatchRecord::own`, and its work in `BatchRecord::blocks`: the pool knows the
/// count of blocks as well.
void BatchPlanner::complete(Lane& lane, BatchRecord& record) noexcept {
  if (lane.group != kNoBlock) fail_group(lane);  // incomplete
  end_part(lane);
  const bool bursts = record.burst != 0 || (record.flags & kBurstUntilEnded) != 0;
  Plan& plan = lane.plan;
  if (lane.place < record.records) plan.express = 0;
  plan.resumes = lane.resumes > 0 && lane.resumes == record.records && !bursts ? 1 : 0;
  plan.missing_from = lane.place;
  plan.spare_first = lane.cursor;
  plan.spare_blocks = pool_.chain(lane.batch).blocks - lane.blocks;
  record.own = std::bit_cast<decltype(record.own)>(plan);
  record.blocks = lane.work;
  known_[std::exchange(lane.batch, kNoBlock)] = Known::plan;
}

void BatchPlanner::begin_record(Lane& lane) noexcept {
  const RecordHead& head = pool_.head(lane.cursor);
  const BlockChain chain = pool_.chain(lane.batch);
  const std::uint64_t claimed = blocks_of(head.payload_bytes);
  const std::uint32_t there = chain.blocks - lane.blocks;
  lane.begun = true;
  lane.verdict = Verdict::invalid;
  lane.last = lane.cursor;
  lane.to_walk = 0;
  if (claimed > there) {
    // it gets the remaining blocks
    lane.record_blocks = there;
    lane.last = chain.last;
    return;
  }
  lane.record_blocks = static_cast<std::uint32_t>(claimed);
  const bool is_wanted = (head.kind == RecordKind::member) == (lane.group != kNoBlock);
  if (!is_wanted || head.id != record_id(pool_.batch(lane.batch).id, lane.place)) {
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

bool BatchPlanner::check_record(Lane& lane) noexcept {
  if (!lane.begun) {
    begin_record(lane);
    --lane.budget;
  }
  if (lane.verdict == Verdict::unfinished) {
    lane.verdict = check_.go_on(pool_, lane.cursor, lane.progress, lane.budget);
    if (lane.verdict == Verdict::unfinished) return false;
    stop_reading(lane);
  }
  for (; lane.to_walk > 0; --lane.to_walk, --lane.budget) {
    if (lane.budget == 0) return false;
    lane.last = pool_.next(lane.last);
  }
  RecordHead& head = pool_.head(lane.cursor);
  const bool is_member = lane.group != kNoBlock;
  const bool fits = is_member ? fits_group(lane, head) : !is_one_too_many(lane, head);
  const bool valid = fits && lane.verdict == Verdict::valid;
  if (is_member) {
    lane.group_blocks += lane.record_blocks;
    if (valid) {
      add_member(lane, head);
    } else {
      fail_group(lane);
    }
  } else if (valid && head.kind == RecordKind::group) {
    enter(lane, head);
    lane.group = lane.cursor;
    lane.first_member = kNoBlock;
    lane.members_left = head.rows;
    lane.group_blocks = 1;
  } else {
    if (!valid) reject(lane, head, lane.record_blocks);
    enter(lane, head);
    add(lane, lane.cursor);
    ++lane.place;
  }
  lane.cursor = pool_.next(lane.last);
  lane.begun = false;
  lane.blocks += lane.record_blocks;
  return true;
}

/// Prepares a checked record, which ends at `lane.last`, for the lists of the backend.
void BatchPlanner::enter(const Lane& lane, RecordHead& head) noexcept {
  if (is_timed(head)) note_rows(head, lane.progress.rows);
  head.own = {kNoBlock, lane.batch, lane.last, kNoBlock};
}

/// Makes of these blocks one invalid record.
void BatchPlanner::reject(const Lane& lane, RecordHead& head, std::uint32_t blocks) noexcept {
  head.kind = RecordKind::invalid_list;
  head.id = record_id(pool_.batch(lane.batch).id, lane.place);
  head.payload_bytes = static_cast<std::uint32_t>(blocks * kBlockBytes - sizeof(RecordHead));
}

// ------------------------------------------------------------------------------ groups

/// True if a member has the options of its group, and an actuator that no other member has.
bool BatchPlanner::fits_group(Lane& lane, const RecordHead& head) noexcept {
  if (head.actuator >= lane.targets.size()) return false;
  const RecordHead& group = pool_.head(lane.group);
  const bool is_new = std::exchange(target(lane, head.actuator).group, lane.group) != lane.group;
  const bool is_first = lane.first_member == kNoBlock;
  const bool same_rows = is_first || head.rows == pool_.head(lane.first_member).rows;
  return is_new && same_rows && head.mode == group.mode && head.pace == group.pace &&
         head.profile == group.profile && head.start == group.start && head.amount == group.amount;
}

void BatchPlanner::add_member(Lane& lane, RecordHead& head) noexcept {
  head.kind = RecordKind::command;
  enter(lane, head);
  head.id = kMemberMark | lane.group;
  (lane.first_member == kNoBlock ? lane.first_member
                                 : pool_.head(lane.last_member).own[Own::kNextStep]) = lane.cursor;
  lane.last_member = lane.cursor;
  if (--lane.members_left == 0) complete_group(lane);
}

/// Adds the members of a complete group, which go to their queues like other commands.
void BatchPlanner::complete_group(Lane& lane) noexcept {
  CommandGroup group;
  group.open = static_cast<std::uint16_t>(pool_.head(lane.group).rows);
  CommandGroups(pool_).at(lane.group) = group;
  for (BlockIndex member = lane.first_member; member != kNoBlock;) {
    const BlockIndex record = member;
    member = std::exchange(pool_.head(record).own[Own::kNextStep], kNoBlock);
    add(lane, record);
    spend(lane, 1);
  }
  lane.group = kNoBlock;
  ++lane.plan.groups;
  ++lane.place;
}

/// Replaces an invalid group by one invalid record with all its blocks read so far.
void BatchPlanner::fail_group(Lane& lane) noexcept {
  const BlockIndex group = std::exchange(lane.group, kNoBlock);
  RecordHead& head = pool_.head(group);
  reject(lane, head, lane.group_blocks);
  enter(lane, head);
  add(lane, group);
  ++lane.place;
}

/// True if the record exceeds the limits of a batch. pulse() refuses such a batch, but a frontend
/// can write its lane directly.
bool BatchPlanner::is_one_too_many(Lane& lane, const RecordHead& head) noexcept {
  switch (head.kind) {
    case RecordKind::request:
    case RecordKind::resume:
      return lane.plan.requests >= kMostRequests;
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
  const auto plan = std::bit_cast<Plan>(record.own);
  return {record.blocks,      plan.requests,   plan.express != 0,
          plan.releases != 0, plan.moves != 0, plan.resumes != 0};
}

std::optional<Plan> BatchPlanner::plan(BlockIndex batch) noexcept {
  const Known known = std::exchange(known_[batch], Known::nothing);
  if (known != Known::plan) return std::nullopt;
  return std::bit_cast<Plan>(pool_.batch(batch).own);
}

void BatchPlanner::forget(std::uint32_t lane, BlockIndex batch) noexcept {
  known_[batch] = Known::nothing;
  if (lanes_[lane].batch == batch) lanes_[lane].batch = kNoBlock;
}

}  // namespace o80
