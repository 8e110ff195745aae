#include "robot/loop/run_options.hpp"

#include <getopt.h>

#include <algorithm>
#include <iomanip>
#include <sstream>
#include <vector>

#include "o80/base/error.hpp"
#include "robot/loop/flag_errors.hpp"

namespace o80 {

namespace {

/// What getopt_long returns for the first option; above the characters ':' and '?', which it
/// returns for errors.
constexpr int kFirstOption = 256;

std::string dashed(std::string name) {
  std::ranges::replace(name, '_', '-');
  return name;
}

/// The kind of value that follows a flag, for the help.
std::string value_of(const LoopOption& option) {
  switch (option.kind) {
    case LoopOption::Kind::boolean:
      return "";
    case LoopOption::Kind::word:
      return " word";
    case LoopOption::Kind::octal:
      return " octal";
    case LoopOption::Kind::list:
      return " list";
    case LoopOption::Kind::text:
      return " text";
    default:
      return option.kind == LoopOption::Kind::integer ? " integer" : " number";
  }
}

std::string help_of(const LoopOption& option) {
  std::string text = option.help;
  if (option.is_switch()) return text;
  if (option.kind == LoopOption::Kind::word) text += std::string(": ") + option.allowed;
  return text + " (default: " + option.otherwise + ")";
}

void line(std::ostringstream& out, const std::string& flag, const std::string& help) {
  out << "  " << std::left << std::setw(28) << flag << ' ' << help << '\n';
}

}  // namespace

RunOptions parse_run_options(const RobotTable& table, int argc, char** argv) {
  // flags of the loop first, then those of the robot's Config, under both spellings
  std::vector<std::string> names;
  std::vector<std::string> robot_options;
  std::vector<option> long_options;
  for (const LoopOption& flag : loop_options()) names.push_back(dashed(flag.name));
  for (const Option& own : options_of(table)) {
    if (std::ranges::find(names, dashed(own.name)) != names.end()) {
      throw InvalidArgument("robot '" + std::string(table.name) + "' has an option '" + own.name +
                            "', which is a flag of every robot: rename it in its Config");
    }
    robot_options.push_back(own.name);
  }
  for (const std::string& own : robot_options) names.push_back(dashed(own));
  const auto add = [&](const std::string& spelled, std::size_t i) {
    const bool is_switch = i < loop_options().size() && loop_options()[i].is_switch();
    long_options.push_back({spelled.c_str(), is_switch ? no_argument : required_argument, nullptr,
                            kFirstOption + static_cast<int>(i)});
  };
  for (std::size_t i = 0; i < names.size(); ++i) add(names[i], i);
  // the same number again: an abbreviation of both spellings is not ambiguous
  for (std::size_t i = 0; i < robot_options.size(); ++i) {
    add(robot_options[i], loop_options().size() + i);
  }
  long_options.push_back({nullptr, 0, nullptr, 0});

  std::vector<std::string> switches;
  for (const LoopOption& flag : loop_options()) {
    if (flag.is_switch()) switches.push_back(dashed(flag.name));
  }
  const std::vector<std::string> words(argv, argv + argc);  // getopt_long changes their order

  RunOptions options;
  options.backend.segment = table.name;
  options.real_time.priority = 80;
  bool has_priority = false;
  opterr = 0;
  optind = 0;  // begins anew, also after a command line that was refused half way
  for (int chosen = 0;
       (chosen = getopt_long(argc, argv, ":", long_options.data(), nullptr)) != -1;) {
    if (chosen == ':') {
      throw InvalidArgument(std::string(argv[optind - 1]) + " needs a value");
    }
    if (chosen == '?' || chosen < 0) {
      throw InvalidArgument(refused_flag(argv[optind - 1], names, switches));
    }
    const auto index = static_cast<std::size_t>(chosen - kFirstOption);
    if (index < loop_options().size()) {
      const char* text = optarg == nullptr ? "true" : optarg;
      set_loop_option(options, loop_options()[index], text, "--" + names[index]);
      has_priority = has_priority || names[index] == "priority";
      options.has_policy = options.has_policy || names[index] == "policy";
    } else {
      options.robot.emplace_back(robot_options[index - loop_options().size()], optarg);
    }
  }
  if (optind < argc) {
    throw InvalidArgument(refused_word(argv[optind], words, switches));
  }
  if (has_priority && options.real_time.policy == RealTimeOptions::Policy::other) {
    throw InvalidArgument(
        "--priority needs --policy fifo, rr or auto: policy other has no priorities");
  }
  check_options(table, options.robot);
  return options;
}

std::string run_help(const RobotTable& table) {
  std::ostringstream out;
  out << "Runs the robot '" << table.name << "' (" << table.built_with << ").\n";
  const std::vector<Option> own = options_of(table);
  if (!own.empty()) out << "\nThe robot:\n";
  for (const Option& each : own) {
    const std::string unit = each.unit.empty() ? "" : " [" + each.unit + "]";
    const std::string otherwise =
        each.default_text.empty() ? "" : " (default: " + each.default_text + ")";
    line(out, "--" + dashed(each.name) + " " + each.kind, each.help + unit + otherwise);
  }
  out << "\nThe loop:\n";
  for (const LoopOption& flag : loop_options()) {
    line(out, "--" + dashed(flag.name) + value_of(flag), help_of(flag));
  }
  return out.str();
}

}  // namespace o80
