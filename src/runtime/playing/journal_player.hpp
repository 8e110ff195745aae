#pragma once

#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <string>

#include "memory/ring/journal.hpp"
#include "o80/memory/halt.hpp"
#include "o80/memory/life.hpp"

namespace o80 {

/// Writes recorded entries into the journal of a segment that is played, each before the row of its
/// iteration, with its number.
///
/// Writer:   one thread.
/// Readers:  JournalReader.
class JournalPlayer {
 public:
  struct End {
    BackendState state = BackendState::stopped;
    std::string text;  // the fault of a failed backend
  };

  explicit JournalPlayer(const SegmentView& view) : writer_(view) {}

  /// Adds consecutive entries of a recording, in this version of its format; returns the iteration
  /// of the last one. Throws InvalidArgument if they are damaged, or of a newer version.
  Iteration add(std::span<const std::byte> entries, std::int64_t codec);
  /// Writes the added entries up to this iteration.
  void write_until(Iteration k);
  /// The newest halt among the written entries; its number is 0 if there is none.
  const Halt& halt() const noexcept { return halt_; }
  /// How the recorded backend ended, if that is among the written entries.
  const std::optional<End>& end() const noexcept { return end_; }

 private:
  void note(const JournalItem& item);

  JournalWriter writer_;
  std::deque<JournalItem> added_;  // and not written
  Halt halt_;
  std::optional<End> end_;
};

}  // namespace o80
