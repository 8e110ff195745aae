#include "scripts/script_generator.hpp"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <type_traits>
#include <utility>
#include <vector>

#include "describe/visit_number.hpp"
#include "dice.hpp"

namespace o80::test {
namespace {

constexpr double kSecond = 1000.0;  // [iterations]
constexpr std::int64_t kLongestScript = 900;
constexpr std::array kNumericKinds{Kind::float64, Kind::float32, Kind::int8,    Kind::int16,
                                   Kind::int32,   Kind::int64,   Kind::uint8,   Kind::uint16,
                                   Kind::uint32,  Kind::uint64,  Kind::boolean, Kind::enumeration};

/// Values around which a field of this kind moves.
struct Range {
  double low;
  double high;
  double size() const { return high - low; }
};

Range range_of_kind(Kind kind) {
  if (kind == Kind::boolean) return {0.0, 1.0};
  if (kind == Kind::enumeration) return {0.0, 2.0};
  return visit_number(kind, []<class T>(T) -> Range {
    if constexpr (std::is_floating_point_v<T>) return {-1e30, 1e30};
    constexpr double kFar = std::is_signed_v<T> ? 9.2e18 : 1.8e19;  // of 64 bits
    using Whole = std::numeric_limits<T>;
    return {std::max(static_cast<double>(Whole::min()), -kFar),
            std::min(static_cast<double>(Whole::max()), kFar)};
  });
}

class Generator {
 public:
  /// Every fourth seed has commands of several actuators; they are drawn apart from the rest.
  Generator(std::uint64_t seed, bool linear) : dice_(seed), linear_(linear) {
    if (seed % 4 == 3) grouping_ = std::make_unique<Dice>(seed ^ 0x6f38305f67727570U);
  }

  Script script() {
    const std::int64_t count = dice_.one_in(2) ? 1 : dice_.whole(1, 3);
    for (std::int64_t i = 0; i < count; ++i) add_actuator();
    while (played_ < kLongestScript && script_.steps.size() < 300) add_round();
    if (grouping_ != nullptr && count > 1) add_groups();
    return std::move(script_);
  }
  Script planned_script();

 private:
  ScriptStep& add(Action action) {
    ScriptStep& step = script_.steps.emplace_back();
    step.action = action;
    return step;
  }
  void run(std::int64_t iterations) {
    add(Action::run).count = iterations;
    played_ += iterations;
  }
  void pulse(std::uint32_t lane) { add(Action::pulse).lane = lane; }
  std::uint16_t any_actuator() {
    return static_cast<std::uint16_t>(
        dice_.whole(0, static_cast<std::int64_t>(script_.actuators.size()) - 1));
  }
  std::uint32_t any_lane() {
    return dice_.one_in(2) ? 0 : static_cast<std::uint32_t>(dice_.whole(0, 3));
  }

  // the robot
  void add_actuator();
  NumberSpec any_number(Kind kind, const Range& range, bool limited);
  void add_limits(NumberSpec& number, const Range& range);

  // what happens to it
  void add_round();
  void add_chain();
  void add_bulk();
  void add_reading();
  void add_trajectory(std::uint16_t actuator, std::uint32_t lane);
  void add_command(std::uint16_t actuator, std::uint32_t lane);
  void add_restart();
  RecordHead any_planned_head();
  void add_groups();
  bool may_join(std::uint16_t actuator, const ScriptStep& first) const;
  bool can_go_fastest(std::uint16_t actuator) const;
  RecordHead any_head(std::uint16_t actuator);
  double any_target(std::uint16_t actuator, std::size_t number);
  void add_targets(ScriptStep& step, std::size_t rows);
  std::uint64_t any_mask(std::uint16_t actuator);

  Dice dice_;
  std::unique_ptr<Dice> grouping_;  // only where there are groups
  bool linear_;                     // and not limited
  Script script_;
  std::vector<std::vector<Range>> ranges_;
  std::int64_t played_ = 0;
};

/// Full speed takes up to 100 iterations to reach; targets are up to 100 iterations at it away.
Script Generator::planned_script() {
  auto& numbers = script_.actuators.emplace_back().numbers;
  auto& ranges = ranges_.emplace_back();
  for (std::int64_t n = dice_.whole(1, 3); n > 0; --n) {
    Limits& limits = numbers.emplace_back().limits;
    limits.speed = dice_.magnitude(0.001, 1.0) * kSecond;
    limits.acceleration = limits.speed / dice_.magnitude(0.3, 100.0) * kSecond;
    if (!dice_.one_in(3)) {
      limits.jerk = limits.acceleration / dice_.magnitude(0.3, 30.0) * kSecond;
    }
    const double size = limits.speed / kSecond * 100.0;
    ranges.push_back({-size, size});
  }
  std::vector<double> targets(numbers.size(), 0.0);
  for (std::int64_t commands = dice_.whole(1, 5); commands > 0; --commands) {
    ScriptStep& step = add(Action::command);
    step.head = any_planned_head();
    for (std::size_t n = 0; n < numbers.size(); ++n) {
      const double far = ranges[n].high * dice_.magnitude(0.001, 1.0);
      if (!dice_.one_in(10)) targets[n] = dice_.real(-far, far);
    }
    step.values = targets;
    pulse(0);
    if (commands == 1 || dice_.one_in(3)) {
      add(Action::settle);
    } else {
      run(dice_.whole(0, 150));
    }
  }
  return std::move(script_);
}

RecordHead Generator::any_planned_head() {
  RecordHead head;
  head.pace = std::array{Pace::fastest, Pace::speed, Pace::direct, Pace::until,
                         Pace::iterations}[static_cast<std::size_t>(dice_.whole(0, 4))];
  if (head.pace == Pace::speed) {
    head.speed = script_.actuators[0].numbers[0].limits.speed * dice_.magnitude(0.16, 2.0);
  } else if (head.pace == Pace::direct) {
    head.amount = dice_.whole(0, 1) * dice_.whole(1, 30) * 1'000'000;
  } else if (head.pace == Pace::until) {
    head.amount = played_ + dice_.whole(1, 300);
  } else if (head.pace == Pace::iterations) {
    head.amount = dice_.whole(1, 300);
  }
  if (head.pace != Pace::fastest && dice_.one_in(2)) head.profile = Profile::minimum_jerk;
  if (!dice_.one_in(3)) head.mode = Mode::overwrite;
  return head;
}

void Generator::add_actuator() {
  ActuatorSpec spec;
  std::vector<Range> ranges;
  spec.follow = dice_.one_in(5);
  spec.blend = dice_.one_in(10) && !linear_;
  const bool limited = !spec.blend && !linear_ && dice_.one_in(2);
  const bool mixed = !spec.blend && dice_.one_in(3);
  const std::int64_t numbers = spec.blend ? 2 : dice_.one_in(2) ? 1 : dice_.whole(1, 4);
  for (std::int64_t n = 0; n < numbers; ++n) {
    Kind kind = Kind::float64;
    if (mixed) {
      kind = kNumericKinds[static_cast<std::size_t>(
          dice_.whole(0, static_cast<std::int64_t>(kNumericKinds.size()) - 1))];
    }
    const Range whole = range_of_kind(kind);
    const bool is_float = kind == Kind::float64 || kind == Kind::float32;
    const double size = dice_.magnitude(is_float ? 1e-3 : 5.0, dice_.one_in(8) ? 1e12 : 1e3);
    const double middle = dice_.one_in(2) ? 0.0 : dice_.real(-size, size) * 3.0;
    const Range range{std::clamp(middle - size, whole.low, whole.high - 1.0),
                      std::clamp(middle + size, whole.low + 1.0, whole.high)};
    ranges.push_back(range);
    NumberSpec number = any_number(kind, range, limited);
    if (spec.blend) number.resting = false;
    spec.numbers.push_back(number);
  }
  script_.actuators.push_back(spec);
  ranges_.push_back(ranges);
}

NumberSpec Generator::any_number(Kind kind, const Range& range, bool limited) {
  NumberSpec number;
  number.kind = kind;
  if (number.moves() && limited) add_limits(number, range);
  if (number.moves() && !linear_ && dice_.one_in(5)) {
    number.resting = true;
    const double low = std::max(range.low, number.limits.minimum);
    const double high = std::min(range.high, number.limits.maximum);
    number.rest = dice_.one_in(2) && low <= 0.0 && high >= 0.0 ? 0.0 : dice_.real(low, high);
    if (!number.is_float()) {
      number.rest = std::round(number.rest);
      if (number.rest < number.limits.minimum || number.rest > number.limits.maximum) {
        number.resting = false;
      }
    }
  }
  number.start = dice_.real(range.low, range.high);
  if (dice_.one_in(8)) number.start += (range.high - range.low) * dice_.real(-2.0, 2.0);
  if (!number.is_float()) number.start = std::round(number.start);
  return number;
}

void Generator::add_limits(NumberSpec& number, const Range& range) {
  Limits& limits = number.limits;
  if (dice_.one_in(2)) {
    const double low = range.low + dice_.real(0.0, 0.4) * range.size();
    const double high = range.high - dice_.real(0.0, 0.4) * range.size();
    // not always whole numbers, but some of those lie between them
    const double room = number.is_float() ? 0.0 : 1.0;
    if (!dice_.one_in(5)) limits.minimum = low - room;
    if (!dice_.one_in(5)) limits.maximum = high + room;
  }
  if (dice_.one_in(4)) return;
  // so fast that the whole range takes 4 to 2000 iterations; speed, then acceleration, come in 1
  // to 100
  limits.speed = range.size() / dice_.magnitude(4.0, 2000.0) * kSecond;
  if (dice_.one_in(4)) return;
  limits.acceleration = limits.speed / dice_.magnitude(0.5, 100.0) * kSecond;
  if (dice_.one_in(2)) return;
  limits.jerk = limits.acceleration / dice_.magnitude(0.5, 50.0) * kSecond;
}

void Generator::add_round() {
  switch (dice_.whole(0, 15)) {
    case 0:
    case 1:
      return add_chain();
    case 2:
      add_bulk();
      break;
    case 3:
    case 4:
      add_reading();
      break;
    case 5:
      add(Action::purge).actuator = dice_.one_in(2) ? kEveryActuator : any_actuator();
      break;
    case 6: {
      ScriptStep& step = add(Action::purge_own);
      step.actuator = dice_.one_in(2) ? kEveryActuator : any_actuator();
      step.lane = any_lane();
      break;
    }
    case 7:
      add(Action::interrupt).actuator = any_actuator();
      break;
    case 8:
      add(Action::halt);
      run(dice_.whole(0, 30));
      if (!linear_ && !dice_.one_in(4)) add(Action::resume);
      break;
    case 9:
      if (dice_.one_in(3)) add_restart();
      break;
    case 10:
    case 11: {
      const std::uint32_t lane = any_lane();
      add_trajectory(any_actuator(), lane);
      pulse(lane);
      break;
    }
    default: {
      const std::uint32_t lane = any_lane();
      for (std::int64_t i = dice_.whole(1, 3); i > 0; --i) add_command(any_actuator(), lane);
      pulse(lane);
    }
  }
  run(static_cast<std::int64_t>(dice_.magnitude(1.0, dice_.one_in(6) ? 250.0 : 40.0)) - 1);
}

/// Overwrites of one actuator, one soon after the other.
void Generator::add_chain() {
  const std::uint16_t actuator = any_actuator();
  const std::int64_t longest = dice_.whole(0, 12);
  const std::int64_t links = static_cast<std::int64_t>(dice_.magnitude(2.0, 60.0));
  const bool smooth = !linear_ && dice_.one_in(2);
  for (std::int64_t i = 0; i < links; ++i) {
    add_command(actuator, 0);
    RecordHead& head = script_.steps.back().head;
    head.mode = Mode::overwrite;
    if (smooth && head.profile == Profile::linear) head.profile = Profile::minimum_jerk;
    pulse(0);
    run(dice_.whole(0, longest));
  }
}

/// Many commands in one batch.
void Generator::add_bulk() {
  const std::uint32_t lane = any_lane();
  for (std::int64_t i = dice_.whole(5, 25); i > 0; --i) {
    add_command(any_actuator(), lane);
    RecordHead& head = script_.steps.back().head;
    if (head.pace == Pace::iterations) head.amount = std::min<std::int64_t>(head.amount, 12);
  }
  pulse(lane);
}

void Generator::add_reading() {
  if (dice_.one_in(3)) {
    add(Action::track);
    return;
  }
  const std::uint16_t actuator = any_actuator();
  const auto& numbers = script_.actuators[actuator].numbers;
  ScriptStep& step = add(Action::read);
  step.actuator = actuator;
  step.number =
      static_cast<std::uint32_t>(dice_.whole(0, static_cast<std::int64_t>(numbers.size()) - 1));
  const Range& range = ranges_[actuator][step.number];
  double value = dice_.real(range.low, range.high);
  if (dice_.one_in(3)) value += range.size() * dice_.real(-3.0, 3.0);
  if (dice_.one_in(4) && !linear_) {
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const std::array odd{std::nan(""), kInfinity, -kInfinity};
    value = odd[static_cast<std::size_t>(dice_.whole(0, 2))];
    if (!numbers[step.number].is_float()) value = range.high;
  }
  step.values.push_back(value);
}

/// Gives some commands further actuators, which do the same.
void Generator::add_groups() {
  std::vector<ScriptStep> steps;
  steps.swap(script_.steps);
  std::uint32_t groups = 0;
  std::swap(dice_, *grouping_);
  for (ScriptStep& step : steps) {
    const bool is_first =
        step.action == Action::command && step.head.profile != Profile::as_sent && dice_.one_in(2);
    if (is_first) step.group = ++groups;
    script_.steps.push_back(step);
    if (!is_first) continue;
    const std::size_t rows = step.values.size() / script_.actuators[step.actuator].numbers.size();
    for (std::uint16_t a = 0; a < script_.actuators.size(); ++a) {
      if (a == step.actuator || !may_join(a, step) || dice_.one_in(4)) continue;
      ScriptStep member = step;
      member.actuator = a;
      member.mask = any_mask(a);
      member.values.clear();
      add_targets(member, rows);
      script_.steps.push_back(member);
    }
  }
}

bool Generator::may_join(std::uint16_t actuator, const ScriptStep& first) const {
  if (first.head.pace == Pace::fastest) return can_go_fastest(actuator);
  if (first.head.pace != Pace::speed) return true;
  // at a speed that suits its range, too
  const double ratio = ranges_[actuator].front().size() / ranges_[first.actuator].front().size();
  return ratio < 10.0;
}

bool Generator::can_go_fastest(std::uint16_t actuator) const {
  return std::ranges::all_of(script_.actuators[actuator].numbers, [](const NumberSpec& number) {
    return number.moves() && std::isfinite(number.limits.acceleration);
  });
}

void Generator::add_restart() {
  if (dice_.one_in(2)) {
    add(Action::restart);
    return;
  }
  std::vector<double> states;
  for (std::uint16_t a = 0; a < script_.actuators.size(); ++a) {
    for (std::size_t n = 0; n < script_.actuators[a].numbers.size(); ++n) {
      states.push_back(any_target(a, n));
    }
  }
  add(Action::restart_with).values = states;
}

double Generator::any_target(std::uint16_t actuator, std::size_t number) {
  const NumberSpec& spec = script_.actuators[actuator].numbers[number];
  const Range& range = ranges_[actuator][number];
  double value = dice_.real(range.low, range.high);
  if (dice_.one_in(6)) value = dice_.one_in(2) ? 0.0 : spec.rest;
  // targets outside the bounds are refused; now and then they lie on them
  double low = std::max(range.low, spec.limits.minimum);
  double high = std::min(range.high, spec.limits.maximum);
  if (!spec.is_float()) {
    low = std::ceil(low);
    high = std::floor(high);
    value = std::round(value);
  }
  value = std::clamp(value, low, std::max(low, high));
  if (spec.kind == Kind::float32) {
    auto narrow = static_cast<float>(value);
    if (narrow > high) narrow = std::nextafter(narrow, -HUGE_VALF);
    if (narrow < low) narrow = std::nextafter(narrow, HUGE_VALF);
    value = narrow;
  }
  return value;
}

void Generator::add_targets(ScriptStep& step, std::size_t rows) {
  for (std::size_t row = 0; row < rows; ++row) {
    for (std::size_t n = 0; n < script_.actuators[step.actuator].numbers.size(); ++n) {
      step.values.push_back(any_target(step.actuator, n));
    }
  }
}

std::uint64_t Generator::any_mask(std::uint16_t actuator) {
  const std::size_t numbers = script_.actuators[actuator].numbers.size();
  if (numbers == 1 || !dice_.one_in(4)) return 0;
  return static_cast<std::uint64_t>(dice_.whole(1, (std::int64_t{1} << numbers) - 1));
}

RecordHead Generator::any_head(std::uint16_t actuator) {
  RecordHead head;
  const Range& range = ranges_[actuator].front();
  switch (dice_.whole(0, 7)) {
    case 0:
      head.pace = Pace::direct;
      if (dice_.one_in(3)) head.amount = dice_.whole(1, 40) * 1'000'000;
      break;
    case 1:
    case 2:
      head.pace = Pace::duration;
      head.amount = static_cast<std::int64_t>(dice_.magnitude(1e5, 2e8));
      break;
    case 3:
    case 4:
      head.pace = Pace::speed;
      head.speed = range.size() / dice_.magnitude(3.0, 300.0) * kSecond;
      break;
    case 5:
      head.pace = Pace::until;
      // resumes and fresh starts take iterations of their own
      head.amount = played_ + dice_.whole(-3, 150);
      break;
    case 6: {
      if (can_go_fastest(actuator)) {
        head.pace = Pace::fastest;
        break;
      }
      [[fallthrough]];
    }
    default:
      head.pace = Pace::iterations;
      head.amount = static_cast<std::int64_t>(dice_.magnitude(1.0, 200.0)) - 1;
  }
  if (!linear_ && dice_.one_in(2)) head.profile = Profile::minimum_jerk;
  if (!linear_ && head.pace == Pace::direct && dice_.one_in(4)) head.profile = Profile::as_sent;
  if (dice_.one_in(3)) head.mode = Mode::overwrite;
  if (dice_.one_in(8)) head.start = Start::observed;
  return head;
}

void Generator::add_command(std::uint16_t actuator, std::uint32_t lane) {
  const RecordHead head = any_head(actuator);
  ScriptStep& step = add(Action::command);
  step.actuator = actuator;
  step.lane = lane;
  step.head = head;
  step.mask = any_mask(actuator);
  add_targets(step, 1);
}

void Generator::add_trajectory(std::uint16_t actuator, std::uint32_t lane) {
  RecordHead head = any_head(actuator);
  const auto rows = static_cast<std::size_t>(dice_.magnitude(2.0, 40.0));
  if (head.pace == Pace::until || head.pace == Pace::fastest) head.pace = Pace::duration;
  if (head.pace == Pace::duration) head.amount = 0;
  if (head.profile == Profile::as_sent) head.profile = Profile::linear;
  if (head.pace == Pace::iterations) head.amount = dice_.whole(0, 9);
  const bool is_due = head.pace == Pace::iterations || head.pace == Pace::duration;
  if (is_due && !linear_ && dice_.one_in(2))
    head.profile = dice_.one_in(4)   ? Profile::hold
                   : dice_.one_in(3) ? Profile::monotone
                                     : Profile::smooth;
  ScriptStep& step = add(Action::command);
  step.actuator = actuator;
  step.lane = lane;
  step.head = head;
  step.mask = any_mask(actuator);
  add_targets(step, rows);
  if (head.pace != Pace::duration) return;
  // rows of many iterations, of less than one, and several at one time
  const double usual = dice_.magnitude(1e5, 1e7);
  std::int64_t time = 0;
  for (std::size_t row = 0; row < rows; ++row) {
    if (!dice_.one_in(6)) time += static_cast<std::int64_t>(dice_.real(0.0, 2.0 * usual));
    step.times.push_back(time);
  }
  step.head.amount = 0;
}

}  // namespace

Script random_script(std::uint64_t seed) { return Generator(seed, false).script(); }
Script linear_script(std::uint64_t seed) { return Generator(seed, true).script(); }
Script planned_script(std::uint64_t seed) { return Generator(seed, false).planned_script(); }

}  // namespace o80::test
