// A script as text, and back: one line a step, words and numbers.
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
constexpr std::array<std::pair<Action, const char*>, 12> kActionWords{{
    {Action::command, "command"},
    {Action::pulse, "pulse"},
    {Action::run, "run"},
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

template <class Words>
auto value_of(const Words& words, const std::string& word) {
  for (const auto& [value, each] : words) {
    if (word == each) return value;
  }
  throw std::invalid_argument("unknown word '" + word + "' in a script");
}

std::string digits(double value) {
  std::array<char, 40> text{};
  std::snprintf(text.data(), text.size(), "%.17g", value);
  // the shortest that reads back as the same
  if (value == std::round(value)) return text.data();
  for (int precision = 1; precision < 17; ++precision) {
    std::array<char, 40> shorter{};
    std::snprintf(shorter.data(), shorter.size(), "%.*g", precision, value);
    if (std::stod(shorter.data()) == value) return shorter.data();
  }
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

/// The words of one line.
class Line {
 public:
  explicit Line(const std::string& text) : words_(text) {}
  std::string word() {
    std::string found;
    if (!(words_ >> found)) throw std::invalid_argument("a line of a script ends too soon");
    return found;
  }
  bool next(std::string& found) { return static_cast<bool>(words_ >> found); }
  double number() { return std::stod(word()); }
  std::int64_t whole() { return std::stoll(word()); }
  std::uint16_t actuator() {
    const std::string found = word();
    return found == "all" ? kEveryActuator : static_cast<std::uint16_t>(std::stoul(found));
  }
  std::uint32_t index() { return static_cast<std::uint32_t>(std::stoul(word())); }

 private:
  std::istringstream words_;
};

NumberSpec parse_number(Line& line) {
  NumberSpec number;
  number.kind = value_of(kKindWords, line.word());
  std::string word;
  while (line.next(word)) {
    if (word == "at") {
      number.start = line.number();
    } else if (word == "minimum") {
      number.limits.minimum = line.number();
    } else if (word == "maximum") {
      number.limits.maximum = line.number();
    } else if (word == "speed") {
      number.limits.speed = line.number();
    } else if (word == "acceleration") {
      number.limits.acceleration = line.number();
    } else if (word == "jerk") {
      number.limits.jerk = line.number();
    } else if (word == "rest") {
      number.resting = true;
      number.rest = line.number();
    } else {
      throw std::invalid_argument("unknown word '" + word + "' of a number");
    }
  }
  return number;
}

void parse_command(Line& line, ScriptStep& step) {
  step.actuator = line.actuator();
  line.word();  // lane
  step.lane = line.index();
  step.head.pace = value_of(kPaceWords, line.word());
  if (step.head.pace == Pace::speed) {
    step.head.speed = line.number();
  } else if (step.head.pace != Pace::direct && step.head.pace != Pace::fastest) {
    step.head.amount = line.whole();
  }
  bool times = false;
  for (std::string word = line.word(); word != "to"; word = line.word()) {
    if (word == "minimum_jerk") {
      step.head.profile = Profile::minimum_jerk;
    } else if (word == "as_sent") {
      step.head.profile = Profile::as_sent;
    } else if (word == "every") {
      step.head.amount = line.whole();
    } else if (word == "overwrite") {
      step.head.mode = Mode::overwrite;
    } else if (word == "observed") {
      step.head.start = Start::observed;
    } else if (word == "mask") {
      step.mask = static_cast<std::uint64_t>(line.whole());
    } else if (word == "group") {
      step.group = line.index();
    } else if (word == "times") {
      times = true;
    } else if (times) {
      step.times.push_back(std::stoll(word));
    } else {
      throw std::invalid_argument("unknown word '" + word + "' of a command");
    }
  }
  std::string word;
  while (line.next(word)) step.values.push_back(std::stod(word));
}

ScriptStep parse_step(Action action, Line& line) {
  ScriptStep step;
  step.action = action;
  switch (action) {
    case Action::command:
      parse_command(line, step);
      break;
    case Action::pulse:
      step.lane = line.index();
      break;
    case Action::run:
      step.count = line.whole();
      break;
    case Action::purge:
    case Action::interrupt:
      step.actuator = line.actuator();
      break;
    case Action::purge_own:
      step.actuator = line.actuator();
      line.word();  // lane
      step.lane = line.index();
      break;
    case Action::restart_with: {
      std::string word;
      while (line.next(word)) step.values.push_back(std::stod(word));
      break;
    }
    case Action::read:
      step.actuator = line.actuator();
      step.number = line.index();
      step.values.push_back(line.number());
      break;
    default:
      break;
  }
  return step;
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

Script Script::parse(std::string_view text) {
  Script script;
  std::istringstream lines{std::string(text)};
  for (std::string each; std::getline(lines, each);) {
    Line line(each);
    std::string word;
    if (!line.next(word) || word[0] == '#') continue;
    if (word == "actuator") {
      ActuatorSpec& actuator = script.actuators.emplace_back();
      while (line.next(word)) {
        if (word == "follow") actuator.follow = true;
        if (word == "blend") actuator.blend = true;
      }
    } else if (word == "number") {
      script.actuators.at(script.actuators.size() - 1).numbers.push_back(parse_number(line));
    } else {
      script.steps.push_back(parse_step(value_of(kActionWords, word), line));
    }
  }
  return script;
}

}  // namespace o80::test
