// Lanes: batches come whole, in the order of their tickets and of what caused them, never before
// their commit, and blocks are never overwritten before they were given back.
//
// mutant committed_relaxed: src/memory/ring/lane_sender.cpp
//   - page_->committed.store(sent_, std::memory_order_release);
//   + page_->committed.store(sent_, std::memory_order_relaxed);
// mutant freed_relaxed: src/memory/ring/lane_receiver.cpp
//   - feedback_->freed.store(freed_, std::memory_order_release);
//   + feedback_->freed.store(freed_, std::memory_order_relaxed);
// mutant freed_read_relaxed: src/memory/ring/lane_sender.cpp
//   - feedback_->freed.load(std::memory_order_acquire);
//   + feedback_->freed.load(std::memory_order_relaxed);
// mutant commit_before_the_copy: src/memory/ring/lane_sender.cpp
//   - O80_CRASH_POINT("lane.before_copy");
//   + page_->committed.store(sent_ + count, std::memory_order_release);
// mutant tickets_not_looked_at_first: src/memory/ring/lane_receiver.cpp
//   - below_ = drawn;
//   + below_ = ~std::uint64_t{0};
// mutant ticket_drawn_relaxed: src/memory/ring/lane_sender.cpp
//   - view_.bell().tickets.fetch_add(1, std::memory_order_seq_cst);
//   + view_.bell().tickets.fetch_add(1, std::memory_order_relaxed);

#include "blocks.hpp"

namespace {

/// Two frontends; the second sends its last batch after it has seen the first one's go out.
struct Lanes : rl::test_suite<Lanes, 3> {
  model::Segment segment{1, 2, 2, 2};
  std::atomic<int> sent{0};

  void thread(unsigned index) {
    if (index == 0) return receive();
    const o80::AttachedSegment attached = model::attach();
    o80::LaneSender lane(attached);
    if (index == 1) {
      // the third batch lies over the first two
      send(lane, 11, 1);
      send(lane, 12, 1);
      sent.store(1, std::memory_order_release);
      send(lane, 13, 2);
    } else {
      send(lane, 21, 2);
      rl::linear_backoff backoff;
      while (sent.load(std::memory_order_acquire) == 0) backoff.yield(RL_INFO);
      send(lane, 22, 1);
    }
  }

  static void send(o80::LaneSender& lane, std::uint64_t number, std::uint64_t count) {
    rl::linear_backoff backoff;
    while (!model::send(lane, number, count)) backoff.yield(RL_INFO);
  }

  void receive() {
    o80::LaneReceivers lanes(segment.view, model::kTicketAt);
    o80::BellWaiter bell(segment.view);
    std::vector<std::uint64_t> taken;
    while (taken.size() < 5) {
      bool news = lanes.poll();
      while (news) {
        const std::optional<std::uint32_t> lane = lanes.next();
        if (!lane) break;
        const std::uint64_t before = lanes[*lane].in_flight();
        taken.push_back(model::take(lanes[*lane]));
        lanes[*lane].free(static_cast<std::uint32_t>(lanes[*lane].in_flight() - before));
      }
      o80::wake_sleepers(segment.view, {.lanes = lanes.announce()});
      if (taken.size() < 5) bell.wait(lanes.bell_seen());
    }
    const auto place = [&](std::uint64_t number) {
      return std::find(taken.begin(), taken.end(), number) - taken.begin();
    };
    model::check(place(11) < place(12) && place(12) < place(13), "one lane's order is lost");
    model::check(place(21) < place(22), "one lane's order is lost");
    model::check(place(12) < place(22), "a batch came before what caused it");
    model::check(lanes[0].resets() + lanes[1].resets() == 0, "an honest lane was reset");
  }
};

}  // namespace

int main(int count, char** arguments) { return model::explore<Lanes>(count, arguments); }
