// A driver whose requests take time, behind the table of functions and in the loop.

#include <memory>

#include "robot/fake_driver.hpp"

namespace o80::test {
namespace {

using ::testing::IsEmpty;

class RunningRequestLoopTest : public FakeDriverTest {
 protected:
  void burst(int iterations) {
    frontend_.start_burst(iterations);
    loop_->run_granted(kAll);
  }

  std::unique_ptr<Loop> loop_ = started();
  UntypedFrontend frontend_{"fake"};
};

TEST_F(RunningRequestLoopTest, TheReadingTellsProgressAndEnd) {
  std::vector<bool> ran;
  FakeDriver::on_read = [&](Reading<FakeDriver>& reading) {
    ran.push_back(reading.runs<Poke>());
    if (reading.iteration() == 2) reading.progress<Poke>("half way");
    if (reading.iteration() == 4) reading.ended<Poke>(Served::done());
  };
  const Batch batch = poke(frontend_, 5);
  burst(1);
  EXPECT_EQ(batch.handle(0).progress, "feels the poke");
  burst(2);
  EXPECT_EQ(batch.handle(0).progress, "half way") << "it stays until the next one";
  burst(2);
  EXPECT_EQ(batch.handle(0).status, Status::completed);
  EXPECT_EQ(batch.handle(0).iteration, 4);
  EXPECT_EQ(ran, (std::vector<bool>{true, true, true, true, false}));
}

TEST_F(RunningRequestLoopTest, AnEndAndAProgressInOneReadingAreAnEnd) {
  FakeDriver::on_read = [](Reading<FakeDriver>& reading) {
    reading.ended<Poke>(Served::rejected("slipped"));
    reading.progress<Poke>("nearly there");
    reading.ended<Poke>(Served::done());
  };
  const Batch batch = poke(frontend_, 5);
  burst(1);
  EXPECT_EQ(batch.handle(0).status, Status::rejected);
  EXPECT_EQ(batch.handle(0).text, "slipped") << "the first end stands";
}

TEST_F(RunningRequestLoopTest, WhatDoesNotRunCannotEnd) {
  FakeDriver::on_read = [](Reading<FakeDriver>& reading) {
    reading.ended<Poke>(Served::failed("of what?"));
    reading.progress<Poke>("of what?");
  };
  burst(3);
  EXPECT_EQ(frontend_.published(), 3);
  EXPECT_THAT(frontend_.running_requests(), IsEmpty());
}

TEST_F(RunningRequestLoopTest, AFailureEndsTheLoopWithItsName) {
  FakeDriver::on_read = [](Reading<FakeDriver>& reading) {
    reading.ended<Poke>(Served::failed("the gear broke"));
  };
  poke(frontend_, 5);
  burst(3);
  EXPECT_THAT(loop_->fault(), AllOf(HasSubstr("failed in poke"), HasSubstr("the gear broke")));
  EXPECT_EQ(frontend_.published(), 1) << "its row is still published";
  EXPECT_EQ(FakeDriver::calls.stopped, 1);
}

TEST_F(RunningRequestLoopTest, MayEndInTheReadingOfAnothersFreshStart) {
  FakeDriver::on_read = [](Reading<FakeDriver>& reading) {
    if (reading.fresh()) reading.ended<Poke>(Served::start_afresh());
  };
  const Batch batch = poke(frontend_, 5);
  burst(1);
  ASSERT_EQ(batch.handle(0).status, Status::active);
  // a resume is a fresh start that asks no handler
  const std::uint64_t number = frontend_.halt("");
  loop_->run_granted(kAll);
  EXPECT_EQ(batch.handle(0).status, Status::halted);
  send_resume(frontend_, number);
  loop_->run_granted(kAll);
  EXPECT_FALSE(frontend_.halted());
}

TEST_F(RunningRequestLoopTest, AResumeCannotRun) {
  FakeDriver::on_resume = [] { return Served::running("warming up"); };
  const std::uint64_t number = frontend_.halt("");
  loop_->run_granted(kAll);
  const Batch batch = send_resume(frontend_, number);
  loop_->run_granted(kAll);
  EXPECT_THAT(batch.handle(0).text, HasSubstr("resume it again when it is"));
  EXPECT_TRUE(frontend_.halted());
}

}  // namespace
}  // namespace o80::test
