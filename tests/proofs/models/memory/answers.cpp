// The answers of a lane: nobody sleeps on while what it waits for is there, though no slice ever
// passes; who has the answer to its burst reads its row.
//
// mutant burst_relaxed: src/memory/ring/lane_receiver.cpp
//   - slot.id.store(id, std::memory_order_release);    // sync burst
//   + slot.id.store(id, std::memory_order_relaxed);
// mutant flag_not_looked_at_again: src/memory/ring/lane_receiver.cpp
//   - sleepers || waiting.load(std::memory_order_seq_cst) != 0;
//   + sleepers;
// mutant flag_not_raised: src/memory/ring/lane_sender.cpp
//   - page_->waiting.store(1, std::memory_order_seq_cst);
//   +
// mutant sleeps_on_a_later_value: src/memory/ring/lane_sender.cpp
//   - futex_wait(wake, now, at_most);
//   + futex_wait(wake, wake.load(std::memory_order_seq_cst), at_most);

#include "kernel.hpp"

namespace {

constexpr std::uint64_t kBatches = 2;

/// Two threads wait with one lane, for a batch and for a burst, while batches and bursts end.
struct Answers : rl::test_suite<Answers, 3> {
  model::Segment segment{1, 3, 1, 1};
  std::optional<o80::AttachedSegment> attached;
  std::optional<o80::LaneSender> lane;

  void before() {
    attached.emplace(model::attach());
    lane.emplace(*attached);
  }
  void after() {
    lane.reset();
    attached.reset();
  }

  void thread(unsigned index) {
    if (index == 0) return answer();
    if (index == 2) return burst();
    const auto has_ended = [&] { return lane->status(1).known == o80::LaneSender::Known::yes; };
    lane->wait_until(has_ended, o80::Deadline({}));
  }

  void burst() {
    const auto is_done = [&] { return lane->burst(2).known == o80::LaneSender::Known::yes; };
    lane->wait_until(is_done, o80::Deadline({}));
    std::uint64_t word = 0;
    const o80::HistoryReader reader(segment.view);
    model::check(reader.read(lane->burst(2).row, reinterpret_cast<std::byte*>(&word)) && word == 2,
                 "its row is not there");
  }

  void answer() {
    o80::LaneReceivers lanes(segment.view, 0);
    o80::HistoryWriter history(segment.view);
    for (std::uint64_t id = 1; id <= kBatches; ++id) {
      const auto row = static_cast<o80::Iteration>(id - 1);
      history.publish(row, reinterpret_cast<const std::byte*>(&id));
      lanes[0].set_burst_done(id, row);
      lanes[0].set_status(id, {.status = 3});
      lanes[0].flag();
      o80::wake_sleepers(segment.view, {.lanes = lanes.announce()});
    }
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<Answers>(count, arguments); }
