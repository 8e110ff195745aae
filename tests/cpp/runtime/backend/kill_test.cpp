// kill -9 of either side, at the level of frontends and backends.

#include "memory/child_process.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

class KillTest : public ManualBackendTest {};

/// Takes control, sends a long movement, and a command for later.
void command(const StandingProcess::Stand& stand) {
  UntypedFrontend frontend("pair", {.timeout = kPatience});
  frontend.add_take_control();
  add(frontend, 0, 1e6, {.pace = iterations(1'000'000)});
  frontend.pulse();
  add(frontend, 1, 1.0);
  frontend.pulse({.at = 500'000});
  stand();
}

// rule W5
TEST_F(KillTest, TheBackendGoesOnWhenACommandingFrontendIsKilledAndTheNextOneCommands) {
  StartedBackend manual({.segment = "pair", .lanes = 1});
  StandingProcess commander(command);
  manual.run(3);
  commander.kill_now();
  UntypedFrontend next("pair");
  manual.run(2);
  EXPECT_GT(desired(next.latest()), 4.0) << "held: the movement goes on";
  const Batch batch = send(next, 0, -1.0, {.mode = Mode::overwrite});
  manual.run_until([&] { return batch.ended(); });
  EXPECT_EQ(batch.handle(0).status, Status::completed) << "control fell with its holder";
  EXPECT_EQ(desired(next.latest()), -1.0);
}

// rule W5
TEST_F(KillTest, ADeadCommanderPurgesHaltsOrStopsAsToldSo) {
  for (const Stale stale : {Stale::purge, Stale::halt, Stale::stop}) {
    SCOPED_TRACE(static_cast<int>(stale));
    StartedBackend manual({.segment = "pair", .stale = stale});
    UntypedFrontend reader("pair");
    StandingProcess commander(command);
    manual.run(3);
    EXPECT_TRUE(reader.latest().active(0));
    commander.kill_now();
    Step step = Step::run;
    manual.run_until([&] {
      if (step != Step::ended) step = manual.iterate();
      return stale == Stale::stop ? step == Step::ended : !reader.latest().active(0);
    });
    EXPECT_EQ(step, stale == Stale::stop ? Step::ended : Step::run);
    EXPECT_EQ(manual.backend.failure(), stale == Stale::stop ? "a commanding frontend died" : "");
    EXPECT_EQ(reader.halted().value_or(Halt{}).cause,
              stale == Stale::halt ? HaltCause::dead_frontend : HaltCause::none);
    if (stale != Stale::purge) continue;
    // nor is what it had sent for later taken
    while (manual.last() < 500'010) manual.iterate();
    EXPECT_EQ(desired(reader.latest(), 1), 0.0);
  }
}

TEST_F(KillTest, WhatADeadFrontendSentForLaterIsDroppedWhoeverHasItsLaneByNow) {
  for (const bool successor_stays : {true, false}) {
    StartedBackend manual({.segment = "pair", .lanes = 1, .stale = Stale::purge});
    UntypedFrontend reader("pair");
    StandingProcess dying([](const StandingProcess::Stand& stand) {
      UntypedFrontend frontend("pair", {.timeout = kPatience});
      add(frontend, 0, 1.0);
      frontend.pulse({.at = 300});
      stand();
    });
    manual.run(3);  // it waits for its iteration
    dying.kill_now();
    std::optional<UntypedFrontend> successor("pair");
    const Batch own = send(*successor, 1, 1.0);
    if (!successor_stays) successor.reset();
    manual.run_until([&] { return own.ended(); });
    while (manual.last() < 310) manual.iterate();
    EXPECT_EQ(desired(reader.latest(), 0), 0.0);
    EXPECT_EQ(desired(reader.latest(), 1), 1.0) << "the batch of its successor is carried out";
  }
}

}  // namespace
}  // namespace o80::test
