#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "memory/ring/journal.hpp"
#include "runtime/frontend/link.hpp"
#include "runtime/journal/journal_encoder.hpp"

namespace o80 {

class UntypedFrontend;

/// Reads the entries of a journal in the format of files: see journal_format.hpp. RecordedJournal
/// decodes them.
///
/// Writer / Readers: one thread.
class RawJournal {
 public:
  /// Consecutive entries.
  struct Entries {
    std::vector<std::byte> bytes;
    std::uint64_t first = 0;  // number of the first entry
    std::uint64_t next = 0;   // number after the last one; = first: there are no entries
    bool more = false;        // the next read may return entries at once
    bool notable = false;     // there are others than batches, bursts and ends of commands
    std::vector<JournalEncoder::Mark> marks;  // in these entries
  };

  /// Starts at the oldest entry in the ring, or at the entry with number `first` if that is later.
  /// Throws Closed.
  RawJournal(const UntypedFrontend& frontend, std::uint64_t first);

  /// False if the backend was started without a journal.
  bool exists() const { return reader_.has_journal(); }
  /// Share of the ring that holds what was not read yet, from 0 to 1. Throws Closed.
  double unread() const;
  /// The entries since the last call. Ends before entries that were missed, and after `most` bytes.
  /// Does not wait. Throws Closed, UsedAfterFork.
  Entries read(std::size_t most);

 private:
  std::shared_ptr<Link> link_;
  JournalReader reader_;
  std::uint64_t first_;
  JournalItem item_;
  JournalEncoder encoder_;
  bool holds_ = false;  // item_ is an entry that was not returned yet
};

}  // namespace o80
