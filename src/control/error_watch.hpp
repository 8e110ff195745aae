#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/short_text.hpp"
#include "control/state_layout.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Notices when desired and observed states are further apart than their error limits: a collision,
/// a motor that has lost its power.
///
/// An observed number that is infinite or NaN is further apart than any limit.
///
/// Realtime: everything but construction; O(numbers that have such a limit).
class ErrorWatch {
 public:
  explicit ErrorWatch(const Schema& schema);

  /// A number whose desired and observed values are too far apart.
  struct Excess {
    std::uint32_t actuator = 0;
    std::uint32_t number = 0;  // of its state
    double desired = 0.0;
    double observed = 0.0;
    double limit = 0.0;
  };
  /// The first such number of two blocks of states.
  std::optional<Excess> find(const std::byte* desired, const std::byte* observed) const noexcept;

 private:
  struct Watched {
    std::uint32_t actuator;
    std::uint32_t number;
    std::uint32_t offset;  // of the actuator in the block [bytes]
    std::uint32_t type;
    double limit;
  };

  std::vector<Watched> watched_;
  std::vector<std::optional<StateLayout>> layouts_;  // of each type that is watched
};

/// "position of actuator 'elbow' is observed at 0.1, 0.4 away from the desired 0.5 (error limit
/// 0.2)".
void describe_excess(const Schema& schema, const ErrorWatch::Excess& excess,
                     ShortText<248>& text) noexcept;

}  // namespace o80
