#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "o80/base/time.hpp"

namespace o80 {

/// Why a backend was halted.
enum class HaltCause : std::uint32_t {
  none,
  frontend,       // somebody asked for it
  driver,         // the robot's own code did
  silence,        // a commander showed no life for too long
  dead_frontend,  // a commander died
  error,          // desired and observed states were too far apart
  overruns,       // too many iterations were late
  predecessor     // the backend before was halted, or died while commands acted
};
inline constexpr std::size_t kHaltCauses = 8;
std::string_view to_text(HaltCause cause) noexcept;

/// One halt: its number, and why it was asked for.
struct Halt {
  std::uint64_t number = 0;  // from 1; 0: none
  HaltCause cause = HaltCause::none;
  Iteration iteration = -1;      // in which it began to act, -1 before
  std::array<char, 64> who{};    // asked: a process, or nothing if it was the backend
  std::array<char, 248> text{};  // the reason in words

  std::string_view who_text() const noexcept { return who.data(); }
  std::string_view reason() const noexcept { return text.data(); }
};

}  // namespace o80
