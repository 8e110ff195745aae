// A robot with values of many kinds and padding between them: all its numbers are counted.

#include <type_traits>

#include "describe/described.hpp"
#include "o80/robot.hpp"

namespace {

constexpr int kNumbers = 97;  // a value repeats after so many

/// Fills the numbers of a described value, in their order, with `next`, `next` + 1 and so on.
template <class T>
void count_into(T& value, int& next) {
  if constexpr (std::is_same_v<T, bool>) {
    value = next++ % kNumbers % 2 != 0;
  } else if constexpr (std::is_same_v<T, described::ControlMode>) {
    using enum described::ControlMode;
    value = std::array{off, position, torque}[static_cast<std::size_t>(next++ % kNumbers % 3)];
  } else if constexpr (std::is_arithmetic_v<T>) {
    value = static_cast<T>(next++ % kNumbers);
  } else if constexpr (requires { value.size(); }) {
    for (auto& each : value) count_into(each, next);
  } else {
    o80_describe(o80::Tag<T>(),
                 [&](auto, auto member, auto, auto) { count_into(value.*member, next); });
  }
}

}  // namespace

class Gapped {
 public:
  struct Config {};
  using Actuators = described::Actuators;
  using Extended = described::Sensors;
  using Requests = o80::Requests<o80::Reset, o80::Snapshot, o80::Restore>;

  explicit Gapped(const Config& /*config*/) {}

  void describe(o80::Schema& schema) const { schema.simulated(); }
  void start() {}
  void write(const o80::Desired<Gapped>& /*desired*/) {}
  void read(o80::Reading<Gapped>& reading) {
    int next = static_cast<int>(7 * reading.iteration());
    count_into(reading.observed, next);
    count_into(reading.extended, next);
  }
  void stop() noexcept {}

  o80::Served on(const o80::Reset& /*reset*/) { return o80::Served::start_afresh(); }
  o80::Served on(const o80::Snapshot& /*snapshot*/) { return o80::Served::done(); }
  o80::Served on(const o80::Restore& /*restore*/) { return o80::Served::start_afresh(); }
};
O80_DESCRIBE(Gapped::Config);

O80_ROBOT(gapped, Gapped);
