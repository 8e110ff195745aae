#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "base/short_text.hpp"
#include "control/motion/state_layout.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// Checks whether readings may become desired states: a robot cannot move farther than its limits
/// of speed allow, nor lie far outside its bounds.
///
/// A number is farther than it can be if it has moved by more than its speed allows since the
/// reading before, and a tenth of its error limit; or if it lies outside its bounds by more than
/// its error limit, or without one by a tenth of their width. Resting numbers are not watched,
/// because they begin at rest, nor what has no such limit.
///
/// Realtime: everything but construction; O(numbers with a limit of speed or bounds).
class ReadingWatch {
 public:
  enum class Of : std::uint8_t { all, followers, none };
  explicit ReadingWatch(const Schema& schema, Of of = Of::all);

  /// True if no number is watched.
  bool empty() const noexcept { return watched_.empty(); }

  /// A number that cannot be where it was read.
  struct Fault {
    std::uint32_t actuator = 0;
    std::uint32_t number = 0;  // index in the state
    double before = 0.0;       // read before; or the bound
    double read = 0.0;
    double tolerance = 0.0;  // how far apart they may be
    bool is_outside = false;
  };

  /// Later readings are compared with this one.
  void begin(const std::byte* observed) noexcept;
  /// The next reading, `elapsed` [s] after the one before. A step that cannot be is remembered,
  /// until another one leads back.
  void add(const std::byte* observed, double elapsed) noexcept;
  /// The first number that is wrong since begin(), or would be with this reading; bounds included.
  std::optional<Fault> find(const std::byte* observed, double elapsed) const noexcept;
  /// The first number of this actuator that is wrong now, or was wrong one reading before.
  std::optional<Fault> find_of(std::uint32_t actuator) const noexcept;
  /// The same for all actuators that are idle or brake: only these follow their readings.
  std::optional<Fault> find_idle(const std::uint64_t* active,
                                 const std::uint64_t* braking) const noexcept;

 private:
  struct Watched {
    std::uint32_t actuator;
    std::uint32_t number;
    std::uint32_t offset;  // of the actuator in the block [bytes]
    std::uint32_t type;
    double speed;  // [unit/s]
    double noise;  // the described noise, else a tenth of the error limit
    double low;    // bounds, with their tolerance
    double high;
    double before = 0.0;
    double good = 0.0;   // before the step that cannot be
    double since = 0.0;  // time since `good` [s]
    bool is_wrong = false;
    double last = 0.0;  // read before `before`
    bool was_wrong = false;

    bool is_outside(double value) const noexcept { return !(value >= low && value <= high); }
    Fault outside(double value) const noexcept {
      return {actuator, number, value > high ? high : low, value, 0.0, true};
    }
    /// How far it may have come in this time; rounding of the reading is no motion.
    double reach(double elapsed) const noexcept {
      constexpr double kRounding = 1e-9;
      return speed * elapsed * (1.0 + kRounding) + noise + kRounding * std::abs(good);
    }
  };
  static std::optional<Fault> fault_of(const Watched& each) noexcept;
  double value(const Watched& each, const std::byte* block) const noexcept {
    return layouts_[each.type]->number(each.number, block + each.offset);
  }

  std::vector<Watched> watched_;
  Layouts layouts_;  // empty: not watched
};

/// "position of actuator 'elbow' was read at 1 after 0.1: farther than its speed limit allows
/// (0.03). Check the sensor and the robot; if the reading is right, resume with --accept-reading".
void describe_reading(const Schema& schema, const ReadingWatch::Fault& fault, std::string_view cure,
                      ShortText<248>& text) noexcept;

}  // namespace o80
