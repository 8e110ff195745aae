#pragma once

#include <cstddef>
#include <cstdint>
#include <vector>

#include "o80/control/state_layout.hpp"

namespace o80 {

/// Keeps the desired state of one actuator within its limits: last of all, whatever came before.
class Clamp {
 public:
  Clamp(const Schema& schema, const ActuatorRow& actuator, const StateLayout& layout);

  /// Something is limited.
  bool any() const noexcept { return !limits_.empty(); }
  /// Bounds first, then the step from `previous`; true if anything had to give way.
  bool apply(std::byte* state, const std::byte* previous) const noexcept;

 private:
  struct Limit {
    std::uint32_t number;
    double minimum;
    double maximum;
    double step;  // most in one iteration
  };
  const StateLayout& layout_;
  std::vector<Limit> limits_;
};

}  // namespace o80
