#pragma once

#include <cstdint>
#include <vector>

#include "control/pool.hpp"
#include "control/record.hpp"
#include "control/state_layout.hpp"
#include "o80/describe/schema.hpp"

namespace o80 {

/// A command whose rows have their own times.
inline bool is_timed(const RecordHead& head) noexcept {
  return head.kind == RecordKind::command && head.pace == Pace::duration && head.rows > 1;
}
/// Keeps in the head of such a command, whose `amount` means nothing, where its rows begin...
void note_rows(RecordHead& head, const Cursor& rows) noexcept;
/// ... so that nobody goes along its times to get there.
Cursor rows_of_timed(const BlockPool& pool, const RecordHead& head,
                     std::uint32_t row_bytes) noexcept;

/// Judges records that crossed a lane: whatever their bytes are, they do no harm.
///
/// Realtime: everything but construction.
class RecordCheck {
 public:
  /// One layout for each type that an actuator or a request has (the others are null).
  using Layouts = std::vector<const StateLayout*>;
  RecordCheck(const Schema& schema, Layouts layouts);

  enum class Verdict : std::uint8_t { unfinished, valid, invalid };
  /// What is left to look at of one record.
  struct Progress {
    Cursor payload;
    std::uint32_t times_left = 0;
    std::uint32_t rows_left = 0;
    std::int64_t time = 0;  // end of the row before [ns]
    Cursor rows{};          // where they begin
  };

  /// Judges all but the times and rows of the record starting at `block`, whose blocks are there.
  /// The payload of a valid record has been read to its end.
  Verdict begin(const BlockPool& pool, BlockIndex block, Progress& progress) noexcept;
  /// Goes on with times and rows, for about `budget` blocks, which it takes off.
  Verdict go_on(const BlockPool& pool, BlockIndex block, Progress& progress,
                std::uint32_t& budget) noexcept;

 private:
  Verdict begin_command(const RecordHead& head, Progress& progress) noexcept;
  Verdict check_request(const RecordHead& head, Cursor& payload) noexcept;

  Layouts layouts_;
  std::vector<std::uint32_t> actuator_types_;
  std::vector<std::uint32_t> first_limits_;     // of each actuator, in what follows
  std::vector<std::uint8_t> has_acceleration_;  // one for each number; 1 also if it does not move
  std::vector<std::uint32_t> request_types_;
  std::vector<std::uint64_t> state_;
  std::vector<std::uint64_t> mask_;
};

}  // namespace o80
