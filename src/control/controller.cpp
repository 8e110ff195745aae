#include "control/controller.hpp"

#include <algorithm>
#include <bit>
#include <utility>

#include "control/layouts_of_types.hpp"

namespace o80 {
namespace {

RecordCheck::Layouts pointers_to(const std::vector<std::optional<StateLayout>>& layouts) {
  RecordCheck::Layouts pointers;
  for (const auto& layout : layouts) pointers.push_back(layout ? &*layout : nullptr);
  return pointers;
}

/// Calls `visit(index)` for each bit set.
template <class Visit>
void each_bit(std::uint64_t word, std::uint32_t base, Visit&& visit) noexcept {
  for (; word != 0; word &= word - 1) {
    visit(base + static_cast<std::uint32_t>(std::countr_zero(word)));
  }
}

}  // namespace

Controller::Controller(const Schema& schema, BlockPool& pool, StatusSink& sink, std::uint32_t lanes)
    : pool_(pool),
      sink_(sink),
      ledger_(pool, sink),
      layouts_(layouts_of_types(schema)),
      planner_(schema, pointers_to(layouts_), pool, lanes),
      purge_tickets_(lanes, static_cast<std::uint32_t>(schema.actuators.size())),
      desired_((schema.head.block + kBlockBytes - 1) / kBlockBytes) {
  const auto count = static_cast<std::uint32_t>(schema.actuators.size());
  const std::uint32_t words = mask_words(count);
  active_mask_.resize(words);
  clamped_mask_.resize(words);
  braking_mask_.resize(words);
  busy_.resize(words);
  stepped_.resize(words);
  dropped_.resize(words);
  follow_.resize(words);
  actuators_.reserve(count);
  auto* block = reinterpret_cast<std::byte*>(desired_.data());
  for (std::uint32_t i = 0; i < count; ++i) {
    const ActuatorRow& row = schema.actuators[i];
    offsets_.push_back(row.offset);
    types_.push_back(&*layouts_[row.type]);
    actuators_.emplace_back(schema, row, *layouts_[row.type], pool_, ledger_, block + row.offset,
                            lanes);
    busy_[i / 64] |= std::uint64_t{1} << (i % 64);
    if (row.when_idle == WhenIdle::follow) follow_[i / 64] |= std::uint64_t{1} << (i % 64);
  }
}

void Controller::restart(const std::byte* observed, const std::byte* wanted,
                         Iteration row) noexcept {
  const std::byte* source = wanted != nullptr ? wanted : observed;
  for (std::uint32_t i = 0; i < actuators_.size(); ++i) {
    O80_COUNT(queue_dropped);
    actuators_[i].drop(Status::purged, Reason::fresh_start, row);
    actuators_[i].restart(of(i, source));
    busy_[i / 64] |= std::uint64_t{1} << (i % 64);
  }
  for (std::size_t word = 0; word < busy_.size(); ++word) {
    active_mask_[word] = 0;
    clamped_mask_[word] = 0;
    braking_mask_[word] = 0;
  }
}

/// Begins the commands of several actuators whose members are next in all queues.
void Controller::step_groups(Iteration iteration, const std::byte* observed,
                             std::uint32_t& late_budget) noexcept {
  // end dropped members first, so that the others of their group do not wait for them
  told_ = ledger_.report_ends(kStatusesPerIteration);
  if (ledger_.undecided_groups() == 0) return;
  const auto each_busy = [&](auto&& visit) {
    for (std::size_t word = 0; word < busy_.size(); ++word) {
      each_bit(busy_[word], static_cast<std::uint32_t>(word * 64), visit);
    }
  };
  each_busy([&](std::uint32_t i) { actuators_[i].arrive(iteration, late_budget); });
  each_busy([&](std::uint32_t i) {
    if (actuators_[i].follows() && actuators_[i].begins_group(iteration) && !sink_.may_begin(i)) {
      actuators_[i].drop(Status::interrupted, Reason::reading, iteration);
    }
  });
  each_busy([&](std::uint32_t i) { actuators_[i].agree_on_carry(iteration); });
  each_busy([&](std::uint32_t i) { actuators_[i].plan_with_others(iteration, of(i, observed)); });
}

void Controller::step(Iteration iteration, const std::byte* observed) noexcept {
  std::uint32_t late_budget = kStatusesPerIteration;
  told_ = 0;
  if (ledger_.open_groups() > 0) step_groups(iteration, observed, late_budget);
  const bool gives = given_.acts(iteration);
  if (gives) step_given(iteration, observed);
  for (std::size_t word = 0; word < busy_.size(); ++word) {
    const auto base = static_cast<std::uint32_t>(word * 64);
    const std::uint64_t stepped = gives ? stepped_[word] : 0;
    std::uint64_t active = stepped;
    std::uint64_t clamped = gives ? clamped_mask_[word] & stepped : 0;
    std::uint64_t braking = 0;

    // idle actuators follow the observed state, busy ones step
    each_bit(follow_[word] & ~busy_[word], base,
             [&](std::uint32_t i) { actuators_[i].follow(of(i, observed)); });
    each_bit(busy_[word] & ~stepped, base, [&](std::uint32_t i) {
      ActuatorQueue& queue = actuators_[i];
      const std::uint64_t bit = std::uint64_t{1} << (i % 64);
      switch (queue.step(iteration, of(i, observed), late_budget)) {
        case ActuatorQueue::Moved::idle:
          // the queue is not empty if late commands have used up their budget
          if (queue.empty() && queue.at_rest()) busy_[word] &= ~bit;
          break;
        case ActuatorQueue::Moved::braking:
          braking |= bit;
          active |= bit;
          break;
        case ActuatorQueue::Moved::clamped:
          clamped |= bit;
          [[fallthrough]];
        case ActuatorQueue::Moved::active:
          active |= bit;
      }
    });
    active_mask_[word] = active;
    clamped_mask_[word] = clamped;
    braking_mask_[word] = braking;
  }
  told_ += kStatusesPerIteration - late_budget;
}

bool Controller::has_no_command(std::span<const std::uint32_t> actuators) const noexcept {
  return std::ranges::all_of(actuators,
                             [&](std::uint32_t i) { return actuators_[i].has_no_command(); });
}

/// The targets of this iteration => desired.
void Controller::step_given(Iteration iteration, const std::byte* observed) noexcept {
  const bool first = !std::exchange(was_given_, true);
  if (first) std::ranges::fill(dropped_, 0);
  std::ranges::fill(stepped_, 0);
  const auto step = static_cast<std::size_t>(iteration - given_.first);
  const std::byte* states = given_.states;
  for (const std::uint32_t i : given_.actuators) {
    const std::size_t size = types_[i]->size();
    const std::byte* target = states + step * size;
    states += given_.steps * size;
    const std::uint64_t bit = std::uint64_t{1} << (i % 64);
    if ((dropped_[i / 64] & bit) != 0) continue;
    if (first) actuators_[i].begin_given(given_.mode);
    const bool clamped =
        actuators_[i].go_to(iteration, of(i, observed), target) == ActuatorQueue::Moved::clamped;
    stepped_[i / 64] |= bit;
    busy_[i / 64] |= bit;
    clamped_mask_[i / 64] = clamped ? clamped_mask_[i / 64] | bit : clamped_mask_[i / 64] & ~bit;
  }
}

/// Ends targets that have begun: they no longer reach this actuator.
void Controller::forget_given(std::uint32_t actuator) noexcept {
  if (was_given_) dropped_[actuator / 64] |= std::uint64_t{1} << (actuator % 64);
}

bool Controller::finish_all_pending() noexcept {
  const std::uint32_t told = std::min(std::exchange(told_, 0), kStatusesPerIteration);
  ledger_.report_ends(kStatusesPerIteration - told);
  return !ledger_.pending();
}

bool Controller::acts(std::uint32_t lane) const noexcept {
  return std::ranges::any_of(actuators_,
                             [&](const ActuatorQueue& queue) { return queue.acts(lane); });
}

double Controller::difference(std::uint32_t offset, std::uint32_t order) const noexcept {
  const auto behind = std::ranges::upper_bound(offsets_, offset);
  if (behind == offsets_.begin()) return 0.0;
  const auto i = static_cast<std::size_t>(behind - offsets_.begin()) - 1;
  if ((active_mask_[i / 64] >> (i % 64) & 1) == 0) return 0.0;
  return actuators_[i].difference(offset - offsets_[i], order);
}

std::optional<NotFinite> Controller::not_finite(const std::byte* block) const noexcept {
  for (std::uint32_t i = 0; i < actuators_.size(); ++i) {
    const std::uint32_t number = types_[i]->first_not_finite(of(i, block));
    if (number != StateLayout::kNoNumber) return NotFinite{i, number};
  }
  return std::nullopt;
}

bool Controller::active() const noexcept {
  for (const ActuatorQueue& queue : actuators_) {
    if (!queue.empty()) return true;
  }
  return false;
}

void Controller::purge(std::uint32_t actuator, Iteration iteration, Reason reason) noexcept {
  each(actuator, [&](ActuatorQueue& queue) { queue.drop(Status::purged, reason, iteration); });
}

void Controller::purge_lane(std::uint32_t lane, std::uint32_t actuator, Iteration iteration,
                            Reason reason) noexcept {
  each(actuator,
       [&](ActuatorQueue& queue) { queue.drop_lane(lane, Status::purged, reason, iteration); });
}

void Controller::halt(Iteration iteration) noexcept {
  each(kEveryActuator,
       [&](ActuatorQueue& queue) { queue.drop(Status::halted, Reason::halted, iteration); });
}

void Controller::interrupt(std::uint32_t actuator, Iteration iteration) noexcept {
  forget_given(actuator);
  each(actuator,
       [&](ActuatorQueue& queue) { queue.drop(Status::interrupted, Reason::none, iteration); });
}

bool Controller::braking() const noexcept {
  // in the last step; or in the next one, for an actuator that has just lost its command
  return std::ranges::any_of(braking_mask_, [](std::uint64_t word) { return word != 0; }) ||
         std::ranges::any_of(actuators_, [](const ActuatorQueue& queue) {
           return queue.empty() && !queue.rests();
         });
}

bool Controller::holds() const noexcept {
  return std::ranges::any_of(actuators_, [](const ActuatorQueue& queue) { return queue.holds(); });
}

}  // namespace o80
