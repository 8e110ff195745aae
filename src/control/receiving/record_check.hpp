#pragma once

#include <cstdint>
#include <vector>

#include "control/batch/command_check.hpp"
#include "control/batch/record.hpp"
#include "control/motion/state_layout.hpp"
#include "control/receiving/chunk_rows.hpp"
#include "control/receiving/pool.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// True for a trajectory whose rows have their own times.
inline bool is_timed(const RecordHead& head) noexcept {
  return head.kind == RecordKind::command && head.pace == Pace::duration && head.rows > 1;
}
/// True for a command that follows rows, each in its own iteration, as a chunk does. The others are
/// planned to rest at their target, or at each of their rows.
inline bool plays_rows(const RecordHead& head) noexcept {
  const bool in_lines = head.profile == Profile::linear && head.rows > 1 &&
                        head.pace != Pace::direct && head.pace != Pace::fastest;
  return in_lines || is_of_rows(head.profile);
}
/// For a timed one: stores the position of its first row in `amount`, which it does not use.
inline void note_rows(RecordHead& head, const Cursor& rows) noexcept {
  head.amount = static_cast<std::int64_t>(std::uint64_t{rows.offset()} << 32 | rows.block());
}
/// A cursor at that position, so that the times need not be skipped one by one.
inline Cursor rows_of_timed(const BlockPool& pool, const RecordHead& head,
                            std::uint32_t row_bytes) noexcept {
  const auto noted = static_cast<std::uint64_t>(head.amount);
  return {pool, static_cast<BlockIndex>(noted), static_cast<std::uint32_t>(noted >> 32),
          std::uint64_t{head.rows} * row_bytes};
}

/// Validates records from a lane. Arbitrary bytes are safe.
///
/// Realtime: everything but construction.
class RecordCheck {
 public:
  RecordCheck(const Schema& schema, const Layouts& layouts);

  enum class Verdict : std::uint8_t { unfinished, valid, invalid };
  /// The unchecked rest of a record.
  struct Progress {
    Cursor payload;
    std::uint32_t times_left = 0;
    std::uint32_t rows_left = 0;
    std::int64_t time = 0;  // end time of the row before [ns]
    Cursor rows{};          // position of the first row
    ChunkRows::Notes notes{};
  };

  /// Checks the record at `block` except for its times and rows. All its blocks must be in the
  /// pool. The planner walks over what was not read of a payload.
  Verdict begin(BlockPool& pool, BlockIndex block, Progress& progress) noexcept;
  /// Continues with times and rows for about `budget` blocks, and reduces `budget` by them.
  Verdict advance(BlockPool& pool, BlockIndex block, Progress& progress,
                  std::uint32_t& budget) noexcept;

 private:
  Verdict begin_command(const RecordHead& head, Progress& progress) noexcept;
  Verdict advance_chunk(BlockPool& pool, BlockIndex block, Progress& progress,
                        std::uint32_t& budget, const std::uint64_t* mask) noexcept;
  bool is_request(const RecordHead& head, Cursor& payload) noexcept {
    if (head.actuator >= requests_.size()) return false;
    const StateLayout* layout = requests_[head.actuator];
    if (layout == nullptr) return head.payload_bytes == 0;
    auto* state = reinterpret_cast<std::byte*>(state_.data());
    return head.payload_bytes == layout->size() && payload.read(state, layout->size()) &&
           layout->proper(state);
  }

  TargetLimits targets_;
  std::vector<const StateLayout*> requests_;  // null: no payload
  std::vector<std::uint64_t> state_;
  std::vector<std::uint64_t> mask_;
};

}  // namespace o80
