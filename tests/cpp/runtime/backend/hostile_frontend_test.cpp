// An owner of a lane that lies about itself and its predecessors: the next owners have an ordinary
// lane.

#include <memory>
#include <thread>

#include "memory/child_process.hpp"
#include "runtime/hostile_frontend.hpp"
#include "runtime/shared_scene.hpp"

namespace o80::test {
namespace {

/// What an owner of a lane may have written about itself and its predecessors.
struct SelfDescription {
  std::uint64_t incarnation, closed, dead_incarnation, successor_begin, owner_begin;

  void write(LaneSenderPage& page) const {
    page.closed = closed;
    page.dead_incarnation = dead_incarnation;
    page.successor_begin = successor_begin;
    page.owner_begin = owner_begin;
    page.incarnation = incarnation;
  }
};

constexpr std::uint64_t kFar = (std::uint64_t{1} << 62) - 2;
constexpr std::uint64_t kFurther = ~std::uint64_t{0} - 1;
constexpr SelfDescription kLies[] = {
    {kFar + 1, 0, 0, 0, 0},
    {kFar, kFar, 0, 0, 0},
    {kFurther, kFar, kFar, kFar, kFar},
    {1, kFar, kFar, kFar, kFar},
    {1, 2, 2, 1000, 1000},
    {2, 2, 1, kFar, 0},
    {0, 0, 0, 0, 0},
    {0, kFurther, 3, 9, 9},
    {100, 101, 100, 5, 5},
    {1 << 20, 1 << 20, 7, kFar, 0},
    {(1 << 20) + 1, 0, 0, 0, 0},
};

/// A hostile frontend in lane 0, an honest frontend in lane 1.
class LyingOwnerTest : public ManualBackendTest {
 protected:
  LyingOwnerTest() { manual_.start(); }

  void honest_frontend_comes() {
    other_ = std::make_unique<UntypedFrontend>("pair");
    send(*other_, 0, 0.0);
    ASSERT_EQ(other_->link()->lane()->lane(), 1U);
    manual_.run(1);
  }
  /// After a life with each lie, which the backend has seen or not.
  void leaves_an_ordinary_lane(const std::function<void(const SelfDescription&, bool)>& live) {
    for (const bool seen : {false, true})
      for (const SelfDescription& lie : kLies) {
        SCOPED_TRACE(::testing::Message() << lie.incarnation << (seen ? ", seen" : ""));
        live(lie, seen);
        expect_an_ordinary_lane();
        if (HasFatalFailure()) return;
      }
  }
  /// The next owners of lane 0: each is served, keeps its control, is known to have closed or died.
  void expect_an_ordinary_lane() {
    UntypedFrontend next("pair");
    next.add_take_control();
    const Batch taken = pulse_as_soon_as_there_is_room(next, manual_);
    ASSERT_EQ(next.link()->lane()->lane(), 0U);
    manual_.run_until([&] { return taken.ended(); });
    EXPECT_EQ(taken.handle(0).status, Status::completed);
    for (int i = 0; i < 3; ++i) {
      const Batch refused = send(*other_, 0, 1.0);
      manual_.run(1);
      EXPECT_THAT(refused.rejection(), HasSubstr("exclusive control"));
    }
    next.add_release_control();
    add(next, 1, 1.0, {.pace = iterations(1'000'000)});
    next.pulse();
    manual_.run(2);
    next.close();

    // its command goes on, since it closed, when the lane has its next owner; that one dies
    StandingProcess owner([](const StandingProcess::Stand& stand) {
      UntypedFrontend frontend("pair");
      send(frontend, 0, 0.5, {.pace = iterations(1'000'000)});
      stand();
    });
    manual_.run(2);
    EXPECT_EQ(*manual_.backend.active() & 3, 3U) << "of the closed owner, and of the living one";
    owner.kill_now();
    manual_.run_until([&] { return (*manual_.backend.active() & 1) == 0; });
    other_.reset();
  }

  ManualBackend manual_{{.segment = "pair", .lanes = 2, .lane_blocks = 64, .stale = Stale::purge}};
  std::unique_ptr<UntypedFrontend> other_;
};

TEST_F(LyingOwnerTest, ThatClosesLeavesAnOrdinaryLane) {
  leaves_an_ordinary_lane([&](const SelfDescription& lie, bool seen) {
    HostileFrontend hostile;
    honest_frontend_comes();
    lie.write(hostile.page());
    if (seen) manual_.run(2);
    hostile.leave();
    lie.write(hostile.page());
  });
}

TEST_F(LyingOwnerTest, ThatDiesLeavesAnOrdinaryLane) {
  leaves_an_ordinary_lane([&](const SelfDescription& lie, bool seen) {
    const SharedScene scene;
    ReadyProcess hostile([&](const ChildProcess::Ready& ready) {
      HostileFrontend own;
      ready();
      while (!scene->over) std::this_thread::yield();
      lie.write(own.page());
      ++scene->scribbles;
      pause_for_ever();
    });
    honest_frontend_comes();
    scene->over = true;
    while (scene->scribbles == 0) std::this_thread::yield();
    if (seen) manual_.run(2);
  });
}

}  // namespace
}  // namespace o80::test
