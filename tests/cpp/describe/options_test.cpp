#include "o80/describe/options.hpp"

#include <gmock/gmock.h>

#include "describe/described.hpp"

namespace o80 {
namespace {

using described::Config;
using described::ConfigOfParts;
using described::ControlMode;
using ::testing::AllOf;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

TEST(Options, SayNameKindDefaultHelpAndUnit) {
  const std::vector<Option> options = options_of<Config>();
  ASSERT_EQ(options.size(), 7U);
  EXPECT_EQ(options[0].name, "address");
  EXPECT_EQ(options[0].kind, "text");
  EXPECT_EQ(options[0].default_text, "192.168.0.1");
  EXPECT_EQ(options[0].help, "where the arm listens");
  EXPECT_EQ(options[1].kind, "number");
  EXPECT_EQ(options[1].unit, "Nm/rad");
  EXPECT_EQ(options[2].kind, "integer");
  EXPECT_EQ(options[3].kind, "boolean");
  EXPECT_EQ(options[3].default_text, "true");
  EXPECT_EQ(options[4].kind, "one of: off, position, torque");
  EXPECT_EQ(options[4].default_text, "position");
  EXPECT_EQ(options[5].kind, "3 x number");
}

TEST(Options, ReadBackWhatTheyPrint) {
  Config config;
  config.address = "a b,c";
  config.gain = 0.1;
  config.count = 77;
  config.fast = false;
  config.mode = ControlMode::torque;
  config.offsets = {1.0 / 3.0, -1e300, 5};
  config.small = 3;
  Config again;
  o80_describe(Tag<Config>{}, [&]<class Field>(std::string_view name, Field Config::* member,
                                               std::size_t, std::string_view) {
    set_option(again, name, describing::option_text(config.*member));
  });
  EXPECT_EQ(again.address, config.address);
  EXPECT_EQ(again.gain, config.gain);
  EXPECT_EQ(again.count, config.count);
  EXPECT_EQ(again.fast, config.fast);
  EXPECT_EQ(again.mode, config.mode);
  EXPECT_EQ(again.offsets, config.offsets);
  EXPECT_EQ(again.small, config.small);
}

TEST(Options, OfAStructAmongTheFieldsAreListedAndSetUnderTheirOwnNames) {
  std::vector<std::string> names;
  for (const Option& option : options_of<ConfigOfParts>()) names.push_back(option.name);
  EXPECT_THAT(names, ElementsAre("address", "grip", "fingers", "count"));
  EXPECT_EQ(options_of<ConfigOfParts>()[1].unit, "N");
  EXPECT_EQ(options_of<ConfigOfParts>()[2].default_text, "1,2");

  ConfigOfParts config;
  set_option(config, "fingers", "3,4");
  set_option(config, "count", "7");
  EXPECT_EQ(config.gripper.fingers, (std::array<double, 2>{3, 4}));
  EXPECT_EQ(config.count, 7);
  EXPECT_THAT(message_of<InvalidArgument>([&] { set_option(config, "gripper", "1"); }),
              AllOf(HasSubstr("no option 'gripper'"), HasSubstr("grip")));
}

struct GripperTwice {
  double grip = 0;
  described::GripperConfig gripper;
};
O80_DESCRIBE(GripperTwice, grip, gripper);

TEST(Options, WithTheSameNameAreFoundWhenTheyAreCompiled) {
  static_assert(describing::has_repeated_option<GripperTwice>());
  static_assert(!describing::has_repeated_option<ConfigOfParts>());
}

std::string refusal(std::string_view name, std::string_view text) {
  Config config;
  return message_of<InvalidArgument>([&] { set_option(config, name, text); });
}

TEST(Options, RefuseWhatIsNoSuchValue) {
  EXPECT_THAT(refusal("gain", "fast"), HasSubstr("option 'gain' must be a number, got 'fast'"));
  EXPECT_NE(refusal("gain", "1.5x"), "");
  EXPECT_NE(refusal("gain", ""), "");
  EXPECT_NE(refusal("count", "1.5"), "");
  EXPECT_NE(refusal("small", "256"), "");
  EXPECT_NE(refusal("small", "-1"), "");
  EXPECT_NE(refusal("fast", "maybe"), "");
  EXPECT_THAT(refusal("mode", "fly"), HasSubstr("one of: off, position, torque"));
  EXPECT_NE(refusal("offsets", "1,2"), "");
  EXPECT_NE(refusal("offsets", "1,2,3,4"), "");
  EXPECT_NE(refusal("offsets", "1,,3"), "");
}

TEST(Options, ListWhatThereIs) {
  EXPECT_THAT(refusal("gian", "1"), HasSubstr("no option 'gian'. Did you mean 'gain'?"));
  EXPECT_THAT(
      refusal("wheels", "1"),
      AllOf(HasSubstr("no option 'wheels'; there are: address, gain, count"), HasSubstr(" more")));
  described::Home none;
  EXPECT_THAT(message_of<InvalidArgument>([&] { set_option(none, "x", "1"); }),
              HasSubstr("this robot has none"));
}

}  // namespace
}  // namespace o80
