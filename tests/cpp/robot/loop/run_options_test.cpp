#include "robot/loop/run_options.hpp"

#include <algorithm>
#include <iterator>
#include <sstream>

#include "robot/fake_driver.hpp"

namespace o80::test {
namespace {

using ::testing::Pair;

class RunOptionsTest : public FakeDriverTest {
 protected:
  static RunOptions parse(std::vector<std::string> words, const RobotTable& robot = table()) {
    words.insert(words.begin(), "o80-run");
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    return parse_run_options(robot, static_cast<int>(words.size()), arguments.data());
  }
  static std::string refusal(const std::vector<std::string>& words) {
    return message_of<InvalidArgument>([&] { parse(words); });
  }
};

TEST_F(RunOptionsTest, HaveDefaults) {
  const RunOptions options = parse({});
  EXPECT_EQ(options.backend.segment, "fake");
  EXPECT_EQ(options.backend.period, 0);
  EXPECT_FALSE(options.backend.bursting);
  EXPECT_EQ(options.backend.permission, 0600U);
}

TEST_F(RunOptionsTest, APriorityNeedsAPolicyThatHasOne) {
  EXPECT_THAT(refusal({"--priority", "90"}), HasSubstr("needs --policy fifo, rr or auto"));
  EXPECT_THAT(refusal({"--policy", "other", "--priority", "90"}), HasSubstr("needs --policy"));
  EXPECT_EQ(parse({"--priority", "90", "--policy", "rr"}).real_time.priority, 90);
}

TEST_F(RunOptionsTest, AreReadFromFlags) {
  std::istringstream line(
      "--segment=left --frequency 500 --bursting --history 42 --lanes 3 --lane-blocks 64 "
      "--permission 660 --stale purge --silence 50 --policy fifo --priority 50 --cpus 1,2 "
      "--lock-memory --until-eof --gain 2.5 --finish-at 7 --finish_at 8");
  const RunOptions options = parse({std::istream_iterator<std::string>(line), {}});
  EXPECT_EQ(options.backend.segment, "left");
  EXPECT_EQ(options.backend.period, 2'000'000);
  EXPECT_TRUE(options.backend.bursting);
  EXPECT_EQ(options.backend.history, 42U);
  EXPECT_EQ(options.backend.lanes, 3U);
  EXPECT_EQ(options.backend.lane_blocks, 64U);
  EXPECT_EQ(options.backend.permission, 0660U);
  EXPECT_EQ(options.backend.stale, Stale::purge);
  EXPECT_EQ(options.backend.silence, 50);
  EXPECT_EQ(options.real_time.policy, RealTimeOptions::Policy::fifo);
  EXPECT_EQ(options.real_time.priority, 50);
  EXPECT_THAT(options.real_time.processors, ElementsAre(1, 2));
  EXPECT_TRUE(options.real_time.lock_memory);
  EXPECT_TRUE(options.until_eof);
  EXPECT_THAT(options.robot,
              ElementsAre(Pair("gain", "2.5"), Pair("finish_at", "7"), Pair("finish_at", "8")));
}

TEST_F(RunOptionsTest, TakeAbbreviationsOfOneOptionInBothSpellings) {
  for (const char* word : {"--gai=30", "--finish-a=30", "--finish_a=30", "--finish=30"}) {
    const OptionValues given = parse({word}).robot;
    ASSERT_EQ(given.size(), 1U) << word;
    EXPECT_EQ(given[0].second, "30");
  }
  EXPECT_EQ(refusal({"--f", "1"}), "--f may be --frequency, --fails, --finish-at: write it out");
}

TEST_F(RunOptionsTest, RefuseWhatIsNotAllowedNamingTheFlag) {
  EXPECT_THAT(refusal({"--frequency", "0"}), AllOf(HasSubstr("--frequency"), HasSubstr("from")));
  EXPECT_THAT(refusal({"--lanes", "1.5"}),
              HasSubstr("must be a whole number from 1 to 256, got '1.5'"));
  EXPECT_THAT(refusal({"--policy", "idle"}), HasSubstr("other, fifo, rr or auto"));
  EXPECT_THAT(refusal({"--gain"}), HasSubstr("needs a value"));
  EXPECT_THAT(refusal({"--gian", "2"}), HasSubstr("there is no flag --gian"));
  EXPECT_THAT(refusal({"--gian", "2"}), HasSubstr("Did you mean --gain?"));
  EXPECT_THAT(refusal({"--frequenzy=2"}), HasSubstr("no flag --frequenzy. Did you mean --freq"));
  EXPECT_THAT(refusal({"--la", "2"}), HasSubstr("--la may be --lanes, --lane-blocks"));
  EXPECT_THAT(refusal({"stray"}), HasSubstr("'stray' is not a flag"));
  EXPECT_THAT(refusal({"--"}), HasSubstr("there is no flag --; see --help"));
  EXPECT_THAT(refusal({"gain=2"}), HasSubstr("for example --gain=2"));
  const char* const no_value = "--bursting takes no value, got '0'";
  EXPECT_THAT(refusal({"--bursting", "0"}), HasSubstr(no_value));
  EXPECT_THAT(refusal({"--bursting=0"}), HasSubstr(no_value));
  EXPECT_THAT(refusal({"--gain", "fast"}),
              HasSubstr("robot 'fake': option 'gain' must be a number, got 'fast'"));
  EXPECT_THAT(refusal({"--fails", "often"}), HasSubstr("must be one of: never"));
  EXPECT_EQ(FakeDriver::calls.constructed, 0);
}

TEST_F(RunOptionsTest, AreAllInTheHelp) {
  const std::string help = run_help(table());
  EXPECT_THAT(help, AllOf(HasSubstr("--gain number"), HasSubstr("of nothing [1/s] (default: 1.5)"),
                          HasSubstr("--finish-at"), HasSubstr("one of: never")));
  for (const LoopOption& option : loop_options()) {
    std::string flag = option.name;
    std::ranges::replace(flag, '_', '-');
    EXPECT_THAT(help, HasSubstr("--" + flag));
    EXPECT_THAT(help, HasSubstr(option.help));
  }
}

/// A robot whose Config takes a flag of every robot for itself.
struct Greedy {
  struct Config {
    int lane_blocks = 1;
  };
  using Actuators = NoActuators;
  explicit Greedy(const Config&) {}
  void start() {}
  void write(const Desired<Greedy>&) {}
  void read(Reading<Greedy>&) {}
  void stop() noexcept {}
};
O80_DESCRIBE(Greedy::Config, lane_blocks);

TEST_F(RunOptionsTest, RefuseARobotThatTakesAFlagOfEveryRobot) {
  EXPECT_THAT(message_of<InvalidArgument>([] { parse({}, *robot_table<Greedy>("greedy")); }),
              AllOf(HasSubstr("'lane_blocks'"), HasSubstr("rename it")));
}

}  // namespace
}  // namespace o80::test
