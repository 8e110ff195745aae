// A writer of the journal that is killed at every labelled point: readers see whole entries only.

#include "memory/ring/journal.hpp"

#include <gmock/gmock.h>
#include <sys/wait.h>

#include <array>

#include "base/crash_point.hpp"
#include "memory/segments.hpp"

namespace o80 {
namespace {

constexpr std::uint64_t kEntries = 300;
constexpr std::size_t kWords = 9;

std::array<std::uint64_t, kWords> words_of_entry(std::uint64_t number) {
  std::array<std::uint64_t, kWords> words;
  words.fill(number * 17);
  return words;
}

class KilledJournalTest : public SegmentTest, public ::testing::WithParamInterface<const char*> {
 protected:
  /// Writes in a process that is killed when it passes the label for the n-th time.
  static void write_until_killed(const char* label, long passage) {
    const pid_t child = fork();
    if (child == 0) {
      SegmentSpec spec = small_spec();
      spec.journal_bytes = kMinJournal;
      const OwnedSegment segment = running_segment(spec);
      JournalWriter writer(segment.view());
      crash_plan().label = label;
      crash_plan().passages_left = passage;
      for (std::uint64_t i = 0; i < kEntries; ++i) {
        writer.write({.iteration = static_cast<Iteration>(i)}, words_of_entry(i).data(),
                     8 * kWords);
      }
      _exit(0);
    }
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status) && WTERMSIG(status) == SIGKILL) << label;
  }
};

TEST_P(KilledJournalTest, LeavesEveryEntryThatWasPublishedAndNoOther) {
  const bool is_published = std::string_view(GetParam()) == "journal.after_published";
  for (const long passage : {1L, 2L, 38L, 39L, 40L, 41L, 200L, 300L}) {
    write_until_killed(GetParam(), passage);
    const auto end = static_cast<std::uint64_t>(is_published ? passage : passage - 1);
    const AttachedSegment attached =
        AttachedSegment::attach("arm", Access::read_only, patient(), {.dead = true});
    JournalReader reader(attached.view());
    JournalItem item;
    std::uint64_t next = 0;
    while (reader.next(item)) {
      ASSERT_EQ(item.head.number, next + item.missed);
      ASSERT_EQ(item.payload.size(), 8 * kWords);
      EXPECT_EQ(
          std::memcmp(item.payload.data(), words_of_entry(item.head.number).data(), 8 * kWords), 0);
      next = item.head.number + 1;
    }
    EXPECT_EQ(next, end) << passage;
  }
}

INSTANTIATE_TEST_SUITE_P(AtEachPoint, KilledJournalTest,
                         ::testing::Values("journal.before_begun", "journal.before_entry",
                                           "journal.before_published", "journal.after_published"));

}  // namespace
}  // namespace o80
