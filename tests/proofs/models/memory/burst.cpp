// The burst hand-shake: request, grant, rows, answer, wake-up. Nobody sleeps on while its answer is
// there, and who has its answer reads its row.
//
// mutant burst_relaxed: src/memory/ring/lane_receiver.cpp
//   - slot.id.store(id, std::memory_order_release);    // sync burst
//   + slot.id.store(id, std::memory_order_relaxed);

#include "blocks.hpp"

namespace {

constexpr std::uint64_t kBursts = 2;

/// What a burst's row holds.
std::uint64_t word_of(std::uint32_t lane, std::uint64_t id) { return 100 * (lane + 1) + id; }

/// Two frontends burst a backend that stands still in between, as the loop of runtime does; a third
/// thread waits with the first one's lane.
struct Bursts : rl::test_suite<Bursts, 4> {
  model::Segment segment{1, 4, 2, 2};
  std::optional<o80::AttachedSegment> attached;
  std::optional<o80::LaneSender> shared;

  void before() {
    attached.emplace(model::attach());
    shared.emplace(*attached);
  }
  void after() {
    shared.reset();
    attached.reset();
  }

  void thread(unsigned index) {
    if (index == 0) return serve();
    if (index == 1) {
      for (std::uint64_t id = 1; id <= kBursts; ++id) model::send(*shared, id, 1);
      return wait(*shared, kBursts, 0);
    }
    if (index == 2) return wait(*shared, 1, 0);
    const o80::AttachedSegment own = model::attach();
    o80::LaneSender lane(own);
    model::send(lane, 1, 1);
    wait(lane, 1, 1);
  }

  void wait(o80::LaneSender& lane, std::uint64_t id, std::uint32_t index) {
    o80::Iteration row = -1;
    lane.wait_until(
        [&] {
          const o80::LaneSender::BurstAnswer answer = lane.burst(id);
          row = answer.row;
          return answer.known != o80::LaneSender::Known::not_yet;
        },
        o80::Deadline({}));
    std::uint64_t word = 0;
    const o80::HistoryReader reader(segment.view);
    model::check(reader.read(row, reinterpret_cast<std::byte*>(&word)), "the row is not there");
    model::check(word == word_of(index, id), "the row is another");
  }

  void serve() {
    o80::LaneReceivers lanes(segment.view, model::kTicketAt);
    o80::BellWaiter bell(segment.view);
    o80::HistoryWriter history(segment.view);
    o80::RowSignal signal(segment.view);
    const auto bursts = static_cast<o80::Iteration>(kBursts + 1);
    for (o80::Iteration row = 0; row < bursts;) {
      const bool news = lanes.poll();
      const std::optional<std::uint32_t> lane = news ? lanes.next() : std::nullopt;
      if (!lane) {
        o80::wake_sleepers(segment.view, {.lanes = lanes.announce()});
        bell.wait(lanes.bell_seen());
        continue;
      }
      // one grant, one iteration
      const std::uint64_t id = model::take(lanes[*lane]);
      const std::uint64_t word = word_of(*lane, id);
      history.publish(row, reinterpret_cast<const std::byte*>(&word));
      lanes[*lane].set_burst_done(id, row);
      lanes[*lane].free(1);
      o80::wake_sleepers(segment.view, {.lanes = lanes.announce(), .rows = signal.announce(row)});
      lanes.rescan();
      ++row;
    }
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<Bursts>(count, arguments); }
