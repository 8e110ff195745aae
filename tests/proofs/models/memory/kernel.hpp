#pragma once

/// What surrounds the product in a model: shared memory, kernel and clock of one segment.
///
/// Time stands still: no slice ever passes, so nothing heals a lost wake-up, and Relacy reports a
/// state in which everybody sleeps.

#include "memory/ring/history.hpp"
#include "memory/ring/lane_receiver.hpp"
#include "memory/ring/lane_sender.hpp"
#include "memory/segment/segment_layout.hpp"
#include "memory/segment/signal.hpp"

namespace model {

/// A word of the history: a relaxed atomic, as in the product. A word of a lane's transport: plain
/// memory, since with honest owners the counters order every access; Relacy reports one that they
/// do not, also where its own memory could not show the damage (it never reads from the future).
class Word {
 public:
  explicit Word(bool ordered) : ordered_(ordered) {
    if (ordered_)
      plain_(RL_INFO) = 0;
    else
      value_.store(0, rl::mo_relaxed, RL_INFO);
  }
  std::uint64_t load(rl::memory_order order, rl::debug_info_param info) {
    return ordered_ ? static_cast<std::uint64_t>(plain_(info)) : value_.load(order, info);
  }
  void store(std::uint64_t value, rl::memory_order order, rl::debug_info_param info) {
    if (ordered_)
      plain_(info) = value;
    else
      value_.store(value, order, info);
  }

 private:
  bool ordered_;
  rl::atomic<std::uint64_t> value_;
  rl::var<std::uint64_t> plain_;
};

/// Thrown where a process dies.
struct Death {};

/// A segment, laid out by the product; of each part only what the models touch exists.
class Segment {
 public:
  static constexpr std::size_t kRemembered = 4;  // bursts and messages that a model may use

  Segment(std::uint64_t row_words, std::uint64_t slots, std::uint32_t lanes,
          std::uint32_t lane_blocks, std::uint64_t journal_bytes = 0) {
    view.shape = {.page_bytes = 4096,
                  .schema_bytes = 0,
                  .provenance_bytes = 0,
                  .row_bytes = 8 * row_words,
                  .slots = slots,
                  .lanes = lanes,
                  .lane_blocks = lane_blocks,
                  .journal_bytes = journal_bytes > 0 ? o80::kMinJournal : 0};
    if (!o80::SegmentOffsets::compute(view.shape, view.offsets)) std::abort();
    static std::byte* memory =
        static_cast<std::byte*>(std::aligned_alloc(4096, view.offsets.file_bytes));
    static std::byte* commands =
        static_cast<std::byte*>(std::aligned_alloc(4096, view.offsets.commands_bytes));
    view.shape.journal_bytes = journal_bytes;  // smaller than a real one
    view.base = memory;
    view.commands = commands;
    current() = this;
    make(view.counters().begun, -1);
    make(view.counters().published, -1);
    make_all(view.counters().first, view.counters().next_at, view.counters().processor);
    make(view.counters().state, static_cast<std::uint32_t>(o80::BackendState::running));
    make_all(view.wakes().row_wake, view.wakes().lane_wake, view.wakes().sleeping);
    make_all(view.bell().rung, view.bell().tickets, view.bell().passed_on, view.bell().halts);
    make(view.bell().wanted, std::numeric_limits<std::int64_t>::max());
    for (o80::HaltSlot& reason : view.bell().reasons) make(reason);
    make_all(view.counters().halted, view.counters().cleared, view.counters().halt);
    words(view.history(), row_words * slots, false);
    if (journal_bytes > 0) {
      make_all(view.counters().journal.begun, view.counters().journal.published);
      for (auto& mark : view.counters().journal.marks) make(mark);
      words(view.journal(), journal_bytes / 8, false);
    }
    for (std::uint32_t i = 0; i < lanes; ++i) make_lane(i);
  }
  Segment& operator=(Segment&&) = delete;
  ~Segment() {
    for (const auto& destroy : destroyers_) destroy();
  }

  static Segment*& current() {
    static Segment* segment = nullptr;
    return segment;
  }
  Word& word(const void* address) {
    const auto* at = static_cast<const std::byte*>(address);
    for (Region& region : regions_)
      if (at >= region.begin && at < region.begin + 8 * region.words.size())
        return region.words[static_cast<std::size_t>(at - region.begin) / 8];
    std::abort();
  }
  rl::atomic<std::uint32_t>& lock(std::uint64_t byte) { return locks_[byte]; }

  /// The process of this thread dies when it passes that crash point (of a function that may
  /// throw): from there on it only lets go, as the kernel does for it.
  void die_at(std::string_view label) { dies_at_[rl::ctx().threadx_->index_] = label; }
  bool dies_at(std::string_view label) const {
    return dies_at_[rl::ctx().threadx_->index_] == label;
  }
  void die() { dead_[rl::ctx().threadx_->index_] = true; }
  bool died() const { return dead_[rl::ctx().threadx_->index_]; }

  o80::SegmentView view;

 private:
  struct Region {
    const std::byte* begin;
    std::deque<Word> words;
  };

  template <class T>
  void make(rl::atomic<T>& place, std::int64_t value = 0) {
    std::construct_at(&place, static_cast<T>(value));
    destroyers_.push_back([&place] { std::destroy_at(&place); });
  }
  void make(o80::HaltSlot& slot) { make_all(slot.number, slot.iteration, slot.cause); }
  void make(o80::BurstSlot& slot) { make_all(slot.id, slot.row); }
  template <class... Places>
  void make_all(Places&... places) {
    (make(places), ...);
  }
  void words(const std::byte* begin, std::size_t count, bool ordered) {
    Region& region = regions_.emplace_back(Region{begin, {}});
    for (std::size_t i = 0; i < count; ++i) region.words.emplace_back(ordered);
  }
  void make_lane(std::uint32_t i) {
    o80::LaneSenderPage& page = view.lane(i);
    make_all(page.committed, page.incarnation, page.closed, page.dead_incarnation,
             page.successor_begin, page.owner_begin, page.next_id, page.waiting, page.cancels);
    for (auto& cancelled : page.cancelled) make(cancelled);
    o80::LaneFeedback& feedback = view.feedback(i);
    make_all(feedback.freed, feedback.burst, feedback.bursts, feedback.events, feedback.ids,
             feedback.incarnation);
    for (std::size_t k = 0; k < kRemembered; ++k) make(feedback.recent_bursts[k]);
    for (std::size_t k = 0; k < 2 * view.shape.lane_blocks; ++k)
      make_all(view.statuses(i)[k].id, view.statuses(i)[k].word);
    words(view.transport(i), view.shape.lane_blocks * o80::kBlockSize / 8, true);
    make(locks_[o80::kFirstLaneByte + i]);
  }

  std::vector<std::function<void()>> destroyers_;
  std::deque<Region> regions_;
  std::array<bool, 8> dead_{};
  std::array<std::string_view, 8> dies_at_{};
  union {
    rl::atomic<std::uint32_t> locks_[o80::kFirstLaneByte + 8];
  };
};

/// What a model asserts.
inline void check(bool true_, const char* what) {
  if (!true_) rl::ctx().fail_test(what, rl::test_result_user_assert_failed, RL_INFO);
}

/// Explores a model: `program random N` or `program bound N` (all orders with N forced switches).
template <class Model>
int explore(int count, char** arguments) {
  rl::test_params options;
  const bool random = count != 3 || std::string_view(arguments[1]) == "random";
  const auto number = static_cast<unsigned>(count == 3 ? std::stoul(arguments[2]) : 10'000);
  options.search_type = random ? rl::random_scheduler_type : rl::fair_context_bound_scheduler_type;
  if (random)
    options.iteration_count = number;
  else
    options.context_bound = number;
  std::ostream nowhere(nullptr);
  options.progress_stream = &nowhere;
  const bool holds = rl::simulate<Model>(options);
  std::cout << (holds ? "holds in " : "fails at ") << options.stop_iteration << " executions\n";
  return holds ? 0 : 1;
}

}  // namespace model

namespace model {

inline o80::AttachedSegment attach() {
  return o80::AttachedSegment::attach("model", o80::Access::read_write, o80::Deadline({}));
}

}  // namespace model
