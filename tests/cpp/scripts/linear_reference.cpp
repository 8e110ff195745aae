#include "scripts/linear_reference.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace o80::test {
namespace {

constexpr std::int64_t kPeriodNs = 1'000'000;

long double as_stored(Kind kind, double value) {
  std::array<std::byte, 8> bytes{};
  store_as(kind, value, bytes.data());
  return load_as(kind, bytes.data());
}

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
      batches_[step.lane].push_back({place, &step});
      break;
    case Action::pulse:
      for (const Queued& queued : batches_[step.lane]) {
        Actuator& actuator = actuators_[queued.step->actuator];
        if (queued.step->head.mode == Mode::overwrite) {
          drop(queued.step->actuator, Status::overwritten, next_);
        }
        actuator.queue.push_back(queued);
        outcomes_[queued.place] = {};
      }
      batches_[step.lane].clear();
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
    for (const Queued& queued : actuator.queue) outcomes_[queued.place] = {status, iteration};
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
      outcomes_[queued.place] = {Status::purged, next_};
      return true;
    });
    if (actuator.queue.empty()) actuator.unbroken = false;
  }
}

void LinearReference::step() {
  for (std::size_t a = 0; a < actuators_.size(); ++a) step(a);
  ++next_;
}

void LinearReference::step(std::size_t a) {
  Actuator& actuator = actuators_[a];
  if (!actuator.running && !begin_command(a)) {
    actuator.unbroken = false;
    for (std::size_t n = 0; n < desired_[a].size() && script_.actuators[a].follow; ++n) {
      desired_[a][n] = observed(a, n);
    }
    return;
  }
  if (next_ > actuator.last) {
    ++actuator.row;
    begin_row(a, false);
  }
  for (std::size_t n = 0; n < desired_[a].size(); ++n) desired_[a][n] = between(a, n);

  // the last iteration of the last row ends the command
  const ScriptStep& step = *actuator.queue.front().step;
  const std::size_t rows = step.values.size() / desired_[a].size();
  if (next_ < actuator.last || actuator.row + 1 < rows) return;
  outcomes_[actuator.queue.front().place] = {Status::completed, next_};
  actuator.queue.pop_front();
  actuator.running = false;
}

bool LinearReference::begin_command(std::size_t a) {
  Actuator& actuator = actuators_[a];
  while (!actuator.queue.empty()) {
    const RecordHead& head = actuator.queue.front().step->head;
    if (head.pace != Pace::until || head.amount >= next_) break;
    outcomes_[actuator.queue.front().place] = {Status::rejected, next_};
    actuator.queue.pop_front();
    actuator.unbroken = false;
  }
  if (actuator.queue.empty()) return false;
  if (!actuator.unbroken) actuator.exact = (next_ - 1) * kPeriodNs;
  actuator.unbroken = true;
  actuator.running = true;
  actuator.started = actuator.exact;
  actuator.row = 0;
  begin_row(a, true);
  return true;
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
        const double needed = distance / (step.head.speed * 1e-3) * (1.0 - 1e-12);
        if (needed > static_cast<double>(kMostIterations)) return run_on(kMostIterations);
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
