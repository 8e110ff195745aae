// A script as text: one line a step, words and numbers.
#include <array>
#include <cmath>
#include <cstdarg>
#include <cstdio>
#include <sstream>

#include "o80/describe/options.hpp"
#include "scripts/script.hpp"

namespace o80::test {
namespace {

/// Words of the kinds, in their order.
constexpr std::array kKindWords{"boolean", "int8",   "int16",  "int32",   "int64",   "uint8",
                                "uint16",  "uint32", "uint64", "float32", "float64", "enumeration"};

std::string digits(double value) { return printed("%.17g", value); }

void print_number(std::ostringstream& out, const NumberSpec& number) {
  out << "  number " << kKindWords.at(static_cast<std::size_t>(number.kind)) << " at "
      << digits(number.start);
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
  out << ' ' << step.actuator << " lane " << step.lane << ' ' << to_text(head.pace);
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
  out << describing::option_text(step.action);
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

std::string printed(const char* format, ...) {
  std::array<char, 160> text{};
  va_list arguments;
  va_start(arguments, format);
  std::vsnprintf(text.data(), text.size(), format, arguments);
  va_end(arguments);
  return text.data();
}

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
