#include "balls/contact_record.hpp"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <limits>

namespace o80::mujoco {
namespace {

using testing::Each;

const Ball kBall{{}, {0, 3, 4}, {}};

/// Records of a ball with two watched surfaces and two others.
class ContactRecordsTest : public testing::Test {
 protected:
  const Surface bat_{.watched = true, .record = 0};
  const Surface glove_{.watched = true, .record = 1};
  const Surface floor_{.watched = false, .record = 0};
  const Surface wall_{.watched = false, .record = 1};
  std::array<WatchedContacts, 2> watched_;
  std::array<SurfaceContacts, 2> others_;
  ContactRecords records_{watched_, others_};

  void meet(const Surface& surface, std::int64_t iteration, const Ball& after = kBall) {
    const Contact contact{.surface = &surface,
                          .share = 0.5,
                          .point = {0.1, static_cast<double>(iteration), 0.7},
                          .normal = {0, 0, 1}};
    records_.add({.iteration = iteration}, contact, kBall, after);
  }
};

TEST_F(ContactRecordsTest, OfOtherSurfacesTheFirstContactAfterAWatchedOneCounts) {
  meet(floor_, 3);
  meet(bat_, 10);
  meet(floor_, 90);
  meet(floor_, 95);
  meet(wall_, 97);

  EXPECT_EQ(others_[0].count, 3);
  EXPECT_EQ(others_[0].iteration, 90);
  EXPECT_EQ(others_[0].position, (std::array<double, 3>{0.1, 90, 0.7}));
  EXPECT_EQ(others_[1].iteration, 97);
  EXPECT_EQ(watched_[0].iteration, 10);
  EXPECT_EQ(watched_[0].smallest_distance, 0);
}

TEST_F(ContactRecordsTest, WithNothingWatchedTheFirstContactOfAllCounts) {
  records_.watched = {};
  meet(floor_, 3);
  meet(floor_, 4);

  EXPECT_EQ(others_[0].count, 2);
  EXPECT_EQ(others_[0].iteration, 3);
}

TEST_F(ContactRecordsTest, EachWatchedSurfaceKeepsItsOwnFirstContact) {
  meet(glove_, 5);
  meet(bat_, 8);
  meet(glove_, 9);

  EXPECT_EQ(watched_[0].iteration, 8);
  EXPECT_EQ(watched_[0].count, 1);
  EXPECT_EQ(watched_[1].iteration, 5);
  EXPECT_EQ(watched_[1].count, 2);
}

TEST_F(ContactRecordsTest, TheLargestSpeedIsThatSinceTheFirstContact) {
  records_.add_velocity({50, 0, 0});
  meet(bat_, 8);
  EXPECT_EQ(watched_[0].largest_speed, 5);
  meet(floor_, 9, {{}, {0, 6, 8}, {}});
  records_.add_velocity({0, 0, 7});

  EXPECT_EQ(watched_[0].largest_speed, 10);
  EXPECT_EQ(watched_[1].largest_speed, 0);
}

TEST_F(ContactRecordsTest, GapsAreKeptForWatchedSurfacesUntilCleared) {
  records_.add_gap(bat_, 0.4);
  records_.add_gap(bat_, 0.3);
  records_.add_gap(bat_, 0.5);
  records_.add_gap(floor_, 0.1);
  EXPECT_EQ(watched_[0].smallest_distance, 0.3);

  meet(bat_, 1);
  meet(floor_, 2);
  records_.clear();
  EXPECT_EQ(watched_[0].smallest_distance, std::numeric_limits<double>::infinity());
  EXPECT_EQ(watched_[0].count, 0);
  EXPECT_EQ(watched_[0].iteration, -1);
  EXPECT_EQ(others_[0].count, 0);
  EXPECT_EQ(others_[0].iteration, -1);
}

TEST_F(ContactRecordsTest, TheFractionCountsTheStepsOfAnIteration) {
  const Contact contact{.surface = &bat_, .share = 0.5};
  records_.add({.iteration = 1, .number = 3, .count = 4}, contact, kBall, kBall);

  EXPECT_EQ(watched_[0].fraction, 0.875);
}

}  // namespace
}  // namespace o80::mujoco
