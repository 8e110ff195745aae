#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <string_view>

#include "o80/base/time.hpp"

namespace o80 {

/// Cause of a halt.
enum class HaltCause : std::uint32_t {
  none,
  frontend,       // a frontend or `o80 halt` requested it
  driver,         // the driver requested it
  silence,        // a commander was silent for longer than `silence`
  dead_frontend,  // a commander died
  error,          // desired and observed states were further apart than an error limit
  overruns,       // too many iterations overran
  predecessor,    // the former backend was halted, or died while commands were active
  unreachable     // the files of the segment were removed: no frontend can attach any more
};
inline constexpr std::size_t kHaltCauses = 9;
std::string_view to_text(HaltCause cause) noexcept;

/// One halt and its reason.
struct Halt {
  std::uint64_t number = 0;  // from 1; 0: none
  HaltCause cause = HaltCause::none;
  Iteration iteration = -1;      // the first halted iteration; -1: it has not begun
  std::array<char, 64> who{};    // the requesting process; empty: the backend
  std::array<char, 248> text{};  // the reason

  std::string_view who_text() const noexcept { return who.data(); }
  std::string_view reason() const noexcept { return text.data(); }
};

}  // namespace o80
