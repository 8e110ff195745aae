// Processes that are killed at every labelled point of taking, giving up and cleaning a name.

#include <gmock/gmock.h>
#include <sys/wait.h>

#include <filesystem>
#include <functional>

#include "base/crash_point.hpp"
#include "memory/segment/segment_draft.hpp"
#include "memory/segment/segment_name.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"
#include "o80/memory/segment_list.hpp"

namespace o80 {
namespace {

using NamesTest = SegmentTest;
using Call = std::function<void()>;

/// In a process that is killed where it passes the label, or when it is done ("").
/// True if it was killed there.
bool killed_at(const std::string& label, const Call& call) {
  const pid_t child = fork();
  if (child == 0) {
    CrashPlan& plan = crash_plan();
    plan.label = label;
    plan.passages_left = label.empty() ? 0 : 1;
    try {
      call();
    } catch (...) {
      _exit(1);
    }
    if (label.empty()) raise(SIGKILL);
    _exit(0);
  }
  int status = 0;
  waitpid(child, &status, 0);
  return WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL;
}

void live_and_end() { running_segment(); }
[[noreturn]] void live_until_killed() {
  const OwnedSegment segment = running_segment();
  raise(SIGKILL);
  std::abort();
}

class KilledTest : public SegmentTest, public ::testing::WithParamInterface<const char*> {
 protected:
  /// What a backend leaves that was killed, beside the draft of a starter that was killed.
  static void leave_a_dead_segment() {
    // in this order: the backend sweeps when it starts
    ASSERT_TRUE(killed_at("segment.after_state", live_and_end));
    ASSERT_TRUE(killed_at("create.before_link", [] { SegmentDraft("leg").publish({}); }));
  }
  /// Whatever bears the name can be read and commanded.
  static void expect_whole() {
    for (const Access access : {Access::read_only, Access::read_write}) {
      try {
        const AttachedSegment segment = AttachedSegment::attach(
            "arm", access, Deadline(std::chrono::nanoseconds(0)), {.dead = true});
        EXPECT_TRUE(segment.gone());
      } catch (const TimeoutError& none) {
        EXPECT_THAT(none.what(), ::testing::HasSubstr("no segment has that name"));
      }
    }
  }
  /// The dead keep nothing: neither the name, nor a file.
  void expect_a_successor_and_nothing_left() {
    {
      const OwnedSegment next = running_segment();
      EXPECT_EQ(attach().epoch(), next.epoch());
      EXPECT_EQ(list_segments().size(), 1U);
      EXPECT_EQ(directory_.files(), 2U);
    }
    EXPECT_EQ(directory_.files(), 0U);
  }
};

using KilledStarterTest = KilledTest;

TEST_P(KilledStarterTest, LeavesANameThatIsWholeAndIsTakenOver) {
  leave_a_dead_segment();
  ASSERT_TRUE(killed_at(GetParam(), live_and_end)) << "it never came by there";
  expect_whole();
  expect_a_successor_and_nothing_left();
}

TEST_P(KilledStarterTest, LeavesNothingThatCannotBeCleaned) {
  leave_a_dead_segment();
  ASSERT_TRUE(killed_at(GetParam(), live_and_end));
  clean_dead();
  EXPECT_EQ(directory_.files(), 0U);
}

INSTANTIATE_TEST_SUITE_P(AtEveryPoint, KilledStarterTest,
                         ::testing::Values("sweep.before_draft", "sweep.after_draft",
                                           "sweep.after_commands", "create.before_lock",
                                           "create.after_lock", "create.after_draft",
                                           "create.before_link", "segment.before_end",
                                           "create.before_rename", "create.after_rename",
                                           "create.after_former", "segment.after_state",
                                           "segment.after_end", "segment.before_unlink",
                                           "segment.between_unlinks", "segment.after_unlink"));

using KilledFirstStarterTest = KilledTest;

TEST_P(KilledFirstStarterTest, LeavesANameThatIsWholeAndIsTakenOver) {
  ASSERT_TRUE(killed_at(GetParam(), live_and_end)) << "it never came by there";
  expect_whole();
  expect_a_successor_and_nothing_left();
}

INSTANTIATE_TEST_SUITE_P(AtEveryPoint, KilledFirstStarterTest,
                         ::testing::Values("create.before_lock", "create.after_lock",
                                           "create.after_draft", "create.before_link",
                                           "create.after_link", "segment.between_unlinks"));

using KilledCleanerTest = KilledTest;

TEST_P(KilledCleanerTest, LeavesANameThatIsWholeAndIsTakenOver) {
  leave_a_dead_segment();
  ASSERT_TRUE(killed_at(GetParam(), [] { clean_dead(); })) << "it never came by there";
  expect_whole();
  expect_a_successor_and_nothing_left();
}

INSTANTIATE_TEST_SUITE_P(AtEveryPoint, KilledCleanerTest,
                         ::testing::Values("sweep.before_draft", "sweep.after_draft",
                                           "sweep.after_commands", "clean.before_unlink",
                                           "clean.between_unlinks", "clean.after_unlink"));

TEST_F(NamesTest, IsTakenOverAlsoWhenTheCommandersFileWasRemovedByHand) {
  ASSERT_TRUE(killed_at("", live_until_killed));
  std::filesystem::remove(commands_path("arm", list_segments().at(0).epoch));

  const OwnedSegment next = running_segment();

  EXPECT_EQ(attach().epoch(), next.epoch());
  EXPECT_EQ(directory_.files(), 2U);
}

TEST_F(NamesTest, IsKeptByALivingBackendWhoseCommandersFileWasRemovedByHand) {
  const OwnedSegment living = running_segment();
  std::filesystem::remove(commands_path("arm", living.epoch()));

  EXPECT_THROW(running_segment(), SegmentTaken);
  EXPECT_THROW(clean("arm"), SegmentTaken);
  EXPECT_THAT(clean_dead(), ::testing::ElementsAre());
  EXPECT_EQ(attach("arm", Access::read_only).life(), Life::running);
  EXPECT_THAT(
      message_of<TimeoutError>([] { AttachedSegment::attach("arm", Access::read_write, soon()); }),
      ::testing::HasSubstr("commanders' file"));
}

}  // namespace
}  // namespace o80
