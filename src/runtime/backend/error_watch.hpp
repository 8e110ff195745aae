#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/short_text.hpp"
#include "control/motion/state_layout.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Finds numbers whose desired and observed values differ by more than their error limit, for
/// example after a collision or the failure of a motor.
///
/// An observed number that is infinite or NaN exceeds any limit.
///
/// Realtime: everything but construction; O(numbers with an error limit).
class ErrorWatch {
 public:
  explicit ErrorWatch(const Schema& schema);

  /// True if no number has an error limit.
  bool empty() const noexcept { return watched_.empty(); }

  /// A number whose desired and observed values differ by more than its limit.
  struct Excess {
    std::uint32_t actuator = 0;
    std::uint32_t number = 0;  // index in the state
    double desired = 0.0;
    double observed = 0.0;
    double limit = 0.0;
  };
  /// The first such number of two blocks of states, if any.
  std::optional<Excess> find(const std::byte* desired, const std::byte* observed) const noexcept;

 private:
  struct Watched {
    std::uint32_t actuator;
    std::uint32_t number;
    std::uint32_t offset;  // offset of the actuator in the block [bytes]
    std::uint32_t type;
    double limit;
  };

  std::vector<Watched> watched_;
  Layouts layouts_;  // empty: not watched
};

/// "position of actuator 'elbow' is observed at 0.1, desired at 0.5: further apart than its error
/// limit of 0.2".
void describe_excess(const Schema& schema, const ErrorWatch::Excess& excess,
                     ShortText<248>& text) noexcept;

}  // namespace o80
