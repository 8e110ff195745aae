#include "o80/base/nearest_name.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace o80 {
namespace {

using Names = std::vector<std::string>;

TEST(NearestName, IsOneThatASlipOfTheFingersMakes) {
  const Names options{"frequency", "bursting", "gain", "reach"};

  EXPECT_EQ(nearest_name("frequenzy", options), "frequency");
  EXPECT_EQ(nearest_name("freqeuncy", options), "frequency");
  EXPECT_EQ(nearest_name("gian", options), "gain");
  EXPECT_EQ(nearest_name("Reach", options), "reach");
  EXPECT_EQ(nearest_name("burst", options), "bursting");
}

TEST(NearestName, TakesDashesForUnderscores) {
  EXPECT_EQ(nearest_name("two-joints", {"two_joints"}), "two_joints");
}

TEST(NearestName, IsEmptyIfNoneIsNear) {
  EXPECT_EQ(nearest_name("wheel", {"shoulder", "elbow"}), "");
  EXPECT_EQ(nearest_name("", {"shoulder"}), "");
  EXPECT_EQ(nearest_name("x", {"y"}), "");
  EXPECT_EQ(nearest_name(std::string(1000, 'a'), {"shoulder", std::string(1000, 'a')}), "");
}

TEST(NearestName, IsNotAnotherNumber) {
  EXPECT_EQ(nearest_name("joint_9", {"joint_0", "joint_1"}), "");
  EXPECT_EQ(nearest_name("jiont_1", {"joint_0", "joint_1"}), "joint_1");
}

TEST(NamesInstead, ListsAFewAndSaysWhichIsMeant) {
  EXPECT_EQ(names_instead("elbw", {"shoulder", "elbow"}),
            "; there are: shoulder, elbow. Did you mean 'elbow'?");
  EXPECT_EQ(names_instead("wheel", {"shoulder", "elbow"}), "; there are: shoulder, elbow");
  EXPECT_EQ(names_instead("wheel", {}), "; there are none");
}

TEST(NamesInstead, NeverListsMoreThanFive) {
  Names joints;
  for (int i = 0; i < 40; ++i) joints.push_back("joint_" + std::to_string(i));

  EXPECT_EQ(names_instead("wheel", joints),
            "; there are: joint_0, joint_1, joint_2, joint_3, joint_4 and 35 more");
  EXPECT_EQ(names_instead("jiont_17", joints), ". Did you mean 'joint_17'?");
}

}  // namespace
}  // namespace o80
