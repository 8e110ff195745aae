#include "robot/loop/loop_options.hpp"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>
#include <optional>
#include <utility>
#include <vector>

#include "o80/base/error.hpp"

namespace o80 {

namespace {

using OptionKind = LoopOption::Kind;

constexpr unsigned kProcess = LoopOption::kProcess;
constexpr unsigned kInline = LoopOption::kInline;
constexpr unsigned kEmbedded = LoopOption::kEmbedded;
constexpr unsigned kEverywhere = kProcess | kInline | kEmbedded;

/// Reads the whole text as a number; false if it is not one.
template <class Number, class... Base>
bool read_number(std::string_view text, Number& number, Base... base) {
  const std::string copy(text);
  const char* end = copy.c_str() + copy.size();
  const auto result = std::from_chars(copy.c_str(), end, number, base...);
  return result.ec == std::errc() && result.ptr == end;
}

bool set_stale(LoopOptions& options, std::string_view text, double /*number*/) {
  const std::optional<Stale> stale = stale_of(text);
  if (stale) options.backend.stale = stale;
  return stale.has_value();
}

bool set_permission(LoopOptions& options, std::string_view text, double /*number*/) {
  mode_t mode = 0;
  if (!read_number(text, mode, 8) || mode < 0400 || mode > 0777) return false;
  options.backend.permission = mode;
  return true;
}

bool set_policy(LoopOptions& options, std::string_view text, double /*number*/) {
  using Policy = RealTimeOptions::Policy;
  const auto* word = std::ranges::find(kPolicies, text);
  if (word == kPolicies.end()) return false;
  options.real_time.policy = static_cast<Policy>(word - kPolicies.begin());
  return true;
}

bool set_processors(LoopOptions& options, std::string_view text, double /*number*/) {
  std::vector<int> list;
  while (true) {
    const std::size_t comma = std::min(text.find(','), text.size());
    int processor = 0;
    if (!read_number(text.substr(0, comma), processor) || processor < 0 || processor > 1023)
      return false;
    list.push_back(processor);
    if (comma == text.size()) break;
    text.remove_prefix(comma + 1);
  }
  options.real_time.processors = std::move(list);
  return true;
}

/// A setter of one member, from the number that was read.
#define O80_SET(member)                                             \
  [](LoopOptions& options, std::string_view, double number) {       \
    options.member = static_cast<decltype(options.member)>(number); \
    return true;                                                    \
  }

constexpr std::array kOptions = {
    LoopOption{"segment", OptionKind::text, "a name", 0, 0, "the robot's name",
               "name that frontends attach to", LoopOption::kFlag,
               [](LoopOptions& options, std::string_view text, double) {
                 options.backend.segment = text;
                 return true;
               }},
    LoopOption{"frequency", OptionKind::number, "a number from 0.001 to 1000000 [1/s]", 1e-3, 1e6,
               "the robot's own, or 1000", "iterations a second; in bursting, of simulated time",
               kEverywhere,
               [](LoopOptions& options, std::string_view, double number) {
                 options.backend.period = std::llround(1e9 / number);
                 return true;
               }},
    LoopOption{"bursting", OptionKind::boolean, "true or false", 0, 1, "no",
               "run only the iterations that frontends request", kProcess | kEmbedded,
               O80_SET(backend.bursting)},
    LoopOption{"history", OptionKind::integer, "a whole number from 1 to 1000000000", 1, 1e9,
               "as many as 16 MiB hold, at most 100000", "rows kept", kEverywhere,
               O80_SET(backend.history)},
    LoopOption{"lanes", OptionKind::integer, "a whole number from 1 to 256", 1, 256, "8",
               "frontends that may command at once", kEverywhere, O80_SET(backend.lanes)},
    LoopOption{"lane_blocks", OptionKind::integer, "a whole number from 16 to 4194304", 16, 1 << 22,
               "16384", "blocks of 64 bytes that each of them may have in flight", kEverywhere,
               O80_SET(backend.lane_blocks)},
    LoopOption{"journal", OptionKind::number, "0 or a number from 0.5 to 65536 [MiB]", 0, 65536,
               "twice the largest batch",
               "size of the journal [MiB], 0: none; a batch may be half as large", kEverywhere,
               [](LoopOptions& options, std::string_view, double number) {
                 options.backend.journal = std::llround(number * (1 << 20));
                 return number == 0 || number >= 0.5;
               }},
    LoopOption{"permission", OptionKind::octal, "an octal mode such as 600, 640 or 660", 0, 0,
               "600", "read bits: who may observe, write bits: who may command", kEverywhere,
               set_permission},
    LoopOption{"stale", OptionKind::word, "hold, purge, halt or stop", 0, 0,
               "halt with silence, else hold",
               "policy for a commander that dies, or is silent for too long", kEverywhere,
               set_stale},
    LoopOption{"silence", OptionKind::integer,
               "a whole number from 1 to 1000000000000000 (iterations: seconds x frequency)", 1,
               1e15, "no watchdog",
               "watchdog: iterations without a sign of life before stale applies", kEverywhere,
               O80_SET(backend.silence)},
    LoopOption{"max_overruns", OptionKind::integer, "a whole number from 1 to 100000", 1, 1e5,
               "no limit", "number of late iterations within a second that halts the robot",
               kProcess | kEmbedded, O80_SET(backend.max_overruns)},
    LoopOption{"gap", OptionKind::number, "0 or a number from 0.001 to 3600 [s]", 0, 3600,
               "20 periods and at least 0.1 (none for simulations), or the driver's if it is less",
               "longest time between two iterations; a longer one halts [s], 0: any", kProcess,
               [](LoopOptions& options, std::string_view, double number) {
                 options.backend.gap = std::llround(number * 1e9);
                 return number == 0 || number >= 1e-3;
               }},
    LoopOption{"resume", OptionKind::boolean, "true or false", 0, 1, "no",
               "start without a halt even if the previous backend was halted or killed",
               kProcess | kEmbedded, O80_SET(backend.resume)},
    LoopOption{"accept_reading", OptionKind::boolean, "true or false", 0, 1, "no",
               "start where the robot is read to be, even if it cannot have come there",
               kProcess | kEmbedded, O80_SET(backend.accept_reading)},
    LoopOption{"policy", OptionKind::word, "other, fifo, rr or auto", 0, 0, "other",
               "scheduling class of the loop", kProcess, set_policy},
    LoopOption{"priority", OptionKind::integer, "a whole number from 1 to 99", 1, 99, "80",
               "priority of the loop, unless its policy is other", kProcess,
               O80_SET(real_time.priority)},
    LoopOption{"cpus", OptionKind::list, "a list of processors such as 2,3", 0, 0, "all",
               "processors of the loop", kProcess, set_processors},
    LoopOption{"lock_memory", OptionKind::boolean, "true or false", 0, 1, "no",
               "keep all memory resident", kProcess, O80_SET(real_time.lock_memory)},
    LoopOption{"until_eof", OptionKind::boolean, "true or false", 0, 1, "no",
               "stop when the standard input ends", LoopOption::kFlag, O80_SET(until_eof)},
    LoopOption{"help", OptionKind::boolean, "true or false", 0, 1, "no", "this text",
               LoopOption::kFlag, O80_SET(help)}};
#undef O80_SET

/// Reads a number or a boolean; false if the text is invalid. Other kinds have no number.
bool read_number(const LoopOption& option, std::string_view text, double& number) {
  switch (option.kind) {
    case OptionKind::boolean:
      number = text == "true" ? 1 : 0;
      return text == "true" || text == "false";
    case OptionKind::number:
    case OptionKind::integer:
      if (!read_number(text, number) || !(number >= option.minimum && number <= option.maximum)) {
        return false;
      }
      return option.kind == OptionKind::number || number == std::floor(number);
    default:
      return true;
  }
}

}  // namespace

std::string text_of(std::span<const int> processors) {
  std::string text;
  for (const int processor : processors) {
    text += (text.empty() ? "" : ",") + std::to_string(processor);
  }
  return text;
}

std::span<const LoopOption> loop_options() { return kOptions; }

const LoopOption* find_loop_option(std::string_view name) {
  const auto found = std::ranges::find(kOptions, name, &LoopOption::name);
  return found == kOptions.end() ? nullptr : &*found;
}

void set_loop_option(LoopOptions& options, const LoopOption& option, std::string_view text,
                     std::string_view spelled) {
  double number = 0;
  if (read_number(option, text, number) && option.set(options, text, number)) return;
  throw InvalidArgument(std::string(spelled) + " must be " + option.allowed + ", got '" +
                        std::string(text) + "'");
}

}  // namespace o80
