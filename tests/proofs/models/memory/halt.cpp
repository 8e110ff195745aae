// The halt: each one that is asked for is latched, also by a backend that stands still; a resume
// clears none that it has not seen; what is shown is of one halt.
//
// mutant asked_without_the_bell: src/memory/segment/halt_word.cpp
//   - O80_CRASH_POINT("halt.after_count");
//   - ring_bell(view);
//   - write_halt(
//   + write_halt(
//   - // again: the backend may have read the slot before this reason and sleep since
//   - ring_bell(view);
//   +
// mutant counted_not_added: src/memory/segment/halt_word.cpp
//   - bell.halts.fetch_add(1, std::memory_order_seq_cst) + 1;
//   + bell.halts.load(std::memory_order_seq_cst) + 1;
//   + bell.halts.store(number, std::memory_order_seq_cst);
// mutant clears_what_it_has_not_seen: src/memory/segment/halt_word.cpp
//   - if (view_.bell().halts.load(std::memory_order_seq_cst) != seen_) return false;
//   + seen_ = view_.bell().halts.load(std::memory_order_seq_cst);
// mutant reason_relaxed: src/memory/segment/halt_word.cpp
//   - slot.number.store(number, std::memory_order_release);
//   + slot.number.store(number, std::memory_order_relaxed);
// mutant reason_changed_in_public: src/memory/segment/halt_word.cpp
//   - slot.number.store(0, std::memory_order_relaxed);
//   +
// mutant reason_not_asked_again: src/memory/segment/halt_word.cpp
//   - if (slot.number.load(std::memory_order_relaxed) != number) return false;
//   +

#include "kernel.hpp"
#include "memory/segment/halt_word.hpp"

namespace {

constexpr int kAskers = 2;
constexpr int kEach = 2;

/// Two ask, the backend latches, shows and clears, one reads what is shown.
struct Halts : rl::test_suite<Halts, 2 + kAskers> {
  model::Segment segment{1, 2, 0, 1};
  std::atomic<int> over{0};

  void thread(unsigned index) {
    if (index == 0) return latch();
    if (index == 1) return read();
    for (int i = 0; i < kEach; ++i)
      // the cause tells who asked: it must come together with a number of that asker's
      asked[index - 2][i] =
          o80::request_halt(segment.view, static_cast<o80::HaltCause>(10 * index), "", "");
  }

  void latch() {
    o80::BellWaiter bell(segment.view);
    o80::HaltLatch halts(segment.view);
    std::uint64_t last = 0;
    while (last < kAskers * kEach) {
      const std::uint32_t seen = bell.value();
      if (halts.poll()) {
        model::check(halts.halt().number > last, "numbers of halts grow");
        last = halts.halt().number;
        show(halts, last);
        const bool cleared = halts.clear();
        const std::uint64_t now = segment.view.bell().halts.load(std::memory_order_seq_cst);
        if (cleared && now > last && halts.poll()) last = show_rest(halts, last);
        continue;
      }
      bell.wait(seen);
    }
    over.store(1, std::memory_order_release);
  }

  /// A halt that came while one was cleared acts.
  std::uint64_t show_rest(o80::HaltLatch& halts, std::uint64_t last) {
    const std::uint64_t number = halts.halt().number;
    model::check(number > last, "numbers of halts grow");
    show(halts, number);
    return number;
  }

  void show(o80::HaltLatch& halts, std::uint64_t number) {
    if (!halts.show(100 + static_cast<o80::Iteration>(number))) return;
    reasons[number] = static_cast<unsigned>(halts.halt().cause);
    model::check(reasons[number] != 0, "a halt is shown with a reason that is not there yet");
  }

  void read() {
    for (int i = 0; i < 3; ++i) {
      const auto halt = o80::shown_halt(segment.view);
      if (!halt || halt->iteration < 0) continue;
      model::check(halt->iteration == 100 + static_cast<o80::Iteration>(halt->number),
                   "a halt was shown with the words of another");
    }
  }

  std::uint64_t asked[kAskers][kEach];
  unsigned reasons[kAskers * kEach + 1] = {};  // as the backend read them, 0: not there yet

  void after() {
    for (int a = 0; a < kAskers; ++a)
      for (int i = 0; i < kEach; ++i) {
        const unsigned reason = reasons[asked[a][i]];
        model::check(reason == 0 || reason == 10U * (a + 2), "a halt has the reason of another");
        for (int b = 0; b < kAskers; ++b)
          for (int j = 0; j < kEach; ++j)
            model::check((a == b && i == j) || asked[a][i] != asked[b][j],
                         "two halts have one number");
      }
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<Halts>(count, arguments); }
