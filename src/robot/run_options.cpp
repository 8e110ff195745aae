#include "robot/run_options.hpp"

#include <getopt.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <iomanip>
#include <optional>
#include <sstream>
#include <vector>

#include "o80/base/error.hpp"

namespace o80 {

namespace {

constexpr RunFlag kFlags[] = {
    {"segment", "NAME", "name that frontends attach to (default: the robot's)"},
    {"frequency", "HZ", "iterations a second (default: the robot's own, or 1000)"},
    {"bursting", nullptr, "stand still until a frontend asks for iterations"},
    {"history", "ROWS", "rows kept (default: as many as 16 MiB hold, at most 100000)"},
    {"lanes", "N", "frontends that may command at once (default: 8)"},
    {"lane-blocks", "N", "blocks of 64 bytes each of them may have in flight (default: 16384)"},
    {"permission", "OCTAL", "read: may observe, write: may command (default: 600; 640, 660, 644)"},
    {"stale", "POLICY", "when a frontend dies or is silent: hold, purge, halt or stop (hold)"},
    {"silence", "N", "iterations a commander may show no life before that applies (default: ever)"},
    {"max-overruns", "N", "halt when so many iterations within a second are late (default: never)"},
    {"resume", nullptr, "run although the process before was halted or died while commands acted"},
    {"policy", "CLASS", "scheduling: other, fifo or rr (default: other)"},
    {"priority", "N", "1 to 99, with fifo and rr (default: 80)"},
    {"cpus", "LIST", "processors of the loop, for example 2,3"},
    {"lock-memory", nullptr, "keep all memory resident"},
    {"until-eof", nullptr, "stop when the standard input ends"},
    {"help", nullptr, "this text"},
};

double number(std::string_view flag, const char* text, double minimum, double maximum) {
  char* end = nullptr;
  const double value = std::strtod(text, &end);
  if (end == text || *end != 0 || !(value >= minimum && value <= maximum)) {
    std::ostringstream why;
    why << "--" << flag << " cannot be '" << text << "': a number from " << minimum << " to "
        << maximum << " is needed";
    throw InvalidArgument(why.str());
  }
  return value;
}

std::uint64_t whole(std::string_view flag, const char* text, double minimum, double maximum) {
  const double value = number(flag, text, minimum, maximum);
  if (value != std::floor(value)) {
    throw InvalidArgument("--" + std::string(flag) + " cannot be '" + text + "': it is a count");
  }
  return static_cast<std::uint64_t>(value);
}

[[noreturn]] void refuse(std::string_view flag, const char* text, const char* allowed) {
  throw InvalidArgument("--" + std::string(flag) + " cannot be '" + text + "': it is " + allowed);
}

mode_t permission(const char* text) {
  char* end = nullptr;
  const long mode = std::strtol(text, &end, 8);
  if (end == text || *end != 0 || mode < 0400 || mode > 0777) {
    refuse("permission", text, "an octal mode such as 600, 640 or 660");
  }
  return static_cast<mode_t>(mode);
}

std::vector<int> processors(const char* text) {
  std::vector<int> list;
  std::istringstream parts(text);
  for (std::string part; std::getline(parts, part, ',');) {
    list.push_back(static_cast<int>(whole("cpus", part.c_str(), 0, 1023)));
  }
  if (list.empty()) refuse("cpus", text, "a list of processors such as 2,3");
  return list;
}

void set_flag(RunOptions& options, std::string_view flag, const char* text) {
  BackendOptions& backend = options.backend;
  const std::string value = text == nullptr ? "" : text;
  if (flag == "segment") backend.segment = value;
  if (flag == "frequency") {
    backend.period = std::llround(1e9 / number(flag, text, 1e-3, 1e6));
  }
  if (flag == "bursting") backend.bursting = true;
  if (flag == "history") backend.history = whole(flag, text, 1, 1e9);
  if (flag == "lanes") backend.lanes = static_cast<std::uint32_t>(whole(flag, text, 1, 256));
  if (flag == "lane-blocks") {
    backend.lane_blocks = static_cast<std::uint32_t>(whole(flag, text, 16, 1 << 22));
  }
  if (flag == "permission") backend.permission = permission(text);
  if (flag == "stale") {
    const std::optional<Stale> stale = stale_of(value);
    if (!stale) refuse(flag, text, "hold, purge, halt or stop");
    backend.stale = *stale;
  }
  if (flag == "silence") backend.silence = static_cast<std::int64_t>(whole(flag, text, 1, 1e15));
  if (flag == "max-overruns") {
    options.backend.max_overruns = static_cast<std::uint32_t>(whole(flag, text, 1, 1e5));
  }
  if (flag == "resume") backend.resume = true;
  if (flag == "policy") {
    using Policy = RealTimeOptions::Policy;
    if (value != "other" && value != "fifo" && value != "rr")
      refuse(flag, text, "other, fifo or rr");
    options.real_time.policy = value == "other"  ? Policy::other
                               : value == "fifo" ? Policy::fifo
                                                 : Policy::round_robin;
  }
  if (flag == "priority") {
    options.real_time.priority = static_cast<int>(whole(flag, text, 1, 99));
  }
  if (flag == "cpus") options.real_time.processors = processors(text);
  if (flag == "lock-memory") options.real_time.lock_memory = true;
  if (flag == "until-eof") options.until_eof = true;
  if (flag == "help") options.help = true;
}

std::string dashed(std::string name) {
  std::ranges::replace(name, '_', '-');
  return name;
}

void line(std::ostringstream& out, const std::string& flag, const std::string& help) {
  out << "  " << std::left << std::setw(28) << flag << ' ' << help << '\n';
}

}  // namespace

const RunFlag* run_flags(std::size_t& count) {
  count = std::size(kFlags);
  return kFlags;
}

RunOptions parse_run_options(const RobotTable& table, int argc, char** argv) {
  // flags of the loop first, then those of the robot's Config, under both spellings
  std::vector<std::string> names;
  std::vector<std::string> robot_options;
  std::vector<option> long_options;
  for (const RunFlag& flag : kFlags) names.emplace_back(flag.name);
  for (const Option& own : options_of(table)) {
    if (std::ranges::find(names, dashed(own.name)) != names.end()) {
      throw InvalidArgument("robot '" + std::string(table.name) + "' has an option '" + own.name +
                            "', which is a flag of every robot: rename it in its Config");
    }
    robot_options.push_back(own.name);
  }
  for (const std::string& own : robot_options) names.push_back(dashed(own));
  for (const std::string& own : robot_options) names.push_back(own);
  for (std::size_t i = 0; i < names.size(); ++i) {
    const bool is_switch = i < std::size(kFlags) && kFlags[i].value == nullptr;
    long_options.push_back({names[i].c_str(), is_switch ? no_argument : required_argument, nullptr,
                            static_cast<int>(i)});
  }
  long_options.push_back({nullptr, 0, nullptr, 0});

  RunOptions options;
  options.backend.segment = table.name;
  options.real_time.priority = 80;
  bool has_priority = false;
  opterr = 0;
  optind = 1;
  for (int chosen = 0;
       (chosen = getopt_long(argc, argv, ":", long_options.data(), nullptr)) != -1;) {
    if (chosen == ':') {
      throw InvalidArgument(std::string(argv[optind - 1]) + " needs a value");
    }
    if (chosen == '?' || chosen < 0) {
      throw InvalidArgument("there is no flag " + std::string(argv[optind - 1]) +
                            " (or it is ambiguous); see --help");
    }
    const auto index = static_cast<std::size_t>(chosen);
    if (index < std::size(kFlags)) {
      set_flag(options, names[index], optarg);
      has_priority = has_priority || names[index] == "priority";
    } else {
      const std::size_t own = (index - std::size(kFlags)) % robot_options.size();
      options.robot.emplace_back(robot_options[own], optarg);
    }
  }
  if (optind < argc) {
    throw InvalidArgument("'" + std::string(argv[optind]) + "' is no flag; see --help");
  }
  if (has_priority && options.real_time.policy == RealTimeOptions::Policy::other) {
    throw InvalidArgument("--priority needs --policy fifo or rr: policy other has no priorities");
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
  for (const RunFlag& flag : kFlags) {
    line(out,
         "--" + std::string(flag.name) +
             (flag.value == nullptr ? "" : " " + std::string(flag.value)),
         flag.help);
  }
  return out.str();
}

}  // namespace o80
