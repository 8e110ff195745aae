// Halts of a backend that bursts.

#include <gmock/gmock.h>

#include "o80/base/error.hpp"
#include "runtime/station.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using HaltBurstTest = StationTest;

// rule H5
TEST_F(HaltBurstTest, AHaltEndsABurstAfterTheIterationUnderWay) {
  for (const bool to_end : {false, true}) {
    BurstingStation bursting("pair", [](Station& station) {
      station.before_publish = [&station] {
        if (station.backend.iteration() == 5) station.backend.halt(HaltCause::driver, "five");
      };
    });
    UntypedFrontend frontend("pair");
    add(frontend, 0, 100.0, {.pace = iterations(100)});
    const auto burst = [&] {
      to_end ? frontend.pulse_and_wait(kPatience) : frontend.burst(100, kPatience);
    };
    EXPECT_THAT(message_of<BackendHalted>(burst),
                AllOf(HasSubstr(to_end ? "" : "ended in iteration 5"), HasSubstr("five")));
    EXPECT_EQ(frontend.published(), 5);
    ASSERT_TRUE(frontend.halted());
    EXPECT_EQ(frontend.halted()->iteration, 6) << "the next one, that has not begun";
  }
}

// rule H7
TEST_F(HaltBurstTest, BurstsAreServedWhileHalted) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  frontend.halt("");
  const auto row = frontend.burst(3, kPatience);
  EXPECT_EQ(row.iteration(), 3);
  EXPECT_EQ(row.head().halted, 1U);
  add(frontend, 0, 1.0);
  EXPECT_THAT(message_of<BackendHalted>([&] { frontend.burst(1, kPatience); }),
              HasSubstr("rejected"));
  EXPECT_EQ(frontend.published(), 3);
  frontend.resume(frontend.halted()->number, kPatience);
  EXPECT_FALSE(frontend.halted());
  add(frontend, 0, 1.0);
  EXPECT_EQ(desired(frontend.burst(1, kPatience)), 1.0);
}

TEST_F(HaltBurstTest, AHaltIsSeenByABackendThatStandsStill) {
  BurstingStation bursting;
  UntypedFrontend frontend("pair");
  add(frontend, 0, 9.0, {.pace = iterations(9)});
  frontend.burst(2, kPatience);
  const Batch waiting = send(frontend, 0, 3.0);
  frontend.halt("");
  EXPECT_THROW(waiting.wait(kPatience), BackendHalted);
  EXPECT_EQ(waiting.handle(0).status, Status::halted);
}

}  // namespace
}  // namespace o80::test
