#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "memory/journal.hpp"
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

  /// Adds consecutive entries, as they were in the recorded segment; returns the iteration of the
  /// last one. Throws InvalidArgument if they are damaged.
  Iteration add(std::span<const std::byte> entries);
  /// Writes the added entries up to this iteration.
  void write_until(Iteration k);
  /// The newest halt among the written entries; its number is 0 if there is none.
  const Halt& halt() const noexcept { return halt_; }
  /// How the recorded backend ended, if that is among the written entries.
  const std::optional<End>& end() const noexcept { return end_; }

 private:
  void note(const JournalHead& head, std::span<const std::byte> payload);

  JournalWriter writer_;
  std::vector<std::byte> added_;
  std::size_t written_ = 0;  // bytes of added_
  Halt halt_;
  std::optional<End> end_;
};

}  // namespace o80
