#include "memory/ring/history.hpp"

#include <algorithm>
#include <atomic>
#include <cstring>

#include "base/crash_point.hpp"
#include "memory/os/atomic_words.hpp"
#include "memory/os/prefetch.hpp"

// The thread sanitizer does not model fences. It reports nothing here, because every word that the
// fences order is atomic.
#if defined(__SANITIZE_THREAD__) && !defined(__clang__)
#pragma GCC diagnostic ignored "-Wtsan"
#endif

namespace o80 {

namespace {

// above any iteration of a backend; counters of a damaged file are clamped to it, to exclude
// overflows
constexpr Iteration kFarthest = Iteration{1} << 60;
constexpr std::size_t kRowsAtOnce = 64;
constexpr int kReadings = 100;  // attempts while `published` does not change

/// Copies a part of adjacent rows.
void copy_part(const HistoryReader::Part& part, const std::byte* from, std::size_t row_bytes,
               std::byte* to, std::size_t packed, std::size_t rows) noexcept {
  const std::size_t begin = part.begin;
  const std::size_t size = part.size;
  to += part.to;
  const bool is_word = begin % 8 == 0 && size == 8;  // known to the compiler, it is a tight loop
  for (; rows > 0; --rows, from += row_bytes, to += packed) {
    if (is_word) {
      load_words(to, from + begin, 8);
    } else {
      load_bytes(to, from, begin, size);
    }
  }
}

}  // namespace

HistoryWriter::HistoryWriter(const SegmentView& view) noexcept
    : counters_(&view.counters()),
      slots_begin_(view.history()),
      row_bytes_(view.shape.row_bytes),
      slots_(view.shape.slots) {}

void HistoryWriter::publish(Iteration k, const std::byte* row) noexcept {
  std::byte* slot = slots_begin_ + static_cast<std::uint64_t>(k) % slots_ * row_bytes_;
  O80_CRASH_POINT("history.before_begun");
  counters_->begun.store(k, std::memory_order_relaxed);
  std::atomic_thread_fence(std::memory_order_release);  // sync row
  O80_CRASH_POINT("history.before_row");
  store_words(slot, row, row_bytes_);
  O80_CRASH_POINT("history.before_published");
  // sequentially consistent, because RowSignal loads `wanted` right after it
  counters_->published.store(k, std::memory_order_seq_cst);  // sync published
  O80_CRASH_POINT("history.after_published");
}

void HistoryWriter::skip_to(Iteration k) noexcept {
  O80_CRASH_POINT("history.before_first");
  // before `begun`: a row ahead of `published` by more than one is damage, unless it is `first`
  counters_->first.store(k, std::memory_order_relaxed);
  O80_CRASH_POINT("history.after_first");
}

void HistoryWriter::expect(Iteration k) const noexcept {
  constexpr std::size_t kMax = 512;  // further lines are prefetched by the processor
  prefetch_to_write(&counters_->begun);
  const std::byte* slot = slots_begin_ + static_cast<std::uint64_t>(k) % slots_ * row_bytes_;
  const std::size_t bytes = std::min(row_bytes_, kMax);
  for (std::size_t at = 0; at < bytes; at += kLineBytes) prefetch_to_write(slot + at);
  prefetch_to_write(slot + bytes - 1);
}

HistoryReader::HistoryReader(const SegmentView& view) noexcept
    : counters_(&view.counters()),
      slots_begin_(view.history()),
      row_bytes_(view.shape.row_bytes),
      slots_(view.shape.slots) {}

Iteration HistoryReader::published() const noexcept {
  const Iteration k = counters_->published.load(std::memory_order_acquire);  // sync published
  return std::clamp<Iteration>(k, -1, kFarthest);
}

Iteration HistoryReader::begun() const noexcept {
  return std::clamp<Iteration>(counters_->begun.load(std::memory_order_relaxed), -1, kFarthest);
}

bool HistoryReader::is_damaged() const noexcept {
  // a row beyond all that a backend can write would be waited for without end
  if (counters_->published.load(std::memory_order_relaxed) > kFarthest) return true;
  // `begun` is at most one row ahead of `published`; compare them only while `published` is stable
  for (int i = 0; i < kReadings; ++i) {
    const Iteration before = published();
    std::atomic_thread_fence(std::memory_order_seq_cst);
    const Iteration under_way = begun();
    std::atomic_thread_fence(std::memory_order_seq_cst);
    if (under_way <= before + 1 || under_way == first_available() || published() != before)
      return false;
  }
  return true;
}

Iteration HistoryReader::first_available() const noexcept {
  return std::clamp<Iteration>(counters_->first.load(std::memory_order_relaxed), 0, kFarthest);
}

Iteration HistoryReader::oldest() const noexcept {
  // `published` before `first`: who sees a row after a gap sees the gap
  const Iteration newest = published();
  return std::max(first_available(), newest - static_cast<Iteration>(rows()) + 1);
}

const std::byte* HistoryReader::slot(Iteration k) const noexcept {
  return slots_begin_ + static_cast<std::uint64_t>(k) % slots_ * row_bytes_;
}

Iteration HistoryReader::first_intact() const noexcept {
  std::atomic_thread_fence(std::memory_order_acquire);  // sync row
  return begun() - static_cast<Iteration>(slots_) + 1;
}

bool HistoryReader::read(Iteration k, std::byte* to) const noexcept {
  if (k < oldest() || k > published()) return false;
  load_words(to, slot(k), row_bytes_);
  return k >= first_intact() && k >= first_available();
}

Iteration HistoryReader::latest(std::byte* to) const noexcept {
  Iteration last = -1;
  for (int tries = 0; tries < kReadings;) {
    const Iteration k = published();
    if (k < 0) return -1;
    load_words(to, slot(k), row_bytes_);
    if (k >= first_intact()) return k;
    // the writer has overwritten the row during the copy: try again
    tries = k == last ? tries + 1 : 0;
    last = k;
  }
  return -1;
}

template <class Copy>
HistoryReader::Range HistoryReader::read_by(Iteration first, std::size_t count, std::size_t packed,
                                            std::byte* to, Copy copy) const noexcept {
  const Iteration newest = published();
  const std::uint64_t behind = first < 0 ? -static_cast<std::uint64_t>(first) : 0;
  if (count <= behind) return {0, 0};
  const Iteration begin = std::max(first, oldest());
  if (begin > newest) return {begin, 0};
  // compare `count`, do not add it: any value is possible
  const auto skipped = static_cast<std::uint64_t>(begin - std::max<Iteration>(first, 0)) + behind;
  if (count <= skipped) return {begin, 0};
  const auto there = static_cast<std::uint64_t>(newest - begin) + 1;
  const std::uint64_t rows = std::min<std::uint64_t>(there, count - skipped);

  // slots => to, in two runs at most
  const std::uint64_t slot_of_begin = static_cast<std::uint64_t>(begin) % slots_;
  const std::uint64_t before_end = std::min(rows, slots_ - slot_of_begin);
  copy(slot(begin), before_end, to);
  copy(slots_begin_, rows - before_end, to + before_end * packed);

  // drop rows that the writer may have overwritten during the copy
  const Iteration kept = std::max({begin, first_intact(), first_available()});
  const auto lost = static_cast<std::uint64_t>(kept - begin);
  if (lost >= rows) return {kept, 0};
  if (lost > 0) std::memmove(to, to + lost * packed, (rows - lost) * packed);
  return {kept, rows - lost};
}

HistoryReader::Range HistoryReader::read_range(Iteration first, std::size_t count,
                                               std::byte* to) const noexcept {
  return read_by(first, count, row_bytes_, to,
                 [this](const std::byte* from, std::size_t rows, std::byte* at) {
                   load_words(at, from, rows * row_bytes_);
                 });
}

HistoryReader::Range HistoryReader::read_parts(Iteration first, std::size_t count,
                                               std::span<const Part> parts, std::size_t packed,
                                               std::byte* to) const noexcept {
  return read_by(first, count, packed, to,
                 [&](const std::byte* from, std::size_t rows, std::byte* at) {
                   // few rows at a time: they stay in the cache for the next part
                   for (std::size_t i = 0; i < rows; i += kRowsAtOnce) {
                     const std::byte* const begin = from + i * row_bytes_;
                     std::byte* const row = at + i * packed;
                     const std::size_t some = std::min(rows - i, kRowsAtOnce);
                     for (const Part& part : parts) {
                       copy_part(part, begin, row_bytes_, row, packed, some);
                     }
                   }
                 });
}

}  // namespace o80
