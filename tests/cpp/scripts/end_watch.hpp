#pragma once

#include <cstddef>
#include <optional>

#include "scripts/script_world.hpp"

namespace o80::test {

/// What holds when a command has ended: a completed one is on its target bit for bit, and without
/// a command a number stays, rests, follows or brakes, as the row says
/// (docs/commands.md#with-no-command-left).
class EndWatch {
 public:
  std::optional<Failure> step(const ScriptWorld& world) const;

 private:
  std::optional<Failure> says_clamped(const ScriptWorld& world, std::size_t actuator) const;
  std::optional<Failure> on_target(const ScriptWorld& world, const SentCommand& command) const;
  std::optional<Failure> masks(const ScriptWorld& world, std::size_t actuator) const;
  std::optional<Failure> idle(const ScriptWorld& world, std::size_t actuator) const;
};

}  // namespace o80::test
