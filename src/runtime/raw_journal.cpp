#include "runtime/raw_journal.hpp"

#include "o80/runtime/frontend.hpp"

namespace o80 {

RawJournal::RawJournal(const UntypedFrontend& frontend, std::uint64_t first)
    : link_(frontend.link()), reader_(link_->segment.view()), first_(first) {
  link_->check_usable();
}

RawJournal::Entries RawJournal::read(std::size_t most) {
  link_->check_usable();
  Entries entries;
  while (entries.bytes.size() < most && (holds_ || reader_.next(item_))) {
    holds_ = true;
    const JournalHead& head = item_.head;
    if (head.number >= first_) {
      const bool begins = entries.bytes.empty();
      if (!begins && head.number != entries.next) break;  // entries were missed
      if (begins) entries.first = head.number;
      entries.next = head.number + head.numbers();
      const auto* bytes = reinterpret_cast<const std::byte*>(&head);
      entries.bytes.insert(entries.bytes.end(), bytes, bytes + sizeof head);
      entries.bytes.insert(entries.bytes.end(), item_.payload.begin(), item_.payload.end());
    }
    holds_ = false;
  }
  entries.more = holds_ || entries.bytes.size() >= most;
  return entries;
}

}  // namespace o80
