// The journal: a reader never accepts a torn entry, gets every entry once and in order, and counts
// exactly those that were overwritten before it came.
//
// mutant without_release_fence: src/memory/ring/journal.cpp
//   - std::atomic_thread_fence(std::memory_order_release);
//   +
// mutant without_acquire_fence: src/memory/ring/journal.cpp
//   - std::atomic_thread_fence(std::memory_order_acquire);
//   +
// mutant never_begun: src/memory/ring/journal.cpp
//   - counters_->begun.store(position_ + length, std::memory_order_relaxed);
//   +
// mutant begun_without_its_head: src/memory/ring/journal.cpp
//   - counters_->begun.store(position_ + length, std::memory_order_relaxed);
//   + counters_->begun.store(position_ + length - sizeof(JournalHead), std::memory_order_relaxed);
// mutant published_relaxed: src/memory/ring/journal.cpp
//   - counters_->published.store(position_, std::memory_order_release);
//   + counters_->published.store(position_, std::memory_order_relaxed);
// mutant read_relaxed: src/memory/ring/journal.cpp
//   - counters_->published.load(std::memory_order_acquire)
//   + counters_->published.load(std::memory_order_relaxed)
// mutant overwritten_accepted: src/memory/ring/journal.cpp
//   - if (position_ < first_intact()) return Got::overtaken;
//   +
// mutant gap_not_counted: src/memory/ring/journal.cpp
//   - item.missed = item.head.number - std::min(expected_, item.head.number);
//   + item.missed = 0;

#include "memory/ring/journal.hpp"

#include "kernel.hpp"

namespace {

constexpr std::uint64_t kEntries = 9;
constexpr std::uint64_t kRing = 256;  // six entries of 40 bytes

std::uint64_t word_of(std::uint64_t number) { return 1000 + number; }

bool is_whole(const o80::JournalItem& item) {
  std::uint64_t word = 0;
  if (item.payload.size() != sizeof word) return false;
  std::memcpy(&word, item.payload.data(), sizeof word);
  return word == word_of(item.head.number) && item.head.id == item.head.number &&
         item.head.iteration == static_cast<o80::Iteration>(item.head.number);
}

struct Journal : rl::test_suite<Journal, 3> {
  model::Segment segment{1, 2, 0, 1, kRing};

  void thread(unsigned index) {
    if (index == 0) return write();
    read(index == 1 ? 2 : 4);
  }

  void write() {
    o80::JournalWriter writer(segment.view);
    for (std::uint64_t i = 0; i < kEntries; ++i) {
      o80::JournalHead head;
      head.id = i;
      head.iteration = static_cast<o80::Iteration>(i);
      const std::uint64_t word = word_of(i);
      writer.write(head, &word, sizeof word);
    }
  }

  void read(int most) {
    o80::JournalReader reader(segment.view);
    o80::JournalItem item;
    std::uint64_t next = 0;
    for (int i = 0; i < most; ++i) {
      if (!reader.next(item)) continue;
      model::check(is_whole(item), "an entry is torn");
      model::check(item.head.number == next + item.missed, "an entry is lost, or comes twice");
      model::check(item.head.number < kEntries, "an entry that nobody wrote");
      next = item.head.number + 1;
    }
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<Journal>(count, arguments); }
