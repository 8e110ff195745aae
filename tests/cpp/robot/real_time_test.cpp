#include "o80/robot/real_time.hpp"

#include <gmock/gmock.h>
#include <sched.h>
#include <sys/resource.h>

#include <thread>

namespace o80 {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

/// In a thread of its own, so that nothing stays set.
std::vector<std::string> set_up(const RealTimeOptions& options) {
  std::vector<std::string> refused;
  std::thread([&] { refused = set_up_real_time(options); }).join();
  return refused;
}

TEST(RealTime, AsksForNothingUnlessTold) { EXPECT_THAT(set_up({}), IsEmpty()); }

TEST(RealTime, RunsOnTheProcessorsItIsGiven) {
  std::thread([] {
    cpu_set_t allowed;
    ASSERT_EQ(sched_getaffinity(0, sizeof allowed, &allowed), 0);
    int first = 0;
    while (!CPU_ISSET(first, &allowed)) ++first;
    RealTimeOptions options;
    options.processors = {first};
    EXPECT_THAT(set_up_real_time(options), IsEmpty());
    EXPECT_EQ(sched_getcpu(), first);
  }).join();
}

TEST(RealTime, SaysHowToGetWhatTheMachineRefuses) {
  RealTimeOptions elsewhere;
  elsewhere.processors = {1000};
  EXPECT_THAT(set_up(elsewhere),
              ElementsAre(AllOf(HasSubstr("processors 1000 were refused"), HasSubstr("taskset"))));
  RealTimeOptions options;
  options.policy = RealTimeOptions::Policy::fifo;
  options.priority = 1000;  // which no machine grants
  EXPECT_THAT(set_up(options), ElementsAre(AllOf(HasSubstr("real-time priority 1000 was refused"),
                                                 HasSubstr("ulimit -r 99"))));
}

}  // namespace
}  // namespace o80
