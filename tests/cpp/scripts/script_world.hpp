#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "control/rig.hpp"
#include "scripts/script.hpp"

namespace o80::test {

inline constexpr Iteration kNever = -1;

/// A promise that a script broke.
struct Failure {
  std::string property;  // the same for all failures of one kind
  std::string text;
};

/// A command that was sent, and what was told of it.
struct SentCommand {
  std::size_t step = 0;  // of the script
  std::uint32_t lane = 0;
  CommandId id = 0;
  Status status = Status::queued;
  Iteration active_since = kNever;
  Iteration ended_at = kNever;

  /// It gave the desired state of this iteration.
  bool drove(Iteration iteration) const {
    if (active_since == kNever || active_since > iteration) return false;
    if (ended_at == kNever) return true;
    const bool until_its_end =
        status == Status::completed || status == Status::limited || status == Status::interrupted;
    return until_its_end ? iteration <= ended_at : iteration < ended_at;
  }
};

/// Where one number of an actuator is and was.
struct NumberTrack {
  std::uint32_t offset = 0;  // in the block [bytes]
  long double now = 0.0L;
  long double before = 0.0L;      // desired in the iteration before
  std::optional<double> reading;  // observed there; else where it is desired
};

struct ActuatorTrack {
  std::vector<NumberTrack> numbers;
  const SentCommand* driver = nullptr;    // gave the desired state of this iteration
  const SentCommand* previous = nullptr;  // of the iteration before
  const SentCommand* last = nullptr;      // the last that did, since the last fresh start
  Iteration dropped_at = kNever;          // all its commands were dropped before this iteration
  Iteration maybe_dropped_at = kNever;    // some of them, or none
  bool active = false;
  bool clamped = false;
  bool braking = false;
};

/// A script's robot while it plays: the controller, and all that can be seen from outside.
class ScriptWorld {
 public:
  explicit ScriptWorld(const Script& played);

  void add(const ScriptStep& step, std::size_t place);
  void pulse(std::uint32_t lane);
  /// A fresh start: its row takes an iteration.
  void restart(const std::vector<double>* desired);
  void note_drop(std::uint16_t actuator, bool surely = true);
  /// One iteration; the failure is of what was told, not of motion.
  std::optional<Failure> step();

  const ScriptStep& step_of(const SentCommand& command) const { return script.steps[command.step]; }
  /// Whether a command names this number.
  bool names(const SentCommand& command, std::size_t number) const {
    const std::uint64_t mask = step_of(command).mask;
    return mask == 0 || (mask >> number & 1) != 0;
  }
  std::size_t rows_of(const SentCommand& command) const;
  /// A number of the target in a row of a command, as its field holds it.
  long double target(const SentCommand& command, std::size_t row, std::size_t number) const;
  std::string where(std::size_t actuator, std::size_t number) const;

  const Script& script;
  Rig rig;
  std::vector<ActuatorTrack> actuators;
  std::vector<SentCommand*> sent;         // in order; of all lanes
  std::vector<const SentCommand*> ended;  // in this iteration
  Iteration iteration = 0;                // of the last row
  std::uint64_t blocks_sent = 0;

 private:
  void observe();
  void look();
  std::optional<Failure> hear();
  std::optional<Failure> find_drivers();

  struct Pending {
    std::size_t step;
    std::uint32_t place;
  };
  struct LaneBatch {
    BatchBuilder builder;
    std::vector<Pending> commands;
  };
  std::map<std::uint32_t, LaneBatch> batches_;
  std::map<std::pair<std::uint32_t, CommandId>, SentCommand> commands_;
  std::vector<std::vector<const SentCommand*>> running_;  // of each actuator
  std::size_t heard_ = 0;
};

}  // namespace o80::test
