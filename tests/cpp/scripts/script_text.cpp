// A script as text: one line a step, words and numbers.
#include <array>
#include <cmath>
#include <cstdio>
#include <sstream>
#include <stdexcept>
#include <utility>

#include "scripts/script.hpp"

namespace o80::test {
namespace {

constexpr std::array<std::pair<Kind, const char*>, 12> kKindWords{{
    {Kind::boolean, "boolean"},
    {Kind::int8, "int8"},
    {Kind::int16, "int16"},
    {Kind::int32, "int32"},
    {Kind::int64, "int64"},
    {Kind::uint8, "uint8"},
    {Kind::uint16, "uint16"},
    {Kind::uint32, "uint32"},
    {Kind::uint64, "uint64"},
    {Kind::float32, "float32"},
    {Kind::float64, "float64"},
    {Kind::enumeration, "enumeration"},
}};
constexpr std::array<std::pair<Action, const char*>, 13> kActionWords{{
    {Action::command, "command"},
    {Action::pulse, "pulse"},
    {Action::run, "run"},
    {Action::settle, "settle"},
    {Action::purge, "purge"},
    {Action::purge_own, "purge_own"},
    {Action::interrupt, "interrupt"},
    {Action::halt, "halt"},
    {Action::resume, "resume"},
    {Action::restart, "restart"},
    {Action::restart_with, "restart_with"},
    {Action::read, "read"},
    {Action::track, "track"},
}};
constexpr std::array<std::pair<Pace, const char*>, 6> kPaceWords{{
    {Pace::direct, "direct"},
    {Pace::duration, "duration"},
    {Pace::speed, "speed"},
    {Pace::until, "until"},
    {Pace::iterations, "over"},
    {Pace::fastest, "fastest"},
}};

template <class Words, class Value>
std::string word_for(const Words& words, Value value) {
  for (const auto& [each, word] : words) {
    if (each == value) return word;
  }
  throw std::invalid_argument("a value without a word");
}

std::string digits(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.17g", value);
  return text.data();
}

void print_number(std::ostringstream& out, const NumberSpec& number) {
  out << "  number " << word_for(kKindWords, number.kind) << " at " << digits(number.start);
  const auto limit = [&](const char* word, double value) {
    if (std::isfinite(value)) out << ' ' << word << ' ' << digits(value);
  };
  limit("minimum", number.limits.minimum);
  limit("maximum", number.limits.maximum);
  limit("speed", number.limits.speed);
  limit("acceleration", number.limits.acceleration);
  limit("jerk", number.limits.jerk);
  if (number.resting) out << " rest " << digits(number.rest);
  out << '\n';
}

std::string actuator_word(std::uint16_t actuator) {
  return actuator == kEveryActuator ? "all" : std::to_string(actuator);
}

void print_command(std::ostringstream& out, const ScriptStep& step) {
  const RecordHead& head = step.head;
  out << ' ' << step.actuator << " lane " << step.lane << ' ' << word_for(kPaceWords, head.pace);
  if (head.pace == Pace::speed) {
    out << ' ' << digits(head.speed);
  } else if (head.pace != Pace::direct && head.pace != Pace::fastest) {
    out << ' ' << head.amount;
  }
  if (head.pace == Pace::direct && head.amount != 0) out << " every " << head.amount;
  if (head.profile != Profile::linear) out << ' ' << to_text(head.profile);
  if (head.mode == Mode::overwrite) out << " overwrite";
  if (head.start == Start::observed) out << " observed";
  if (step.mask != 0) out << " mask " << step.mask;
  if (step.group != 0) out << " group " << step.group;
  if (!step.times.empty()) out << " times";
  for (const std::int64_t time : step.times) out << ' ' << time;
  out << " to";
  for (const double value : step.values) out << ' ' << digits(value);
}

void print_step(std::ostringstream& out, const ScriptStep& step) {
  out << word_for(kActionWords, step.action);
  switch (step.action) {
    case Action::command:
      print_command(out, step);
      break;
    case Action::pulse:
      out << ' ' << step.lane;
      break;
    case Action::run:
      out << ' ' << step.count;
      break;
    case Action::purge:
    case Action::interrupt:
      out << ' ' << actuator_word(step.actuator);
      break;
    case Action::purge_own:
      out << ' ' << actuator_word(step.actuator) << " lane " << step.lane;
      break;
    case Action::restart_with:
      for (const double value : step.values) out << ' ' << digits(value);
      break;
    case Action::read:
      out << ' ' << step.actuator << ' ' << step.number << ' ' << digits(step.values.at(0));
      break;
    default:
      break;
  }
  out << '\n';
}

}  // namespace

std::string Script::text() const {
  std::ostringstream out;
  for (const ActuatorSpec& actuator : actuators) {
    out << "actuator" << (actuator.follow ? " follow" : "") << (actuator.blend ? " blend" : "")
        << '\n';
    for (const NumberSpec& number : actuator.numbers) print_number(out, number);
  }
  for (const ScriptStep& step : steps) print_step(out, step);
  return out.str();
}

}  // namespace o80::test
