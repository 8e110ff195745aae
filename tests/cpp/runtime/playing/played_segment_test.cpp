#include "runtime/playing/played_segment.hpp"

#include <cstring>
#include <fstream>
#include <optional>
#include <thread>

#include "describe/table.hpp"
#include "memory/child_process.hpp"
#include "memory/ring/lane_sender.hpp"
#include "memory/segment/segment_name.hpp"
#include "runtime/frontend/loop_state.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

using ::testing::ThrowsMessage;

/// Rows and description of a pair that ran before.
class PlayedSegmentTest : public ManualBackendTest {
 protected:
  static constexpr Iteration kRows = 40;

  void SetUp() override {
    ManualBackendTest::SetUp();
    StartedBackend manual({.segment = "recorded", .bursting = true});
    UntypedFrontend frontend("recorded");
    description_ = to_bytes(frontend.schema());
    add(frontend, 0, 1.0, {.pace = iterations(30)});
    const Burst burst = frontend.start_burst(kRows - 1);
    manual.drive();
    rows_ = frontend.history(0, kRows - 1);
    ASSERT_EQ(rows_.count, static_cast<std::size_t>(kRows));
  }

  PlayedOptions options(bool bursting = false) const {
    return {.segment = "pair", .description = description_, .bursting = bursting, .history = 100};
  }
  std::span<const std::byte> rows(Iteration first, Iteration last) const {
    return std::span(rows_.bytes)
        .subspan(static_cast<std::size_t>(first) * rows_.row_bytes,
                 static_cast<std::size_t>(last - first + 1) * rows_.row_bytes);
  }
  std::span<const std::byte> all() const { return rows(0, kRows - 1); }
  /// Row 0, as one of another iteration.
  std::vector<std::byte> row_at(Iteration k) const {
    std::vector<std::byte> row(rows(0, 0).begin(), rows(0, 0).end());
    std::memcpy(row.data() + offsetof(RowHead, iteration), &k, sizeof k);
    return row;
  }
  /// Copies of these rows with a mark of a halt.
  std::vector<std::byte> halted(Iteration first, Iteration last) const {
    const auto from = rows(first, last);
    std::vector<std::byte> copy(from.begin(), from.end());
    for (std::size_t at = 0; at < copy.size(); at += rows_.row_bytes) {
      RowHead head;
      std::memcpy(&head, copy.data() + at, sizeof head);
      head.halted = 1;
      std::memcpy(copy.data() + at, &head, sizeof head);
    }
    return copy;
  }

  std::vector<std::byte> description_;
  Rows rows_;
};

TEST_F(PlayedSegmentTest, HasTheDescriptionOfTheRecordedRobot) {
  PlayedSegment played(options());
  played.publish(rows(0, 0), {});
  Schema recorded = schema_from_bytes(description_);
  recorded.head.bursting = 0;  // how it is run is not a property of the robot
  EXPECT_TRUE(UntypedFrontend("pair").schema() == recorded);
}

TEST_F(PlayedSegmentTest, ARecordingThatBeginsLaterHasNoRowsBefore) {
  PlayedSegment played(options());
  played.publish(rows(7, 12), {});

  const UntypedFrontend reader("pair");
  EXPECT_EQ(reader.oldest(), 7);
  EXPECT_EQ(reader.published(), 12);
  const Rows found = reader.history(0, 100);
  EXPECT_EQ(found.first, 7);
  EXPECT_TRUE(std::ranges::equal(found.bytes, rows(7, 12)));
  EXPECT_EQ(reader.history(100).count, 6U);
  EXPECT_THROW(reader.wait_for(6, kAtOnce), RowOverwritten);
  EXPECT_EQ(reader.iteration_at(-1), 6);
}

TEST_F(PlayedSegmentTest, AGapLooksLikeOverwrittenRows) {
  PlayedSegment played(options());
  played.publish(rows(0, 9), {});
  const UntypedFrontend reader("pair");
  Iteration position = 5;
  std::vector<std::byte> row(rows_.row_bytes);
  EXPECT_EQ(reader.wait_for_next(position, row.data(), kAtOnce), 0);
  played.publish(rows(20, 29), {});

  EXPECT_EQ(reader.oldest(), 20);
  EXPECT_THROW(reader.wait_for(15, kAtOnce), RowOverwritten);
  EXPECT_THROW(reader.wait_for(9, kAtOnce), RowOverwritten);
  EXPECT_EQ(reader.wait_for_next(position, row.data(), kAtOnce), 14) << "rows 6 to 19 are missed";
  EXPECT_EQ(position, 21);
  EXPECT_TRUE(std::ranges::equal(reader.history(0, 100).bytes, rows(20, 29)));
}

TEST_F(PlayedSegmentTest, RowsOutOfOrderAreRefused) {
  PlayedSegment played(options());
  played.publish(rows(5, 9), {});
  EXPECT_THAT([&] { played.publish(rows(9, 9), {}); },
              ThrowsMessage<InvalidArgument>(HasSubstr("row 9 follows row 9")));
  EXPECT_THROW(played.publish(std::span(rows_.bytes).first(10), {}), InvalidArgument);
}

TEST_F(PlayedSegmentTest, RefusesCommandsRequestsAndHalts) {
  PlayedSegment played(options(true));
  played.publish(rows(0, 0), {});
  UntypedFrontend frontend("pair");
  const auto refusal = ThrowsMessage<ReadOnly>(HasSubstr("a recording that is being played"));
  EXPECT_THAT([&] { add(frontend, 0, 1.0); }, refusal);
  EXPECT_THAT([&] { frontend.add_purge(); }, refusal);
  EXPECT_THAT([&] { add_request(frontend, Reset{}); }, refusal);
  EXPECT_THAT([&] { frontend.add_take_control(); }, refusal);
  EXPECT_THAT([&] { frontend.halt("why"); }, refusal);
  EXPECT_THAT([&] { frontend.resume(1, kAtOnce); }, refusal);
  EXPECT_THAT([&] { halt("pair", "why"); }, refusal);
  EXPECT_EQ(frontend.added(), 0U);
  EXPECT_FALSE(frontend.halted());
}

TEST_F(PlayedSegmentTest, BurstsPublishTheRequestedRows) {
  PlayedSegment played(options(true));
  std::thread player([&] { played.serve(all()); });
  {
    UntypedFrontend frontend("pair", {.timeout = kPatience});
    EXPECT_EQ(frontend.latest().iteration(), 0);
    EXPECT_EQ(frontend.burst(5, kPatience).iteration(), 5);
    UntypedFrontend other("pair");
    EXPECT_EQ(other.burst(1, kPatience).iteration(), 6);
    std::vector<std::byte> some(4 * rows_.row_bytes);
    EXPECT_EQ(frontend.burst_rows(some, kPatience), 10);
    EXPECT_TRUE(std::ranges::equal(some, rows(7, 10)));
    EXPECT_EQ(frontend.burst(kRows - 11, kPatience).iteration(), kRows - 1);
    EXPECT_TRUE(std::ranges::equal(frontend.history(0, kRows).bytes, all()));
  }
  player.join();
}

TEST_F(PlayedSegmentTest, ABurstBeyondTheLastRowEndsWithTheRecording) {
  PlayedSegment played(options(true));
  UntypedFrontend frontend("pair", {.timeout = kAtOnce, .starting = true});
  std::thread player([&] {
    played.serve(all());
    played.end();
  });
  EXPECT_THROW(frontend.burst(kRows + 10, kPatience), BackendStopped);
  player.join();
  EXPECT_EQ(frontend.published(), kRows - 1);
}

TEST_F(PlayedSegmentTest, ABurstEndsWithItsSenderAndWithItsDeath) {
  for (const bool dies : {false, true}) {
    PlayedSegment played(options(true));
    played.publish(rows(0, 0), {});
    if (dies) {
      StandingProcess sender([&](const StandingProcess::Stand& stand) {
        UntypedFrontend frontend("pair");
        frontend.start_burst(1'000'000);
        stand();
      });
      sender.kill_now();
    } else {
      UntypedFrontend("pair").start_burst(1'000'000);
    }
    UntypedFrontend stayer("pair");
    const Burst burst = stayer.start_burst(3);
    std::thread player([&] { played.serve(rows(1, kRows - 1)); });
    EXPECT_EQ(burst.wait(kPatience).iteration(), 3);
    EXPECT_EQ(stayer.published(), 3);
    played.ask_to_stop();
    player.join();
  }
}

TEST_F(PlayedSegmentTest, ALyingBursterDoesNotStopTheOthers) {
  PlayedSegment played(options(true));
  played.publish(rows(0, 0), {});
  const AttachedSegment attached =
      AttachedSegment::attach("pair", Access::read_write, Deadline(kAtOnce));
  LaneSender hostile(attached);
  std::array<Block, 2> blocks{};
  BatchRecord record;
  record.id = 1;
  record.records = 1;  // a command, which an honest frontend refuses to send
  record.blocks = 2;
  std::memcpy(blocks.data(), &record, sizeof record);
  hostile.send(std::as_bytes(std::span(blocks)), offsetof(BatchRecord, ticket));
  UntypedFrontend frontend("pair");
  std::thread player([&] { played.serve(rows(1, kRows - 1)); });
  EXPECT_EQ(frontend.burst(2, kPatience).iteration(), 2);
  played.ask_to_stop();
  player.join();
}

TEST_F(PlayedSegmentTest, ShowsHaltsOfTheRows) {
  PlayedSegment played(options());
  played.publish(rows(0, 3), {});
  const UntypedFrontend reader("pair", {.access = Access::read_only});
  EXPECT_FALSE(reader.halted());
  played.publish(halted(4, 8), {});
  ASSERT_TRUE(reader.halted());
  EXPECT_EQ(reader.halted()->iteration, 4);
  played.publish(rows(9, 9), {});
  EXPECT_FALSE(reader.halted());
  played.publish(halted(10, 10), {});
  EXPECT_EQ(reader.halted()->number, 2U);
}

TEST_F(PlayedSegmentTest, ARobotDoesNotInheritAHaltOfARecording) {
  StandingProcess player([&](const StandingProcess::Stand& stand) {
    PlayedSegment played(options());
    played.publish(halted(0, 3), {});
    stand();
  });
  player.kill_now();
  StartedBackend robot;
  EXPECT_FALSE(UntypedFrontend("pair").halted());
}

TEST_F(PlayedSegmentTest, AKilledPlayerIsSeenAndReplaced) {
  StandingProcess player([&](const StandingProcess::Stand& stand) {
    PlayedSegment played(options());
    played.publish(rows(0, 9), {});
    stand();
  });
  const UntypedFrontend reader("pair");
  player.kill_now();
  EXPECT_EQ(reader.life(), Life::killed);
  EXPECT_THROW(reader.wait_for(10, kPatience), BackendKilled);
  EXPECT_TRUE(std::ranges::equal(reader.history(100).bytes, rows(0, 9)));

  PlayedSegment successor(options());
  successor.publish(rows(0, 3), {});
  EXPECT_EQ(reader.life(), Life::superseded);
  EXPECT_EQ(UntypedFrontend("pair").published(), 3);
}

TEST_F(PlayedSegmentTest, DoesNotReplaceARobotThatLivesOrWasKilled) {
  {
    StartedBackend robot;
    EXPECT_THAT([&] { const PlayedSegment refused{options()}; },
                ThrowsMessage<SegmentTaken>(HasSubstr("under another name with --prefix")));
  }
  StandingProcess robot([&](const StandingProcess::Stand& stand) {
    StartedBackend manual;
    stand();
  });
  robot.kill_now();
  EXPECT_THAT([&] { const PlayedSegment refused{options()}; },
              ThrowsMessage<SegmentTaken>(HasSubstr("o80 save pair -o FILE.mcap")));
  EXPECT_EQ(UntypedFrontend("pair", {.timeout = kAtOnce, .dead = true}).life(), Life::killed);
}

TEST_F(PlayedSegmentTest, AnEndedRecordingIsNoHangingLoop) {
  PlayedSegment played(
      {.segment = "pair", .description = description_, .clock = Clock::monotonic, .history = 100});
  played.publish(all(), {});
  const UntypedFrontend reader("pair");
  const LoopState state = loop_state(reader, monotonic_now());
  EXPECT_TRUE(state.played);
  EXPECT_EQ(state.trouble(), "");
}

TEST_F(PlayedSegmentTest, RowsWaitForTheirTime) {
  PlayedSegment played(options());
  const std::int64_t begin = monotonic_now();
  const std::array due{begin, begin + 2'000'000, begin + 4'000'000};
  EXPECT_EQ(played.publish(rows(0, 2), due), 3U);
  EXPECT_GE(monotonic_now(), due.back());
  // a wait that is called off
  const std::array never{std::numeric_limits<std::int64_t>::max()};
  EXPECT_EQ(played.publish(rows(3, 3), never, [] { return false; }), 0U);
  EXPECT_EQ(UntypedFrontend("pair").published(), 2);
}

TEST_F(PlayedSegmentTest, ReadersNeverSeeARowThatIsNotThere) {
  // rows with gaps, again and again: what a reader gets has the iteration that it asked for
  PlayedSegment played({.segment = "pair", .description = description_, .history = 8});
  played.publish(rows(0, 0), {});
  std::atomic<bool> wrong{false};
  std::atomic<bool> over{false};
  std::atomic<int> reading{0};
  const auto read = [&] {
    const UntypedFrontend reader("pair", {.access = Access::read_only});
    ++reading;
    while (!over) {
      const Rows found = reader.history(reader.oldest(), reader.oldest() + 7);
      for (std::size_t i = 0; i < found.count; ++i) {
        RowHead head;
        std::memcpy(&head, found.bytes.data() + i * found.row_bytes, sizeof head);
        if (head.iteration != found.first + static_cast<Iteration>(i)) wrong = true;
      }
      if (reader.latest().iteration() > reader.published()) wrong = true;
    }
  };
  std::thread one(read);
  std::thread other(read);
  while (reading < 2) std::this_thread::yield();
  Iteration k = 0;
  for (int i = 0; i < 20'000; ++i) {
    k += i % 3 == 0 ? 1 + i % 17 : 1;
    played.publish(row_at(k), {});
  }
  over = true;
  one.join();
  other.join();
  EXPECT_FALSE(wrong);
}

TEST_F(PlayedSegmentTest, ReadersWaitForARowAfterAGapWhileItsPlayerLives) {
  std::optional<PlayedSegment> played;
  played.emplace(PlayedOptions{.segment = "pair", .description = description_, .history = 8});
  played->publish(rows(0, 0), {});
  const UntypedFrontend reader("pair", {.access = Access::read_only});

  // as a player leaves the counters that is stopped before it writes the row
  const auto stop_before = [&](Iteration k) {
    std::fstream file(segment_path("pair"), std::ios::binary | std::ios::in | std::ios::out);
    for (const std::size_t counter : {offsetof(Counters, first), offsetof(Counters, begun)}) {
      file.seekp(
          static_cast<std::streamoff>(reader.link()->segment.view().offsets.counters + counter));
      file.write(reinterpret_cast<const char*>(&k), sizeof k).flush();
    }
  };
  stop_before(20);
  std::atomic<bool> reads{false};
  std::thread other([&] {
    reads = true;
    EXPECT_EQ(reader.latest().iteration(), 20);
  });
  while (!reads) std::this_thread::yield();
  played->publish(row_at(20), {});
  other.join();

  stop_before(50);
  played.reset();
  EXPECT_THAT([&] { static_cast<void>(reader.latest()); },
              ThrowsMessage<Error>(HasSubstr("a row after a gap: read rows up to 20")));
}

}  // namespace
}  // namespace o80::test
