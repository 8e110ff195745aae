
#include <fcntl.h>
#include <gmock/gmock.h>

#include <optional>

#include "memory/blocks.hpp"
#include "memory/child_process.hpp"
#include "memory/segment/liveness.hpp"
#include "memory/segment/signal.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"

namespace o80 {
namespace {

using ForkTest = SegmentTest;

TEST_F(ForkTest, MarksEveryObjectOfTheParentAsUsedAfterFork) {
  const OwnedSegment owner = running_segment();
  const AttachedSegment segment = attach();
  LaneSender sender(segment);
  RowWaiter waiter(segment);
  const auto text = [](auto&& call) { return message_of<UsedAfterFork>(call); };

  EXPECT_EQ(in_child([&] {
              int failures = 0;
              for (const std::string& said :
                   {text([&] { segment.throw_if_gone(); }), text([&] { segment.check_process(); }),
                    text([&] { send(sender, 1); }), text([&] { owner.check_process(); }),
                    text([&] { waiter.wait_for_row(0, patient()); }),
                    text([&] { LaneSender again(segment); })})
                if (said.find("open it again in this process") == std::string::npos) ++failures;
              return failures;
            }),
            0);
  EXPECT_NO_THROW(segment.throw_if_gone());
  EXPECT_NO_THROW(send(sender, 1));
}

TEST_F(ForkTest, LetsAChildOpenEverythingAgain) {
#ifdef O80_TEST_SANITIZED
  GTEST_SKIP() << "a sanitizer's own locks may be held by a thread that a forked child lacks";
#endif
  const OwnedSegment owner = running_segment();
  const LaneLiveness liveness(owner);
  const AttachedSegment segment = attach();
  const LaneSender sender(segment);

  EXPECT_EQ(in_child([&] {
              const AttachedSegment mine = attach();
              LaneSender lane(mine);
              const OwnedSegment own = running_segment(small_spec("own"));
              LaneLiveness watch(own);
              watch.refresh();
              return lane.lane() == 1 ? 0 : 1;
            }),
            0);
}

TEST_F(ForkTest, LeavesFileLockAndLaneToTheParentWhenTheChildEndsInOrder) {
  OwnedSegment owner = running_segment();
  AttachedSegment segment = attach();
  std::optional<LaneSender> sender(std::in_place, segment);
  EXPECT_EQ(in_child([&] {
              // as if the child left the scope of its parent's objects
              {
                const OwnedSegment gone = std::move(owner);
              }
              sender.reset();
              {
                const AttachedSegment gone = std::move(segment);
              }
              return 0;
            }),
            0);
  EXPECT_EQ(segment.life(), Life::running);
  EXPECT_TRUE(std::filesystem::exists(directory_.file_of("arm")));
  EXPECT_TRUE(is_byte_locked(segment.commands_descriptor(), kFirstLaneByte));
  EXPECT_EQ(owner.state(), BackendState::running);
}

TEST_F(ForkTest, DoesNotKeepADeadBackendAliveInItsChild) {
  int test_lives[2];
  ASSERT_EQ(pipe(test_lives), 0);
  ChildProcess backend([&](const ChildProcess::Ready& ready) {
    ::close(test_lives[1]);
    const OwnedSegment owner = running_segment();
    if (fork() == 0) {
      // lives on after its parent, with all that it inherited, until the test is over
      ready();
      char byte;
      while (read(test_lives[0], &byte, 1) > 0) {
      }
      _exit(0);
    }
    pause_for_ever();
  });
  ::close(test_lives[0]);
  ASSERT_TRUE(backend.wait_until_ready());
  const AttachedSegment segment = attach();
  EXPECT_EQ(segment.life(), Life::running);
  backend.kill_now();

  EXPECT_EQ(segment.life(), Life::killed);
  EXPECT_NO_THROW(running_segment());
  ::close(test_lives[1]);
}

}  // namespace
}  // namespace o80
