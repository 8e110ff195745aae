#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>

#include "o80/base/error.hpp"

namespace o80 {

/// Kind of a field of a described struct.
enum class Kind : std::uint8_t {
  boolean,
  int8,
  int16,
  int32,
  int64,
  uint8,
  uint16,
  uint32,
  uint64,
  float32,
  float64,
  enumeration,  // an integer of 1, 2, 4 or 8 bytes with labels
  structure,    // a nested described struct
  text,         // a string; only in options, never in shared memory
};

/// Behaviour of an actuator without a command: hold its last desired state, or follow the
/// observed one.
enum class WhenIdle : std::uint8_t { hold, follow };

/// Text of fixed size for shared memory, padded with zeros.
template <std::size_t Size>
struct FixedText {
  std::array<char, Size> chars{};

  FixedText() = default;
  explicit FixedText(std::string_view text) {
    if (text.size() >= Size) {
      throw InvalidArgument("'" + std::string(text) + "' is too long: at most " +
                            std::to_string(Size - 1) + " bytes are kept");
    }
    if (!text.empty()) std::memcpy(chars.data(), text.data(), text.size());
  }

  std::string_view view() const { return {chars.data(), strnlen(chars.data(), Size)}; }
  std::string str() const { return std::string(view()); }
  bool operator==(const FixedText&) const = default;
};

using NameText = FixedText<48>;
using UnitText = FixedText<24>;
using HelpText = FixedText<120>;
using FieldHelpText = FixedText<119>;

/// Origin of a field's value. A replay compares only values that the robot computes.
enum class Origin : std::uint8_t {
  robot,  // commands, options and former states
  clock,  // time or load of the machine, which differ from run to run
  world,  // a sensor, which no replay can repeat
  absent  // none: the field exists only because the simulation takes a robot's face
};
constexpr Origin of_the_clock() { return Origin::clock; }
constexpr Origin of_the_world() { return Origin::world; }

inline constexpr std::uint32_t kNoType = 0xFFFFFFFF;

/// One field of a described struct.
struct FieldRow {
  NameText name;
  UnitText unit;
  FieldHelpText help;
  Origin origin = Origin::robot;
  std::uint32_t type = kNoType;   // index of the type of a nested struct
  std::uint32_t offset = 0;       // from the start of the struct [bytes]
  std::uint32_t size = 0;         // size of one element [bytes]
  std::uint32_t rows = 0;         // shape of an array field: 0 x 0 is a plain field,
  std::uint32_t columns = 0;      // n x 0 a vector, n x m a matrix
  std::uint32_t first_label = 0;  // labels of an enumeration
  std::uint32_t labels = 0;
  Kind kind = Kind::float64;
  std::uint8_t is_signed = 0;    // 1: the underlying type of the enumeration is signed
  std::uint8_t resting = 0;      // 1: goes to `rest` without a command
  std::uint8_t has_default = 0;  // 1: a request may omit it
  double rest = 0.0;             // in the field's unit

  std::uint32_t count() const { return (rows == 0 ? 1 : rows) * (columns == 0 ? 1 : columns); }
  bool operator==(const FieldRow&) const = default;
};

/// One described struct. A plain number is a type with a single field without a name.
struct TypeRow {
  NameText name;
  std::uint32_t size = 0;
  std::uint32_t alignment = 1;
  std::uint32_t first_field = 0;
  std::uint32_t fields = 0;
  std::uint32_t first_default = kNoType;  // offset of the default values in Schema::defaults
  std::uint32_t blends = 0;               // 1: interpolates in C++, by code of the driver
  bool operator==(const TypeRow&) const = default;
};

/// One value of an enumeration.
struct LabelRow {
  NameText name;
  std::int64_t value = 0;
  bool operator==(const LabelRow&) const = default;
};

/// Limits and rest value of one number of an actuator's state, in the unit of its field.
struct LimitRow {
  double minimum;
  double maximum;
  double speed;           // [1/s]
  double acceleration;    // [1/s^2]
  double jerk;            // [1/s^3]
  double error;           // largest |desired - observed|; a larger one halts the backend
  double rest;            // value without a command, if `resting` is 1
  std::uint32_t resting;  // 1: the number goes to `rest` without a command
  float noise;            // of a reading; 0: a tenth of `error`
  bool operator==(const LimitRow&) const = default;
};

/// Bounds of the integral of a number: of the position that a velocity moves.
struct IntegralRow {
  std::uint32_t limit = 0;   // index of the limits of the moving number
  std::uint32_t number = 0;  // index of the moved number in the observed state
  double minimum = 0.0;      // in the unit of the moved number
  double maximum = 0.0;
  double reaction = 0.0;  // from the desired velocity to the observed one [s]
  bool operator==(const IntegralRow&) const = default;
};

/// One actuator.
struct ActuatorRow {
  NameText name;
  std::uint32_t type = 0;
  std::uint32_t offset = 0;       // offset in the desired and in the observed block [bytes]
  std::uint32_t first_limit = 0;  // `limits` limits: one for each number of the state
  std::uint32_t limits = 0;
  std::uint32_t group = 0;
  WhenIdle when_idle = WhenIdle::hold;
  std::array<std::uint8_t, 3> reserved{};
  bool operator==(const ActuatorRow&) const = default;
};

/// Consecutive actuators of one type under one name ("joints"): an array, or a single actuator.
struct GroupRow {
  NameText name;  // empty: the robot is one array of actuators
  std::uint32_t type = 0;
  std::uint32_t offset = 0;
  std::uint32_t first_actuator = 0;
  std::uint32_t count = 0;
  std::uint32_t is_array = 0;
  bool operator==(const GroupRow&) const = default;
};

/// One request that a driver handles.
struct RequestRow {
  NameText name;
  HelpText help;
  std::uint32_t type = kNoType;
  std::uint32_t while_halted = 0;  // 1: served also while the backend is halted
  bool operator==(const RequestRow&) const = default;
};

/// Clock of the times of a history.
enum class Clock : std::uint8_t { monotonic, simulated };

/// Policy for the commands of a frontend that dies or becomes silent.
enum class Stale : std::uint8_t {
  hold,   // the commands keep running
  purge,  // the commands are dropped
  stop,   // the backend stops
  halt    // the backend halts
};
constexpr std::string_view name_of(Stale stale) {
  constexpr std::string_view kNames[] = {"hold", "purge", "stop", "halt"};
  return kNames[static_cast<std::size_t>(stale)];
}

/// Returns the policy with this name, if any.
constexpr std::optional<Stale> stale_of(std::string_view name) {
  for (const Stale stale : {Stale::hold, Stale::purge, Stale::stop, Stale::halt}) {
    if (name_of(stale) == name) return stale;
  }
  return std::nullopt;
}

/// The properties of a whole robot.
struct SchemaHead {
  NameText robot;
  std::int64_t period = 0;           // [ns]
  std::uint32_t extended = kNoType;  // index of the type of the sensor values
  std::uint32_t block = 0;           // size of the desired and of the observed block [bytes]
  Clock clock = Clock::monotonic;
  std::uint8_t bursting = 0;
  Stale stale = Stale::hold;
  /// 1: of the world in real time; 2: simulated; 3: of the world also in bursts (drivers in
  /// Python); 0: not said, in old recordings only
  std::uint8_t of_the_world = 1;
  std::uint32_t gap = 0;     // longest time between two rows that does not halt [us]; 0: by default
  std::int64_t silence = 0;  // iterations without a sign of life until `stale`; 0: no watchdog
  bool is_simulated() const { return of_the_world == 2; }
  bool operator==(const SchemaHead&) const = default;
};

static_assert(std::is_trivially_copyable_v<FieldRow> && std::is_standard_layout_v<FieldRow>);
static_assert(std::is_trivially_copyable_v<TypeRow> && std::is_trivially_copyable_v<LabelRow>);
static_assert(std::is_trivially_copyable_v<LimitRow> && std::is_trivially_copyable_v<ActuatorRow>);
static_assert(std::is_trivially_copyable_v<GroupRow> && std::is_trivially_copyable_v<RequestRow>);
static_assert(std::is_trivially_copyable_v<SchemaHead>);

}  // namespace o80
