// The end of a backend: whoever waits, for a row or with a lane, is told at once, though no slice
// ever passes; what was there before the end is not lost to it.
//
// mutant end_of_rows_slept_through: src/memory/segment/signal.cpp
//   - // the end is stored before `row_wake` changes: has_ended() is reliable after the load above
//   - if (segment.has_ended()) return std::nullopt;
//   +
// mutant end_of_lanes_slept_through: src/memory/ring/lane_sender.cpp
//   - // the end is stored before `lane_wake` changes: has_ended() is reliable after the load above
//   - if (segment_->has_ended()) return;
//   +
// mutant ended_after_the_wake: src/memory/segment/segment_file.cpp
//   - counters.state.store(static_cast<std::uint32_t>(state), std::memory_order_seq_cst);
//   +
//   - futex_wake(wakes.row_wake, kEverybody);
//   + futex_wake(wakes.row_wake, kEverybody);
//   + counters.state.store(static_cast<std::uint32_t>(state), std::memory_order_seq_cst);

#include "kernel.hpp"
#include "memory/segment/segment_file.hpp"
#include "o80/base/error.hpp"

namespace {

/// One row, one batch that ends, then the end; one waits for rows, one with its lane, and either
/// for one thing more than ever comes.
struct Ending : rl::test_suite<Ending, 3> {
  model::Segment segment{1, 2, 1, 1};

  void thread(unsigned index) {
    if (index == 0) return end();
    const o80::AttachedSegment attached = model::attach();
    if (index == 1) {
      o80::RowWaiter waiter(attached);
      for (o80::Iteration k = 0; k < 2; ++k)
        model::check(told([&] { waiter.wait_for_row(k, o80::Deadline({})); }) == (k == 1),
                     "the end came instead of a row");
    } else {
      o80::LaneSender lane(attached);
      for (std::uint64_t id = 1; id < 3; ++id)
        model::check(told([&] {
                       const auto has_ended = [&] {
                         return lane.status(id).known == o80::LaneSender::Known::yes;
                       };
                       lane.wait_until(has_ended, o80::Deadline({}));
                     }) == (id == 2),
                     "the end came instead of an answer");
    }
  }

  template <class Wait>
  static bool told(Wait&& wait) {
    try {
      wait();
    } catch (const o80::BackendGone&) {
      return true;
    }
    return false;
  }

  void end() {
    o80::LaneReceivers lanes(segment.view, 0);
    o80::HistoryWriter writer(segment.view);
    o80::RowSignal signal(segment.view);
    const std::uint64_t row = 0;
    writer.publish(0, reinterpret_cast<const std::byte*>(&row));
    lanes[0].set_status(1, {.status = 3});
    lanes[0].flag();
    o80::wake_sleepers(segment.view, {.lanes = lanes.announce(), .rows = signal.announce(0)});
    o80::end_segment(segment.view, o80::BackendState::stopped);
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<Ending>(count, arguments); }
