// BatchPlanner: converts the checked records of a batch to the steps of its plan.

#include <array>
#include <utility>

#include "control/batch_plan.hpp"

namespace o80 {
namespace {

// work of a step; copying a block is 1
constexpr std::uint32_t kStepWork = 2;
constexpr std::uint32_t kRequestWork = 16;  // plus 1 for each actuator: it may make a fresh start

}  // namespace

void BatchPlanner::add(Lane& lane, BlockIndex record) noexcept {
  tails_[record] = record;
  const RecordHead& head = pool_.head(record);
  switch (head.kind) {
    case RecordKind::command:
      lane.plan.express = 0;
      lane.plan.moves = 1;
      return add_command(lane, record);
    case RecordKind::purge:
      return add_purge(lane, record);
    case RecordKind::request:
    case RecordKind::resume:
      if (head.kind == RecordKind::resume) {
        ++lane.resumes;
      } else if (!while_halted_[head.actuator]) {
        lane.plan.moves = 1;
      }
      // a resume makes a fresh start too. It is never express: if it overtook commands that were
      // sent during the halt, they would act instead of being rejected
      lane.plan.express = 0;
      ++lane.plan.requests;
      end_part(lane);
      return add_step(lane, record, kRequestWork + static_cast<std::uint32_t>(lane.targets.size()));
    case RecordKind::release_control:
      lane.plan.releases = 1;
      [[fallthrough]];
    case RecordKind::take_control:
      return add_step(lane, record, kStepWork);
    default:
      lane.plan.express = 0;
      add_to_end(lane, End::invalid, record);
  }
}

void BatchPlanner::add_command(Lane& lane, BlockIndex record) noexcept {
  const RecordHead& head = pool_.head(record);
  Target& to = target(lane, head.actuator);
  if (!std::exchange(to.listed, true)) lane.listed.push_back(head.actuator);
  if (head.mode == Mode::queue) {
    if (to.list != kNoBlock) return join(to.list, record, record);
    to.list = record;
    to.list_is_step = false;
    return;
  }
  drop_list(lane, to, End::overwritten);
  to.list = record;
  to.list_is_step = !to.done.empty;
  if (to.list_is_step) add_step(lane, record, kStepWork);
  to.done.empty = to.done.empty_own = true;
}

void BatchPlanner::add_purge(Lane& lane, BlockIndex record) noexcept {
  const RecordHead& head = pool_.head(record);
  const bool own = head.only_own != 0;
  const bool all = head.actuator == kEveryActuator;
  const bool does_something = all ? purge_all(lane, own) : purge_one(lane, head.actuator, own);
  if (!does_something) return add_to_end(lane, End::completed, record);
  add_step(lane, record, kStepWork + (all ? static_cast<std::uint32_t>(lane.targets.size()) : 0));
}

/// True if the purge affects the queue, besides dropping commands that this part would append.
bool BatchPlanner::purge_one(Lane& lane, std::uint32_t actuator, bool own) noexcept {
  Target& to = target(lane, actuator);
  drop_list(lane, to, End::purged);
  const Done before = to.done;
  if (!own) {
    to.done = {.empty = true, .empty_own = true, .at_rest = true, .purged = true};
    return !before.purged;
  }
  to.done.empty_own = true;
  to.done.at_rest = before.at_rest || before.empty;
  return !before.empty_own || (before.empty && !before.at_rest);
}

bool BatchPlanner::purge_all(Lane& lane, bool own) noexcept {
  bool does_something = own ? !lane.all.empty_own : !lane.all.purged;
  for (const std::uint16_t actuator : lane.listed) {
    does_something = purge_one(lane, actuator, own) || does_something;
    target(lane, actuator).listed = false;
    spend(lane, 1);
  }
  lane.listed.clear();
  lane.all.empty_own = true;
  if (!own) {
    lane.all = {.empty = true, .empty_own = true, .at_rest = true, .purged = true};
    ++lane.epoch;  // every Target starts again from `all`
  }
  return does_something;
}

/// Ends a part: adds a step for each list of commands that was not dropped.
void BatchPlanner::end_part(Lane& lane) noexcept {
  for (const std::uint16_t actuator : lane.listed) {
    const Target& to = target(lane, actuator);
    spend(lane, 1);
    if (to.list == kNoBlock || to.list_is_step) continue;
    pool_.head(to.list).mode = Mode::queue;  // the queue is empty
    add_step(lane, to.list, kStepWork);
  }
  begin_part(lane);
}

void BatchPlanner::begin_part(Lane& lane) noexcept {
  ++lane.epoch;
  lane.listed.clear();
  lane.all = {};
  lane.ends.fill(kNoBlock);
}

void BatchPlanner::drop_list(Lane& lane, Target& to, End end) noexcept {
  if (to.list == kNoBlock) return;
  if (to.list_is_step) {
    pool_.head(to.list).kind = end == End::overwritten ? RecordKind::overwriter_overwritten
                                                       : RecordKind::overwriter_purged;
  } else {
    add_to_end(lane, end, to.list);
  }
  to.list = kNoBlock;
}

void BatchPlanner::add_to_end(Lane& lane, End end, BlockIndex list) noexcept {
  constexpr std::array<RecordKind, 4> kKinds = {
      RecordKind::invalid_list, RecordKind::overwritten_list, RecordKind::purged_list,
      RecordKind::completed_list};
  BlockIndex& first = lane.ends[static_cast<std::size_t>(end)];
  if (first != kNoBlock) return join(first, list, tails_[list]);
  first = list;
  pool_.head(list).kind = kKinds[static_cast<std::size_t>(end)];
  add_step(lane, list, kStepWork);
}

void BatchPlanner::add_step(Lane& lane, BlockIndex record, std::uint32_t work) noexcept {
  lane.work += work;
  (lane.last_step == kNoBlock ? lane.plan.steps : pool_.head(lane.last_step).own[Own::kNextStep]) =
      record;
  lane.last_step = record;
}

void BatchPlanner::join(BlockIndex list, BlockIndex first, BlockIndex last) noexcept {
  pool_.head(tails_[list]).own[Own::kNext] = first;
  tails_[list] = last;
}

BatchPlanner::Target& BatchPlanner::target(Lane& lane, std::uint32_t actuator) noexcept {
  Target& to = lane.targets[actuator];
  if (to.epoch != lane.epoch) to = {.epoch = lane.epoch, .done = lane.all};
  return to;
}

}  // namespace o80
