#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "runtime/journal/journal_decoder.hpp"
#include "runtime/journal/journal_format.hpp"

namespace o80 {

/// Decodes the entries of a journal in a recording, of any version of its format.
class RecordedJournal {
 public:
  /// `first`: number of the first entry to return. `rests`: also entries `at_rest`.
  explicit RecordedJournal(std::shared_ptr<const Description> description, std::uint64_t first = 0,
                           bool rests = false)
      : decoder_(std::move(description)) {
    decoder_.start_at(first);
    if (rests) decoder_.show_rests();
  }

  /// Appends the entries in `bytes`, which follow those of the last call. `codec`: version of their
  /// format. Throws InvalidArgument if it is newer than this o80, or if the bytes are damaged.
  void decode(std::span<const std::byte> bytes, std::vector<JournalEntry>& entries,
              std::int64_t codec = kJournalCodec);

 private:
  void take(JournalItem& item, std::vector<JournalEntry>& entries);

  JournalDecoder decoder_;
  std::uint64_t expected_ = 0;  // number of the next entry
};

}  // namespace o80
