#include "memory/ring/lane_receiver.hpp"
#include "memory/ring/lane_sender.hpp"

#include <gmock/gmock.h>

#include <atomic>
#include <optional>
#include <thread>

#include "memory/blocks.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"

namespace o80 {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using Known = LaneSender::Known;

class LaneTest : public SegmentTest {
 protected:
  std::vector<std::uint64_t> take_all() {
    std::vector<std::uint64_t> numbers;
    if (!lanes_.poll()) return numbers;
    while (const auto lane = lanes_.next()) numbers.push_back(take_batch(lanes_[*lane]));
    return numbers;
  }
  void flush() { wake_sleepers(segment_.view(), {.lanes = lanes_.announce()}); }
  void give_back(std::uint32_t lane) {
    lanes_[lane].free(static_cast<std::uint32_t>(lanes_[lane].in_flight()));
    flush();
  }

  OwnedSegment segment_ = running_segment();  // 2 lanes of 16 blocks
  LaneReceivers lanes_{segment_.view(), kTicketAt};
  AttachedSegment attached_ = attach();
};

TEST_F(LaneTest, CarriesBatchesWholeAroundItsEndManyTimes) {
  LaneSender sender(attached_);
  std::uint64_t number = 0;
  for (int round = 0; round < 200; ++round) {
    const std::size_t count = 1 + static_cast<std::size_t>(round * 7 % 16);
    send(sender, ++number, count);
    std::size_t taken = 0;
    ASSERT_TRUE(lanes_.poll());
    const auto lane = lanes_.next();
    ASSERT_TRUE(lane);
    EXPECT_EQ(take_batch(lanes_[*lane], &taken), number);
    EXPECT_EQ(taken, count);
    give_back(*lane);
  }
}

TEST_F(LaneTest, HasNothingToLookAtUntilTheBellRings) {
  EXPECT_THAT(take_all(), ElementsAre());
  EXPECT_FALSE(lanes_.poll());
  LaneSender sender(attached_);
  send(sender, 1);
  EXPECT_THAT(take_all(), ElementsAre(1));
  EXPECT_FALSE(lanes_.poll());
}

TEST_F(LaneTest, RefusesABatchThatDoesNotFitAndSendsNothingOfIt) {
  LaneSender sender(attached_);
  EXPECT_EQ(sender.free_blocks(), 16U);
  send(sender, 1, 10);
  EXPECT_EQ(sender.free_blocks(), 6U);

  EXPECT_THAT(message_of<LaneFull>([&] { send(sender, 2, 7); }),
              AllOf(HasSubstr("7 blocks"), HasSubstr("6 of 16"), HasSubstr("Nothing")));
  EXPECT_THAT(take_all(), ElementsAre(1));

  // taken is not free: the commands may still be in the queue
  EXPECT_THROW(send(sender, 2, 7), LaneFull);
  give_back(0);
  EXPECT_EQ(sender.free_blocks(), 16U);
  send(sender, 2, 16);
  EXPECT_THAT(take_all(), ElementsAre(2));
}

TEST_F(LaneTest, TakesBatchesOfAllLanesInTheOrderOfTheirTickets) {
  const AttachedSegment other = attach();
  LaneSender first(attached_), second(other);
  send(second, 1);
  send(first, 2, 3);
  send(first, 3);
  send(second, 4, 2);
  send(first, 5);
  EXPECT_THAT(take_all(), ElementsAre(1, 2, 3, 4, 5));
}

TEST_F(LaneTest, LeavesForTheNextLookWhatWasSentAfterThisOne) {
  LaneSender sender(attached_);
  send(sender, 1);
  ASSERT_TRUE(lanes_.poll());
  send(sender, 2);
  const auto lane = lanes_.next();
  ASSERT_TRUE(lane);
  EXPECT_EQ(take_batch(lanes_[*lane]), 1U);
  EXPECT_FALSE(lanes_.next());
  EXPECT_THAT(take_all(), ElementsAre(2));
}

TEST_F(LaneTest, DoesNotWaitForATicketThatWasDrawnAndNeverUsed) {
  LaneSender sender(attached_);
  attached_.view().bell().tickets.fetch_add(1);  // killed between ticket and commit
  send(sender, 1);
  EXPECT_THAT(take_all(), ElementsAre(1));
}

TEST_F(LaneTest, TakesWhatOneProcessCausedAnotherToSendAfterItsCause) {
  constexpr std::uint64_t kRounds = 2000;
  const AttachedSegment other = attach();
  std::atomic<std::uint64_t> sent{0};
  const auto play = [&](const AttachedSegment& segment, std::uint64_t parity) {
    LaneSender sender(segment);
    for (std::uint64_t number = 1 + parity; number <= kRounds; number += 2) {
      while (sent.load() != number - 1) std::this_thread::yield();
      while (sender.free_blocks() == 0) std::this_thread::yield();
      send(sender, number);
      sent = number;
    }
    const auto all_ended = [&] { return sender.status(kRounds).known == Known::yes; };
    EXPECT_EQ(sender.wait_until(all_ended, patient()), Waited::ready);
  };
  std::thread ping([&] { play(attached_, 0); });
  std::thread pong([&] { play(other, 1); });

  std::vector<std::uint64_t> order;
  while (order.size() < kRounds) {
    for (const std::uint64_t number : take_all()) order.push_back(number);
    give_back(0);
    give_back(1);
  }
  for (std::uint32_t i = 0; i < 2; ++i) {
    lanes_[i].set_status(kRounds, {.status = 3});
    lanes_[i].flag();
  }
  flush();
  ping.join();
  pong.join();

  for (std::uint64_t i = 0; i < kRounds; ++i) ASSERT_EQ(order[i], i + 1);
}

TEST_F(LaneTest, RefusesAFrontendTooManyNamingTheHolders) {
  const AttachedSegment second_process = attach(), third_process = attach();
  const LaneSender first(attached_), second(second_process);
  EXPECT_NE(first.lane(), second.lane());
  EXPECT_THAT(
      message_of<NoLane>([&] { LaneSender third(third_process); }),
      AllOf(HasSubstr("all of its 2 lanes"), HasSubstr("pid " + std::to_string(getpid()) + " (")));
}

TEST_F(LaneTest, RefusesAFrontendThatOnlyReads) {
  const AttachedSegment reader = attach("arm", Access::read_only);
  EXPECT_THROW(LaneSender{reader}, ReadOnly);
}

TEST_F(LaneTest, GoesOnWhereItsFormerOwnerLeftOff) {
  {
    LaneSender first(attached_);
    EXPECT_EQ(first.next_id(), 1U);
    first.draw_ids(6);
    send(first, 1, 3);
  }
  const AttachedSegment other = attach();
  LaneSender second(other);
  EXPECT_EQ(second.lane(), 0U);
  EXPECT_EQ(second.incarnation(), 2U);
  EXPECT_EQ(second.next_id(), 6U);
  EXPECT_EQ(second.free_blocks(), 13U);
  send(second, 2);
  EXPECT_THAT(take_all(), ElementsAre(1, 2));
}

TEST_F(LaneTest, IsResetWhenItsCountersAreImpossible) {
  LaneSender sender(attached_);
  send(sender, 1, 4);
  EXPECT_THAT(take_all(), ElementsAre(1));
  LaneSenderPage& page = segment_.view().lane(0);
  for (const std::uint64_t nonsense :
       {std::uint64_t{0}, std::uint64_t{1} << 60, ~std::uint64_t{0}}) {
    page.committed = nonsense;
    EXPECT_EQ(lanes_[0].available(), 0U);
    EXPECT_EQ(lanes_[0].in_flight(), 4U);
    TestBlock block;
    EXPECT_FALSE(take(lanes_[0], block));
  }
  EXPECT_EQ(lanes_[0].resets(), 3U);

  // the next owner goes on from there
  flush();
  const AttachedSegment other = attach();
  sender.give_back();
  LaneSender next(other);
  EXPECT_EQ(next.lane(), 0U);
  EXPECT_EQ(next.free_blocks(), 12U);
  send(next, 2, 12);
  EXPECT_THAT(take_all(), ElementsAre(2));
}

TEST_F(LaneTest, TakesABatchWhoseTicketNobodyDrew) {
  LaneSender sender(attached_);
  send(sender, 1);
  const std::uint64_t nonsense = ~0ULL;
  store_words(segment_.view().transport(0) + kTicketAt,
              reinterpret_cast<const std::byte*>(&nonsense), 8);
  EXPECT_THAT(take_all(), ElementsAre(1));
}

TEST_F(LaneTest, ForgetsGarbageWhenToldTo) {
  LaneSender sender(attached_);
  send(sender, 1, 3);
  ASSERT_TRUE(lanes_.poll());
  ASSERT_TRUE(lanes_.next());
  lanes_[0].reset();
  flush();
  EXPECT_FALSE(lanes_.next());
  EXPECT_EQ(sender.free_blocks(), 16U);
  send(sender, 2);
  EXPECT_THAT(take_all(), ElementsAre(2));
}

TEST_F(LaneTest, KeepsTheBatchOfASuccessorBehindTheGarbageOfItsPredecessor) {
  for (const bool successor_comes_late : {false, true}) {
    {
      const LaneSender hostile(attached_);
      segment_.view().lane(0).committed += 3;
    }
    std::optional<LaneSender> successor;
    if (successor_comes_late) {
      EXPECT_EQ(lanes_[0].available(), 3U);
    }
    successor.emplace(attached_);
    send(*successor, 7, 2);
    if (!successor_comes_late) {
      EXPECT_EQ(lanes_[0].available_of_one(), 3U);
    }
    lanes_[0].reset();
    EXPECT_EQ(lanes_[0].available_of_one(), 2U);
    EXPECT_THAT(take_all(), ElementsAre(7));
    give_back(0);
    EXPECT_EQ(successor->free_blocks(), 16U);
  }
}

TEST_F(LaneTest, TakesTheBatchOfASuccessorWherePartOfALaneWasTakenBack) {
  for (const std::size_t blocks : {2U, 3U, 4U}) {
    {
      LaneSender hostile(attached_);
      send(hostile, 1, 4);
      EXPECT_THAT(take_all(), ElementsAre(1));
      give_back(0);
      segment_.view().lane(0).committed -= 3;
    }
    LaneSender successor(attached_);
    // no room until the backend has seen whose lane it is
    lanes_[0].poll_owner();
    flush();
    EXPECT_EQ(successor.free_blocks(), 16U);
    send(successor, 7, blocks);
    EXPECT_THAT(take_all(), ElementsAre(7)) << blocks;
    give_back(0);
  }
}

TEST_F(LaneTest, AnswersWhatBecameOfAnId) {
  LaneSender sender(attached_);
  EXPECT_EQ(sender.status(1).known, Known::not_yet);
  const StatusWord word{.status = 2, .reason = 15, .detail = 255, .iteration = 123'456'789'012};
  lanes_[0].set_status(1, word);
  EXPECT_EQ(sender.status(1).known, Known::yes);
  EXPECT_EQ(sender.status(1).word, word);
  lanes_[0].set_status(1, {.status = 3, .iteration = -1});
  EXPECT_EQ(sender.status(1).word, (StatusWord{.status = 3, .iteration = -1}));

  // 16 blocks, 32 statuses
  EXPECT_EQ(sender.status(33).known, Known::not_yet);
  lanes_[0].set_status(33, word);
  EXPECT_EQ(sender.status(1).known, Known::forgotten);
  EXPECT_EQ(sender.status(33).word, word);
}

TEST_F(LaneTest, ForgetsAStatusWhosePlaceWasAboutToBeAnothers) {
  LaneSender sender(attached_);
  const std::uint64_t later = 1 + sender.statuses();
  lanes_[0].set_status(1, {.status = 3, .iteration = 5});
  // what a backend leaves that dies before it names the next id
  segment_.view().statuses(0)[1].word.store(StatusWord::announcing(later));
  EXPECT_EQ(sender.status(1).known, Known::forgotten);
  EXPECT_EQ(sender.status(later).known, Known::not_yet);
  lanes_[0].set_status(later, {.status = 1, .iteration = 6});
  EXPECT_EQ(sender.status(later).known, Known::yes);
}

TEST_F(LaneTest, NeverMixesTheStatusesOfTwoIds) {
  constexpr std::uint64_t kLast = 40'000;
  LaneSender sender(attached_);
  std::atomic<bool> mixed{false};
  std::thread reader([&] {
    while (sender.status(kLast).known != Known::yes)
      for (std::uint64_t base = 1; base <= 32; ++base)
        // the slot of `base` holds ids of the same remainder: ask for the one that is there
        for (std::uint64_t id = base; id <= kLast; id += 32) {
          const auto answer = sender.status(id);
          if (answer.known == Known::yes && answer.word.iteration != static_cast<Iteration>(id))
            mixed = true;
          if (answer.known == Known::not_yet) break;
        }
  });
  for (std::uint64_t id = 1; id <= kLast; ++id)
    for (std::uint8_t status = 1; status < 4; ++status)
      lanes_[0].set_status(id, {.status = status, .iteration = static_cast<Iteration>(id)});
  reader.join();
  EXPECT_FALSE(mixed);
}

TEST_F(LaneTest, KeepsTheTextsOfTheLastIds) {
  LaneSender sender(attached_);
  for (std::uint64_t id = 1; id <= kMessages + 1; ++id)
    lanes_[0].set_message(id, "text of " + std::to_string(id));
  EXPECT_EQ(sender.message(1), std::nullopt);
  EXPECT_EQ(sender.message(2), "text of 2");
  lanes_[0].set_message(1000, std::string(300, 'x'));
  EXPECT_EQ(sender.message(1000), std::string(247, 'x'));
}

TEST_F(LaneTest, AnswersForTheLastBursts) {
  LaneSender sender(attached_);
  EXPECT_EQ(sender.burst(2).known, Known::not_yet);
  for (std::uint64_t id = 2; id <= 2 * kBurstsKept; id += 2)
    lanes_[0].set_burst_done(id, static_cast<Iteration>(10 * id));
  EXPECT_EQ(sender.burst(2 * kBurstsKept).row, static_cast<Iteration>(20 * kBurstsKept));
  EXPECT_EQ(sender.burst(2).row, 20);
  EXPECT_EQ(sender.burst(2 * kBurstsKept + 2).known, Known::not_yet);

  lanes_[0].set_burst_done(2 * kBurstsKept + 2, 1);
  EXPECT_EQ(sender.burst(2).known, Known::forgotten);
  EXPECT_EQ(sender.burst(4).row, 40);
}

TEST_F(LaneTest, WakesThoseWhoWaitForABurst) {
  LaneSender sender(attached_);
  std::atomic<Iteration> row{-1};
  std::vector<std::thread> waiters;
  waiters.reserve(3);
  for (int i = 0; i < 3; ++i)
    waiters.emplace_back([&] {
      EXPECT_EQ(sender.wait_until([&] { return sender.burst(2).known == Known::yes; }, patient()),
                Waited::ready);
      row = sender.burst(2).row;
    });
  while (segment_.view().lane(0).waiting.load() == 0) std::this_thread::yield();
  lanes_[0].set_burst_done(2, 99);
  flush();
  for (std::thread& waiter : waiters) waiter.join();
  EXPECT_EQ(row, 99);
}

TEST_F(LaneTest, MovesItsEventsOnceAFlushAndOnlyWithCause) {
  const std::atomic<std::uint32_t>& events = segment_.view().feedback(0).events;
  lanes_[0].set_status(1, {.status = 2});
  flush();
  EXPECT_EQ(events.load(), 0U);
  lanes_[0].set_burst_done(2, 0);
  lanes_[0].flag();
  flush();
  EXPECT_EQ(events.load(), 1U);
  EXPECT_EQ(segment_.view().feedback(1).events.load(), 0U);
}

TEST_F(LaneTest, EndsAWaitInTime) {
  LaneSender sender(attached_);
  const auto never = [] { return false; };
  EXPECT_EQ(sender.wait_until(never, Deadline(Timeout(0))), Waited::timed_out);
  EXPECT_EQ(sender.wait_until(never, soon()), Waited::timed_out);
  EXPECT_THROW(sender.wait_until(never, patient(), [] { return false; }), Cancelled);

  std::thread waiter([&] { EXPECT_THROW(sender.wait_until(never, patient()), BackendStopped); });
  segment_.end(BackendState::stopped);
  waiter.join();
  EXPECT_THROW(sender.wait_until(never, Deadline(Timeout(0))), BackendStopped);
  EXPECT_EQ(sender.wait_until([] { return true; }, Deadline(Timeout(0))), Waited::ready);
}

}  // namespace
}  // namespace o80
