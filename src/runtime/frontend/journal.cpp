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

struct Journal::Body {
  explicit Body(std::shared_ptr<Link> of)
      : link(std::move(of)),
        reader(link->segment.view()),
        decoder(link->description, bytes_of_lanes(link->segment.view().shape)) {}

  std::shared_ptr<Link> link;
  JournalReader reader;
  JournalDecoder decoder;
};

Journal::Journal(const UntypedFrontend& frontend) : body_(std::make_unique<Body>(frontend.link())) {
  // the name of an owner may stand behind an entry that it caused, because names are repeated
  JournalReader names = body_->reader;
  JournalDecoder& decoder = body_->decoder;
  // bounded: a fast writer adds entries meanwhile
  const std::uint64_t most = body_->link->segment.view().shape.journal_bytes / sizeof(JournalHead);
  for (std::uint64_t i = 0; i < most && names.next(decoder.item()); ++i) decoder.note_name();
}

Journal::Journal(Journal&&) noexcept = default;
Journal& Journal::operator=(Journal&&) noexcept = default;
Journal::~Journal() = default;

bool Journal::exists() const { return body_->reader.has_journal(); }

bool Journal::next(JournalEntry& entry) {
  auto& [link, reader, decoder] = *body_;
  link->check_usable();
  while (!decoder.next(entry)) {
    if (!reader.next(decoder.item())) return false;
    decoder.take();
  }
  return true;
}

void Journal::seek(std::uint64_t number) {
  // from the oldest entry on: blocks of a batch lie before the decision on it
  body_->reader = JournalReader(body_->link->segment.view());
  body_->decoder.start_at(number);
}

void Journal::seek_end() {
  body_->reader.seek_end();
  body_->decoder.start_at(0);
}

}  // namespace o80
