// A lane whose owners die anywhere in taking it and sending: their successor's positions go on,
// each batch is taken once, and the backend can tell who sent it.
//
// mutant successor_begins_anew: src/memory/ring/lane_sender.cpp
//   - sent_ = page_->committed.load(std::memory_order_relaxed);
//   + sent_ = 0;
// mutant successor_leaves_no_mark: src/memory/ring/lane_sender.cpp
//   - page_->successor_begin.store(sent_, std::memory_order_relaxed);
//   +
// mutant successor_counts_relaxed: src/memory/ring/lane_sender.cpp
//   - page_->incarnation.store(incarnation_, std::memory_order_release);
//   + page_->incarnation.store(incarnation_, std::memory_order_relaxed);
// mutant commit_before_the_copy: src/memory/ring/lane_sender.cpp
//   - O80_CRASH_POINT("lane.before_copy");
//   + page_->committed.store(sent_ + count, std::memory_order_release);

#include "blocks.hpp"
#include "o80/base/error.hpp"

namespace {

constexpr std::array<const char*, 8> kDeaths = {"",
                                                "lane.before_dead",
                                                "lane.before_incarnation",
                                                "lane.after_incarnation",
                                                "lane.before_copy",
                                                "lane.before_ticket",
                                                "lane.before_commit",
                                                "lane.after_commit"};

/// Two owners, in either order, each killed somewhere or after its send, never closing.
struct Successors : rl::test_suite<Successors, 3> {
  model::Segment segment{1, 2, 1, 2};
  std::vector<std::uint64_t> committed;
  std::atomic<int> finished{0};

  void thread(unsigned index) {
    if (index == 0) return receive();
    segment.die_at(kDeaths[rl::ctx().rand(kDeaths.size(), rl::sched_type_user)]);
    const o80::AttachedSegment attached = model::attach();
    rl::linear_backoff backoff;
    while (!live(attached, index)) backoff.yield(RL_INFO);
    finished.fetch_add(1, std::memory_order_release);
    o80::ring_bell(segment.view);
  }

  /// False if the lane is another's still.
  bool live(const o80::AttachedSegment& attached, unsigned index) {
    try {
      o80::LaneSender lane(attached);
      const std::uint64_t number = 10 * lane.incarnation() + index;
      rl::linear_backoff backoff;
      while (lane.free_blocks() < 2) backoff.yield(RL_INFO);
      committed.push_back(number);
      model::send(lane, number, 2);
      segment.die();
    } catch (const model::Death&) {
      if (!committed.empty() && committed.back() % 10 == index &&
          !segment.dies_at("lane.after_commit"))
        committed.pop_back();
    } catch (const o80::NoLane&) {
      return false;
    }
    return true;
  }

  void receive() {
    o80::LaneReceivers lanes(segment.view, model::kTicketAt);
    o80::BellWaiter bell(segment.view);
    std::vector<std::uint64_t> taken;
    while (true) {
      const std::uint32_t seen = bell.value();
      const bool over = finished.load(std::memory_order_acquire) == 2;
      while (lanes[0].available() > 0) {
        const std::uint64_t owners = lanes[0].incarnation();
        const bool of_dead = lanes[0].next_is_of_dead();
        taken.push_back(model::take(lanes[0]));
        const std::uint64_t owner = taken.back() / 10;
        model::check(!of_dead || owner == 1,
                     "the batch of a living owner passes for that of a dead one");
        model::check(of_dead || owner >= owners,
                     "the batch of a dead owner passes for its successor's");
        lanes[0].free(2);
      }
      o80::wake_sleepers(segment.view, {.lanes = lanes.announce()});
      if (over) break;
      bell.wait(seen);
    }
    model::check(taken == committed, "a batch was lost or taken twice");
    model::check(lanes[0].resets() == 0, "an honest lane was reset");
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<Successors>(count, arguments); }
