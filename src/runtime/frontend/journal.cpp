#include "o80/runtime/journal.hpp"

#include "memory/ring/journal.hpp"
#include "o80/runtime/frontend.hpp"
#include "runtime/frontend/link.hpp"
#include "runtime/journal/journal_decoder.hpp"

namespace o80 {

namespace {

/// Bytes of all lanes: more are in no transfer at a time, unless the journal is damaged.
std::uint64_t bytes_of_lanes(const SegmentShape& shape) {
  return std::uint64_t{shape.lanes} * shape.lane_blocks * kBlockBytes;
}

}  // namespace

class Journal::Body {
 public:
  explicit Body(std::shared_ptr<Link> link)
      : link_(std::move(link)),
        reader_(link_->segment.view()),
        decoder_(link_->description, bytes_of_lanes(link_->segment.view().shape)) {
    // the name of an owner may stand behind an entry that it caused, because names are repeated
    JournalReader names = reader_;
    // bounded: a fast writer adds entries meanwhile
    const std::uint64_t most = link_->segment.view().shape.journal_bytes / sizeof(JournalHead);
    for (std::uint64_t i = 0; i < most && names.next(decoder_.item()); ++i) decoder_.note_name();
  }

  bool exists() const { return reader_.has_journal(); }
  bool next(JournalEntry& entry) {
    link_->check_usable();
    while (!decoder_.next(entry)) {
      if (!reader_.next(decoder_.item())) return false;
      decoder_.take();
    }
    return true;
  }
  void seek(std::uint64_t number) {
    // from the oldest entry on: blocks of a batch lie before the decision on it
    reader_ = JournalReader(link_->segment.view());
    decoder_.start_at(number);
  }
  void seek_end() {
    reader_.seek_end();
    decoder_.start_at(0);
  }

 private:
  std::shared_ptr<Link> link_;
  JournalReader reader_;
  JournalDecoder decoder_;
};

Journal::Journal(const UntypedFrontend& frontend)
    : body_(std::make_unique<Body>(frontend.link())) {}
Journal::Journal(Journal&&) noexcept = default;
Journal& Journal::operator=(Journal&&) noexcept = default;
Journal::~Journal() = default;

bool Journal::exists() const { return body_->exists(); }
bool Journal::next(JournalEntry& entry) { return body_->next(entry); }
void Journal::seek(std::uint64_t number) { body_->seek(number); }
void Journal::seek_end() { body_->seek_end(); }

}  // namespace o80
