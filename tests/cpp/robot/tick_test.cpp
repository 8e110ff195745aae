// A driver that paces the loop itself, and one whose wait returns too early.

#include <gmock/gmock.h>

#include <array>
#include <cstdint>
#include <memory>
#include <thread>

#include "o80/robot/loop.hpp"
#include "o80/robot/make_table.hpp"
#include "runtime/station.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using TickTest = StationTest;

/// Ticks by itself, until its cable is pulled.
class Ticking {
 public:
  struct Config {};
  using Actuators = std::array<double, 1>;

  static inline int in_time = 0;  // waits that take their time
  static inline int stopped = 0;

  explicit Ticking(const Config&) {}
  void start() {}
  void write(const Desired<Ticking>& desired) { now_ = desired.states; }
  void read(Reading<Ticking>& reading) {
    reading.observed = now_;
    if (reading.iteration() == 100'000) reading.finish();  // nobody has noticed
  }
  void wait(std::int64_t due) {
    if (++waits_ > in_time) return;
    while (!sleep_until(due)) {
    }
  }
  void stop() noexcept { ++stopped; }

 private:
  std::array<double, 1> now_{};
  int waits_ = 0;
};
O80_DESCRIBE(Ticking::Config);

TEST_F(TickTest, AWaitThatReturnsAtOnceIsAFaultBeforeItMovesTheRobotFar) {
  Ticking::in_time = 20;
  Ticking::stopped = 0;
  Loop loop(std::make_unique<Robot>(*robot_table<Ticking>("ticking"), OptionValues{}),
            BackendOptions{.segment = "ticking", .period = 1'000'000});
  loop.start();
  const Ended ended = loop.run();
  EXPECT_FALSE(ended.in_order);
  EXPECT_THAT(ended.fault, AllOf(HasSubstr("failed in wait"), HasSubstr("ticks came in"),
                                 HasSubstr("--frequency"), HasSubstr("wait")));
  EXPECT_EQ(Ticking::stopped, 1);
  EXPECT_GE(loop.backend().iteration(), 20 + 10);
}

}  // namespace
}  // namespace o80::test
