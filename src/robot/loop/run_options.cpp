#include "robot/loop/run_options.hpp"

#include <algorithm>
#include <iomanip>
#include <optional>
#include <sstream>
#include <string_view>
#include <vector>

#include "o80/base/error.hpp"
#include "o80/base/nearest_name.hpp"

namespace o80 {

namespace {

std::string dashed(std::string name) {
  std::ranges::replace(name, '_', '-');
  return name;
}

/// A flag of the command line: a loop option, or an option of the robot's Config.
struct Flag {
  std::string option;
  std::string name = dashed(option);    // without the two dashes before it
  const LoopOption* of_loop = nullptr;  // null: the robot's

  bool is_switch() const { return of_loop != nullptr && of_loop->is_switch(); }
};

std::vector<Flag> flags_of(const RobotTable& table) {
  std::vector<Flag> flags;
  for (const LoopOption& option : loop_options()) {
    flags.push_back({.option = option.name, .of_loop = &option});
  }
  for (const Option& own : options_of(table)) {
    if (find_loop_option(own.name) != nullptr) {
      throw InvalidArgument("robot '" + std::string(table.name) + "' has an option '" + own.name +
                            "', which is a flag of every robot: rename it in its Config");
    }
    flags.push_back({.option = own.name});
  }
  return flags;
}

/// The flag of "--name" or "--name=value", whose name may be abbreviated and have underscores.
const Flag& flag_of(std::string_view word, const std::vector<Flag>& flags) {
  const std::string given(word.substr(0, word.find('=')));
  const std::string name = dashed(given.substr(2));
  const Flag* found = nullptr;
  std::vector<std::string> names;
  std::vector<std::string> begun;
  for (const Flag& flag : flags) {
    if (flag.name == name) return flag;
    names.push_back(flag.name);
    if (name.empty() || !flag.name.starts_with(name)) continue;
    begun.push_back("--" + flag.name);
    found = &flag;
  }
  if (begun.size() == 1) return *found;
  if (begun.size() > 1) {
    throw InvalidArgument(given + " may be " + first_names(begun) + ": write it out");
  }
  const std::string near = nearest_name(name, names);
  throw InvalidArgument(
      "there is no flag " + given +
      (near.empty() ? "; see --help" : ". Did you mean --" + near + "? See --help"));
}

[[noreturn]] void refuse_word(std::string_view word) {
  const bool flag_without_dashes = word.find('=') != std::string_view::npos;
  throw InvalidArgument(
      "'" + std::string(word) + "' is not a flag: flags begin with --" +
      (flag_without_dashes ? ", for example --" + std::string(word) : "; see --help"));
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
  const std::vector<Flag> flags = flags_of(table);
  RunOptions options;
  options.backend.segment = table.name;
  options.real_time.priority = 80;
  bool has_priority = false;
  for (int i = 1; i < argc; ++i) {
    const std::string_view word = argv[i];
    if (!word.starts_with("--")) refuse_word(word);
    const Flag& flag = flag_of(word, flags);
    std::optional<std::string_view> value;
    if (const auto equals = word.find('='); equals != std::string_view::npos) {
      value = word.substr(equals + 1);
    } else if (i + 1 < argc && (!flag.is_switch() || argv[i + 1][0] != '-')) {
      value = argv[++i];
    }
    if (flag.is_switch() && value) {
      throw InvalidArgument("--" + flag.name + " takes no value, got '" + std::string(*value) +
                            "': give it without a value, or leave it out");
    }
    if (flag.is_switch()) value = "true";
    if (!value) throw InvalidArgument(std::string(word) + " needs a value");
    if (flag.of_loop == nullptr) {
      options.robot.emplace_back(flag.option, *value);
      continue;
    }
    set_loop_option(options, *flag.of_loop, *value, "--" + flag.name);
    has_priority = has_priority || flag.option == "priority";
    options.has_policy = options.has_policy || flag.option == "policy";
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
    const std::string value = flag.is_switch() ? "" : std::string(" ") + flag.kind_name();
    line(out, "--" + dashed(flag.name) + value, help_of(flag));
  }
  return out.str();
}

}  // namespace o80
