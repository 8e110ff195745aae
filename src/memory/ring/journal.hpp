#pragma once

#include <array>
#include <bit>
#include <cstddef>
#include <cstdint>
#include <type_traits>
#include <vector>

#include "memory/os/atomic_words.hpp"
#include "memory/segment/segment_layout.hpp"
#include "o80/base/time.hpp"
#include "o80/memory/journal_kind.hpp"

// The journal: a ring of entries of variable length. A position is the number of bytes written
// since the start; the entry at position p begins in the ring at p modulo its size, and may wrap
// around its end. An entry is a JournalHead and a payload, both multiples of 8 bytes.
//
// The ring is divided into sectors. The mark of a sector is the position of the first entry that
// begins in it, so that a reader that was overtaken finds the begin of an entry again.

namespace o80 {

struct JournalHead {
  std::uint16_t words = 0;  // length of the entry with this head [8 bytes]
  JournalKind kind = JournalKind::none;
  std::uint8_t lane = 0;
  /// records: index of the first block; statuses: their number; else as `how` packs it.
  std::uint32_t what = 0;
  std::uint64_t number = 0;  // of the entry, from 0; an entry of n statuses has n numbers
  Iteration iteration = 0;
  std::uint64_t id = 0;  // of a batch, record or halt; incarnation of an owner; an actuator

  /// The fields before `number`, with this length.
  constexpr std::uint64_t first_word(std::uint64_t length) const noexcept {
    static_assert(std::endian::native == std::endian::little);
    return length | std::uint64_t{static_cast<std::uint8_t>(kind)} << 16 |
           std::uint64_t{lane} << 24 | std::uint64_t{what} << 32;
  }
  /// The numbers that the entry takes.
  constexpr std::uint64_t numbers() const noexcept {
    return kind == JournalKind::statuses && what > 0 ? what : 1;
  }
  /// Packs a status, a reason and its detail into `what`.
  static constexpr std::uint32_t how(std::uint8_t status, std::uint8_t reason = 0,
                                     std::uint8_t detail = 0) noexcept {
    return status | std::uint32_t{reason} << 8 | std::uint32_t{detail} << 16;
  }
  constexpr std::uint8_t status() const noexcept { return static_cast<std::uint8_t>(what); }
  constexpr std::uint8_t reason() const noexcept { return static_cast<std::uint8_t>(what >> 8); }
  constexpr std::uint8_t detail() const noexcept { return static_cast<std::uint8_t>(what >> 16); }
};
static_assert(offsetof(JournalHead, lane) == 3 && offsetof(JournalHead, what) == 4);
static_assert(sizeof(JournalHead) == 32 && std::is_trivially_copyable_v<JournalHead>);

/// Largest payload of an entry [bytes].
inline constexpr std::size_t kMaxJournalPayload = 0xFFFF * 8 - sizeof(JournalHead);

/// Appends entries to the journal. Without a journal in the segment every call does nothing.
///
/// Writer:   one thread, wait-free.
/// Readers:  JournalReader, any number, any process.
/// Realtime: yes; the time of an entry grows with its bytes.
class JournalWriter {
 public:
  explicit JournalWriter(const SegmentView& view) noexcept;

  bool is_on() const noexcept { return bytes_ != 0; }
  /// Position of the next entry.
  std::uint64_t position() const noexcept { return position_; }
  std::uint64_t bytes() const noexcept { return bytes_; }
  /// True if an entry may have so large a payload.
  bool fits(std::size_t payload) const noexcept { return payload <= most_; }
  /// Appends an entry; sets `number` and `words` of its head. `bytes`: a multiple of 8. A payload
  /// larger than kMaxJournalPayload or a quarter of the ring is left out.
  void write(const JournalHead& head, const void* payload = nullptr,
             std::size_t bytes = 0) noexcept;

  /// The next entry has this number: entries before it are missing. A smaller one has no effect.
  void skip_to(std::uint64_t number) noexcept { number_ = number > number_ ? number : number_; }

  // an entry whose payload comes in pieces: begin, add any number of times, end
  /// `most`: upper bound of the payload.
  void begin(std::size_t most) noexcept;
  /// A piece that does not fit in `most` is left out.
  void add(const std::byte* piece, std::size_t bytes) noexcept {
    if (added_ + bytes > room_) return;
    store(sizeof(JournalHead) + added_, piece, bytes);
    added_ += bytes;
  }
  /// Appends the entry; without any payload, nothing.
  void end(const JournalHead& head) noexcept;

 private:
  /// Stores a part of the entry that was begun.
  void store(std::size_t offset, const std::byte* from, std::size_t bytes) noexcept {
    if (entry_ == nullptr) return store_across(offset, from, bytes);
    store_words(entry_ + offset, from, bytes);
  }
  void store_across(std::size_t offset, const std::byte* from, std::size_t bytes) noexcept;
  void publish(const JournalHead& head) noexcept;
  void announce(std::size_t length) noexcept;
  std::array<std::uint64_t, 4> words_of(const JournalHead& head, std::size_t length) const noexcept;
  void finish(const JournalHead& head, std::size_t length) noexcept;

  JournalCounters* counters_;
  std::byte* ring_;
  std::uint64_t bytes_;
  int sector_shift_;  // a sector has 1 << sector_shift_ bytes
  std::size_t most_;  // largest payload
  std::uint64_t position_ = 0;
  std::uint64_t marked_ = ~std::uint64_t{0};  // last sector with a mark, counted over all laps
  std::uint64_t number_ = 0;
  // the entry that was begun
  std::byte* entry_ = nullptr;  // null if it may wrap around the end of the ring
  std::size_t room_ = 0;        // for its payload; 0: without a journal
  std::size_t added_ = 0;       // its payload
};

/// An entry that was read.
struct JournalItem {
  JournalHead head;
  std::uint64_t missed = 0;        // entries overwritten before they were read, just before this
  std::vector<std::byte> payload;  // memory is reused by the next read
};

/// Reads entries in their order. It never returns a torn entry and never waits. An overtaken reader
/// continues at the oldest entry that it can read safely.
///
/// Any content of the file is possible: every length is checked, every call ends.
///
/// Writer:   JournalWriter.
/// Readers:  one thread each; a read-only mapping is enough.
class JournalReader {
 public:
  /// Starts at the oldest entry.
  explicit JournalReader(const SegmentView& view);

  bool has_journal() const noexcept { return bytes_ != 0; }
  /// Reads the next entry; false if there is none now.
  bool next(JournalItem& item);
  /// Continues behind the newest entry.
  void seek_end() noexcept;
  /// Share of the ring that holds what was not read yet, from 0 to 1.
  double unread() const noexcept {
    if (bytes_ == 0) return 0.0;
    const std::uint64_t end = published();
    const std::uint64_t behind = std::min(end - std::min(end, position_), bytes_);
    return static_cast<double>(behind) / static_cast<double>(bytes_);
  }

 private:
  enum class Got : std::uint8_t { entry, nothing, overtaken, damaged };

  std::uint64_t published() const noexcept;
  /// First position that the writer has not begun to overwrite, for bytes copied before this call.
  std::uint64_t first_intact() const noexcept;
  void load(std::uint64_t position, std::byte* to, std::size_t bytes) const noexcept;
  Got read_head(std::uint64_t position, JournalHead& head) const noexcept;
  Got read(JournalItem& item);
  void go_to_oldest() noexcept;
  void skip_to_end() noexcept;

  const JournalCounters* counters_;
  const std::byte* ring_;
  std::uint64_t bytes_;
  std::uint64_t position_ = 0;
  std::uint64_t expected_ = 0;  // number of the next entry
  bool jumped_ = false;         // the entry at position_ may have a later number than expected
};

}  // namespace o80
