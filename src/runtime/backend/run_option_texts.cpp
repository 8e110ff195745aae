#include "runtime/backend/run_option_texts.hpp"

#include <array>
#include <charconv>
#include <string>

namespace o80 {

namespace {

/// The shortest text that reads back as the same number.
std::string shortest(double number) {
  std::array<char, 32> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), number).ptr};
}

std::string octal(mode_t mode) {
  std::array<char, 16> text{};
  return {text.data(), std::to_chars(text.data(), text.data() + text.size(), mode, 8).ptr};
}

const char* text_of(bool flag) { return flag ? "true" : "false"; }

}  // namespace

Provenance::Options texts_of(const BackendOptions& options) {
  constexpr double kMebi = 1 << 20;
  Provenance::Options texts{
      {"frequency", shortest(1e9 / static_cast<double>(options.period))},
      {"bursting", text_of(options.bursting)},
      {"history", std::to_string(options.history)},
      {"lanes", std::to_string(options.lanes)},
      {"lane_blocks", std::to_string(options.lane_blocks)},
      {"journal", shortest(static_cast<double>(options.journal) / kMebi)},
      {"permission", octal(options.permission)},
      {"stale", std::string(name_of(options.stale_policy()))},
      {"resume", text_of(options.resume)},
      {"accept_reading", text_of(options.accept_reading)},
  };
  if (options.silence > 0) texts.emplace_back("silence", std::to_string(options.silence));
  if (options.gap >= 0)
    texts.emplace_back("gap", shortest(static_cast<double>(options.gap) * 1e-9));
  if (options.max_overruns > 0)
    texts.emplace_back("max_overruns", std::to_string(options.max_overruns));
  return texts;
}

}  // namespace o80
