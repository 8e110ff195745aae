// Requests that take time: answered with `running`, ended some iterations later.

#include <gmock/gmock.h>

#include "memory/child_process.hpp"
#include "o80/runtime/typed_backend.hpp"
#include "runtime/station.hpp"

namespace o80::test::homing {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

struct Home {
  double speed = 0.1;
};
O80_DESCRIBE(Home, speed);
/// Moves nothing: it goes on in a halt.
struct Calibrate {
  static constexpr bool kWhileHalted = true;
};
O80_DESCRIBE(Calibrate);
struct Jump {};
O80_DESCRIBE(Jump);

struct Homing {
  using Actuators = std::array<double, 2>;
  using Requests = o80::Requests<Home, Calibrate, Jump>;
};

/// Two joints that home when they are asked to, and end when the test says so.
class HomingStation {
 public:
  explicit HomingStation(const BackendOptions& options = {.segment = "pair"},
                         const Backend<Homing>::Describe& describe = {})
      : backend(options, describe) {
    backend.on<Home>([this](const Home&) {
      ++homed;
      return Served::running("looks for the index of joint 1");
    });
    backend.on<Calibrate>([](const Calibrate&) { return Served::running(); });
    backend.on<Jump>([this](const Jump&) {
      now = {9, 9};
      return Served::start_afresh();
    });
    backend.on_fresh_start([this](std::array<double, 2>& observed, NoExtended&) {
      ++fresh;
      observed = now;
    });
    backend.publish(now);
  }
  Step iterate() {
    const Step step = backend.untyped().try_step();
    if (step != Step::run) return step;
    if (before_publish) before_publish();
    backend.publish(now);
    return step;
  }
  void run(int iterations) {
    for (int i = 0; i < iterations; ++i) ASSERT_EQ(iterate(), Step::run) << i;
  }
  void end_in_next_row(const Served& how) {
    before_publish = [this, how] { backend.ended<Home>(how); };
  }
  Iteration last() { return backend.untyped().iteration() - 1; }

  std::array<double, 2> now{};
  int homed = 0;
  int fresh = 0;
  std::function<void()> before_publish;
  Backend<Homing> backend;
};

template <class Request>
Batch ask(UntypedFrontend& frontend, const Request& request = {}) {
  add_request(frontend, request);
  return frontend.pulse();
}

using RunningRequestOptionsTest = StationTest;

class RunningRequestTest : public StationTest {
 protected:
  /// A request that runs since iteration 1.
  Batch home() {
    const Batch batch = ask<Home>(frontend);
    station.run(1);
    return batch;
  }

  HomingStation station;
  UntypedFrontend frontend{"pair"};
};

// rule B10
TEST_F(RunningRequestTest, IsActiveUntilTheDriverEndsIt) {
  const Batch batch = ask<Home>(frontend);
  station.run(3);
  EXPECT_EQ(batch.handle(0).status, Status::active);
  EXPECT_EQ(batch.handle(0).iteration, 1);
  EXPECT_FALSE(batch.ended());
  EXPECT_THROW(batch.wait(kAtOnce), TimeoutError);

  station.before_publish = [&] {
    station.backend.ended<Home>(Served::done());
    EXPECT_EQ(batch.handle(0).status, Status::active) << "the row is not out";
  };
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::completed);
  EXPECT_EQ(batch.handle(0).iteration, 4);
  EXPECT_EQ(batch.last_iteration(), 4);
  batch.wait(kAtOnce);
  EXPECT_EQ(station.fresh, 0);
}

TEST_F(RunningRequestTest, ShowsItsProgressToItsSenderAndToObservers) {
  const Batch batch = ask<Home>(frontend);
  EXPECT_EQ(batch.handle(0).progress, "");
  station.run(1);
  EXPECT_EQ(batch.handle(0).progress, "looks for the index of joint 1");
  station.backend.progress<Home>("looks for the index of joint 2");
  EXPECT_EQ(batch.handle(0).progress, "looks for the index of joint 2");

  const UntypedFrontend observer("pair", {.access = Access::read_only});
  ASSERT_EQ(observer.running_requests().size(), 1U);
  const RequestUnderWay seen = observer.running_requests()[0];
  EXPECT_EQ(seen.name, "home");
  EXPECT_EQ(seen.since, 1);
  EXPECT_THAT(seen.who, HasSubstr("pid " + std::to_string(getpid())));
  EXPECT_EQ(seen.progress, "looks for the index of joint 2");

  station.backend.ended<Home>(Served::done());
  station.run(1);
  EXPECT_EQ(batch.handle(0).progress, "");
  EXPECT_THAT(observer.running_requests(), IsEmpty());
}

TEST_F(RunningRequestTest, ALongProgressIsCut) {
  const Batch batch = home();
  station.backend.progress<Home>(std::string(1000, 'x'));
  EXPECT_EQ(batch.handle(0).progress, std::string(247, 'x'));
  station.backend.progress<Home>({});
  EXPECT_EQ(batch.handle(0).progress, "");
}

TEST_F(RunningRequestTest, MayEndAsRejectedWithItsReason) {
  const Batch batch = home();
  station.backend.ended<Home>(Served::rejected("no index pulse within 20 s"));
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::rejected);
  EXPECT_EQ(batch.handle(0).reason, Reason::driver);
  EXPECT_EQ(batch.handle(0).text, "no index pulse within 20 s");
  EXPECT_FALSE(station.backend.runs<Home>());
}

TEST_F(RunningRequestTest, MayEndTheBackend) {
  const Batch batch = home();
  station.backend.ended<Home>(Served::failed("the gear broke"));
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::rejected);
  EXPECT_EQ(station.iterate(), Step::ended);
  EXPECT_EQ(station.backend.untyped().failure(), "the gear broke");
}

TEST_F(RunningRequestTest, MayEndWithAFreshStart) {
  const Batch moves = send(frontend, 0, 5.0, {.pace = iterations(100)});
  const Batch batch = ask<Home>(frontend);
  station.run(2);
  station.now = {-1, -2};
  station.end_in_next_row(Served::start_afresh());
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::active) << "the fresh row is still to come";
  station.run(1);
  EXPECT_EQ(station.fresh, 1);
  EXPECT_EQ(batch.handle(0).status, Status::completed);
  EXPECT_EQ(batch.handle(0).iteration, 4);
  EXPECT_EQ(moves.handle(0).status, Status::purged);
  EXPECT_EQ(moves.handle(0).reason, Reason::fresh_start);
  EXPECT_EQ(frontend.wait_for(4, kAtOnce).head().fresh, 1U);
  EXPECT_THAT(desired(frontend, 4, 5), ElementsAre(-1.0, -1.0));
}

TEST_F(RunningRequestOptionsTest, AFreshStartAtItsEndIsNoErrorOfTheRobot) {
  HomingStation station({.segment = "pair"},
                        [](Schema& schema) { schema.actuator(0).limits({.error = 0.5}); });
  UntypedFrontend frontend("pair");
  ask<Home>(frontend);
  station.run(1);
  station.now = {-1, -2};  // the encoders have a new zero
  station.end_in_next_row(Served::start_afresh());
  station.run(3);
  EXPECT_FALSE(frontend.halted());
}

TEST_F(RunningRequestTest, AReadingThatIsNoNumberFailsItsFreshStart) {
  const Batch batch = home();
  station.now[1] = std::numeric_limits<double>::quiet_NaN();
  station.end_in_next_row(Served::start_afresh());
  station.run(1);
  EXPECT_EQ(station.iterate(), Step::ended);
  EXPECT_EQ(batch.handle(0).status, Status::rejected);
  EXPECT_THAT(batch.handle(0).text, HasSubstr("is NaN or infinite"));
}

TEST_F(RunningRequestTest, ASecondOfItsKindIsRejectedBeforeItsHandlerIsAsked) {
  UntypedFrontend other("pair");
  const Batch first = ask<Home>(frontend);
  station.run(2);
  const Batch second = ask<Home>(other);
  station.run(1);
  EXPECT_EQ(station.homed, 1);
  EXPECT_EQ(second.handle(0).status, Status::rejected);
  EXPECT_EQ(second.handle(0).text, "'home' has been running since iteration 1: wait for its end");
  EXPECT_EQ(first.handle(0).status, Status::active);

  station.backend.ended<Home>(Served::done());
  station.run(1);
  ask<Home>(other);
  station.run(1);
  EXPECT_EQ(station.homed, 2);
  EXPECT_EQ(frontend.running_requests()[0].since, station.last());
}

TEST_F(RunningRequestTest, AnotherKindIsServedBesideIt) {
  const Batch home = ask<Home>(frontend);
  station.run(1);
  const Batch calibrate = ask<Calibrate>(frontend);
  const Batch jump = ask<Jump>(frontend);
  station.run(1);
  EXPECT_EQ(jump.handle(0).status, Status::completed);
  EXPECT_EQ(home.handle(0).status, Status::active) << "another one's fresh start does not end it";
  EXPECT_EQ(frontend.running_requests().size(), 2U);
  station.backend.ended<Calibrate>(Served::done());
  station.run(1);
  EXPECT_EQ(calibrate.handle(0).status, Status::completed);
  EXPECT_EQ(home.handle(0).status, Status::active);
}

TEST_F(RunningRequestTest, WhatFollowsItInItsBatchDoesNotWait) {
  add_request<Home>(frontend);
  add(frontend, 0, 5.0);
  const Batch batch = frontend.pulse();
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::active);
  EXPECT_EQ(batch.handle(1).status, Status::completed);
}

TEST_F(RunningRequestTest, APurgeLeavesItRunning) {
  const Batch batch = home();
  frontend.add_purge();
  frontend.pulse();
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::active);
}

// rule B10
TEST_F(RunningRequestTest, AHaltEndsItAndADriverThatEndsItLaterChangesNothing) {
  const Batch batch = home();
  bool ran = true;
  station.backend.on_halt([&] { ran = station.backend.runs<Home>(); });
  const std::uint64_t number = frontend.halt("a hand in the cell");
  station.run(1);
  EXPECT_FALSE(ran) << "told before the driver is";
  EXPECT_EQ(batch.handle(0).status, Status::halted);
  EXPECT_EQ(batch.handle(0).iteration, 2);
  EXPECT_THAT(batch.handle(0).text, HasSubstr("a hand in the cell"));
  station.backend.ended<Home>(Served::rejected("too late"));
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::halted);

  const Batch refused = ask<Home>(frontend);
  station.run(1);
  EXPECT_EQ(refused.handle(0).status, Status::rejected);
  send_resume(frontend, number);
  ask<Home>(frontend);
  station.run(1);
  EXPECT_EQ(station.homed, 2);
}

TEST_F(RunningRequestTest, AHaltWinsOverAFreshStartAtItsEnd) {
  const Batch batch = home();
  station.end_in_next_row(Served::start_afresh());
  station.run(1);
  frontend.halt("");
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::halted);
  EXPECT_EQ(station.fresh, 0) << "the resume starts afresh";
}

TEST_F(RunningRequestTest, OneThatIsServedInHaltsGoesOnInThem) {
  const Batch before = ask<Calibrate>(frontend);
  station.run(1);
  const std::uint64_t number = frontend.halt("");
  station.run(1);
  EXPECT_EQ(before.handle(0).status, Status::active);
  station.backend.ended<Calibrate>(Served::done());
  station.run(1);
  EXPECT_EQ(before.handle(0).status, Status::completed);
  const Batch within = ask<Calibrate>(frontend);
  station.run(1);
  send_resume(frontend, number);
  station.run(1);
  EXPECT_FALSE(frontend.halted());
  EXPECT_EQ(within.handle(0).status, Status::active);
}

TEST_F(RunningRequestTest, AnEndOfTheBackendEndsIt) {
  const Batch batch = home();
  station.backend.untyped().end(BackendState::stopped);
  EXPECT_EQ(batch.handle(0).status, Status::purged);
  EXPECT_EQ(batch.handle(0).reason, Reason::stopped);
  EXPECT_THAT(frontend.running_requests(), IsEmpty());
}

TEST_F(RunningRequestTest, AStopInOrderEndsItBeforeItBrakes) {
  const Batch batch = home();
  station.backend.untyped().ask_to_stop();
  EXPECT_EQ(station.iterate(), Step::ended);
  EXPECT_EQ(station.backend.untyped().brake(), Step::run) << "the driver learns of it in this one";
  EXPECT_FALSE(station.backend.runs<Home>());
  EXPECT_EQ(batch.handle(0).status, Status::purged);
}

TEST_F(RunningRequestOptionsTest, ItGoesOnWhenItsSenderCloses) {
  HomingStation station;
  {
    UntypedFrontend frontend("pair");
    ask<Home>(frontend);
    station.run(1);
  }
  UntypedFrontend successor("pair");
  const Batch theirs = send(successor, 0, 1.0);
  station.run(1);
  EXPECT_EQ(theirs.handle(0).status, Status::completed);
  EXPECT_TRUE(station.backend.runs<Home>());
  station.backend.ended<Home>(Served::done());
  station.run(1);
  EXPECT_THAT(successor.running_requests(), IsEmpty());
}

TEST_F(RunningRequestOptionsTest, ItGoesOnWhenItsSenderIsKilledAndCommandsArePurged) {
  HomingStation station({.segment = "pair", .stale = Stale::purge});
  StandingProcess child([](const StandingProcess::Stand& stand) {
    UntypedFrontend frontend("pair");
    ask<Home>(frontend);
    stand();
  });
  station.run(1);
  ASSERT_EQ(station.homed, 1);
  child.kill_now();
  // its death is seen when its lane has a new owner, whatever the helper thread has seen
  UntypedFrontend successor("pair");
  send(successor, 0, 1.0);
  station.run(2);
  EXPECT_TRUE(station.backend.runs<Home>());
}

TEST_F(RunningRequestOptionsTest, ItsSilentSenderIsHaltedByTheWatchdog) {
  HomingStation station({.segment = "pair", .stale = Stale::halt, .silence = 5});
  UntypedFrontend frontend("pair");
  const Batch batch = ask<Home>(frontend);
  station.run(20);
  ASSERT_TRUE(frontend.halted());
  EXPECT_EQ(frontend.halted()->cause, HaltCause::silence);
  EXPECT_EQ(batch.handle(0).status, Status::halted);
}

TEST_F(RunningRequestOptionsTest, OneThatMovesNothingNeedsNoSignOfLife) {
  HomingStation station({.segment = "pair", .stale = Stale::halt, .silence = 5});
  UntypedFrontend frontend("pair");
  ask<Calibrate>(frontend);
  station.run(20);
  EXPECT_FALSE(frontend.halted());
}

TEST_F(RunningRequestOptionsTest, ABackendThatIsReplacedWhileItRunsLeavesAHalt) {
  StandingProcess child([](const StandingProcess::Stand& stand) {
    HomingStation station({.segment = "pair"});
    UntypedFrontend frontend("pair");
    ask<Home>(frontend);
    station.run(1);
    stand();
  });
  child.kill_now();
  HomingStation station({.segment = "pair"});
  station.run(1);
  UntypedFrontend frontend("pair");
  ASSERT_TRUE(frontend.halted()) << "the robot moved when its process was killed";
  EXPECT_EQ(frontend.halted()->cause, HaltCause::predecessor);
}

TEST_F(RunningRequestOptionsTest, ABurstUntilTheEndLastsUntilItsEndOrItsFreshStart) {
  for (const bool afresh : {false, true}) {
    HomingStation station({.segment = "pair", .bursting = true});
    UntypedFrontend frontend("pair");
    add_request<Home>(frontend);
    const Batch batch = frontend.pulse_to_end();
    station.before_publish = [&] {
      if (station.backend.untyped().iteration() != 7) return;
      station.backend.ended<Home>(afresh ? Served::start_afresh() : Served::done());
    };
    while (station.iterate() == Step::run) {
    }
    EXPECT_EQ(station.last(), afresh ? 8 : 7);
    EXPECT_EQ(frontend.latest().head().fresh, afresh ? 1U : 0U);
    EXPECT_EQ(batch.last_iteration(), station.last());
  }
}

TEST_F(RunningRequestOptionsTest, AFreshStartAtTheEndOfABurstNeedsNoOtherBurst) {
  HomingStation station({.segment = "pair", .bursting = true});
  UntypedFrontend frontend("pair");
  add_request<Home>(frontend);
  const Burst burst = frontend.start_burst(3);
  station.before_publish = [&] {
    if (station.backend.untyped().iteration() == 3) {
      station.backend.ended<Home>(Served::start_afresh());
    }
  };
  while (station.iterate() == Step::run) {
  }
  EXPECT_EQ(burst.wait(kAtOnce).iteration(), 3);
  EXPECT_EQ(burst.batch().handle(0).status, Status::completed);
  EXPECT_EQ(station.last(), 4) << "the fresh row";
}

TEST_F(RunningRequestOptionsTest, ThousandsOfThemLeaveNoBlockBehind) {
  HomingStation station({.segment = "pair", .lane_blocks = 64});
  UntypedFrontend frontend("pair");
  for (int i = 0; i < 2000; ++i) {
    const Batch batch = ask<Home>(frontend);
    station.run(1);
    station.backend.ended<Home>(Served::done());
    station.run(1);
    ASSERT_EQ(batch.handle(0).status, Status::completed) << i;
  }
}

TEST_F(RunningRequestOptionsTest, ItsStatusIsNotForgottenWhileOthersComeAndGo) {
  HomingStation station({.segment = "pair", .lane_blocks = 64});
  UntypedFrontend frontend("pair");
  const Batch batch = ask<Home>(frontend);
  for (int i = 0; i < 2000; ++i) {
    send(frontend, 0, 1.0 * i);
    station.run(1);
  }
  EXPECT_EQ(batch.handle(0).status, Status::active);
  station.backend.ended<Home>(Served::done());
  station.run(1);
  EXPECT_EQ(batch.handle(0).status, Status::completed);
}

}  // namespace
}  // namespace o80::test::homing
