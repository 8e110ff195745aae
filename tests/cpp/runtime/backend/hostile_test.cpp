// A frontend that writes garbage wherever it can: the loop goes on, within its limits, and others
// are served.

#include <atomic>
#include <cmath>
#include <limits>
#include <random>
#include <thread>

#include "memory/child_process.hpp"
#include "memory/segment/segment_name.hpp"
#include "runtime/hostile_frontend.hpp"
#include "runtime/shared_scene.hpp"

namespace o80::test {
namespace {

class HostileTest : public ManualBackendTest {};

/// A manual backend whose two joints reach one radian either way, and whose desired states are
/// watched.
class Watched {
 public:
  explicit Watched(BackendOptions options)
      : manual(options, [](Schema& schema) {
          for (std::uint32_t i = 0; i < 2; ++i)
            schema.actuator(i).limits({.minimum = -1.0, .maximum = 1.0});
        }) {
    manual.before_publish = [this] {
      for (const double joint : manual.now) whole = whole && std::abs(joint) <= 1.0;
    };
    manual.start();
  }

  ManualBackend manual;
  bool whole = true;  // no state was ever outside; not a number is outside too
};

/// Now many scribbles between two iterations, now a single one that the backend sees for itself.
void scribble_until_over(const SharedScene& scene, std::uint64_t seed,
                         const ChildProcess::Ready& ready) {
  HostileFrontend own;
  std::mt19937_64 random(seed);
  const std::atomic<Iteration>& published = own.view().counters().published;
  ready();
  while (!scene->over) {
    own.scribble(random);
    ++scene->scribbles;
    const Iteration now = published;
    if (random() % 2 == 0) continue;
    while (published == now && !scene->over) std::this_thread::yield();
  }
}

TEST_F(HostileTest, AnotherFrontendCommandsWhileOneScribblesInItsLaneWithoutEnd) {
  Watched watched({.segment = "pair", .lane_blocks = 64});
  const SharedScene scene;
  ReadyProcess hostile(
      [&](const ChildProcess::Ready& ready) { scribble_until_over(scene, 1, ready); });
  UntypedFrontend good("pair");

  // by chance the hostile frontend purges or overwrites what others sent, as any frontend may:
  // nothing is lost without a status, and what was not touched is completed
  int completed = 0;
  for (int i = 0; i < 300; ++i) {
    const double target = i % 2 == 0 ? 0.75 : -0.75;
    const Batch batch = send(good, 1, target, {.mode = Mode::overwrite});
    watched.manual.run_until([&] { return batch.ended(); });
    ASSERT_TRUE(batch.rejection().empty()) << batch.rejection();
    if (batch.handle(0).status == Status::completed) ++completed;
  }
  EXPECT_GT(completed, 30);
  EXPECT_TRUE(watched.whole);
  // it did scribble, and it cannot outlive its scene
  while (scene->scribbles < 3'000) ASSERT_EQ(watched.manual.iterate(), Step::run);
  scene->over = true;
  EXPECT_EQ(hostile.wait(), 0);
  const std::uint64_t believed = good.link()->segment.view().feedback(0).ids;
  EXPECT_GT(believed, 100U) << "some of it looked like batches";
  std::printf(
      "%llu scribbles, %llu ids believed, %d of 300 commands completed in %lld iterations\n",
      static_cast<unsigned long long>(scene->scribbles.load()),
      static_cast<unsigned long long>(believed), completed,
      static_cast<long long>(watched.manual.last()));

  // once it is gone, all is as if it had never been; also for who gets its lane
  good.add_purge();
  good.pulse();
  UntypedFrontend successor("pair");
  add(successor, 0, 0.25);
  pulse_as_soon_as_there_is_room(successor, watched.manual);
  const auto settles = [&](UntypedFrontend& frontend, double target) {
    for (int attempt = 0; attempt < 100; ++attempt) {
      const Batch batch = send(frontend, 1, target, {.mode = Mode::overwrite});
      for (int i = 0; i < 50 && !batch.ended(); ++i) watched.manual.iterate();
      if (batch.ended() && batch.handle(0).status == Status::completed)
        return desired(good.wait_for(batch.last_iteration(), kAtOnce), 1) == target;
    }
    return false;
  };
  EXPECT_TRUE(settles(good, 0.5));
  EXPECT_TRUE(settles(successor, -0.5));
}

TEST_F(HostileTest, BurstsOfAnotherFrontendAreRunWhileOneScribbles) {
  BurstingBackend bursting;
  const SharedScene scene;
  ReadyProcess hostile(
      [&](const ChildProcess::Ready& ready) { scribble_until_over(scene, 2, ready); });
  UntypedFrontend good("pair");
  Iteration last = 0;
  for (int i = 0; i < 200; ++i) {
    const Iteration row = good.burst(2, kPatience).iteration();
    ASSERT_GE(row, last + 2);
    last = row;
  }
  scene->over = true;
  EXPECT_EQ(hostile.wait(), 0);
}

TEST_F(HostileTest, GarbageThatComesFasterThanItIsThrownAwayDoesNotKeepTheLoop) {
  Watched watched({.segment = "pair", .lane_blocks = 64});
  HostileFrontend hostile;
  std::atomic<bool> over{false};
  // never a batch, always one more block than was there
  std::thread flood([&] {
    while (!over) {
      hostile.page().committed.fetch_add(1, std::memory_order_relaxed);
      hostile.bell().rung.fetch_add(1, std::memory_order_relaxed);
    }
  });
  for (int i = 0; i < 2000; ++i) ASSERT_EQ(watched.manual.iterate(), Step::run);
  over = true;
  flood.join();
}

TEST_F(HostileTest, APurgeWhoseTicketIsFarAheadEndsNothingThatIsSentLater) {
  StartedBackend manual;
  UntypedFrontend honest("pair");
  UntypedFrontend hostile("pair");
  send(honest, 0, 0.5);
  manual.run(1);
  AttachedSegment segment =
      AttachedSegment::attach("pair", Access::read_write, Deadline(kPatience));
  auto& tickets = segment.view().bell().tickets;
  const std::uint64_t drawn = tickets.load();
  // the count is far ahead when the purge is staged, and put back before it acts
  tickets.store(std::uint64_t{1} << 60);
  hostile.add_purge();
  const Batch purge = hostile.pulse({.at = manual.last() + 4});
  manual.run(1);
  tickets.store(drawn);
  send(honest, 0, 0.6);
  manual.run(4);
  EXPECT_EQ(purge.handle(0).status, Status::completed);
  const Batch batch = send(honest, 0, 1.0);
  manual.run(2);
  EXPECT_EQ(batch.handle(0).status, Status::completed);
}

TEST_F(HostileTest, GarbageOnTheBellsPageDelaysOthersAtMost) {
  Watched watched({.segment = "pair"});
  HostileFrontend hostile;
  UntypedFrontend good("pair");
  send(good, 0, 0.1);
  watched.manual.run(3);

  // the bell is put back as if nobody had rung: the loop looks all the same, now and then
  const std::uint32_t silent = hostile.bell().rung;
  Batch batch = send(good, 0, 0.2);
  hostile.bell().rung = silent;
  watched.manual.run_until([&] { return batch.ended(); });
  EXPECT_EQ(batch.handle(0).status, Status::completed);

  // tickets from anywhere: their order is lost, no batch is
  for (const std::uint64_t tickets :
       {std::uint64_t{0}, ~std::uint64_t{0}, std::uint64_t{1} << 63}) {
    hostile.bell().tickets = tickets;
    batch = send(good, 0, 0.3);
    hostile.bell().tickets = tickets / 2;
    watched.manual.run_until([&] { return batch.ended(); });
    EXPECT_EQ(batch.handle(0).status, Status::completed);
  }
}

TEST_F(HostileTest, GarbageOnTheBellsPageWakesReadersLateAndNeverNot) {
  Watched watched({.segment = "pair"});
  HostileFrontend hostile;
  const UntypedFrontend reader("pair");
  for (const Iteration wanted : {std::numeric_limits<Iteration>::max(), Iteration{-1},
                                 std::numeric_limits<Iteration>::min(), Iteration{1'000'000}}) {
    std::atomic<bool> asleep{false};
    const Iteration next = watched.manual.last() + 1;
    std::thread waiter([&] {
      reader.wait_for(next, kPatience, [&] {
        asleep = true;  // it has slept for a slice at least
        return true;
      });
    });
    while (!asleep) std::this_thread::yield();
    hostile.bell().wanted = wanted;
    hostile.bell().passed_on = static_cast<std::uint32_t>(wanted);
    watched.manual.run(1);
    waiter.join();
  }
}

TEST_F(HostileTest, ABackendThatStandsStillHearsOfABurstWhoseBellWasPutBack) {
  BurstingBackend bursting;
  HostileFrontend hostile;
  UntypedFrontend good("pair");
  ASSERT_EQ(good.burst(1, kPatience).iteration(), 1);
  const std::uint32_t silent = hostile.bell().rung;
  std::atomic<bool> over{false};
  std::thread silence([&] {
    while (!over) hostile.bell().rung = silent;
  });
  EXPECT_EQ(good.burst(1, kPatience).iteration(), 2);
  EXPECT_EQ(good.burst(1, kPatience).iteration(), 3);
  over = true;
  silence.join();
}

// rule B5
TEST_F(HostileTest, ControlFallsWithADeadHolderWhateverItWroteAboutItself) {
  StartedBackend manual;
  const SharedScene scene;
  ReadyProcess holder([&](const ChildProcess::Ready& ready) {
    HostileFrontend own;
    BatchBuilder builder;
    builder.take_control();
    own.send(builder, {.id = own.sender().next_id()});
    ready();
    while (scene->scribbles == 0) std::this_thread::yield();
    own.page().incarnation = (std::uint64_t{1} << 63) + 5;
    ++scene->scribbles;
    pause_for_ever();
  });
  UntypedFrontend good("pair");
  manual.run(1);
  ++scene->scribbles;
  while (scene->scribbles < 2) std::this_thread::yield();
  const Batch refused = send(good, 0, 1.0);
  manual.run(2);
  EXPECT_THAT(refused.rejection(), HasSubstr("exclusive control"));
  holder.kill_now();
  manual.run_until([&] {
    const Batch batch = send(good, 0, 1.0);
    manual.iterate();
    return batch.rejection().empty() && batch.ended();
  });
}

TEST_F(HostileTest, IdsByLeapsAreRefusedAndTheNextOwnerOfTheLaneIsToldTheTruth) {
  StartedBackend manual({.segment = "pair", .lanes = 1, .lane_blocks = 64});
  {
    HostileFrontend hostile;
    const auto send_with_id = [&](std::uint64_t id) {
      hostile.command(0.5, {.id = id});
      manual.run(1);
      return hostile.sender().status(id).known == LaneSender::Known::yes;
    };
    EXPECT_TRUE(send_with_id(hostile.sender().next_id()));
    for (const std::uint64_t far : {~std::uint64_t{0}, std::uint64_t{1} << 40, std::uint64_t{0}})
      EXPECT_FALSE(send_with_id(far)) << far;
    // its last words, for the next owner
    hostile.page().next_id = ~std::uint64_t{0} - 3;
    hostile.page().committed += 12345;
    hostile.leave();
  }
  manual.run(1);
  for (int owner = 0; owner < 3; ++owner) {
    UntypedFrontend next("pair");
    add(next, 0, 0.25 * owner);
    const Batch batch = pulse_as_soon_as_there_is_room(next, manual);
    EXPECT_FALSE(batch.ended()) << "nothing is known of what was just sent";
    manual.run_until([&] { return batch.ended(); });
    EXPECT_EQ(batch.handle(0).status, Status::completed);
    EXPECT_EQ(desired(next.latest()), 0.25 * owner);
  }
}

}  // namespace
}  // namespace o80::test
