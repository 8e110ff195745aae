#include "memory/segment/attached_segment.hpp"

#include <gmock/gmock.h>

#include <fcntl.h>
#include <unistd.h>

#include <cstring>
#include <future>
#include <thread>

#include "memory/file_bytes.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"
#include "o80/memory/segment_list.hpp"

namespace o80 {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using AttachedSegmentTest = SegmentTest;

TEST_F(AttachedSegmentTest, SeesSchemaAndEpochOfItsBackend) {
  const char text[] = "what the rows mean";
  SegmentSpec spec = small_spec();
  spec.schema = std::as_bytes(std::span(text));
  const OwnedSegment owner = running_segment(spec);

  const AttachedSegment segment = attach();

  ASSERT_EQ(segment.schema().size(), sizeof text);
  EXPECT_EQ(std::memcmp(segment.schema().data(), text, sizeof text), 0);
  EXPECT_EQ(segment.epoch(), owner.epoch());
  EXPECT_EQ(segment.header().pid, getpid());
  EXPECT_EQ(segment.life(), Life::running);
  EXPECT_NO_THROW(segment.throw_if_gone());
}

TEST_F(AttachedSegmentTest, GivesUpAtItsDeadlineListingWhatThereIs) {
  const OwnedSegment other = running_segment(small_spec("leg"));

  EXPECT_THAT(
      message_of<TimeoutError>([] { AttachedSegment::attach("arm", Access::read_only, soon()); }),
      AllOf(HasSubstr("'arm'"), HasSubstr("no segment has that name"), HasSubstr("leg (running)")));
}

TEST_F(AttachedSegmentTest, WaitsForABackendThatComesLaterAndStartsSlowly) {
  std::promise<void> looked;
  std::atomic<int> checks{0};
  std::thread backend([&] {
    while (checks < 2) std::this_thread::yield();
    OwnedSegment segment = OwnedSegment::create(small_spec());
    const int seen = checks;
    while (checks < seen + 2) std::this_thread::yield();
    segment.set_state(BackendState::running);
    looked.get_future().wait();
  });
  const KeepWaiting count = [&] {
    ++checks;
    return true;
  };

  const AttachedSegment segment =
      AttachedSegment::attach("arm", Access::read_write, patient(), {.keep_waiting = count});

  EXPECT_EQ(segment.life(), Life::running);
  looked.set_value();
  backend.join();
}

TEST_F(AttachedSegmentTest, RaisesTheFaultOfABackendThatCouldNotStart) {
  OwnedSegment owner = OwnedSegment::create(small_spec());
  owner.end(BackendState::failed, "the arm does not answer at 10.0.0.2");

  EXPECT_THAT(message_of<BackendFailed>([] { attach(); }),
              HasSubstr("the arm does not answer at 10.0.0.2"));
}

TEST_F(AttachedSegmentTest, EndsItsWaitWhenTheCallerSaysSo) {
  EXPECT_THROW(AttachedSegment::attach("arm", Access::read_only, patient(),
                                       {.keep_waiting = [] { return false; }}),
               Cancelled);
}

TEST_F(AttachedSegmentTest, RefusesEveryCorruptedHeaderWithoutCrashing) {
  const std::string path = directory_.file_of("arm");
  running_segment().end(BackendState::failed);
  const std::vector<char> whole = read_all(path);
  // whatever the numbers say, either it is refused or all of it lies within the file
  for (std::size_t i = 0; i < offsetof(SegmentHeader, started_at); ++i)
    for (const int value : {0, 1, 127, 255}) {
      std::vector<char> bytes = whole;
      bytes[i] = static_cast<char>(value);
      write_all(path, bytes);
      try {
        const auto segment = attach_dead(Access::read_write);
        EXPECT_LE(segment.view().offsets.file_bytes, whole.size());
        // the last byte of the last part: out of bounds would end the test
        const SegmentView& view = segment.view();
        const volatile std::byte last = view.history()[view.shape.slots * view.shape.row_bytes - 1];
        static_cast<void>(last);
      } catch (const SegmentError&) {
        SUCCEED();
      } catch (const TimeoutError& error) {
        // of another epoch: its commanders' file is not there
        EXPECT_THAT(error.what(), HasSubstr("commanders' file"));
      }
    }
}

TEST_F(AttachedSegmentTest, KnowsHowItsBackendEnded) {
  OwnedSegment owner = running_segment();
  const AttachedSegment segment = attach();
  owner.end(BackendState::stopped);
  EXPECT_EQ(segment.life(), Life::stopped);
  EXPECT_THAT(message_of<BackendStopped>([&] { segment.throw_if_gone(); }),
              AllOf(HasSubstr("'arm'"), HasSubstr("stopped"), HasSubstr("attach again")));
  EXPECT_THROW(segment.throw_if_known_gone(), BackendStopped);

  owner.end(BackendState::failed, "joint 2 is too hot");
  EXPECT_THAT(message_of<BackendFailed>([&] { segment.throw_if_gone(); }),
              HasSubstr("joint 2 is too hot"));
  EXPECT_EQ(segment.fault(), "joint 2 is too hot");
}

TEST_F(AttachedSegmentTest, CutsAFaultThatIsTooLong) {
  OwnedSegment owner = running_segment();
  const AttachedSegment segment = attach();
  owner.end(BackendState::failed, std::string(5000, 'x'));
  EXPECT_EQ(segment.fault(), std::string(1023, 'x'));
}

TEST_F(AttachedSegmentTest, WaitsPastAStoppedSegmentUnlessItIsToBeRead) {
  running_segment().end(BackendState::failed);
  {
    const LockFile file = LockFile::open(directory_.file_of("arm"), O_RDWR);
    const auto stopped = static_cast<std::uint32_t>(BackendState::stopped);
    const auto where =
        static_cast<off_t>(attach_dead().view().offsets.counters + offsetof(Counters, state));
    ASSERT_EQ(pwrite(file.descriptor(), &stopped, sizeof stopped, where), 4);
  }

  EXPECT_THAT(
      message_of<TimeoutError>([] { AttachedSegment::attach("arm", Access::read_only, soon()); }),
      AllOf(HasSubstr("was stopped"), HasSubstr("no new one has started")));
  EXPECT_EQ(attach_dead().life(), Life::stopped);
}

using AttachedSegmentDeathTest = SegmentTest;

TEST_F(AttachedSegmentDeathTest, CannotWriteWhatBelongsToTheBackend) {
#ifdef O80_TEST_THREAD_SANITIZED
  GTEST_SKIP() << "clang's thread sanitizer does not let a forked child die of a fault";
#endif
  const OwnedSegment owner = running_segment();
  const AttachedSegment segment = attach();
  const AttachedSegment reader = attach("arm", Access::read_only);

  segment.view().bell().rung.fetch_add(1);
  EXPECT_DEATH(segment.view().counters().begun.store(1), "");
  EXPECT_DEATH(segment.view().history()[0] = std::byte{1}, "");
  EXPECT_DEATH(segment.view().feedback(0).freed.store(1), "");
  EXPECT_DEATH(segment.view().lane(0).committed.store(1), "");
  EXPECT_DEATH(reader.view().bell().rung.fetch_add(1), "");
}

}  // namespace
}  // namespace o80
