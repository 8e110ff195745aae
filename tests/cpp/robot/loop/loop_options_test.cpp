#include "robot/loop/loop_options.hpp"

#include <cstring>
#include <string>

#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

using OptionKind = LoopOption::Kind;

/// Whether an option may have this text.
bool takes(const LoopOption& option, const std::string& text) {
  LoopOptions options;
  return message_of<InvalidArgument>([&] { set_loop_option(options, option, text, "it"); }).empty();
}

TEST(LoopOptionsTest, AreFoundByTheirNames) {
  for (const LoopOption& option : loop_options()) {
    EXPECT_EQ(find_loop_option(option.name), &option);
    EXPECT_EQ(std::strchr(option.name, '-'), nullptr) << "a keyword of Python";
  }
  EXPECT_EQ(find_loop_option("frequenzy"), nullptr);
}

TEST(LoopOptionsTest, NumbersKeepToTheirRange) {
  for (const LoopOption& option : loop_options()) {
    if (option.kind != OptionKind::number && option.kind != OptionKind::integer) continue;
    SCOPED_TRACE(option.name);
    EXPECT_TRUE(takes(option, std::to_string(static_cast<long>(option.maximum))));
    EXPECT_FALSE(takes(option, std::to_string(static_cast<long>(option.maximum) + 1)));
    EXPECT_EQ(takes(option, "0"), option.minimum == 0);
    EXPECT_FALSE(takes(option, "-3"));
    EXPECT_FALSE(takes(option, "nan"));
    EXPECT_FALSE(takes(option, "inf"));
    EXPECT_FALSE(takes(option, ""));
    EXPECT_FALSE(takes(option, "5 "));
    EXPECT_FALSE(takes(option, "0x10"));
    EXPECT_EQ(takes(option, "5.5"), option.kind == OptionKind::number);
  }
}

TEST(LoopOptionsTest, OtherKindsTakeWhatTheirTextSays) {
  const auto option = [](const char* name) { return *find_loop_option(name); };
  for (const char* stale : {"hold", "purge", "halt", "stop"}) {
    EXPECT_TRUE(takes(option("stale"), stale));
    EXPECT_THAT(option("stale").allowed, HasSubstr(stale));
  }
  EXPECT_FALSE(takes(option("stale"), "Hold"));
  EXPECT_TRUE(takes(option("cpus"), "2"));
  EXPECT_TRUE(takes(option("cpus"), "2,3"));
  for (const char* list : {"", ",", "2,", "2,,3", "-1", "1024", "2;3"}) {
    EXPECT_FALSE(takes(option("cpus"), list)) << list;
  }
  EXPECT_TRUE(takes(option("permission"), "0640"));
  for (const char* mode : {"", "200", "1777", "0o640", "8", "-600"}) {
    EXPECT_FALSE(takes(option("permission"), mode)) << mode;
  }
  EXPECT_FALSE(takes(option("bursting"), "1"));
}

TEST(LoopOptionsTest, WhatHoldsOtherwiseIsTheDefault) {
  const LoopOptions defaults;
  LoopOptions options;
  options.backend.lanes = 1;
  options.backend.lane_blocks = 1;
  options.backend.permission = 0;
  for (const char* name : {"lanes", "lane_blocks", "permission", "policy"}) {
    const LoopOption& option = *find_loop_option(name);
    set_loop_option(options, option, option.otherwise, name);
  }
  EXPECT_EQ(options.backend.lanes, defaults.backend.lanes);
  EXPECT_EQ(options.backend.lane_blocks, defaults.backend.lane_blocks);
  EXPECT_EQ(options.backend.permission, defaults.backend.permission);
  EXPECT_EQ(options.real_time.policy, defaults.real_time.policy);
}

}  // namespace
}  // namespace o80::test
