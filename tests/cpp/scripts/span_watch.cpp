#include "scripts/span_watch.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "control/motion/fastest_motion.hpp"
#include "scripts/limit_watch.hpp"

namespace o80::test {
namespace {

constexpr long double kPeriod = 1e-3L;
constexpr Iteration kSmoothAfter = 5;
constexpr long double kAnywhere = std::numeric_limits<long double>::infinity();
constexpr Iteration kAnyTime = std::int64_t{1} << 40;  // [iterations]

/// The number whose speed a command asks for: the first it names that moves.
std::optional<std::size_t> paced_number(const ScriptWorld& world, const SentCommand& command) {
  const auto& numbers = world.script.actuators[world.step_of(command).actuator].numbers;
  for (std::size_t n = 0; n < numbers.size(); ++n) {
    if (world.names(command, n) && numbers[n].moves()) return n;
  }
  return std::nullopt;
}

}  // namespace

void SpanWatch::Span::include(long double place) {
  low = std::min(low, place);
  high = std::max(high, place);
}

void SpanWatch::Span::include(const Span& other) {
  include(other.low);
  include(other.high);
}

SpanWatch::SpanWatch(const ScriptWorld& world) {
  for (const ActuatorTrack& actuator : world.actuators) {
    numbers_.emplace_back(actuator.numbers.size());
  }
  restart(world);
}

void SpanWatch::restart(const ScriptWorld& world) {
  plans_.assign(numbers_.size(), {});
  for (std::size_t a = 0; a < numbers_.size(); ++a) {
    for (std::size_t n = 0; n < numbers_[a].size(); ++n) {
      const long double place = world.actuators[a].numbers[n].now;
      numbers_[a][n] = {};
      numbers_[a][n].span = {place, place};
    }
  }
}

/// Places where a motion may come to rest: its velocity falls to zero as a cubic, within its span.
SpanWatch::Span SpanWatch::stops(const Number& number, long double place, long double rounding) {
  Span found{place, place};
  // the speed now, from differences that lie back by half an iteration and more, and are rounded
  const long double doubt =
      std::fabs(number.second) + std::fabs(number.third) + (rounding > 1e-3L ? 1.0L : 0.0L);
  if (number.first == 0.0L && doubt == 0.0L) return found;
  if (number.first + doubt > 0.0L) found.include(number.span.high);
  if (number.first - doubt < 0.0L) found.include(number.span.low);
  return found;
}

/// The most that a motion may have moved on within an iteration when it was taken over.
long double SpanWatch::seam_speed(const ScriptWorld& world, std::size_t actuator,
                                  const Number& number, const NumberSpec& spec) {
  // differences lie back, and those of integers are rounded
  long double seam = std::fabs(number.first) + std::fabs(number.second) + std::fabs(number.third) +
                     (spec.is_float() ? 0.0L : 7.0L);
  // in a row of few iterations a minimum jerk is up to 3 times as fast as within the last one
  const SentCommand* previous = world.actuators[actuator].previous;
  if (previous != nullptr &&
      (world.rows_of(*previous) > 1 || world.iteration - previous->active_since < kSmoothAfter)) {
    seam = std::max(seam, 3.0L * std::fabs(number.first));
  }
  return seam;
}

void SpanWatch::begin(const ScriptWorld& world, std::size_t actuator, bool taken_over) {
  const SentCommand& command = *world.actuators[actuator].driver;
  const ScriptStep& step = world.step_of(command);
  const auto paced = paced_number(world, command);
  for (std::size_t n = 0; n < numbers_[actuator].size(); ++n) {
    Number& number = numbers_[actuator][n];
    const NumberTrack& track = world.actuators[actuator].numbers[n];
    const long double place = track.before;
    number.from = place;
    Span span{place, place};
    if (step.head.start == Start::observed && track.reading && world.names(command, n) &&
        std::isfinite(*track.reading)) {
      const NumberSpec& spec = world.script.actuators[actuator].numbers[n];
      const long double reading = as_stored(spec.kind, *track.reading);
      span.include(reading);
      // it jumps there, unless limits count from the last desired state
      const bool is_inside = reading >= spec.limits.minimum && reading <= spec.limits.maximum;
      if (is_inside && !std::isfinite(spec.limits.speed)) number.from = reading;
    }
    if (taken_over) {
      span.include(
          stops(number, place, rounding_of(world.script.actuators[actuator].numbers[n], place)));
      span.include(number.targets);
    }
    Span targets{place, place};
    if (world.names(command, n)) {
      targets = {world.target(command, 0, n), world.target(command, 0, n)};
      for (std::size_t row = 1; row < world.rows_of(command); ++row) {
        targets.include(world.target(command, row, n));
      }
    } else if (const NumberSpec& spec = world.script.actuators[actuator].numbers[n]; spec.resting) {
      targets.include(as_stored(spec.kind, spec.rest));
    }
    span.include(targets);
    const bool bends = step.head.profile == Profile::smooth ||
                       (step.head.profile == Profile::monotone && taken_over);
    if (bends && world.names(command, n)) span = {-kAnywhere, kAnywhere};
    number.span = span;
    number.targets = targets;

    number.fastest = 0.0L;
    if (step.head.pace == Pace::speed && paced == n && step.head.start == Start::desired) {
      const NumberSpec& spec = world.script.actuators[actuator].numbers[n];
      long double seam = seam_speed(world, actuator, number, spec);
      if (std::isfinite(spec.limits.jerk)) {
        const long double jerk = spec.limits.jerk * kPeriod * kPeriod * kPeriod;
        seam += number.second * number.second / (2.0L * jerk) + std::fabs(number.second);
      }
      // no pace reaches further than this
      const long double slowest = (span.high - span.low) / kMaxIterations;
      number.fastest = std::max<long double>({step.head.speed * kPeriod, seam, slowest});
    }
  }
}

bool SpanWatch::is_planned(const ScriptWorld& world, const SentCommand& command) {
  const ScriptStep& step = world.step_of(command);
  const ActuatorSpec& spec = world.script.actuators[step.actuator];
  return !command.is_member && step.mask == 0 && world.rows_of(command) == 1 &&
         step.head.start == Start::desired && step.head.profile != Profile::as_sent &&
         !spec.follow && std::ranges::all_of(spec.numbers, [](const NumberSpec& number) {
           return number.kind == Kind::float64 && !number.bounded() && !number.resting &&
                  std::isfinite(number.limits.acceleration);
         });
}

/// Span, and number of iterations, of the motion that begins.
void SpanWatch::plan(const ScriptWorld& world, std::size_t actuator) {
  Plan& plan = plans_[actuator];
  const SentCommand& command = *world.actuators[actuator].driver;
  const SentCommand* before = std::exchange(plan.command, &command);
  const ScriptStep& step = world.step_of(command);
  const RecordHead& head = step.head;
  const bool was_known = std::exchange(plan.is_known, is_planned(world, command));
  if (!plan.is_known) return;
  plan.requested = 0;
  if (before != nullptr && was_known && head.pace == Pace::direct) {
    const ScriptStep& former = world.step_of(*before);
    if (former.head.pace == Pace::direct && former.head.amount == head.amount &&
        former.head.profile == head.profile && former.values == step.values) {
      plan.fewest = kAnyTime;  // an equal set-point goes on with the motion
      return;
    }
  }
  plan.fewest = 1;
  for (std::size_t n = 0; n < numbers_[actuator].size(); ++n) {
    Number& number = numbers_[actuator][n];
    const Limits& limits = world.script.actuators[actuator].numbers[n].limits;
    Rates rates{limits.speed * 1e-3, limits.acceleration * 1e-6, limits.jerk * 1e-9};
    if (head.pace == Pace::speed && n == 0) rates.speed = std::min(rates.speed, head.speed * 1e-3);
    const auto place = static_cast<double>(world.actuators[actuator].numbers[n].before);
    const double highest = rates.acceleration * (1.0 - 1e-12);
    const Moment now{place, static_cast<double>(number.first), static_cast<double>(number.second)};
    const VelocityChange stop(-now.speed, std::clamp(now.acceleration, -highest, highest), rates);
    plan.fewest = std::max(plan.fewest, FastestMotion(now, step.values[n], rates).iterations());
    number.planned = {place, place};
    for (const double turn :
         {place + stop.displacement(), place + stop.run_before_turn(now.speed), step.values[n]}) {
      number.planned.include(turn);
    }
    const double slack = 1e-10 * rates.speed;  // of sums over hundreds of iterations
    number.planned = {number.planned.low - slack, number.planned.high + slack};
  }
  if (head.pace == Pace::iterations) plan.requested = head.amount;
  if (head.pace == Pace::until) plan.requested = head.amount - world.iteration + 1;
  if (head.pace == Pace::direct) plan.requested = 2 * head.amount / 1'000'000;
  if (head.pace == Pace::duration) plan.requested = head.amount / 1'000'000 + 1;
  // a smooth motion at a speed takes up to twice as long, and longer if it turns first
  if (head.pace == Pace::speed && head.profile == Profile::minimum_jerk) plan.fewest *= 5;
}

/// A planned motion takes the iterations requested, or the fewest that its limits allow and one.
std::optional<Failure> SpanWatch::takes_its_time(const ScriptWorld& world,
                                                 std::size_t actuator) const {
  const Plan& plan = plans_[actuator];
  const SentCommand& command = *world.actuators[actuator].driver;
  if (!plan.is_known || command.status != Status::completed) return std::nullopt;
  const Iteration took = command.ended_at - command.active_since + 1;
  const Iteration longest = std::max(plan.requested, plan.fewest + 1);
  const bool is_set_point = world.step_of(command).head.pace == Pace::direct;
  if (took > plan.requested && plan.requested > 0 && !is_set_point &&
      command.reason != Reason::limits) {
    return Failure{"time of a plan", world.where(actuator, 0) + "it is late without a reason"};
  }
  if (took <= longest && (!is_set_point || took >= plan.requested)) return std::nullopt;
  return Failure{
      "time of a plan",
      world.where(actuator, 0) +
          printed("%jd iterations; %jd were requested, and %jd are the fewest", std::intmax_t{took},
                  std::intmax_t{plan.requested}, std::intmax_t{plan.fewest})};
}

std::optional<Failure> SpanWatch::check(const ScriptWorld& world, std::size_t actuator,
                                        std::size_t n) const {
  const NumberSpec& spec = world.script.actuators[actuator].numbers[n];
  const NumberTrack& track = world.actuators[actuator].numbers[n];
  const Number& number = numbers_[actuator][n];
  const long double rounding =
      std::max(rounding_of(spec, track.now), rounding_of(spec, track.before));
  const bool has_span = !spec.limited() && !world.script.actuators[actuator].blend;
  const Span& span = plans_[actuator].is_known ? number.planned : number.span;
  if (has_span || plans_[actuator].is_known) {
    const long double slack =
        rounding + 1e-12L * std::max(std::fabs(span.low), std::fabs(span.high));
    if (track.now < span.low - slack || track.now > span.high + slack) {
      return Failure{
          "span", world.where(actuator, n) + printed("at %.12Lg, outside the span %.12Lg to %.12Lg",
                                                     track.now, span.low, span.high)};
    }
  }
  const long double covered = std::fabs(track.now - track.before);
  // rows are followed, and a start elsewhere is caught up with, as fast as the limits allow
  const bool is_followed = spec.limited() && world.rows_of(*world.actuators[actuator].driver) > 1;
  if (number.fastest > 0.0L && !is_followed && !world.script.actuators[actuator].blend &&
      covered > number.fastest * (1.0L + 1e-8L) + 2.0L * rounding) {
    return Failure{
        "pace", world.where(actuator, n) + printed("a step of %.12Lg where its pace allows %.12Lg",
                                                   covered, number.fastest)};
  }
  return std::nullopt;
}

std::optional<Failure> SpanWatch::step(const ScriptWorld& world) {
  for (std::size_t a = 0; a < numbers_.size(); ++a) {
    const ActuatorTrack& actuator = world.actuators[a];
    const bool begun = actuator.driver != nullptr && actuator.driver != actuator.previous;
    if (begun) {
      // behind a purge or an interrupt it goes on, too, if it comes before an iteration without a
      // command
      const Status before =
          actuator.previous != nullptr ? actuator.previous->status : Status::completed;
      const bool taken_over = before == Status::overwritten || before == Status::purged ||
                              before == Status::interrupted;
      begin(world, a, taken_over);
      plan(world, a);
    }
    if (actuator.driver != nullptr && actuator.driver->ended_at == world.iteration) {
      if (auto failure = takes_its_time(world, a)) return failure;
    }
    for (std::size_t n = 0; n < numbers_[a].size(); ++n) {
      Number& number = numbers_[a][n];
      const NumberTrack& track = actuator.numbers[n];
      if (actuator.driver != nullptr) {
        if (!world.script.actuators[a].numbers[n].moves()) continue;
        if (auto failure = check(world, a, n)) return failure;
      }
      // a jump to the observed state is no speed
      const long double first = track.now - (begun ? number.from : track.before);
      const long double second = first - number.first;
      number.third = second - number.second;
      number.second = second;
      number.first = first;
    }
  }
  return std::nullopt;
}

}  // namespace o80::test
