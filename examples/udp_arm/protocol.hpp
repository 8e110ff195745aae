#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <type_traits>

// What the arm and its driver send each other, one UDP datagram each, little-endian.
//
// The arm is the master of time. At each of its ticks it sends its state to the driver that
// connected last. The driver answers with a command. Both sides discard what is not newer than what
// they have.

namespace udp_arm {

inline constexpr std::size_t kJoints = 6;
inline constexpr std::uint32_t kMagic = 0x6d726131;  // the protocol and its version

enum class Kind : std::uint32_t {
  connect,  // send me your states, hold your position
  move,     // follow this setpoint
  stop      // hold your position, I go
};

struct Command {
  std::uint32_t magic = kMagic;
  Kind kind = Kind::connect;
  std::uint64_t session = 0;               // of the arm, as its states say; any in a connect
  std::uint64_t sequence = 0;              // higher in each command
  std::array<double, kJoints> position{};  // [rad]
};

enum class Mode : std::uint32_t {
  ready,      // holds its position
  moving,     // follows the setpoints
  timed_out,  // holds its position until a connect: no setpoint came for too long
  failed      // the arm's hardware cannot go on
};

struct State {
  std::uint32_t magic = kMagic;
  Mode mode = Mode::ready;
  std::uint64_t session = 0;               // drawn when the arm is switched on
  std::uint64_t tick = 0;                  // since then
  std::int64_t period = 0;                 // of a tick [ns]
  std::array<double, kJoints> position{};  // [rad]
  std::array<double, kJoints> velocity{};  // [rad/s]
};

static_assert(std::is_trivially_copyable_v<Command> && sizeof(Command) == 24 + 8 * kJoints);
static_assert(std::is_trivially_copyable_v<State> && sizeof(State) == 32 + 16 * kJoints);

}  // namespace udp_arm
