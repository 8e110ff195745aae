#include "scripts/script_world.hpp"

#include <algorithm>
#include <utility>

namespace o80::test {
namespace {

constexpr std::uint32_t kEveryLane = 0xFFFF'FFFF;

bool bit_of(const std::uint64_t* mask, std::size_t actuator) {
  return (mask[actuator / 64] >> (actuator % 64) & 1) != 0;
}

}  // namespace

ScriptWorld::ScriptWorld(const Script& played) : script(played), rig(played.schema(), 1 << 13) {
  actuators.resize(script.actuators.size());
  running_.resize(script.actuators.size());
  for (std::size_t a = 0; a < actuators.size(); ++a) {
    const ActuatorRow& row = rig.schema.actuators[a];
    rig.schema.each_scalar(
        row.type,
        [&](std::uint32_t offset, const FieldRow&) {
          actuators[a].numbers.push_back({.offset = offset, .reading = {}});
        },
        row.offset);
  }
  for (std::size_t a = 0; a < actuators.size(); ++a) {
    for (std::size_t n = 0; n < actuators[a].numbers.size(); ++n) {
      const NumberSpec& spec = script.actuators[a].numbers[n];
      store_as(spec.kind, spec.start, rig.observed.data() + actuators[a].numbers[n].offset);
    }
  }
  rig.next = 0;
  restart(nullptr);
}

void ScriptWorld::observe() {
  for (std::size_t a = 0; a < actuators.size(); ++a) {
    for (std::size_t n = 0; n < actuators[a].numbers.size(); ++n) {
      const NumberTrack& track = actuators[a].numbers[n];
      const Kind kind = script.actuators[a].numbers[n].kind;
      std::byte* at = rig.observed.data() + track.offset;
      if (track.reading) {
        store_as(kind, *track.reading, at);
      } else {
        std::copy_n(rig.controller.desired() + track.offset, bytes_of_kind(kind), at);
      }
    }
  }
}

void ScriptWorld::look() {
  for (std::size_t a = 0; a < actuators.size(); ++a) {
    ActuatorTrack& actuator = actuators[a];
    for (std::size_t n = 0; n < actuator.numbers.size(); ++n) {
      NumberTrack& track = actuator.numbers[n];
      track.before = track.now;
      track.now =
          load_as(script.actuators[a].numbers[n].kind, rig.controller.desired() + track.offset);
    }
    actuator.active = bit_of(rig.controller.active_mask(), a);
    actuator.clamped = bit_of(rig.controller.clamped_mask(), a);
    actuator.braking = bit_of(rig.controller.braking_mask(), a);
  }
}

void ScriptWorld::add(const ScriptStep& step, std::size_t place) {
  const ActuatorSpec& spec = script.actuators.at(step.actuator);
  const auto& numbers = actuators[step.actuator].numbers;
  const ActuatorRow& row = rig.schema.actuators[step.actuator];
  const std::uint32_t size = rig.schema.types[row.type].size;
  const std::size_t rows = step.values.size() / numbers.size();

  std::vector<std::byte> states(rows * size);
  for (std::size_t i = 0; i < rows * numbers.size(); ++i) {
    const std::size_t number = i % numbers.size();
    store_as(spec.numbers[number].kind, step.values[i],
             states.data() + i / numbers.size() * size + (numbers[number].offset - row.offset));
  }
  RecordHead head = step.head;
  head.actuator = step.actuator;
  std::vector<std::uint64_t> mask;
  if (step.mask != 0) mask.push_back(step.mask);
  LaneBatch& batch = batches_[step.lane];
  if (batch.first != nullptr && batch.first->group != step.group) add_group(batch);
  if (step.group != 0) {
    if (batch.first == nullptr) batch.first = &step;
    batch.rows = static_cast<std::uint32_t>(rows);
    batch.commands.push_back({place, batch.builder.records(), true});
    batch.group.push_back({head, mask, states});
    return;
  }
  const std::uint32_t at =
      batch.builder.command(head, mask, step.times, static_cast<std::uint32_t>(rows), states);
  batch.commands.push_back({place, at, false});
}

void ScriptWorld::add_group(LaneBatch& batch) {
  const ScriptStep* first = std::exchange(batch.first, nullptr);
  if (first == nullptr) return;
  std::vector<BatchBuilder::Member> members;
  for (const Member& member : batch.group) {
    members.push_back({member.head, member.mask, member.states});
  }
  batch.builder.group(members, first->times, batch.rows);
  batch.group.clear();
}

void ScriptWorld::pulse(std::uint32_t lane) {
  LaneBatch& batch = batches_[lane];
  add_group(batch);
  BatchRecord record;
  CommandId& used = rig.used_ids[lane];
  record.id = used + 1;
  used += 2 + batch.builder.records();
  blocks_sent += batch.builder.blocks();
  for (const Pending& pending : batch.commands) {
    const ScriptStep& step = script.steps[pending.step];
    if (step.head.mode == Mode::overwrite) {
      end_members(step.actuator, kEveryLane, Status::overwritten, rig.next);
    }
    SentCommand& command = commands_.emplace_back();
    command.step = pending.step;
    command.lane = lane;
    command.id = record_id(record.id, pending.place);
    command.is_member = pending.is_member;
    sent.push_back(&command);
    records_[{lane, command.id}].push_back(&command);
    if (command.is_member) members.push_back(&command);
  }
  const BlockIndex first = rig.place(batch.builder.seal(record));
  rig.controller.take(lane, first, rig);
  batch.builder.clear();
  batch.commands.clear();
}

void ScriptWorld::act(const ScriptStep& step, std::size_t place) {
  switch (step.action) {
    case Action::command:
      return add(step, place);
    case Action::pulse:
      return pulse(step.lane);
    case Action::purge:
      return purge(step.actuator);
    case Action::purge_own:
      rig.controller.purge_lane(step.lane, step.actuator, rig.next);
      note_drop(step.actuator, false);
      return end_members(step.actuator, step.lane, Status::purged, rig.next);
    case Action::interrupt:
      rig.controller.interrupt(step.actuator, iteration);
      note_drop(step.actuator, false);
      return end_members(step.actuator, kEveryLane, Status::interrupted, iteration);
    case Action::halt:
      rig.controller.halt(rig.next);
      note_drop(kEveryActuator);
      return end_members(kEveryActuator, kEveryLane, Status::halted, rig.next);
    case Action::restart:
      return restart(nullptr);
    case Action::restart_with:
      return restart(&step.values);
    case Action::read:
      actuators.at(step.actuator).numbers.at(step.number).reading = step.values.at(0);
      return;
    case Action::track:
      for (ActuatorTrack& actuator : actuators) {
        for (NumberTrack& number : actuator.numbers) number.reading.reset();
      }
      return;
    default:
      return;
  }
}

void ScriptWorld::purge(std::uint16_t actuator) {
  rig.controller.purge(actuator, rig.next);
  note_drop(actuator);
  end_members(actuator, kEveryLane, Status::purged, rig.next);
}

/// Members of groups leave them.
void ScriptWorld::end_members(std::uint16_t actuator, std::uint32_t lane, Status status,
                              Iteration at) {
  std::erase_if(members, [&](SentCommand* member) {
    const bool ends = (actuator == kEveryActuator || step_of(*member).actuator == actuator) &&
                      (lane == kEveryLane || member->lane == lane);
    if (!ends) return false;
    member->status = status;
    member->ended_at = at;
    first_ends_.try_emplace({member->lane, member->id}, status);
    return true;
  });
}

void ScriptWorld::restart(const std::vector<double>* desired) {
  std::vector<std::byte> states;
  if (rig.next > 0) observe();
  if (desired != nullptr) {
    states.resize(rig.observed.size());
    std::size_t i = 0;
    for (std::size_t a = 0; a < actuators.size(); ++a) {
      for (std::size_t n = 0; n < actuators[a].numbers.size(); ++n, ++i) {
        const double value = i < desired->size() ? (*desired)[i] : 0.0;
        store_as(script.actuators[a].numbers[n].kind, value,
                 states.data() + actuators[a].numbers[n].offset);
      }
    }
  }
  rig.controller.restart(rig.observed.data(), desired != nullptr ? states.data() : nullptr,
                         rig.next);
  end_members(kEveryActuator, kEveryLane, Status::purged, rig.next);
  iteration = rig.next++;
  note_drop(kEveryActuator);
  look();
  for (ActuatorTrack& actuator : actuators) {
    actuator.driver = actuator.previous = actuator.last = nullptr;
    for (NumberTrack& track : actuator.numbers) track.before = track.now;
  }
}

void ScriptWorld::note_drop(std::uint16_t actuator, bool surely) {
  for (std::size_t a = 0; a < actuators.size(); ++a) {
    if (actuator != kEveryActuator && actuator != a) continue;
    (surely ? actuators[a].dropped_at : actuators[a].maybe_dropped_at) = rig.next;
  }
}

std::optional<Failure> ScriptWorld::step() {
  observe();
  iteration = rig.next;
  rig.step();
  look();
  if (auto failure = hear()) return failure;
  return find_drivers();
}

/// Statuses told since the last iteration => commands.
std::optional<Failure> ScriptWorld::hear() {
  ended.clear();
  const auto& changes = rig.witness.changes;
  for (; heard_ < changes.size(); ++heard_) {
    const StatusChange& change = changes[heard_];
    const auto found = records_.find({change.lane, change.id});
    if (found == records_.end()) continue;  // a batch
    for (SentCommand* command : found->second) {
      if (command->told.status != Status::none) {
        return Failure{"one end", "a command ended twice: " + std::to_string(command->id)};
      }
      if (is_end(change.status)) {
        if (auto failure = hear_end(*command, change)) return failure;
        continue;
      }
      if (command->ended_at != kNever) continue;  // a member that has left
      if (change.iteration != iteration || command->active_since != kNever) {
        return Failure{"activation", "a command became active at another iteration or twice"};
      }
      command->status = change.status;
      command->active_since = change.iteration;
      running_[step_of(*command).actuator].push_back(command);
    }
  }
  return std::nullopt;
}

std::optional<Failure> ScriptWorld::hear_end(SentCommand& command, const StatusChange& change) {
  command.told = {change.status, change.iteration};
  command.reason = change.reason;
  if (command.is_member && command.active_since != kNever) {
    const auto first = first_ends_.find({command.lane, command.id});
    // a member that gives way to its successor ends as overwritten
    const bool gave_way = change.status == Status::overwritten;
    const bool unknown = may_arrive_before_others(command);
    const bool expected =
        gave_way || unknown ||
        change.status == (first != first_ends_.end() ? first->second : Status::completed);
    if (!expected) return Failure{"end of several", "not the first end of its members is told"};
  }
  if (command.ended_at != kNever) return std::nullopt;  // a member that has left
  command.status = change.status;
  if (command.is_member && command.active_since != kNever) command.status = Status::completed;
  command.ended_at = change.iteration;
  std::erase(members, &command);
  // an interrupt between iterations was the end of the others: this one had arrived
  const bool is_left = command.is_member && command.status == Status::completed &&
                       change.status == Status::interrupted && change.iteration < iteration;
  if (is_left) return arrived(command);
  ended.push_back(&command);
  return std::nullopt;
}

std::optional<Failure> ScriptWorld::find_drivers() {
  for (std::size_t a = 0; a < actuators.size(); ++a) {
    ActuatorTrack& actuator = actuators[a];
    actuator.previous = actuator.driver;
    actuator.driver = nullptr;
    for (SentCommand* command : running_[a]) {
      if (!command->drove(iteration)) continue;
      if (actuator.driver != nullptr && gives_way(*actuator.driver, *command)) {
        actuator.driver->status = Status::overwritten;
        actuator.driver->ended_at = iteration;
        std::erase(members, actuator.driver);
      } else if (actuator.driver != nullptr) {
        return Failure{"one driver",
                       "two commands gave one desired state of actuator " + std::to_string(a)};
      }
      actuator.driver = command;
    }
    if (actuator.driver != nullptr && actuator.driver->is_member &&
        (!actuator.active || actuator.braking)) {
      // it follows, and has arrived before the others of its group
      SentCommand& member = *std::exchange(actuator.driver, nullptr);
      member.status = Status::completed;
      member.ended_at = iteration - 1;
      std::erase(members, &member);
      std::erase(ended, &member);
      if (auto failure = arrived(member)) return failure;
    }
    std::erase_if(running_[a], [](const SentCommand* each) { return each->ended_at != kNever; });
    if (actuator.driver != nullptr) actuator.last = actuator.driver;
  }
  return std::nullopt;
}

/// A member that ended before this iteration, and before the others of its group, is at its target.
std::optional<Failure> ScriptWorld::arrived(const SentCommand& member) const {
  if (member.told.status == Status::rejected) return std::nullopt;
  const std::size_t a = step_of(member).actuator;
  for (std::size_t n = 0; n < actuators[a].numbers.size(); ++n) {
    const bool rests = script.actuators[a].numbers[n].resting;
    if (!names(member, n) || rests ||
        actuators[a].numbers[n].before == target(member, rows_of(member) - 1, n)) {
      continue;
    }
    return Failure{"target", where(a, n) + "a member left its group before it arrived"};
  }
  return std::nullopt;
}

/// Rows and starts elsewhere are followed: members may arrive one after the other.
bool ScriptWorld::may_arrive_before_others(const SentCommand& command) const {
  return rows_of(command) > 1 || step_of(command).head.start == Start::observed;
}

/// A member of a group, of which nothing is told: a set-point before a direct command, a trajectory
/// behind its rows, or one that follows and has arrived before the others.
bool ScriptWorld::gives_way(const SentCommand& command, const SentCommand& next) const {
  if (!command.is_member || next.active_since != iteration) return false;
  if (may_arrive_before_others(command)) return true;
  return step_of(command).head.pace == Pace::direct && step_of(next).head.pace == Pace::direct;
}

std::size_t ScriptWorld::rows_of(const SentCommand& command) const {
  const ScriptStep& step = step_of(command);
  return step.values.size() / script.actuators[step.actuator].numbers.size();
}

long double ScriptWorld::target(const SentCommand& command, std::size_t row,
                                std::size_t number) const {
  const ScriptStep& step = step_of(command);
  const auto& numbers = script.actuators[step.actuator].numbers;
  return as_stored(numbers[number].kind, step.values[row * numbers.size() + number]);
}

std::string ScriptWorld::where(std::size_t actuator, std::size_t number) const {
  return "iteration " + std::to_string(iteration) + ", actuator " + std::to_string(actuator) +
         ", number " + std::to_string(number) + ": ";
}

}  // namespace o80::test
