#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/journal_decoder.hpp"

namespace o80 {

/// Decodes bytes that a RawJournal read from a segment, for example those in a recording.
class RecordedJournal {
 public:
  /// `first`: number of the first entry to return.
  explicit RecordedJournal(std::shared_ptr<const Description> description, std::uint64_t first = 0)
      : decoder_(std::move(description)) {
    decoder_.start_at(first);
  }

  /// Appends the entries in `bytes`, which follow those of the last call. Throws InvalidArgument if
  /// the bytes are damaged.
  void decode(std::span<const std::byte> bytes, std::vector<JournalEntry>& entries);

 private:
  std::size_t take_item(std::span<const std::byte> bytes);

  JournalDecoder decoder_;
  std::uint64_t expected_ = 0;  // number of the next entry
};

}  // namespace o80
