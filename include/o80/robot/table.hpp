#pragma once

#include <cstddef>
#include <cstdint>
#include <cstring>
#include <string_view>

#include "o80/describe/hooks.hpp"
#include "o80/describe/rows.hpp"
#include "o80/describe/shown_model.hpp"

// Interface between a robot library and o80: plain structs and functions. Functions do not throw
// and pass no C++ class: O80_ROBOT wraps each function of a driver class, and the wrapper makes a
// FaultText of what the driver throws. o80 compares versions and sizes before it uses a library.

namespace o80 {

inline constexpr std::uint32_t kRobotTableVersion = 9;

/// Reason for the failure of a call.
struct FaultText {
  char text[512];
};

/// Stores as much of a text as fits, and a zero behind it.
template <std::size_t Size>
void store_text(char (&to)[Size], std::string_view text) noexcept {
  to[text.copy(to, Size - 1)] = 0;
}

/// One option with which a robot can be started.
struct OptionRow {
  const char* name;
  const char* kind;
  const char* default_text;
  const char* help;
  const char* unit;
};

struct OptionValue {
  const char* name;
  const char* text;
};

/// Receives the bytes of a schema (o80/describe/schema_bytes.hpp), and the hooks of its types.
using SchemaTaker = void(void* context, const std::byte* bytes, std::uint64_t size,
                         const TypeHooks* hooks);

/// The desired states that a driver writes.
struct DesiredView {
  const std::byte* states;      // the desired block
  const std::uint64_t* active;  // one bit an actuator
  std::int64_t iteration;
  std::int64_t time;    // [ns]
  std::int64_t period;  // [ns]
  /// First (order 1) or second difference, to the previous iteration, of the number at this offset
  /// of the desired block; 0 if its actuator is inactive or it does not move. Null: no differences.
  double (*difference)(const void* context, std::uint32_t offset, std::uint32_t order) = nullptr;
  const void* context = nullptr;
};

/// Result of a request; `running`: it ends in a later reading.
enum class RequestAnswer : std::uint32_t {
  done = 0,
  rejected = 1,
  start_afresh = 2,
  failed = 3,
  running = 4
};

/// Report of a driver, in a reading, about its requests of one kind.
struct RequestReport {
  std::uint32_t runs;     // 1: answered `running`, and not ended
  std::uint32_t changed;  // set it if `answer` or `text` is new
  RequestAnswer answer;   // result, or `running`
  char text[248];         // reason of the end, or progress
};

/// Memory for a driver's reading; observed and extended initially hold the last reading.
struct ReadingView {
  std::byte* observed;
  std::byte* extended;
  std::byte* desired;          // in a fresh start; else null
  std::uint64_t* interrupted;  // one bit an actuator, zero
  RequestReport* requests;     // one for each kind, in the order of the schema
  std::int64_t iteration;
  std::int64_t time;          // [ns]
  std::uint32_t finished;     // set it to end the loop in order
  std::uint32_t has_desired;  // set it if `desired` was filled
  std::uint32_t follows;      // set it in a fresh start if idle actuators follow from now on
  std::uint32_t missed;       // set it after a tick without a reading
  std::uint32_t halted;       // set it to halt the backend
  std::uint32_t reported;     // set it if a request has changed
  FaultText halt_text;        // reason of the halt
};

/// A robot as a table of functions. An int that they return is 0, or 1 if they filled the fault.
struct RobotTable {
  std::uint32_t version;
  std::uint32_t size;          // of this struct
  std::uint32_t row_sizes;     // sum of the sizes of all schema rows; must equal o80's
  std::uint32_t paces_itself;  // 1: the driver has `wait`, which ends each iteration
  const char* name;
  const char* built_with;  // versions of o80 and of the libraries it links
  void* self;              // passed to the functions that need no driver yet

  void (*options)(void* self, void* context, void (*each)(void* context, const OptionRow* row));
  /// Checks names and values of the options without creating the robot.
  int (*accepts)(void* self, const OptionValue* values, std::uint32_t count, FaultText* fault);
  void* (*create)(void* self, const OptionValue* values, std::uint32_t count, FaultText* fault);
  /// `period`: the period that the user requested [ns]; 0: none.
  int (*describe)(void* robot, std::int64_t period, void* context, SchemaTaker* take,
                  FaultText* fault);
  int (*start)(void* robot, FaultText* fault);
  int (*wait)(void* robot, std::int64_t due, FaultText* fault);
  int (*write)(void* robot, const DesiredView* desired, FaultText* fault);
  int (*read)(void* robot, ReadingView* reading, FaultText* fault);
  RequestAnswer (*request)(void* robot, std::uint32_t index, const std::byte* payload,
                           FaultText* text);
  /// Called when a halt begins; null if the driver has no `halt`.
  int (*halt)(void* robot, FaultText* fault);
  /// Called before a halt is cleared: done, rejected (with a text) or failed; null if the driver
  /// has no `resume`.
  RequestAnswer (*resume)(void* robot, FaultText* text);
  /// The snapshot in a slot, valid until the next call of any function; null and 0 if the slot
  /// holds none. Null if the driver has no `snapshot_bytes`.
  const std::byte* (*snapshot_bytes)(void* robot, std::uint32_t slot, std::uint64_t* size);
  /// Fills a slot with bytes from `snapshot_bytes`; null if the driver has no `load_snapshot`.
  int (*load_snapshot)(void* robot, std::uint32_t slot, const std::byte* bytes, std::uint64_t size,
                       FaultText* fault);
  void (*stop)(void* robot);
  void (*destroy)(void* robot);
};

inline constexpr std::uint32_t kSchemaRowSizes =
    sizeof(SchemaHead) + sizeof(TypeRow) + sizeof(FieldRow) + sizeof(LabelRow) + sizeof(GroupRow) +
    sizeof(ActuatorRow) + sizeof(LimitRow) + sizeof(IntegralRow) + sizeof(RequestRow) +
    sizeof(ShownRow);

/// The only symbol that a robot library exports.
inline constexpr const char* kRobotSymbol = "o80_robot_table";
using RobotTableFunction = const RobotTable* (*)();

}  // namespace o80
