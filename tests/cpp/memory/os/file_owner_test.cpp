// Anybody may create a file that bears the name of a robot.

#include "memory/os/file_owner.hpp"

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <unistd.h>

#include "memory/child_process.hpp"
#include "memory/segment/segment_name.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"
#include "o80/memory/segment_list.hpp"

namespace o80 {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

class FileOwnerTest : public SegmentTest {
 protected:
  ~FileOwnerTest() override { unsetenv("O80_TRUST"); }
  void SetUp() override {
    if (geteuid() == kStranger) GTEST_SKIP() << "this user is the other one itself";
  }

  /// Both files of a segment now belong to another user; false if this user may not do that.
  bool give_away(const OwnedSegment& segment, gid_t group = kStranger) const {
    return chown(directory_.file_of("arm").c_str(), kStranger, group) == 0 &&
           chown(commands_path("arm", segment.epoch()).c_str(), kStranger, group) == 0;
  }
  static std::string refusal(Access access) {
    return message_of<SegmentError>([&] { AttachedSegment::attach("arm", access, soon()); });
  }

  std::string somebody_ = user_name(kStranger);
};

constexpr auto kNotRoot = "this user may not give files away";

TEST_F(FileOwnerTest, OfASquattedNameIsNamedToWhoeverAttaches) {
  const OwnedSegment segment = running_segment();
  if (!give_away(segment)) GTEST_SKIP() << kNotRoot;

  for (const Access access : {Access::read_only, Access::read_write})
    EXPECT_THAT(refusal(access),
                AllOf(HasSubstr("belongs to user " + somebody_),
                      HasSubstr("O80_TRUST=" + somebody_), HasSubstr(directory_.file_of("arm"))));
}

TEST_F(FileOwnerTest, OfASquattedNameIsListedInsteadOfWhatTheFileSays) {
  const OwnedSegment segment = running_segment();
  if (!give_away(segment)) GTEST_SKIP() << kNotRoot;

  const SegmentEntry entry = list_segments().at(0);

  EXPECT_FALSE(entry.readable);
  EXPECT_EQ(entry.user, somebody_);
  EXPECT_EQ(entry.pid, 0);
  EXPECT_THAT(entry.problem, HasSubstr("belongs to user " + somebody_));
}

TEST_F(FileOwnerTest, OfASquattedNameIsNamedToTheBackendThatWantsIt) {
  std::optional<OwnedSegment> segment = running_segment();
  if (!give_away(*segment)) GTEST_SKIP() << kNotRoot;
  const auto wanted = AllOf(HasSubstr("belongs to user " + somebody_), HasSubstr("O80_DIRECTORY"),
                            HasSubstr("--segment"));

  EXPECT_THAT(message_of<SegmentError>([] { OwnedSegment::refuse_if_taken("arm"); }), wanted);
  EXPECT_THAT(message_of<SegmentError>([] { OwnedSegment::create(small_spec()); }), wanted);
  // dead or alive
  segment->end(BackendState::failed);
  segment.reset();
  EXPECT_THAT(message_of<SegmentError>([] { OwnedSegment::create(small_spec()); }), wanted);
  EXPECT_TRUE(clean("arm"));
  EXPECT_EQ(directory_.files(), 0U);
}

TEST_F(FileOwnerTest, IsNamedAlsoWhereTheFileCannotBeOpened) {
  const OwnedSegment segment = running_segment();
  ASSERT_EQ(chmod(directory_.path().c_str(), 0777), 0);
  const int code = in_child([&] {
    if (!become_a_stranger()) return 9;
    const std::string owner = "of user " + user_name(0);
    if (refusal(Access::read_only).find(owner) == std::string::npos) return 1;
    const std::string said = message_of<SegmentError>([] { OwnedSegment::create(small_spec()); });
    if (said.find(owner) == std::string::npos) return 2;
    const SegmentEntry entry = list_segments().at(0);
    return entry.user == user_name(0) && entry.problem.find("denied") != std::string::npos ? 0 : 3;
  });
  if (code == 9) GTEST_SKIP() << "this user may not become another one";
  EXPECT_EQ(code, 0);
}

TEST_F(FileOwnerTest, IsTrustedIfTheEnvironmentNamesIt) {
  const OwnedSegment segment = running_segment();
  if (!give_away(segment)) GTEST_SKIP() << kNotRoot;

  for (const std::string& trusted :
       {somebody_, std::to_string(kStranger), "ada," + somebody_, somebody_ + ",bob"}) {
    setenv("O80_TRUST", trusted.c_str(), 1);
    EXPECT_EQ(attach().life(), Life::running) << trusted;
    EXPECT_TRUE(list_segments().at(0).readable) << trusted;
  }
  for (const std::string& trusted : {std::string(","), somebody_ + "y", "x" + somebody_}) {
    setenv("O80_TRUST", trusted.c_str(), 1);
    EXPECT_THAT(refusal(Access::read_only), HasSubstr("belongs to")) << trusted;
  }
}

TEST_F(FileOwnerTest, IsTrustedIfTheFileIsReadableByAGroupOfThisUser) {
  SegmentSpec spec = small_spec();
  spec.permission = 0660;
  const OwnedSegment segment = running_segment(spec);
  if (!give_away(segment, getegid())) GTEST_SKIP() << kNotRoot;
  EXPECT_EQ(attach().life(), Life::running);

  ASSERT_EQ(chmod(directory_.file_of("arm").c_str(), 0604), 0);
  EXPECT_THAT(refusal(Access::read_only), HasSubstr("belongs to"));
}

TEST_F(FileOwnerTest, OfBothFilesMustBeTheSame) {
  const OwnedSegment segment = running_segment();
  if (chown(commands_path("arm", segment.epoch()).c_str(), kStranger, kStranger) != 0)
    GTEST_SKIP() << kNotRoot;
  EXPECT_THAT(refusal(Access::read_write), HasSubstr("another owner"));
  EXPECT_NO_THROW(attach("arm", Access::read_only));
}

TEST_F(FileOwnerTest, RootIsTrustedByEverybodyWhoMayReadButNotLetToCommand) {
  if (geteuid() != 0) GTEST_SKIP() << "this user is not root";
  SegmentSpec spec = small_spec();
  spec.permission = 0644;
  const OwnedSegment segment = running_segment(spec);
  ASSERT_EQ(chmod(directory_.path().c_str(), 0755), 0);
  EXPECT_EQ(in_child([&] {
              if (!become_a_stranger()) return 9;
              if (attach("arm", Access::read_only).life() != Life::running) return 1;
              if (!list_segments().at(0).readable) return 2;
              const std::string said = message_of<ReadOnly>([] { attach(); });
              return said.find("attach read-only") != std::string::npos &&
                             said.find("--permission 660") != std::string::npos
                         ? 0
                         : 3;
            }),
            0);
}

}  // namespace
}  // namespace o80
