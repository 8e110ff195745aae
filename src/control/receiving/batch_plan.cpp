#include "control/receiving/batch_plan.hpp"

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>

#include "control/receiving/chunk_rows.hpp"

namespace o80 {
namespace {

// work of a batch and of a step; copying a block is 1
constexpr std::uint32_t kBatchWork = 6;
constexpr std::uint32_t kStepWork = 2;
constexpr std::uint32_t kChunkWork = 16;    // for each member: finds its rows
constexpr std::uint32_t kRequestWork = 16;  // plus 1 for each actuator: it may make a fresh start

/// The plan of a checked batch, stored over the end of its record, which is not needed any more.
Plan& stored_plan(BlockPool& pool, BlockIndex batch) noexcept {
  constexpr std::size_t kAt = offsetof(BatchRecord, blocks);
  static_assert(kAt + sizeof(Plan) == sizeof(BatchRecord));
  return *reinterpret_cast<Plan*>(pool.bytes(batch) + kAt);
}

}  // namespace

/// What is known of a batch that is being checked.
struct BatchPlanner::Batch {
  BlockIndex batch = kNoBlock;
  BlockIndex cursor = kNoBlock;  // first block of the record being checked
  bool begun = false;            // the check of the record has begun
  RecordCheck::Verdict verdict = RecordCheck::Verdict::unfinished;
  BlockIndex last = kNoBlock;  // last block of the record that was reached
  std::uint32_t to_walk = 0;   // blocks from `last` to the end of the record
  BlockIndex last_step = kNoBlock;
  std::uint32_t place = 0;
  std::uint32_t record_blocks = 0;
  std::uint32_t blocks = 1;  // blocks of the batch that are checked
  Plan plan{.effort = {.work = kBatchWork, .express = 1}};
  std::uint32_t control_orders = 0;
  std::uint32_t free = 0;  // resumes, marks and closed plans
  // the group whose members are being checked
  BlockIndex group = kNoBlock;
  BlockIndex first_member = kNoBlock;
  BlockIndex last_member = kNoBlock;
  std::uint32_t members_left = 0;
  std::uint32_t group_blocks = 0;
};

/// The check of the batches of one lane.
struct BatchPlanner::Lane : Batch {
  using Verdict = RecordCheck::Verdict;
  /// Effect of the present part of a batch on one queue, before its own commands are appended.
  struct Done {
    bool empty = false;      // all commands are dropped
    bool empty_own = false;  // all commands of this lane are dropped
    bool at_rest = false;    // the actuator brakes
    bool purged = false;     // all commands are purged
  };

  /// One actuator in the present part of the batch of a lane.
  struct Target {
    std::uint64_t epoch = 0;      // valid while it equals Lane::epoch
    BlockIndex list = kNoBlock;   // commands that will be appended, unless they are dropped
    bool list_is_step = false;    // its first command overwrites, and is a step already
    bool listed = false;          // is in Lane::listed
    BlockIndex group = kNoBlock;  // the last group with a member of this actuator
    Done done;
  };

  Lane(Shared& used, std::size_t actuators) : shared(used), pool(used.pool), targets(actuators) {
    listed.reserve(actuators);
  }

  Shared& shared;
  BlockPool& pool;
  RecordCheck::Progress progress;
  std::uint32_t budget = 0;
  // the present part
  std::uint64_t epoch = 0;
  std::array<BlockIndex, 4> ends{};   // first records of the lists with an end status
  Done all;                           // effect on every queue
  std::vector<std::uint16_t> listed;  // actuators with a list
  std::vector<Target> targets;        // one for each actuator

  void complete(const BatchRecord& record) noexcept {
    if (group != kNoBlock) fail_group();  // incomplete
    end_part();
    const bool bursts = record.burst != 0 || (record.flags & kBurstUntilEnded) != 0;
    if (place < record.records) plan.effort.express = 0;
    plan.effort.free = free > 0 && free == record.records && !bursts ? 1 : 0;
    plan.missing_from = place;
    plan.spare_first = cursor;
    plan.spare_blocks = pool.chain(batch).blocks - blocks;
    stored_plan(pool, batch) = plan;
    batch = kNoBlock;
  }

  bool check_record() noexcept {
    if (!begun) {
      begin_record();
      --budget;
    }
    if (verdict == Verdict::unfinished) {
      verdict = shared.check.advance(pool, cursor, progress, budget);
      if (verdict == Verdict::unfinished) return false;
      stop_reading();
    }
    for (; to_walk > 0; --to_walk, --budget) {
      if (budget == 0) return false;
      last = pool.next(last);
    }
    RecordHead& head = pool.head(cursor);
    const bool is_member = group != kNoBlock;
    const bool fits = is_member ? fits_group(head) : !is_one_too_many(head);
    const bool valid = fits && verdict == Verdict::valid;
    if (is_member) {
      group_blocks += record_blocks;
      if (valid) {
        add_member(head);
      } else {
        fail_group();
      }
    } else if (valid && head.kind == RecordKind::group) {
      enter(head);
      group = cursor;
      first_member = kNoBlock;
      members_left = head.rows;
      group_blocks = record_blocks;
    } else {
      put(cursor, valid ? 0 : record_blocks);
    }
    cursor = pool.next(last);
    begun = false;
    blocks += record_blocks;
    return true;
  }

  void begin_record() noexcept {
    const RecordHead& head = pool.head(cursor);
    const BlockChain chain = pool.chain(batch);
    const std::uint64_t claimed = blocks_of(head.payload_bytes);
    const std::uint32_t there = chain.blocks - blocks;
    begun = true;
    verdict = Verdict::invalid;
    last = cursor;
    to_walk = 0;
    if (claimed > there) {
      // it gets the remaining blocks
      record_blocks = there;
      last = chain.last;
      return;
    }
    record_blocks = static_cast<std::uint32_t>(claimed);
    const bool is_wanted = (head.kind == RecordKind::member) == (group != kNoBlock);
    if (!is_wanted || head.id != record_id(pool.batch(batch).id, place)) {
      to_walk = record_blocks - 1;
      return;
    }
    verdict = shared.check.begin(pool, cursor, progress);
    if (verdict != Verdict::unfinished) stop_reading();
  }

  /// After the check of a record: computes how many blocks remain to its end.
  void stop_reading() noexcept {
    const Cursor& payload = progress.payload;
    const std::uint64_t here = kBlockBytes - payload.offset();
    const std::uint64_t behind = payload.left() > here ? payload.left() - here : 0;
    last = payload.block();
    to_walk = static_cast<std::uint32_t>((behind + kBlockBytes - 1) / kBlockBytes);
  }

  /// Prepares a checked record, which ends at `last`, for the lists of the backend.
  void enter(RecordHead& head) noexcept {
    if (is_timed(head)) note_rows(head, progress.rows);
    head.own = {kNoBlock, batch, last, kNoBlock};
  }

  /// Adds a record of the batch. If it is invalid, so many blocks become one invalid record.
  void put(BlockIndex record, std::uint32_t invalid_blocks) noexcept {
    RecordHead& head = pool.head(record);
    if (invalid_blocks > 0) {
      head.kind = RecordKind::invalid_list;
      head.id = record_id(pool.batch(batch).id, place);
      head.payload_bytes =
          static_cast<std::uint32_t>(invalid_blocks * kBlockBytes - sizeof(RecordHead));
    }
    enter(head);
    add(record);
    ++place;
  }

  /// True beyond the limits of a batch: pulse() refuses it, but a lane can be written directly.
  bool is_one_too_many(const RecordHead& head) noexcept {
    using enum RecordKind;
    const bool is_request = head.kind == request || head.kind == resume;
    const bool is_order =
        head.kind == take_control || head.kind == release_control || head.kind == close_plan;
    return (is_request && plan.effort.requests >= kMaxRequests) ||
           (is_order && ++control_orders > kMaxOrders);
  }

  /// True if a member has the options of its group, and an actuator that no other member has.
  bool fits_group(const RecordHead& head) noexcept {
    if (head.actuator >= targets.size()) return false;
    const RecordHead& of = pool.head(group);
    const bool is_new = std::exchange(target(head.actuator).group, group) != group;
    const bool is_first = first_member == kNoBlock;
    const bool same_rows =
        is_first ? !is_chunk(head) || !is_chunk(of) || head.rows == chunk_of(pool, group).rows
                 : head.rows == pool.head(first_member).rows;
    return is_new && same_rows && head.mode == of.mode && head.pace == of.pace &&
           head.profile == of.profile && head.start == of.start && head.amount == of.amount;
  }

  void add_member(RecordHead& head) noexcept {
    head.kind = RecordKind::command;
    enter(head);
    head.id = kMemberMark | group;
    (first_member == kNoBlock ? first_member : pool.head(last_member).own[Own::kNextStep]) = cursor;
    last_member = cursor;
    if (--members_left > 0) return;

    // the members of a complete group go to their queues like other commands
    CommandGroups(pool).begin(group);
    if (is_chunk(pool.head(group))) return add_chunk();
    for (BlockIndex member = first_member; member != kNoBlock;) {
      const BlockIndex record = member;
      member = std::exchange(pool.head(record).own[Own::kNextStep], kNoBlock);
      add(record);
      spend(1);
    }
    group = kNoBlock;
    ++plan.effort.groups;
    ++place;
  }

  /// A chunk is one step: its members wait, linked, until it begins.
  void add_chunk() noexcept {
    std::uint32_t work = 0;
    for (BlockIndex member = first_member; member != kNoBlock; work += kChunkWork) {
      RecordHead& head = pool.head(member);
      member = head.own[Own::kNext] = std::exchange(head.own[Own::kNextStep], kNoBlock);
      spend(1);
    }
    pool.head(group).own[Own::kNext] = first_member;
    plan.effort.express = 0;
    plan.effort.moves = 1;
    ++plan.effort.groups;
    end_part();
    add_step(std::exchange(group, kNoBlock), work);
    ++place;
  }

  /// Replaces an invalid group by one invalid record with all its blocks read so far.
  void fail_group() noexcept { put(std::exchange(group, kNoBlock), group_blocks); }

  void add(BlockIndex record) noexcept {
    shared.tails[record] = record;
    const RecordHead& head = pool.head(record);
    switch (head.kind) {
      case RecordKind::command:
        plan.effort.express = 0;
        plan.effort.moves = 1;
        return add_command(record);
      case RecordKind::purge:
        return add_purge(record);
      case RecordKind::request:
      case RecordKind::resume:
        if (head.kind == RecordKind::resume) {
          ++free;
        } else if (!shared.while_halted[head.actuator]) {
          plan.effort.moves = 1;
        }
        // a resume makes a fresh start too. It is never express: if it overtook commands that were
        // sent during the halt, they would act instead of being rejected
        plan.effort.express = 0;
        ++plan.effort.requests;
        end_part();
        return add_step(record, kRequestWork + static_cast<std::uint32_t>(targets.size()));
      case RecordKind::mark:
        plan.effort.express = 0;
        ++free;
        return add_to_end(RecordKind::completed_list, record);
      case RecordKind::close_plan:
        // never express: it would overtake the chunks that it closes
        plan.effort.express = 0;
        ++free;
        return add_step(record, kStepWork + static_cast<std::uint32_t>(targets.size()));
      case RecordKind::release_control:
        plan.effort.releases = 1;
        [[fallthrough]];
      case RecordKind::take_control:
        return add_step(record, kStepWork);
      default:
        plan.effort.express = 0;
        add_to_end(RecordKind::invalid_list, record);
    }
  }

  void add_command(BlockIndex record) noexcept {
    const RecordHead& head = pool.head(record);
    Target& to = target(head.actuator);
    if (!std::exchange(to.listed, true)) listed.push_back(head.actuator);
    if (head.mode == Mode::queue) {
      if (to.list != kNoBlock) return join(to.list, record);
      to.list = record;
      to.list_is_step = false;
      return;
    }
    drop_list(to, RecordKind::overwritten_list);
    to.list = record;
    to.list_is_step = !to.done.empty;
    if (to.list_is_step) add_step(record, kStepWork);
    to.done.empty = to.done.empty_own = true;
  }

  void add_purge(BlockIndex record) noexcept {
    const RecordHead& head = pool.head(record);
    const bool own = head.only_own != 0;
    const bool every = head.actuator == kEveryActuator;
    if (!(every ? purge_all(own) : purge_one(head.actuator, own))) {
      return add_to_end(RecordKind::completed_list, record);
    }
    add_step(record, kStepWork + (every ? static_cast<std::uint32_t>(targets.size()) : 0));
  }

  /// True if the purge affects the queue, besides dropping commands that this part would append.
  bool purge_one(std::uint32_t actuator, bool own) noexcept {
    Target& to = target(actuator);
    drop_list(to, RecordKind::purged_list);
    const Done before = to.done;
    if (!own) {
      to.done = {.empty = true, .empty_own = true, .at_rest = true, .purged = true};
      return !before.purged;
    }
    to.done.empty_own = true;
    to.done.at_rest = before.at_rest || before.empty;
    return !before.empty_own || (before.empty && !before.at_rest);
  }

  bool purge_all(bool own) noexcept {
    bool does_something = own ? !all.empty_own : !all.purged;
    for (const std::uint16_t actuator : listed) {
      does_something = purge_one(actuator, own) || does_something;
      target(actuator).listed = false;
      spend(1);
    }
    listed.clear();
    all.empty_own = true;
    if (!own) {
      all = {.empty = true, .empty_own = true, .at_rest = true, .purged = true};
      ++epoch;  // every target starts again from `all`
    }
    return does_something;
  }

  /// Ends a part: adds a step for each list of commands that was not dropped.
  void end_part() noexcept {
    for (const std::uint16_t actuator : listed) {
      const Target& to = target(actuator);
      spend(1);
      if (to.list == kNoBlock || to.list_is_step) continue;
      pool.head(to.list).mode = Mode::queue;  // the queue is empty
      add_step(to.list, kStepWork);
    }
    begin_part();
  }

  void begin_part() noexcept {
    ++epoch;
    listed.clear();
    all = {};
    ends.fill(kNoBlock);
  }

  void drop_list(Target& to, RecordKind end) noexcept {
    const BlockIndex list = std::exchange(to.list, kNoBlock);
    if (list == kNoBlock) return;
    if (!to.list_is_step) return add_to_end(end, list);
    pool.head(list).kind = end == RecordKind::overwritten_list ? RecordKind::overwriter_overwritten
                                                               : RecordKind::overwriter_purged;
  }

  void add_to_end(RecordKind end, BlockIndex list) noexcept {
    constexpr auto kFirst = static_cast<std::size_t>(RecordKind::overwritten_list);
    BlockIndex& first = ends[static_cast<std::size_t>(end) - kFirst];
    if (first != kNoBlock) return join(first, list);
    first = list;
    pool.head(list).kind = end;
    add_step(list, kStepWork);
  }

  void add_step(BlockIndex record, std::uint32_t step_work) noexcept {
    plan.effort.work += step_work;
    (last_step == kNoBlock ? plan.steps : pool.head(last_step).own[Own::kNextStep]) = record;
    last_step = record;
  }

  /// Appends a list of records, or a single one, to another list.
  void join(BlockIndex list, BlockIndex first) noexcept {
    pool.head(shared.tails[list]).own[Own::kNext] = first;
    shared.tails[list] = shared.tails[first];
  }

  Target& target(std::uint32_t actuator) noexcept {
    Target& to = targets[actuator];
    if (to.epoch != epoch) to = {.epoch = epoch, .done = all};
    return to;
  }

  void spend(std::uint32_t spent) noexcept { budget -= std::min(budget, spent); }
};

BatchPlanner::BatchPlanner(const Schema& schema, const Layouts& layouts, BlockPool& pool,
                           std::uint32_t lanes)
    : shared_{pool, RecordCheck(schema, layouts), std::vector(pool.size(), kNoBlock), {}},
      known_(pool.size(), Known::nothing) {
  lanes_.reserve(lanes);
  for (std::uint32_t i = 0; i < lanes; ++i) lanes_.emplace_back(shared_, schema.actuators.size());
  for (const RequestRow& request : schema.requests) {
    shared_.while_halted.push_back(request.while_halted != 0);
  }
}

BatchPlanner::~BatchPlanner() = default;

bool BatchPlanner::check(std::uint32_t lane_index, BlockIndex batch,
                         std::uint32_t& budget) noexcept {
  if (known_[batch] != Known::nothing) return true;
  Lane& lane = lanes_[lane_index];
  const BatchRecord& record = shared_.pool.batch(batch);
  if (lane.batch != batch) {
    if (record.kind != RecordKind::batch || record.records >= record.blocks ||
        record.blocks != shared_.pool.chain(batch).blocks) {
      known_[batch] = Known::garbage;
      return true;
    }
    static_cast<Batch&>(lane) = {};
    lane.batch = batch;
    lane.cursor = shared_.pool.next(batch);
    lane.begin_part();
  }
  lane.budget = budget;
  bool continues = true;
  while (continues && lane.place < record.records && lane.cursor != kNoBlock) {
    continues = lane.budget > 0 && lane.check_record();
  }
  if (continues) {
    lane.complete(record);
    known_[batch] = Known::plan;
  }
  budget = lane.budget;
  return continues;
}

Effort BatchPlanner::effort(BlockIndex batch) const noexcept {
  if (known_[batch] != Known::plan) return {.work = kBatchWork};
  return stored_plan(shared_.pool, batch).effort;
}

std::optional<Plan> BatchPlanner::plan(BlockIndex batch) noexcept {
  const Known known = std::exchange(known_[batch], Known::nothing);
  if (known != Known::plan) return std::nullopt;
  return stored_plan(shared_.pool, batch);
}

void BatchPlanner::forget(std::uint32_t lane, BlockIndex batch) noexcept {
  known_[batch] = Known::nothing;
  if (lanes_[lane].batch == batch) lanes_[lane].batch = kNoBlock;
}

}  // namespace o80
