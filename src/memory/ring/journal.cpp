#include "memory/ring/journal.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>

#include "base/crash_point.hpp"

// As in history.cpp: the thread sanitizer does not model fences, and every word that they order is
// atomic.
#if defined(__SANITIZE_THREAD__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wtsan"
#endif

namespace o80 {

namespace {
// above any position of a writer; counters of a damaged file are clamped to it
constexpr std::uint64_t kFarthestPosition = std::uint64_t{1} << 62;
constexpr int kOvertakes = 8;  // attempts of one call of next()
}  // namespace

// ------------------------------------------------------------------------------ writer

JournalWriter::JournalWriter(const SegmentView& view) noexcept
    : counters_(&view.counters().journal),
      ring_(view.journal()),
      bytes_(view.shape.journal_bytes),
      sector_shift_(bytes_ == 0 ? 0 : std::countr_zero(bytes_ / kJournalSectors)),
      most_(bytes_ == 0 ? 0 : std::min<std::uint64_t>(kMaxJournalPayload, bytes_ / 4)) {}

void JournalWriter::write(const JournalHead& head, const void* payload,
                          std::size_t bytes) noexcept {
  if (bytes_ == 0) return;
  const std::uint64_t at = position_ & (bytes_ - 1);
  const std::size_t length = sizeof head + bytes;
  if (bytes > most_ || at + length > bytes_) [[unlikely]] {
    begin(bytes);
    add(static_cast<const std::byte*>(payload), bytes);
    return publish(head);
  }
  // the same for most entries, small and without a wrap
  announce(length);
  store_words(ring_ + at + sizeof head, static_cast<const std::byte*>(payload), bytes);
  const std::array<std::uint64_t, 4> words = words_of(head, length);
  store_words(ring_ + at, reinterpret_cast<const std::byte*>(words.data()), sizeof words);
  finish(head, length);
}

/// Before the ring is written: readers learn how far it may be overwritten.
void JournalWriter::announce(std::size_t length) noexcept {
  O80_CRASH_POINT("journal.before_begun");
  counters_->begun.store(position_ + length, std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_release);  // sync entry
  O80_CRASH_POINT("journal.before_entry");
}

/// The head in whole words: to load them from a head that was written field by field would take
/// longer.
std::array<std::uint64_t, 4> JournalWriter::words_of(const JournalHead& head,
                                                     std::size_t length) const noexcept {
  return {head.first_word(length / 8), number_, static_cast<std::uint64_t>(head.iteration),
          head.id};
}

void JournalWriter::begin(std::size_t most) noexcept {
  if (bytes_ == 0) return;
  added_ = 0;
  room_ = std::min(most, most_);
  const std::uint64_t at = position_ & (bytes_ - 1);
  entry_ = at + sizeof(JournalHead) + room_ <= bytes_ ? ring_ + at : nullptr;
  announce(sizeof(JournalHead) + room_);
}

void JournalWriter::end(const JournalHead& head) noexcept {
  if (bytes_ != 0 && added_ > 0) publish(head);
}

void JournalWriter::publish(const JournalHead& head) noexcept {
  const std::size_t length = sizeof head + added_;
  const std::array<std::uint64_t, 4> words = words_of(head, length);
  store(0, reinterpret_cast<const std::byte*>(words.data()), sizeof words);
  finish(head, length);
}

void JournalWriter::finish(const JournalHead& head, std::size_t length) noexcept {
  number_ += head.numbers();
  const std::uint64_t sector = position_ >> sector_shift_;
  if (sector != marked_) {
    marked_ = sector;
    counters_->marks[sector % kJournalSectors].store(position_, std::memory_order_relaxed);
  }
  position_ += length;
  O80_CRASH_POINT("journal.before_published");
  counters_->published.store(position_, std::memory_order_release);  // sync journal
  O80_CRASH_POINT("journal.after_published");
}

/// The same for an entry that may wrap around the end of the ring.
void JournalWriter::store_across(std::size_t offset, const std::byte* from,
                                 std::size_t bytes) noexcept {
  const std::uint64_t at = (position_ + offset) & (bytes_ - 1);
  const std::size_t before_end = std::min<std::uint64_t>(bytes, bytes_ - at);
  store_words(ring_ + at, from, before_end);
  store_words(ring_, from + before_end, bytes - before_end);
}

// ------------------------------------------------------------------------------ reader

JournalReader::JournalReader(const SegmentView& view)
    : counters_(&view.counters().journal), ring_(view.journal()), bytes_(view.shape.journal_bytes) {
  go_to_oldest();
}

std::uint64_t JournalReader::published() const noexcept {
  // whole words: a damaged position must not lead to a misaligned one
  return std::min(counters_->published.load(std::memory_order_acquire),  // sync journal
                  kFarthestPosition) &
         ~std::uint64_t{7};
}

std::uint64_t JournalReader::first_intact() const noexcept {
  std::atomic_thread_fence(std::memory_order_acquire);  // sync entry
  const std::uint64_t begun =
      std::min(counters_->begun.load(std::memory_order_relaxed), 2 * kFarthestPosition);
  return begun - std::min(begun, bytes_);
}

void JournalReader::load(std::uint64_t position, std::byte* to, std::size_t bytes) const noexcept {
  const std::uint64_t at = position & (bytes_ - 1);
  const std::size_t before_end = std::min<std::uint64_t>(bytes, bytes_ - at);
  load_words(to, ring_ + at, before_end);
  load_words(to + before_end, ring_, bytes - before_end);
}

/// Reads the head of the entry at this position, and checks its length.
JournalReader::Got JournalReader::read_head(std::uint64_t position,
                                            JournalHead& head) const noexcept {
  const std::uint64_t end = published();
  if (position >= end) return Got::nothing;
  std::array<std::byte, sizeof(JournalHead)> bytes;
  load(position, bytes.data(), bytes.size());
  if (position < first_intact()) return Got::overtaken;
  std::memcpy(&head, bytes.data(), sizeof head);
  const std::uint64_t length = std::uint64_t{head.words} * 8;
  const bool fits = length >= sizeof head && length <= bytes_ && length <= end - position;
  return fits ? Got::entry : Got::damaged;
}

JournalReader::Got JournalReader::read(JournalItem& item) {
  const Got got = read_head(position_, item.head);
  if (got != Got::entry) return got;
  const std::uint64_t length = std::uint64_t{item.head.words} * 8;
  item.payload.resize(length - sizeof item.head);
  load(position_ + sizeof item.head, item.payload.data(), item.payload.size());
  if (position_ < first_intact()) return Got::overtaken;
  // numbers have gaps only in a recording that is played
  if (!jumped_ && item.head.number < expected_) return Got::damaged;
  position_ += length;
  return Got::entry;
}

bool JournalReader::next(JournalItem& item) {
  if (bytes_ == 0) return false;
  for (int i = 0; i < kOvertakes; ++i) {
    switch (read(item)) {
      case Got::entry:
        item.missed = item.head.number - std::min(expected_, item.head.number);
        expected_ = item.head.number + item.head.numbers();
        jumped_ = false;
        return true;
      case Got::nothing:
        return false;
      case Got::overtaken:
        go_to_oldest();
        break;
      case Got::damaged:
        skip_to_end();
        return false;
    }
  }
  skip_to_end();  // the writer is faster than this reader
  return false;
}

/// Goes to the oldest entry that will not be overwritten soon.
void JournalReader::go_to_oldest() noexcept {
  if (bytes_ == 0) return;
  const std::uint64_t end = published();
  const std::uint64_t intact = first_intact();
  // some room to the writer, unless nothing was overwritten yet
  const std::uint64_t first = intact == 0 ? 0 : intact + bytes_ / 8;
  position_ = end;
  for (const std::atomic<std::uint64_t>& word : counters_->marks) {
    const std::uint64_t mark = word.load(std::memory_order_relaxed);
    if (mark % 8 == 0 && mark >= first && mark < position_) position_ = mark;
  }
  jumped_ = true;
}

void JournalReader::skip_to_end() noexcept {
  position_ = published();
  jumped_ = true;
}

void JournalReader::seek_end() noexcept {
  if (bytes_ != 0) skip_to_end();
  expected_ = ~std::uint64_t{0};  // nothing counts as missed
}

}  // namespace o80
