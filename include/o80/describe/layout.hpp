#pragma once

#include <cstddef>
#include <cstdint>

#include "o80/describe/schema.hpp"

namespace o80 {

/// The first part of every history row.
struct RowHead {
  std::int64_t iteration = 0;
  std::int64_t time = 0;       // [ns], on the clock of the schema
  std::int64_t lateness = 0;   // delay of the begin of the iteration after its due time [ns]
  std::uint32_t overruns = 0;  // iterations so far that ended after their period
  std::uint32_t skipped = 0;   // periods so far that were skipped to catch up
  std::uint32_t fresh = 0;     // 1: fresh start (reset, restore or resume) in this row
  std::uint32_t halted = 0;    // 1: the backend was halted in this iteration
  /// Iterations so far in which a plan of chunks began to be starved (the mask `starved`).
  std::int64_t starvations = 0;
};
static_assert(sizeof(RowHead) == 48 && std::is_trivially_copyable_v<RowHead>);

/// Offsets of the parts of a row from its start [bytes].
struct RowLayout {
  std::uint32_t desired = 0;
  std::uint32_t observed = 0;
  std::uint32_t extended = 0;
  std::uint32_t active = 0;   // mask: one bit for each actuator, in 8-byte words
  std::uint32_t clamped = 0;  // mask
  std::uint32_t braking = 0;  // mask
  std::uint32_t starved = 0;  // mask
  /// A float for each actuator: largest difference of `desired` from the command, over the numbers
  /// of the state.
  std::uint32_t off_plan = 0;
  std::uint32_t size = 0;
  std::uint32_t mask_words = 0;
  std::uint32_t block = 0;
  std::uint32_t extended_size = 0;
  /// Capture time of the row [ns], int64: RowHead::time, or a device's `capture_time`.
  std::uint32_t captured = offsetof(RowHead, time);
};

inline RowLayout row_layout(const Schema& schema) {
  RowLayout layout;
  layout.block = round_up(schema.head.block, 8);
  layout.extended_size =
      schema.head.extended == kNoType ? 0 : round_up(schema.types.at(schema.head.extended).size, 8);
  layout.mask_words = static_cast<std::uint32_t>((schema.actuators.size() + 63) / 64);
  layout.desired = sizeof(RowHead);
  layout.observed = layout.desired + layout.block;
  layout.extended = layout.observed + layout.block;
  layout.active = layout.extended + layout.extended_size;
  layout.clamped = layout.active + layout.mask_words * 8;
  layout.braking = layout.clamped + layout.mask_words * 8;
  layout.starved = layout.braking + layout.mask_words * 8;
  layout.off_plan = layout.starved + layout.mask_words * 8;
  const auto actuators = static_cast<std::uint32_t>(schema.actuators.size());
  layout.size = layout.off_plan + round_up(actuators * sizeof(float), 8);
  if (schema.head.extended == kNoType) return layout;
  const TypeRow& extended = schema.types.at(schema.head.extended);
  for (std::uint32_t i = extended.first_field; i < extended.first_field + extended.fields; ++i) {
    const FieldRow& field = schema.fields.at(i);
    const bool is_time = field.name.view() == "capture_time" && field.kind == Kind::int64;
    if (is_time && field.rows == 0) layout.captured = layout.extended + field.offset;
  }
  return layout;
}

}  // namespace o80
