#pragma once

#include <cstddef>
#include <cstdint>

#include "o80/describe/hooks.hpp"
#include "o80/describe/rows.hpp"

// What crosses the border between a robot library and o80: plain structs and functions that
// neither throw nor know a C++ type of the other side. Both sides compare versions and sizes.

namespace o80 {

inline constexpr std::uint32_t kRobotTableVersion = 4;

/// Why a call failed.
struct FaultText {
  char text[512];
};

/// One value a robot can be started with.
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

/// All rows of a schema.
struct SchemaRows {
  const SchemaHead* head;
  const TypeRow* types;
  const TypeHooks* hooks;  // one for each type
  const FieldRow* fields;
  const LabelRow* labels;
  const GroupRow* groups;
  const ActuatorRow* actuators;
  const LimitRow* limits;
  const RequestRow* requests;
  const std::byte* defaults;
  std::uint32_t type_count, field_count, label_count, group_count, actuator_count, limit_count,
      request_count, default_count;
};

/// What a driver is to write.
struct DesiredView {
  const std::byte* states;      // the desired block
  const std::uint64_t* active;  // one bit an actuator
  std::int64_t iteration;
  std::int64_t time;    // [ns]
  std::int64_t period;  // [ns]
};

/// How a request ended, or that it runs and ends later.
enum class RequestAnswer : std::uint32_t {
  done = 0,
  rejected = 1,
  start_afresh = 2,
  failed = 3,
  running = 4
};

/// What a driver says of a request of one kind in its reading.
struct RequestReport {
  std::uint32_t runs;     // 1: it was answered `running` and has not ended
  std::uint32_t changed;  // set it: `answer` says how it ended, or that it runs on
  RequestAnswer answer;
  char text[248];  // why it ended so, or its progress
};

/// Where a driver's reading goes; observed and extended hold the last one.
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
  std::uint32_t missed;       // set it if this tick of the robot brought no reading
  std::uint32_t halted;       // set it to halt the backend
  std::uint32_t reported;     // set it if a request has changed
  FaultText halt_text;        // why it is to be halted
};

/// A robot, as functions. Those that return int give 0, or 1 and fill the fault.
struct RobotTable {
  std::uint32_t version;
  std::uint32_t size;          // of this struct
  std::uint32_t row_sizes;     // of all schema rows, summed: another layout cannot be read
  std::uint32_t paces_itself;  // the driver's own `wait` says when an iteration begins
  const char* name;
  const char* built_with;  // versions of o80 and of what it links

  void (*options)(void* context, void (*each)(void* context, const OptionRow* row));
  /// Whether a robot can be created with these options: their names and texts are known.
  int (*accepts)(const OptionValue* values, std::uint32_t count, FaultText* fault);
  void* (*create)(const OptionValue* values, std::uint32_t count, FaultText* fault);
  /// `period`: that the user asks for [ns]; 0 if none was asked for.
  int (*describe)(void* robot, std::int64_t period, void* context,
                  void (*rows)(void* context, const SchemaRows* rows), FaultText* fault);
  int (*start)(void* robot, FaultText* fault);
  int (*wait)(void* robot, std::int64_t due, FaultText* fault);
  int (*write)(void* robot, const DesiredView* desired, FaultText* fault);
  int (*read)(void* robot, ReadingView* reading, FaultText* fault);
  RequestAnswer (*request)(void* robot, std::uint32_t index, const std::byte* payload,
                           FaultText* text);
  /// A halt begins; null if the driver has no such verb.
  int (*halt)(void* robot, FaultText* fault);
  /// A halt is to be cleared: done, rejected (the text says why) or failed; null likewise.
  RequestAnswer (*resume)(void* robot, FaultText* text);
  void (*stop)(void* robot);
  void (*destroy)(void* robot);
};

inline constexpr std::uint32_t kSchemaRowSizes =
    sizeof(SchemaHead) + sizeof(TypeRow) + sizeof(FieldRow) + sizeof(LabelRow) + sizeof(GroupRow) +
    sizeof(ActuatorRow) + sizeof(LimitRow) + sizeof(RequestRow);

/// The one symbol of a robot library.
inline constexpr const char* kRobotSymbol = "o80_robot_table";
using RobotTableFunction = const RobotTable* (*)();

}  // namespace o80
