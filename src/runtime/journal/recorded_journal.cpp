#include "runtime/journal/recorded_journal.hpp"

#include <string>
#include <utility>

#include "o80/base/error.hpp"
#include "runtime/journal/journal_codec.hpp"

namespace o80 {

void RecordedJournal::decode(std::span<const std::byte> bytes, std::vector<JournalEntry>& entries,
                             std::int64_t codec) {
  decode_journal(codec, bytes, [&](JournalItem& item) { take(item, entries); });
}

void RecordedJournal::take(JournalItem& item, std::vector<JournalEntry>& entries) {
  if (item.head.number < expected_) {
    throw InvalidArgument("the journal is damaged: entry " + std::to_string(item.head.number) +
                          " comes after entry " + std::to_string(expected_ - 1));
  }
  item.missed = item.head.number - expected_;
  expected_ = item.head.number + item.head.numbers();
  std::swap(decoder_.item(), item);
  decoder_.take();
  for (JournalEntry entry; decoder_.next(entry);) entries.push_back(std::move(entry));
}

}  // namespace o80
