#include "runtime/frontend/raw_journal.hpp"

#include "o80/runtime/frontend.hpp"

namespace o80 {
namespace {

bool is_notable(JournalKind kind) {
  switch (kind) {
    using enum JournalKind;
    case none:
    case records:
    case owner:
    case taken:
    case scheduled:
    case statuses:
    case burst:
    case burst_ended:
    case at_rest:
      return false;
    default:
      return true;
  }
}

}  // namespace

RawJournal::RawJournal(const UntypedFrontend& frontend, std::uint64_t first)
    : link_(frontend.link()), reader_(link_->segment.view()), first_(first) {
  link_->check_usable();
}

double RawJournal::unread() const {
  link_->check_usable();
  return reader_.unread();
}

RawJournal::Entries RawJournal::read(std::size_t most) {
  link_->check_usable();
  Entries entries;
  while (entries.bytes.size() < most && (holds_ || reader_.next(item_))) {
    holds_ = true;
    const JournalHead& head = item_.head;
    const bool begins = entries.bytes.empty();
    if (!begins && head.number != entries.next) break;  // entries were missed
    encoder_.encode(head, item_.payload, entries.bytes);
    holds_ = false;
    if (head.number < first_) {  // the encoder needs it: a batch may begin in it
      entries.bytes.clear();
      encoder_.take_marks();
      continue;
    }
    if (begins) entries.first = head.number;
    entries.notable |= is_notable(head.kind);
    entries.next = head.number + head.numbers();
  }
  entries.marks = encoder_.take_marks();
  entries.more = holds_ || entries.bytes.size() >= most;
  return entries;
}

}  // namespace o80
