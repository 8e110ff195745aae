#pragma once

#include <cstdint>
#include <optional>
#include <vector>

#include "scripts/script_world.hpp"

namespace o80::test {

/// When commands end (docs/commands.md#one-command).
///
/// A duration ends at the rounding of its exact end. The exact time of a queue begins with its
/// first command, runs on through all paces, and starts anew at an `until`; a command takes at
/// least one iteration.
class TimeWatch {
 public:
  explicit TimeWatch(const ScriptWorld& world);

  void restart(const ScriptWorld& world);
  std::optional<Failure> step(const ScriptWorld& world);

 private:
  struct Clock {
    std::int64_t exact = 0;  // end of the queue so far [ns]
    bool known = true;       // no command of the queue was dropped or late since it began
  };

  static bool begins(const ScriptWorld& world, std::size_t actuator);
  void begin(const ScriptWorld& world, std::size_t actuator);
  void begin_together(const ScriptWorld& world, std::size_t actuator);
  static bool may_be_late(const ScriptWorld& world, const SentCommand& command);
  std::optional<Failure> end(const ScriptWorld& world, std::size_t actuator);

  std::vector<Clock> clocks_;
};

}  // namespace o80::test
