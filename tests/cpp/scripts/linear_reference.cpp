#include "scripts/linear_reference.hpp"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace o80::test {
namespace {

constexpr std::int64_t kPeriodNs = 1'000'000;

bool is_wide(Kind kind) { return kind == Kind::int64 || kind == Kind::uint64; }

}  // namespace

LinearReference::LinearReference(const Script& script) : script_(script) {
  for (const ActuatorSpec& spec : script.actuators) {
    actuators_.emplace_back();
    readings_.emplace_back(spec.numbers.size(), nullptr);
    std::vector<long double>& state = desired_.emplace_back();
    for (const NumberSpec& number : spec.numbers) {
      state.push_back(as_stored(number.kind, number.start));
    }
  }
  next_ = 1;
}

long double LinearReference::observed(std::size_t a, std::size_t n) const {
  const double* reading = readings_[a][n];
  if (reading == nullptr) return desired_[a][n];
  return as_stored(script_.actuators[a].numbers[n].kind, *reading);
}

void LinearReference::act(const ScriptStep& step, std::size_t place) {
  switch (step.action) {
    case Action::command:
      batches_[step.lane].push_back({place, &step, nullptr});
      break;
    case Action::pulse:
      pulse(step.lane);
      break;
    case Action::purge:
      drop(step.actuator, Status::purged, next_);
      break;
    case Action::purge_own:
      drop_lane(step.actuator, step.lane);
      break;
    case Action::interrupt:
      drop(step.actuator, Status::interrupted, next_ - 1);
      break;
    case Action::halt:
      drop(kEveryActuator, Status::halted, next_);
      break;
    case Action::restart:
      restart(nullptr);
      break;
    case Action::restart_with:
      restart(&step.values);
      break;
    case Action::read:
      readings_[step.actuator][step.number] = step.values.data();
      break;
    case Action::track:
      for (auto& of_actuator : readings_) std::ranges::fill(of_actuator, nullptr);
      break;
    default:
      break;
  }
}

void LinearReference::pulse(std::uint32_t lane) {
  const Queued* before = nullptr;
  for (Queued& queued : batches_[lane]) {
    if (queued.step->group != 0) {
      const bool continues = before != nullptr && before->step->group == queued.step->group;
      queued.group = continues ? before->group : std::make_shared<Group>();
      queued.group->places.push_back(queued.place);
      ++queued.group->open;
    }
    before = &queued;
  }
  for (const Queued& queued : batches_[lane]) {
    if (queued.step->head.mode == Mode::overwrite) {
      drop(queued.step->actuator, Status::overwritten, next_);
    }
    actuators_[queued.step->actuator].queue.push_back(queued);
    outcomes_[queued.place] = {};
  }
  batches_[lane].clear();
}

/// A command of several actuators ends with its last member, as the first that is not completed.
void LinearReference::end(const Queued& queued, Status status, Iteration iteration) {
  if (queued.group == nullptr) {
    outcomes_[queued.place] = {status, iteration};
    return;
  }
  Group& group = *queued.group;
  if (status != Status::completed && group.end.status == Status::none) group.end.status = status;
  group.end.iteration = std::max(group.end.iteration, iteration);
  if (--group.open > 0) return;
  if (group.end.status == Status::none) group.end.status = Status::completed;
  for (const std::size_t place : group.places) outcomes_[place] = group.end;
}

void LinearReference::restart(const std::vector<double>* states) {
  drop(kEveryActuator, Status::purged, next_);
  std::size_t i = 0;
  for (std::size_t a = 0; a < actuators_.size(); ++a) {
    for (std::size_t n = 0; n < desired_[a].size(); ++n, ++i) {
      desired_[a][n] = states == nullptr
                           ? observed(a, n)
                           : as_stored(script_.actuators[a].numbers[n].kind, (*states)[i]);
    }
  }
  ++next_;
}

void LinearReference::drop(std::uint16_t which, Status status, Iteration iteration) {
  for (std::size_t a = 0; a < actuators_.size(); ++a) {
    if (which != kEveryActuator && which != a) continue;
    Actuator& actuator = actuators_[a];
    for (const Queued& queued : actuator.queue) end(queued, status, iteration);
    actuator.queue.clear();
    actuator.running = actuator.unbroken = false;
  }
}

void LinearReference::drop_lane(std::uint16_t which, std::uint32_t lane) {
  for (std::size_t a = 0; a < actuators_.size(); ++a) {
    if (which != kEveryActuator && which != a) continue;
    Actuator& actuator = actuators_[a];
    if (actuator.running && actuator.queue.front().step->lane == lane) {
      actuator.running = actuator.unbroken = false;
    }
    std::erase_if(actuator.queue, [&](const Queued& queued) {
      if (queued.step->lane != lane) return false;
      end(queued, Status::purged, next_);
      return true;
    });
    if (actuator.queue.empty()) actuator.unbroken = false;
  }
}

void LinearReference::step() {
  const auto each = [&](auto&& visit) {
    for (std::size_t a = 0; a < actuators_.size(); ++a) visit(a);
  };
  each([&](std::size_t a) { end_late(a); });
  each([&](std::size_t a) {
    const auto& queue = actuators_[a].queue;
    if (!queue.empty() && queue.front().group) queue.front().group->arrived = 0;
  });
  each([&](std::size_t a) {
    const auto& queue = actuators_[a].queue;
    if (!actuators_[a].running && !queue.empty() && queue.front().group) {
      ++queue.front().group->arrived;
    }
  });
  each([&](std::size_t a) {
    Actuator& actuator = actuators_[a];
    actuator.begins = !actuator.running && may_begin(a);
    if (!actuator.begins) return;
    if (!actuator.unbroken) actuator.exact = (next_ - 1) * kPeriodNs;
    actuator.unbroken = true;
  });
  each([&](std::size_t a) { agree_on_exact(a); });
  each([&](std::size_t a) { begin(a); });
  each([&](std::size_t a) { agree_on_last(a); });
  each([&](std::size_t a) { move(a); });
  ++next_;
}

void LinearReference::end_late(std::size_t a) {
  Actuator& actuator = actuators_[a];
  while (!actuator.running && !actuator.queue.empty()) {
    const RecordHead& head = actuator.queue.front().step->head;
    if (head.pace != Pace::until || head.amount >= next_) return;
    end(actuator.queue.front(), Status::rejected, next_);
    actuator.queue.pop_front();
    actuator.unbroken = false;
  }
}

/// A member of a group waits until the others that are left are first in their queues.
bool LinearReference::may_begin(std::size_t a) const {
  const auto& queue = actuators_[a].queue;
  if (queue.empty()) return false;
  const Group* group = queue.front().group.get();
  return group == nullptr || group->arrived == group->open;
}

/// A duration of several actuators counts from the latest of their queues' exact ends.
void LinearReference::agree_on_exact(std::size_t a) {
  if (!actuators_[a].begins) return;
  const Queued& queued = actuators_[a].queue.front();
  if (queued.group == nullptr || queued.step->head.pace != Pace::duration) return;
  for (Actuator& other : actuators_) {
    const bool together = other.begins && other.queue.front().group == queued.group;
    if (together) other.exact = std::max(other.exact, actuators_[a].exact);
  }
}

void LinearReference::begin(std::size_t a) {
  Actuator& actuator = actuators_[a];
  if (actuator.begins) {
    actuator.running = true;
    actuator.started = actuator.exact;
    actuator.row = 0;
    begin_row(a, true);
  } else if (actuator.running && next_ > actuator.last) {
    ++actuator.row;
    begin_row(a, false);
  }
}

/// Each row of a group takes as long as its slowest member needs.
void LinearReference::agree_on_last(std::size_t a) {
  const Actuator& actuator = actuators_[a];
  if (!actuator.running || actuator.first != next_) return;
  const Group* group = actuator.queue.front().group.get();
  for (Actuator& other : actuators_) {
    if (group == nullptr || !other.running || other.queue.front().group.get() != group) continue;
    if (other.last >= actuator.last) continue;
    other.exact += (actuator.last - other.last) * kPeriodNs;
    other.last = actuator.last;
  }
}

void LinearReference::move(std::size_t a) {
  Actuator& actuator = actuators_[a];
  if (!actuator.running) {
    actuator.unbroken = false;
    for (std::size_t n = 0; n < desired_[a].size() && script_.actuators[a].follow; ++n) {
      desired_[a][n] = observed(a, n);
    }
    return;
  }
  for (std::size_t n = 0; n < desired_[a].size(); ++n) desired_[a][n] = between(a, n);

  // the last iteration of the last row ends the command
  const ScriptStep& step = *actuator.queue.front().step;
  const std::size_t rows = step.values.size() / desired_[a].size();
  if (next_ < actuator.last || actuator.row + 1 < rows) return;
  end(actuator.queue.front(), Status::completed, next_);
  actuator.queue.pop_front();
  actuator.running = false;
}

void LinearReference::begin_row(std::size_t a, bool begins_command) {
  Actuator& actuator = actuators_[a];
  const ScriptStep& step = *actuator.queue.front().step;
  const std::size_t numbers = desired_[a].size();
  const std::size_t rows = step.values.size() / numbers;
  actuator.first = next_;
  // rows that should have ended already are left out, but for the last one
  const auto end_of = [&](std::size_t row) {
    return (actuator.started + step.times[row] + kPeriodNs / 2) / kPeriodNs;
  };
  if (!step.times.empty()) {
    while (actuator.row + 1 < rows && end_of(actuator.row) < next_) ++actuator.row;
  }

  actuator.from = desired_[a];
  actuator.to = desired_[a];
  for (std::size_t n = 0; n < numbers; ++n) {
    const bool named = step.mask == 0 || (step.mask >> n & 1) != 0;
    if (!named) continue;
    const Kind kind = script_.actuators[a].numbers[n].kind;
    if (begins_command && step.head.start == Start::observed) actuator.from[n] = observed(a, n);
    actuator.to[n] = as_stored(kind, step.values[actuator.row * numbers + n]);
  }
  actuator.last = std::max(next_, end_of_row(a));
}

Iteration LinearReference::end_of_row(std::size_t a) {
  Actuator& actuator = actuators_[a];
  const ScriptStep& step = *actuator.queue.front().step;
  const auto run_on = [&](std::int64_t iterations) {
    actuator.exact += iterations * kPeriodNs;
    return next_ + iterations - 1;
  };
  switch (step.head.pace) {
    case Pace::until:
      actuator.exact = step.head.amount * kPeriodNs;
      return step.head.amount;
    case Pace::iterations:
      return run_on(std::max<std::int64_t>(1, step.head.amount));
    case Pace::duration:
      actuator.exact =
          actuator.started + (step.times.empty() ? step.head.amount : step.times[actuator.row]);
      return (actuator.exact + kPeriodNs / 2) / kPeriodNs;
    case Pace::speed:
      for (std::size_t n = 0; n < desired_[a].size(); ++n) {
        const bool named = step.mask == 0 || (step.mask >> n & 1) != 0;
        if (!named || !script_.actuators[a].numbers[n].moves()) continue;
        const auto distance =
            std::fabs(static_cast<double>(actuator.to[n]) - static_cast<double>(actuator.from[n]));
        const double needed = distance / (step.head.speed * 1e-3) * (1.0 - 1e-9);
        if (needed > 0x1p31) too_long_ = true;
        if (needed > static_cast<double>(kMaxIterations)) return run_on(kMaxIterations);
        return run_on(std::max<std::int64_t>(1, static_cast<std::int64_t>(std::ceil(needed))));
      }
      return run_on(1);
    default:
      return run_on(1);
  }
}

/// Where a number is in this iteration: at the share (i - first + 1) / n of the row's way.
long double LinearReference::between(std::size_t a, std::size_t n) const {
  const Actuator& actuator = actuators_[a];
  const NumberSpec& spec = script_.actuators[a].numbers[n];
  if (next_ >= actuator.last || !spec.moves()) return actuator.to[n];
  const double share = static_cast<double>(next_ - actuator.first + 1) /
                       static_cast<double>(actuator.last - actuator.first + 1);
  if (is_wide(spec.kind)) {
    return std::round(actuator.from[n] + (actuator.to[n] - actuator.from[n]) * share);
  }
  const auto from = static_cast<double>(actuator.from[n]);
  const auto to = static_cast<double>(actuator.to[n]);
  const volatile double covered = (to - from) * share;  // no fused multiplication
  const double value = std::clamp(from + covered, std::min(from, to), std::max(from, to));
  if (spec.kind == Kind::float64) return value;
  if (spec.kind == Kind::float32) return static_cast<float>(value);
  return std::round(value);
}

}  // namespace o80::test
