// The answers of a lane: nobody sleeps on while what it waits for is there, though no slice ever
// passes.
//
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

/// Two threads wait with one lane, for different batches, while the batches end.
struct Answers : rl::test_suite<Answers, 3> {
  model::Segment segment{1, 2, 1, 1};
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
    const auto has_ended = [&] { return lane->status(index).known == o80::LaneSender::Known::yes; };
    lane->wait_until(has_ended, o80::Deadline({}));
  }

  void answer() {
    o80::LaneReceivers lanes(segment.view, 0);
    for (std::uint64_t id = 1; id <= kBatches; ++id) {
      lanes[0].set_status(id, {.status = 3});
      lanes[0].flag();
      o80::wake_sleepers(segment.view, {.lanes = lanes.announce()});
    }
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<Answers>(count, arguments); }
