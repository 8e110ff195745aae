// Statuses and results of bursts: an answer is of the id that was asked for, or none, though the
// places are used again and again.
//
// mutant old_word_stays: src/memory/ring/lane_receiver.cpp
//   - slot.word.store(StatusWord::announcing(id), std::memory_order_relaxed);
//   +
// mutant nothing_announced: src/memory/ring/lane_receiver.cpp
//   - slot.word.store(StatusWord::announcing(id), std::memory_order_relaxed);
//   + slot.word.store(~std::uint64_t{0} >> 16, std::memory_order_relaxed);
// mutant id_relaxed: src/memory/ring/lane_receiver.cpp
//   - slot.id.store(id, std::memory_order_release);  // sync status_id
//   + slot.id.store(id, std::memory_order_relaxed);
// mutant word_relaxed: src/memory/ring/lane_receiver.cpp
//   - slot.word.store(word, std::memory_order_release);
//   + slot.word.store(word, std::memory_order_relaxed);
// mutant word_looked_at_once: src/memory/ring/lane_sender.cpp
//   - slot.word.load(std::memory_order_relaxed) == word) {
//   + true) {
// mutant burst_not_taken_back: src/memory/ring/lane_receiver.cpp
//   - slot.id.store(0, std::memory_order_relaxed); O80_CRASH_POINT("burst.before_row");
//   +
// mutant burst_row_relaxed: src/memory/ring/lane_receiver.cpp
//   - slot.row.store(row, std::memory_order_release);
//   + slot.row.store(row, std::memory_order_relaxed);
// mutant burst_looked_at_once: src/memory/ring/lane_sender.cpp
//   - row = slot.row.load(std::memory_order_acquire);                   // sync burst_row
//   - return slot.id.load(std::memory_order_relaxed) == id;
//   + row = slot.row.load(std::memory_order_acquire);
//   + return true;

#include "kernel.hpp"

namespace {

constexpr std::uint64_t kIds = 3;
constexpr std::uint64_t kPlaces = 2;  // of the statuses of a lane of one block
constexpr std::uint64_t kBurstRow = 1000;

/// Ids that share one place follow each other; two ask, for an early one and for a late one.
struct Statuses : rl::test_suite<Statuses, 3> {
  model::Segment segment{1, 2, 1, 1};

  static std::uint64_t id(std::uint64_t i) { return 1 + i * kPlaces; }

  void thread(unsigned index) {
    if (index == 0) return answer();
    const o80::AttachedSegment attached = model::attach();
    if (index == 2) return watch(attached);
    o80::LaneSender lane(attached);
    for (std::uint64_t i = 0; i < kIds; ++i) ask(lane, i);
  }

  void answer() {
    o80::LaneReceiver lane(segment.view, 0);
    for (std::uint64_t i = 0; i < kIds; ++i) {
      const auto iteration = static_cast<o80::Iteration>(id(i));
      lane.set_status(id(i), {.status = 1, .iteration = iteration});
      lane.set_status(id(i), {.status = 2, .iteration = iteration});
      lane.set_burst_done(id(i), iteration + kBurstRow);
    }
  }

  void ask(const o80::LaneSender& lane, std::uint64_t i) const {
    const auto iteration = static_cast<o80::Iteration>(id(i));
    const o80::LaneSender::StatusAnswer first = lane.status(id(i));
    const o80::LaneSender::StatusAnswer later = lane.status(id(i));
    for (const auto& answer : {first, later})
      if (answer.known == o80::LaneSender::Known::yes)
        model::check(answer.word.iteration == iteration && answer.word.status != 0,
                     "a status is of another id");
    if (first.known == o80::LaneSender::Known::yes) {
      model::check(later.known != o80::LaneSender::Known::not_yet, "a status was lost");
      if (later.known == o80::LaneSender::Known::yes)
        model::check(later.word.status >= first.word.status, "a status went back");
    }
    const o80::LaneSender::BurstAnswer burst = lane.burst(id(i));
    if (burst.known == o80::LaneSender::Known::yes)
      model::check(burst.row == iteration + static_cast<o80::Iteration>(kBurstRow),
                   "a burst's row is another's");
  }

  /// The raw place, as a reader that is slower than any real one.
  void watch(const o80::AttachedSegment& attached) const {
    const o80::StatusSlot& slot = attached.view().statuses(0)[id(0) & (kPlaces - 1)];
    const std::uint64_t owner = slot.id.load(std::memory_order_acquire);
    const std::uint64_t word = slot.word.load(std::memory_order_relaxed);
    if (owner == 0 || word == 0) return;
    model::check(o80::StatusWord::unpack(word).iteration >= static_cast<o80::Iteration>(owner),
                 "a place bears a new id and an old word");
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<Statuses>(count, arguments); }
