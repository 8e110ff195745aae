#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

#include "control/batch/record.hpp"
#include "o80/describe/describe.hpp"
#include "o80/describe/schema.hpp"

namespace o80::test {

/// One number of an actuator's state in a script.
struct NumberSpec {
  Kind kind = Kind::float64;
  double start = 0.0;  // observed in row 0
  Limits limits;
  bool resting = false;
  double rest = 0.0;

  bool moves() const { return kind != Kind::boolean && kind != Kind::enumeration; }
  bool is_float() const { return kind == Kind::float64 || kind == Kind::float32; }
  bool bounded() const;
  bool limited() const;
};

struct ActuatorSpec {
  bool follow = false;
  bool blend = false;  // two float64 with an interpolation of their own
  std::vector<NumberSpec> numbers;
};

/// What a step of a script does.
enum class Action : std::uint8_t {
  command,       // adds a command or trajectory to the batch of a lane
  pulse,         // the batch of a lane is taken
  run,           // iterations
  settle,        // iterations until no command is left
  purge,         // one actuator or all, whoever sent
  purge_own,     // the same, of one lane
  interrupt,     // one actuator
  halt,          // everything
  resume,        // once nothing brakes: a fresh start from the observed state
  restart,       // a fresh start from the observed state
  restart_with,  // a fresh start with given desired states
  read,          // one number is observed at a value from now on
  track          // all numbers are observed where they are desired again
};

O80_DESCRIBE_ENUM(Action, command, pulse, run, settle, purge, purge_own, interrupt, halt, resume,
                  restart, restart_with, read, track);

struct ScriptStep {
  Action action = Action::run;
  std::uint32_t lane = 0;
  std::uint16_t actuator = 0;  // or kEveryActuator
  std::uint32_t number = 0;
  std::int64_t count = 0;   // iterations of run
  RecordHead head;          // pace, amount or speed, profile, mode and start
  std::uint64_t mask = 0;   // 0: the whole state
  std::uint32_t group = 0;  // commands in a row with the same number are one command; 0: alone
  std::vector<std::int64_t> times;
  std::vector<double> values;  // rows of targets, desired states of restart_with, the reading
};

/// How a command of a script ended; no status if it has not.
struct CommandEnd {
  Status status = Status::none;
  Iteration iteration = 0;
  bool operator==(const CommandEnd&) const = default;
};

/// A robot and what happens to it, iteration by iteration, without a clock.
///
/// It prints itself as a few lines of text.
struct Script {
  std::vector<ActuatorSpec> actuators;
  std::vector<ScriptStep> steps;

  std::string text() const;

  /// The robot, iterating every millisecond. Number i of an actuator lies at its `offsets`.
  Schema schema() const;
};

/// Writes a value as a field of this kind has it, rounded and cut to what the kind can hold.
void store_as(Kind kind, double value, std::byte* at);
/// A number as it lies in a block.
long double load_as(Kind kind, const std::byte* at);
/// A value as a field of this kind has it.
long double as_stored(Kind kind, double value);
/// As printf writes it.
[[gnu::format(printf, 1, 2)]] std::string printed(const char* format, ...);
/// Size of a field of this kind in a script's robot [bytes].
std::uint32_t bytes_of_kind(Kind kind);

}  // namespace o80::test
