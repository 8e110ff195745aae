#pragma once

// A robot whose every row says what it must contain.

#include <array>
#include <bit>
#include <cstdint>

#include "o80/runtime/observation.hpp"
#include "o80/runtime/robot_types.hpp"

namespace torture {

inline constexpr std::uint32_t kActuators = 2;
inline constexpr std::uint32_t kFiller = 24;
// of every desired state; quintics that overshoot are clamped there
inline constexpr double kLowest = 0;
inline constexpr double kHighest = 2;
// with some backends, one actuator has these limits too
inline constexpr std::uint32_t kLimited = kActuators - 1;
inline constexpr double kSpeed = 200;            // [1/s]
inline constexpr double kAcceleration = 20'000;  // [1/s^2]

constexpr std::uint64_t mix(std::uint64_t a, std::uint64_t b = 0) {
  std::uint64_t z = a * 0x9E3779B97F4A7C15ULL + b + 0x632BE59BD9B4E019ULL;
  z = (z ^ z >> 30) * 0xBF58476D1CE4E5B9ULL;
  z = (z ^ z >> 27) * 0x94D049BB133111EBULL;
  return z ^ z >> 31;
}

/// Serves nothing but to be counted; every seventh is refused.
struct Mark {
  std::uint64_t id = 0;
};
/// Starts afresh.
struct Again {
  std::uint64_t id = 0;
};

/// Served also while the backend is halted.
struct Look {
  static constexpr bool kWhileHalted = true;
  std::uint64_t id = 0;
};

struct Sensors {
  std::uint64_t generation = 0;  // which backend
  std::uint64_t chain = 0;       // digest of the row before
  std::uint64_t digest = 0;      // of all of this row
  std::array<std::uint64_t, kFiller> filler{};
};

O80_DESCRIBE(Mark, id);
O80_DESCRIBE(Again, id);
O80_DESCRIBE(Look, id);
O80_DESCRIBE(Sensors, generation, chain, digest, filler);

using States = std::array<double, kActuators>;

struct Robot {
  using Actuators = States;
  using Extended = Sensors;
  using Requests = o80::Requests<Mark, Again, Look>;
};

inline bool is_refused(std::uint64_t mark) { return mark % 7 == 0; }

inline std::uint64_t filler(std::uint64_t generation, o80::Iteration iteration,
                            std::uint32_t place) {
  return mix(generation << 40 ^ static_cast<std::uint64_t>(iteration), place);
}

/// What the extended values of a row must be, given its states and the digest of the one before.
inline Sensors sensors_of(std::uint64_t generation, o80::Iteration iteration, std::uint64_t chain,
                          const std::array<double, kActuators>& desired,
                          const std::array<double, kActuators>& observed) {
  Sensors sensors{.generation = generation, .chain = chain, .digest = 0, .filler = {}};
  std::uint64_t digest = mix(generation, static_cast<std::uint64_t>(iteration)) ^ mix(chain, 1);
  for (std::uint32_t i = 0; i < kFiller; ++i) {
    sensors.filler[i] = filler(generation, iteration, i);
    digest = mix(digest, sensors.filler[i]);
  }
  for (std::uint32_t i = 0; i < kActuators; ++i) {
    digest = mix(digest, std::bit_cast<std::uint64_t>(desired[i]));
    digest = mix(digest, std::bit_cast<std::uint64_t>(observed[i]));
  }
  sensors.digest = digest;
  return sensors;
}

/// A target that no other command of a campaign has: 52 bits of chance.
inline double unique_target(std::uint64_t seed) {
  return std::bit_cast<double>(0x3FF0000000000000ULL | mix(seed) >> 12);
}

}  // namespace torture
