#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>

#include "o80/robot/real_time.hpp"
#include "o80/runtime/backend.hpp"

namespace o80 {

/// Words of RealTimeOptions::Policy, in its order.
inline constexpr std::array<std::string_view, 4> kPolicies{"other", "fifo", "rr", "auto"};

/// Options of a backend and its loop that every robot has.
struct LoopOptions {
  BackendOptions backend;
  RealTimeOptions real_time;
  bool until_eof = false;  // stop when the standard input ends
  bool help = false;
};

/// Description of one of these options. The flags of `o80 run` and their help, the keywords in
/// Python and their checks, and the table in docs/options.md are made from it.
struct LoopOption {
  enum class Kind : std::uint8_t { text, number, integer, boolean, word, octal, list };
  // where it can be given
  static constexpr unsigned kProcess = 1;   // o80 run, o80.robots.load(...).start(...)
  static constexpr unsigned kInline = 2;    // o80.robots.load(...).inline(...)
  static constexpr unsigned kEmbedded = 4;  // o80.Backend(...)
  static constexpr unsigned kFlag = 8;      // o80 run only

  const char* name;  // as a flag, with dashes instead of underscores
  Kind kind;
  const char* allowed;    // "stale must be hold, purge, halt or stop"
  double minimum;         // of numbers
  double maximum;         // of numbers
  const char* otherwise;  // the default, in words
  const char* help;
  unsigned scope;
  /// Sets the option; false if the text is invalid.
  bool (*set)(LoopOptions& options, std::string_view text, double number);

  bool is_switch() const { return kind == Kind::boolean; }
  const char* kind_name() const {
    constexpr const char* kNames[] = {"text", "number", "integer", "boolean",
                                      "word", "octal",  "list"};
    return kNames[static_cast<std::size_t>(kind)];
  }
};

/// The text of a list of processors: "2,3".
std::string text_of(std::span<const int> processors);

std::span<const LoopOption> loop_options();
/// Null for an unknown name.
const LoopOption* find_loop_option(std::string_view name);

/// Sets an option from its text. Throws InvalidArgument: "`spelled` must be ..., got ...".
void set_loop_option(LoopOptions& options, const LoopOption& option, std::string_view text,
                     std::string_view spelled);

}  // namespace o80
