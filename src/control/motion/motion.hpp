#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "control/motion/number_motion.hpp"
#include "control/motion/state_layout.hpp"

namespace o80 {

/// A limit of one number of a state.
struct Limited {
  Limit limit = Limit::none;
  std::uint32_t number = 0;

  /// As the detail of a status: the limit in 3 bits, the number (at most 31) above.
  std::uint8_t packed() const noexcept {
    return static_cast<std::uint8_t>(static_cast<std::uint32_t>(limit) | (number < 31 ? number : 31)
                                                                             << 3);
  }
};

/// The motion of one actuator: computes its desired state in each iteration, within its limits.
///
/// For each number it keeps position and differences as double. The published state is their
/// rounding, inward at the bounds.
///
/// Realtime: everything but construction.
class Motion {
 public:
  Motion(const Schema& schema, const ActuatorRow& actuator, const StateLayout& layout);

  /// How a command gets to its target, or to the next row.
  struct Course : Requested {
    std::uint32_t first = 0;  // the number that the cruising speed is for
    bool is_row = false;      // it is followed; the row after it, so many iterations later
    const std::byte* next = nullptr;
    std::int64_t next_iterations = 0;  // 0: it is the last row
    bool is_first = false;             // the first row that is reached; the row after the next one
    const std::byte* after = nullptr;  // null: there is none
  };

  /// The target of the next propose(); fill it before. Numbers of `mask` (null: all) move to it.
  std::byte* target() noexcept { return from() + stride_; }
  /// A command begins.
  void begin(const std::uint64_t* mask) noexcept {
    begin(mask, [](Number& each) { each.motion.begin(); });
  }
  /// Rows begin: they are followed from the plan of the rows before them.
  void take_over(const std::uint64_t* mask) noexcept {
    begin(mask,
          [](Number& each) { each.is_commanded ? each.motion.take_over() : each.motion.begin(); });
  }
  /// What is followed reaches from one place to the other.
  void widen(std::uint32_t number, const Span& range) noexcept {
    for (Number& each : numbers_) {
      if (each.number != number || !each.is_commanded) continue;
      each.motion.widen(range.low);
      each.motion.widen(range.high);
    }
  }
  /// Numbers of `mask` that switch become those of this row, not those of the target.
  void switch_to(const std::byte* row, const std::uint64_t* mask) noexcept {
    for (const std::uint32_t i : switches_) {
      const NumberPlace& place = layout_.numbers()[i];
      if (masked(mask, i)) copy_number(target() + place.offset, row + place.offset, place.size);
    }
  }
  bool has_switches() const noexcept { return !switches_.empty(); }
  /// The last target is where the next row begins.
  void next_row() noexcept { layout_.copy(from(), target()); }
  /// The next plan starts at rest at these values, not where the actuator is.
  void start_at(const std::byte* observed) noexcept { observed_ = observed; }
  /// Proposes the number of iterations to the target, from `desired` or from the last target.
  std::int64_t propose(const Course& course, const std::byte* desired) noexcept;
  /// The part of it that the cruising speed needs.
  std::int64_t requested_by_speed() const noexcept { return requested_by_speed_; }
  /// Then plans for so many iterations, at least those.
  void settle(Iteration first, std::int64_t iterations) noexcept {
    first_ = first;
    last_ = first + (iterations - 1);
    for (Number& each : numbers_) {
      if (!each.is_commanded) continue;
      if (course_.is_row) {
        to_row(each, iterations);
      } else {
        each.motion.settle(iterations);
      }
    }
  }
  /// A set-point of a generator at the rate of the loop: no plan, only limits.
  void follow_as_sent(Iteration first) noexcept {
    first_ = last_ = first;
    begun_ = course_.is_row = false;
    for (Number& each : numbers_) {
      if (each.is_commanded) each.motion.follow_as_sent(layout_.number(each.number, target()));
    }
  }
  /// The plan continues until this iteration or later.
  void extend(Iteration last) noexcept { last_ = std::max(last_, last); }
  /// What is followed reaches to this state, too.
  void widen(const std::byte* row) noexcept {
    for (Number& each : numbers_) {
      if (each.is_commanded) each.motion.widen(layout_.number(each.number, row));
    }
  }
  /// Calls visit(number, moment, rates) for each number of the mask: where rows would take over.
  template <class Visit>
  void each_moment(const std::uint64_t* mask, Visit&& visit) const noexcept {
    for (const Number& each : numbers_) {
      if (!masked(mask, each.number)) continue;
      visit(each.number, each.motion.moment(), each.motion.guard().rates());
    }
  }
  /// True if what settle() planned last is the way to a row, and a limit can keep it from there.
  bool follows_rows() const noexcept {
    return course_.is_row && std::ranges::any_of(numbers_, [](auto& each) {
             return each.is_commanded && each.motion.has_rates();
           });
  }
  /// True if a commanded number has a limit of acceleration.
  bool accelerates() const noexcept {
    return std::ranges::any_of(
        numbers_, [](auto& each) { return each.is_commanded && each.motion.accelerates(); });
  }

  /// Where the robot is: before step() or brake().
  void observe(const std::byte* observed) noexcept {
    if (!has_integrals_) return;
    for (Number& each : numbers_) each.motion.observe(layout_, observed);
  }
  /// One iteration of the motion; the limit that changed it, if any.
  Limited step(Iteration now, std::byte* state) noexcept;
  /// How far that step was from the plan, the most of the numbers; 0 if no limit changed it.
  double off_plan() const noexcept { return off_plan_; }
  Iteration last() const noexcept { return last_; }
  /// True if the state of the last step() was the target: nothing is left to follow.
  bool arrived() const noexcept {
    return all([](auto& each) { return each.arrived(); });
  }
  /// True if bounds of an integral keep a number at rest, and the others have arrived.
  bool is_blocked() const noexcept {
    return has_integrals_ && any([](auto& each) { return each.is_blocked(); }) &&
           all([](auto& each) { return each.is_blocked() || each.arrived(); });
  }
  /// True if such bounds have changed the motion since begin().
  bool was_held_back() const noexcept {
    return has_integrals_ && any([](auto& each) { return each.was_held_back(); });
  }
  /// First (order 1) or second difference of the number at this offset; 0 for what does not move.
  double difference(std::uint32_t offset, std::uint32_t order) const noexcept {
    const auto found = std::ranges::find(numbers_, offset, &Number::offset);
    return found == numbers_.end() ? 0.0 : found->motion.difference(order);
  }
  /// The limit because of which propose() gave more iterations than requested.
  Limited slowest() const noexcept { return slowest_; }
  /// The command has ended, at its target if that is `arrived`.
  void end(bool arrived = false) noexcept {
    for (Number& each : numbers_) each.motion.end(arrived && each.is_commanded);
  }

  /// Sets all numbers to this state, at rest.
  void restart(const std::byte* state) noexcept {
    for (Number& each : numbers_) each.motion.restart(layout_.number(each.number, state));
  }
  /// One iteration of a motion that was made elsewhere, after restart(). Numbers whose differences
  /// a command would not use, or whose bytes are rounded, are at rest there.
  void trace(const std::byte* state) noexcept {
    for (Number& each : numbers_) {
      const double position = layout_.number(each.number, state);
      if (each.kind == Kind::float64 && each.motion.accelerates()) {
        each.motion.trace(position);
      } else {
        each.motion.restart(position);
      }
    }
  }
  /// Numbers without a rest value are at `state`, the observed one; the others stay.
  void follow(std::byte* state) noexcept {
    for (Number& each : numbers_) {
      if (each.motion.has_rest()) {
        publish(each, state);
      } else {
        each.motion.restart(layout_.number(each.number, state));
      }
    }
  }
  /// One iteration of braking, unless it `follows`. Numbers with a rest value go to it, unless they
  /// are held. True while a number moves.
  bool brake(std::byte* state, bool follows) noexcept {
    bool moves = false;
    for (Number& each : numbers_) {
      if (follows && !each.motion.has_rest()) continue;
      const double before = each.motion.position();
      moves = each.motion.brake() || moves;
      if (each.motion.position() != before) publish(each, state);
    }
    return moves;
  }
  /// Holds the commanded numbers that have a rest value where they are, until hold(false).
  void hold(bool holds) noexcept {
    for (Number& each : numbers_) each.motion.hold(holds && each.is_commanded);
  }
  /// True if a number is held away from its rest value.
  bool holds() const noexcept {
    return any([](auto& each) { return each.is_held_away(); });
  }
  /// True if braking would change nothing.
  bool at_rest(bool follows) const noexcept {
    return all([&](auto& each) { return (follows && !each.has_rest()) || each.at_rest(); });
  }
  /// True if no number was rounded when it was written to `state`.
  bool is_published(const std::byte* state) const noexcept {
    return std::ranges::all_of(numbers_, [&](const Number& each) {
      return layout_.number(each.number, state) == each.motion.position();
    });
  }
  /// True if nothing moves, as far as limits of acceleration tell.
  bool rests() const noexcept {
    return all([](auto& each) { return each.rests(); });
  }

 private:
  struct Number {
    std::uint32_t number;
    std::uint32_t offset;  // in the state [bytes]
    double lowest;         // range of its kind
    double highest;
    Kind kind;
    bool is_limited;  // its published value is that of its guard
    NumberMotion motion;
    bool is_commanded = true;
  };

  template <class Begin>
  void begin(const std::uint64_t* mask, Begin&& begin) noexcept {
    begun_ = true;
    observed_ = nullptr;
    for (Number& each : numbers_) {
      each.is_commanded = masked(mask, each.number);
      begin(each);
    }
  }
  template <class Predicate>
  bool all(Predicate&& predicate) const noexcept {
    return std::ranges::all_of(numbers_, predicate, &Number::motion);
  }
  template <class Predicate>
  bool any(Predicate&& predicate) const noexcept {
    return std::ranges::any_of(numbers_, predicate, &Number::motion);
  }
  std::byte* from() noexcept { return reinterpret_cast<std::byte*>(ends_.data()); }
  double start_of(const Number& number) noexcept {
    const bool at_published = starts_observed_ || !number.is_limited;
    return at_published ? layout_.number(number.number, from()) : number.motion.position();
  }
  void to_row(Number& number, std::int64_t iterations) noexcept;
  void blend(Iteration now, std::byte* state) noexcept;
  void publish(const Number& number, std::byte* state) noexcept;

  const StateLayout& layout_;
  std::size_t stride_;                   // [bytes]
  std::vector<std::uint64_t> ends_;      // from, target, and a state to blend into
  std::vector<Number> numbers_;          // those that move; none of a type that blends by itself
  std::vector<std::uint32_t> switches_;  // numbers that switch at the start
  Iteration first_ = 0;
  Iteration last_ = 0;
  Course course_;  // of the last propose()
  const std::byte* observed_ = nullptr;
  bool starts_observed_ = false;  // what propose() planned last
  bool has_integrals_ = false;
  bool begun_ = false;  // the next row begins a command
  std::int64_t requested_by_speed_ = 1;
  Limited slowest_;
  double off_plan_ = 0.0;
};

}  // namespace o80
