#pragma once

#include <cstdint>
#include <string_view>

#include "balls/balls.hpp"
#include "balls/fly_out.hpp"
#include "o80/robot.hpp"

// The requests about balls. `balls` is null in a simulation without any.

namespace o80::mujoco {

/// Clears the contacts of a ball, so that the next contact counts as the first.
struct ClearContacts {
  static constexpr std::string_view kHelp = "clear the contact records of balls";
  std::uint32_t ball = 0;
};
O80_DESCRIBE(ClearContacts, (ball, "which, counted from 1; 0: all of them"));

Served clear_contacts(Balls* balls, const ClearContacts& request) noexcept;

/// Makes the ball fly out in the next iteration of `balls`.
Served fly_out(Balls* balls, const FlyOut& request) noexcept;

}  // namespace o80::mujoco
