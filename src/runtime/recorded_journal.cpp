#include "runtime/recorded_journal.hpp"

#include <cstring>
#include <string>
#include <utility>

#include "o80/base/error.hpp"

namespace o80 {

void RecordedJournal::decode(std::span<const std::byte> bytes, std::vector<JournalEntry>& entries) {
  JournalEntry entry;
  for (std::size_t at = 0; at < bytes.size();) {
    const std::size_t length = take_item(bytes.subspan(at));
    if (length == 0) {
      throw InvalidArgument("the journal is damaged: invalid entry at byte " + std::to_string(at));
    }
    at += length;
    while (decoder_.next(entry)) entries.push_back(std::move(entry));
  }
}

/// Takes the entry at the begin of `bytes`; returns its length, 0 if it is invalid.
std::size_t RecordedJournal::take_item(std::span<const std::byte> bytes) {
  JournalItem& item = decoder_.item();
  if (bytes.size() < sizeof item.head) return 0;
  std::memcpy(&item.head, bytes.data(), sizeof item.head);
  const std::size_t length = item.head.words * std::size_t{8};
  if (length < sizeof item.head || length > bytes.size()) return 0;
  if (item.head.number < expected_) return 0;
  const auto payload = bytes.first(length).subspan(sizeof item.head);
  item.payload.assign(payload.begin(), payload.end());
  item.missed = item.head.number - expected_;
  expected_ = item.head.number + item.head.numbers();
  decoder_.take();
  return length;
}

}  // namespace o80
