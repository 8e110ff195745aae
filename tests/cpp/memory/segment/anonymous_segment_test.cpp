#include "memory/segment/anonymous_file.hpp"

#include <fcntl.h>
#include <gmock/gmock.h>
#include <sys/stat.h>

#include "memory/blocks.hpp"
#include "memory/child_process.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"
#include "o80/memory/segment_list.hpp"

namespace o80 {
namespace {

using ::testing::HasSubstr;

class AnonymousSegmentTest : public SegmentTest {
 protected:
  static SegmentSpec anonymous_spec() {
    SegmentSpec spec = small_spec("arm[3]");
    spec.anonymous = true;
    return spec;
  }
  static OwnedSegment running_anonymous() { return running_segment(anonymous_spec()); }
};

TEST_F(AnonymousSegmentTest, HasNoFileInTheDirectoryAndWorksLikeANamedOne) {
  const OwnedSegment owner = running_anonymous();
  EXPECT_EQ(directory_.files(), 0U);
  const AttachedSegment segment = AttachedSegment::attach(owner);
  LaneSender sender(segment);
  EXPECT_NO_THROW(send(sender, 1));
  EXPECT_EQ(segment.life(), Life::running);
  EXPECT_TRUE(is_byte_locked(segment.commands_descriptor(), kFirstLaneByte));
  EXPECT_EQ(segment.name(), "arm[3]");
}

TEST_F(AnonymousSegmentTest, EndsForItsFrontendsWithItsOwner) {
  for (const bool named : {false, true}) {
    std::optional<OwnedSegment> owner = running_anonymous();
    if (named) owner->publish("arm");
    const AttachedSegment segment = AttachedSegment::attach(*owner);
    owner.reset();
    EXPECT_EQ(segment.life(), Life::stopped);
    EXPECT_EQ(directory_.files(), 0U);
  }
}

TEST_F(AnonymousSegmentTest, IsLeftNowhereByAKilledProcess) {
  StandingProcess child([](const StandingProcess::Stand& stand) {
    const OwnedSegment one = running_anonymous();
    const OwnedSegment other = running_anonymous();
    stand();
  });
  child.kill_now();
  EXPECT_EQ(directory_.files(), 0U);
}

TEST_F(AnonymousSegmentTest, GetsANameOnRequest) {
  OwnedSegment owner = running_anonymous();
  const AttachedSegment before = AttachedSegment::attach(owner);
  LaneSender sender(before);
  owner.publish("arm");
  EXPECT_EQ(directory_.files(), 2U);

  const AttachedSegment after = attach("arm");
  EXPECT_EQ(after.epoch(), before.epoch());
  EXPECT_EQ(after.life(), Life::running);
  EXPECT_NO_THROW(send(sender, 1));
  LaneSender second(after);
  EXPECT_EQ(second.lane(), 1U);
  EXPECT_THROW(OwnedSegment::create(small_spec("arm")), SegmentTaken);
  EXPECT_THAT(message_of<Error>([&] { owner.publish("again"); }), HasSubstr("has a name already"));
}

TEST_F(AnonymousSegmentTest, DoesNotTakeTheNameOfALivingBackend) {
  const OwnedSegment named = running_segment();
  OwnedSegment owner = running_anonymous();
  EXPECT_THROW(owner.publish("arm"), SegmentTaken);
  EXPECT_THROW(owner.publish("no name"), InvalidArgument);
  EXPECT_EQ(directory_.files(), 2U);
  // it is as it was
  EXPECT_EQ(AttachedSegment::attach(owner).life(), Life::running);
  owner.publish("other");
  EXPECT_EQ(attach("other").life(), Life::running);
}

TEST_F(AnonymousSegmentTest, ReplacesAKilledBackendOfThatName) {
  StandingProcess child([](const StandingProcess::Stand& stand) {
    const OwnedSegment dead = running_segment();
    stand();
  });
  const AttachedSegment former = attach();
  child.kill_now();
  OwnedSegment owner = running_anonymous();
  owner.publish("arm");
  EXPECT_EQ(former.life(), Life::superseded);
  EXPECT_EQ(attach().epoch(), owner.epoch());
  EXPECT_EQ(directory_.files(), 2U);
}

TEST_F(AnonymousSegmentTest, WorksOnAFileSystemThatCannotMakeFilesWithoutAName) {
  const LockFile file = create_unlinked();
  ASSERT_TRUE(file.is_open());
  EXPECT_EQ(directory_.files(), 0U);
  const LockFile again = open_again(file, O_RDWR);
  ASSERT_TRUE(again.is_open());
  EXPECT_FALSE(link_open_file(file, directory_.file_of("arm")));
  EXPECT_EQ(errno, ENOENT);
}

}  // namespace
}  // namespace o80
