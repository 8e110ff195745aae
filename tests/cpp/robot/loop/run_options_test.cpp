#include "robot/loop/run_options.hpp"

#include <algorithm>

#include "robot/puppet.hpp"

namespace o80::test {
namespace {

using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::Pair;

class RunOptionsTest : public PuppetTest {
 protected:
  static RunOptions parse(std::vector<std::string> words) {
    words.insert(words.begin(), "o80-run");
    std::vector<char*> arguments;
    for (std::string& word : words) arguments.push_back(word.data());
    arguments.push_back(nullptr);
    return parse_run_options(table(), static_cast<int>(words.size()), arguments.data());
  }
  static std::string refusal(const std::vector<std::string>& words) {
    return message_of<InvalidArgument>([&] { parse(words); });
  }
};

TEST_F(RunOptionsTest, HaveDefaults) {
  const RunOptions options = parse({});
  EXPECT_EQ(options.backend.segment, "puppet");
  EXPECT_EQ(options.backend.period, 0);
  EXPECT_FALSE(options.backend.bursting);
  EXPECT_EQ(options.backend.permission, 0600U);
}

TEST_F(RunOptionsTest, APriorityNeedsAPolicyThatHasOne) {
  EXPECT_THAT(refusal({"--priority", "90"}), HasSubstr("needs --policy fifo or rr"));
  EXPECT_THAT(refusal({"--policy", "other", "--priority", "90"}), HasSubstr("needs --policy"));
  EXPECT_EQ(parse({"--priority", "90", "--policy", "rr"}).real_time.priority, 90);
}

TEST_F(RunOptionsTest, AreReadFromFlags) {
  const RunOptions options = parse({"--segment=left",
                                    "--frequency",
                                    "500",
                                    "--bursting",
                                    "--history",
                                    "42",
                                    "--lanes",
                                    "3",
                                    "--lane-blocks",
                                    "64",
                                    "--permission",
                                    "660",
                                    "--stale",
                                    "purge",
                                    "--silence",
                                    "50",
                                    "--policy",
                                    "fifo",
                                    "--priority",
                                    "50",
                                    "--cpus",
                                    "1,2",
                                    "--lock-memory",
                                    "--until-eof",
                                    "--gain",
                                    "2.5",
                                    "--finish-at",
                                    "7",
                                    "--finish_at",
                                    "8"});
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
  EXPECT_THAT(refusal({"--frequency", "fast"}), HasSubstr("'fast'"));
  EXPECT_THAT(refusal({"--frequency", "nan"}), HasSubstr("'nan'"));
  EXPECT_THAT(refusal({"--lanes", "1.5"}),
              HasSubstr("must be a whole number from 1 to 256, got '1.5'"));
  EXPECT_THAT(refusal({"--permission", "999"}), HasSubstr("octal"));
  EXPECT_THAT(refusal({"--stale", "never"}), HasSubstr("hold, purge, halt or stop"));
  EXPECT_THAT(refusal({"--policy", "idle"}), HasSubstr("other, fifo or rr"));
  EXPECT_THAT(refusal({"--cpus", ""}), HasSubstr("2,3"));
  EXPECT_THAT(refusal({"--gain"}), HasSubstr("needs a value"));
  EXPECT_THAT(refusal({"--gian", "2"}), HasSubstr("there is no flag --gian"));
  EXPECT_THAT(refusal({"--gian", "2"}), HasSubstr("Did you mean --gain?"));
  EXPECT_THAT(refusal({"--frequenzy=2"}), HasSubstr("no flag --frequenzy. Did you mean --freq"));
  EXPECT_THAT(refusal({"--la", "2"}), HasSubstr("--la may be --lanes, --lane-blocks"));
  EXPECT_THAT(refusal({"stray"}), HasSubstr("'stray' is not a flag"));
  EXPECT_THAT(refusal({"gain=2"}), HasSubstr("for example --gain=2"));
  const char* const no_value = "--bursting takes no value, got '0'";
  EXPECT_THAT(refusal({"--bursting", "0"}), HasSubstr(no_value));
  EXPECT_THAT(refusal({"--bursting=0"}), HasSubstr(no_value));
  EXPECT_THAT(refusal({"--gain", "fast"}),
              HasSubstr("robot 'puppet': option 'gain' must be a number, got 'fast'"));
  EXPECT_THAT(refusal({"--fails", "often"}), HasSubstr("must be one of: never"));
  EXPECT_EQ(Puppet::calls.constructed, 0);
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
  std::string program = "o80-run";
  char* words[] = {program.data(), nullptr};
  EXPECT_THAT(message_of<InvalidArgument>(
                  [&] { parse_run_options(*robot_table<Greedy>("greedy"), 1, words); }),
              AllOf(HasSubstr("'lane_blocks'"), HasSubstr("rename it")));
}

/// A robot with more options than there are characters that getopt_long could mistake them for.
struct Settable {
  struct Config {
    int option_0 = 0;
    int option_1 = 0;
    int option_2 = 0;
    int option_3 = 0;
    int option_4 = 0;
    int option_5 = 0;
    int option_6 = 0;
    int option_7 = 0;
    int option_8 = 0;
    int option_9 = 0;
    int option_10 = 0;
    int option_11 = 0;
    int option_12 = 0;
    int option_13 = 0;
    int option_14 = 0;
    int option_15 = 0;
    int option_16 = 0;
    int option_17 = 0;
    int option_18 = 0;
    int option_19 = 0;
    int option_20 = 0;
    int option_21 = 0;
    int option_22 = 0;
    int option_23 = 0;
    int option_24 = 0;
    int option_25 = 0;
    int option_26 = 0;
    int option_27 = 0;
    int option_28 = 0;
    int option_29 = 0;
    int option_30 = 0;
    int option_31 = 0;
    int option_32 = 0;
    int option_33 = 0;
    int option_34 = 0;
    int option_35 = 0;
    int option_36 = 0;
    int option_37 = 0;
    int option_38 = 0;
    int option_39 = 0;
  };
  using Actuators = NoActuators;
  explicit Settable(const Config&) {}
  void start() {}
  void write(const Desired<Settable>&) {}
  void read(Reading<Settable>&) {}
  void stop() noexcept {}
};
O80_DESCRIBE(Settable::Config, option_0, option_1, option_2, option_3, option_4, option_5, option_6,
             option_7, option_8, option_9, option_10, option_11, option_12, option_13, option_14,
             option_15, option_16, option_17, option_18, option_19, option_20, option_21, option_22,
             option_23, option_24, option_25, option_26, option_27, option_28, option_29, option_30,
             option_31, option_32, option_33, option_34, option_35, option_36, option_37, option_38,
             option_39);

TEST_F(RunOptionsTest, EveryOneOfManyOptionsIsRead) {
  const RobotTable& table = *robot_table<Settable>("settable");
  for (const Option& option : options_of(table)) {
    for (const bool dashes : {true, false}) {
      std::string program = "o80-run";
      std::string word = "--" + option.name + "=7";
      if (dashes) std::ranges::replace(word, '_', '-');
      char* words[] = {program.data(), word.data(), nullptr};
      EXPECT_THAT(parse_run_options(table, 2, words).robot, ElementsAre(Pair(option.name, "7")))
          << word;
    }
  }
}

}  // namespace
}  // namespace o80::test
