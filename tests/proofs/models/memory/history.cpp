// The history ring: a reader never accepts a torn row, or a row that is not the one it asked for.
//
// mutant without_release_fence: src/memory/ring/history.cpp
//   - std::atomic_thread_fence(std::memory_order_release);
//   +
// mutant without_acquire_fence: src/memory/ring/history.cpp
//   - std::atomic_thread_fence(std::memory_order_acquire);
//   +
// mutant never_begun: src/memory/ring/history.cpp
//   - counters_->begun.store(k, std::memory_order_relaxed);
//   +
// mutant published_relaxed: src/memory/ring/history.cpp
//   - counters_->published.store(k, std::memory_order_seq_cst);
//   + counters_->published.store(k, std::memory_order_relaxed);
// mutant read_relaxed: src/memory/ring/history.cpp
//   - counters_->published.load(std::memory_order_acquire);
//   + counters_->published.load(std::memory_order_relaxed);
// mutant one_row_too_many: src/memory/ring/history.cpp
//   - static_cast<Iteration>(slots_) + 1;
//   + static_cast<Iteration>(slots_);

#include "kernel.hpp"

namespace {

constexpr std::uint64_t kWords = 2;
constexpr o80::Iteration kRows = 5;

std::uint64_t word_of(o80::Iteration k, std::uint64_t i) {
  return static_cast<std::uint64_t>(100 * (k + 1)) + i;
}

bool is_row(const std::uint64_t* row, o80::Iteration k) {
  for (std::uint64_t i = 0; i < kWords; ++i)
    if (row[i] != word_of(k, i)) return false;
  return true;
}

/// Two rows are promised, three slots hold five rows: every slot but one is written twice.
struct History : rl::test_suite<History, 3> {
  model::Segment segment{kWords, 3, 0, 1};

  void thread(unsigned index) {
    if (index == 0) return write();
    if (index == 1) return read_one();
    read_many();
  }

  void write() {
    o80::HistoryWriter writer(segment.view);
    for (o80::Iteration k = 0; k < kRows; ++k) {
      const std::uint64_t row[] = {word_of(k, 0), word_of(k, 1)};
      writer.publish(k, reinterpret_cast<const std::byte*>(row));
    }
  }

  void read_one() {
    const o80::HistoryReader reader(segment.view);
    std::uint64_t row[kWords];
    auto* bytes = reinterpret_cast<std::byte*>(row);
    const o80::Iteration newest = reader.latest(bytes);
    model::check(newest < 0 || is_row(row, newest), "the newest row is torn");
    const o80::Iteration oldest = reader.oldest();
    if (reader.read(oldest, bytes)) model::check(is_row(row, oldest), "a row read is torn");
    const o80::Iteration later = reader.latest(bytes);
    model::check(later >= newest, "the newest row went back");
    model::check(later < 0 || is_row(row, later), "the newest row is torn");
  }

  void read_many() {
    const o80::HistoryReader reader(segment.view);
    std::uint64_t rows[kRows * kWords];
    const auto [first, count] = reader.read_range(0, kRows, reinterpret_cast<std::byte*>(rows));
    model::check(count <= 2, "more rows than are promised");
    for (std::size_t i = 0; i < count; ++i)
      model::check(is_row(rows + i * kWords, first + static_cast<o80::Iteration>(i)),
                   "a row of many is torn");
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<History>(count, arguments); }
