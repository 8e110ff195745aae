#include "memory/segment/owned_segment.hpp"

#include <gmock/gmock.h>
#include <signal.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>
#include <optional>

#include "memory/child_process.hpp"
#include "memory/segment/segment_name.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"
#include "o80/memory/segment_list.hpp"

namespace o80 {
namespace {

using ::testing::AllOf;
using ::testing::Contains;
using ::testing::ElementsAre;
using ::testing::Field;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using OwnedSegmentTest = SegmentTest;

struct stat status_of(const std::string& path) {
  struct stat status{};
  EXPECT_EQ(stat(path.c_str(), &status), 0) << path;
  return status;
}

TEST_F(OwnedSegmentTest, IsTwoFilesThatGoWithTheirOwner) {
  EXPECT_NO_THROW(OwnedSegment::refuse_if_taken("arm"));
  {
    const OwnedSegment segment = OwnedSegment::create(small_spec());
    EXPECT_EQ(directory_.files(), 2U);
    EXPECT_TRUE(std::filesystem::exists(directory_.file_of("arm")));
    EXPECT_TRUE(std::filesystem::exists(commands_path("arm", segment.epoch())));
  }
  EXPECT_EQ(directory_.files(), 0U);
}

TEST_F(OwnedSegmentTest, LetsThoseObserveWhoMayReadAndThoseCommandWhoMayWrite) {
  struct Case {
    mode_t permission, segment, commands;
  };
  const mode_t before = umask(0077);
  for (const Case& modes : {Case{0600, 0600, 0600}, Case{0640, 0640, 0600}, Case{0644, 0644, 0600},
                            Case{0660, 0640, 0660}, Case{0664, 0644, 0660}, Case{0666, 0644, 0666},
                            Case{0620, 0640, 0660}, Case{0, 0600, 0600}}) {
    SegmentSpec spec = small_spec();
    spec.permission = modes.permission;
    const OwnedSegment segment = OwnedSegment::create(spec);
    EXPECT_EQ(status_of(directory_.file_of("arm")).st_mode & 0777, modes.segment);
    EXPECT_EQ(status_of(commands_path("arm", segment.epoch())).st_mode & 0777, modes.commands);
  }
  umask(before);
}

TEST_F(OwnedSegmentTest, HasItsMemoryReserved) {
  const OwnedSegment segment = OwnedSegment::create(small_spec());

  for (const std::string& path :
       {directory_.file_of("arm"), commands_path("arm", segment.epoch())}) {
    const struct stat status = status_of(path);
    EXPECT_GE(status.st_blocks * 512, status.st_size);
  }
}

TEST_F(OwnedSegmentTest, RefusesASecondLivingBackendNamingTheOwnerAndTheCure) {
  const OwnedSegment segment = OwnedSegment::create(small_spec());
  const auto wanted =
      AllOf(HasSubstr("segment 'arm' already has a backend (pid " + std::to_string(getpid())),
            HasSubstr(", started "), HasSubstr(" by "), HasSubstr("o80 stop arm"),
            HasSubstr("--segment"));

  EXPECT_THAT(message_of<SegmentTaken>([] { OwnedSegment::create(small_spec()); }), wanted);
  EXPECT_THAT(message_of<SegmentTaken>([] { OwnedSegment::refuse_if_taken("arm"); }), wanted);
  EXPECT_EQ(directory_.files(), 2U);
}

TEST_F(OwnedSegmentTest, KeepsItsFileWhenItFailedAndLetsItBeTakenOver) {
  {
    OwnedSegment segment = running_segment();
    segment.end(BackendState::failed, "no hardware");
  }
  EXPECT_EQ(directory_.files(), 2U);

  const OwnedSegment next = OwnedSegment::create(small_spec());
  EXPECT_EQ(directory_.files(), 2U);
  EXPECT_EQ(next.state(), BackendState::starting);
}

TEST_F(OwnedSegmentTest, TakesOverWhateverFileNobodyHolds) {
  std::ofstream(directory_.file_of("arm")) << "left by something else";

  const OwnedSegment segment = running_segment();

  EXPECT_EQ(attach().epoch(), segment.epoch());
}

TEST_F(OwnedSegmentTest, SaysWhenSharedMemoryIsTooSmallAndLeavesNothing) {
  SegmentSpec spec = small_spec();
  spec.rows = 1ULL << 38;

  EXPECT_THAT(message_of<SegmentError>([&] { OwnedSegment::create(spec); }),
              AllOf(HasSubstr("has no room"), HasSubstr("shorter history")));
  EXPECT_EQ(directory_.files(), 0U);
}

TEST_F(OwnedSegmentTest, RefusesNamesThatAreNoFileNames) {
  for (const char* name :
       {"", ".arm", "a/b", "arm.new-1", "arm.commanders-1", "arm arm", "\xc3\xa4"}) {
    SegmentSpec spec = small_spec(name);
    EXPECT_THROW(OwnedSegment::create(spec), InvalidArgument) << name;
  }
  EXPECT_THROW(OwnedSegment::create(small_spec(std::string(65, 'a'))), InvalidArgument);
  EXPECT_NO_THROW(OwnedSegment::create(small_spec(std::string(64, 'a'))));
}

TEST_F(OwnedSegmentTest, RefusesRowsThatAreNoWords) {
  SegmentSpec spec = small_spec();
  spec.row_bytes = 12;
  EXPECT_THROW(OwnedSegment::create(spec), InvalidArgument);
}

TEST_F(OwnedSegmentTest, CanBeMoved) {
  std::optional<OwnedSegment> first = running_segment();
  const OwnedSegment second = std::move(*first);
  first.reset();

  EXPECT_TRUE(std::filesystem::exists(directory_.file_of("arm")));
  EXPECT_EQ(second.state(), BackendState::running);
}

TEST_F(OwnedSegmentTest, DoesNotTakeAwayTheFileOfASuccessor) {
  OwnedSegment segment = running_segment();
  std::filesystem::remove(directory_.file_of("arm"));  // somebody cleaned by hand
  std::ofstream(directory_.file_of("arm")) << "of somebody else";

  segment.remove();

  EXPECT_TRUE(std::filesystem::exists(directory_.file_of("arm")));
}

TEST_F(OwnedSegmentTest, IsFoundAndKeepsItsNameAfterItsFilesWereRemoved) {
  std::optional<OwnedSegment> segment(running_segment());
  EXPECT_THAT(list_segments(), ElementsAre(Field(&SegmentEntry::readable, true)));
  std::filesystem::remove(directory_.file_of("arm"));
  std::filesystem::remove(commands_path("arm", segment->epoch()));

  EXPECT_THAT(
      list_segments(),
      ElementsAre(AllOf(
          Field(&SegmentEntry::name, "arm"), Field(&SegmentEntry::life, Life::running),
          Field(&SegmentEntry::pid, getpid()), Field(&SegmentEntry::problem, HasSubstr("kill")))));
  EXPECT_THAT(message_of<SegmentTaken>([] { OwnedSegment::create(small_spec()); }),
              AllOf(HasSubstr("(pid " + std::to_string(getpid())), HasSubstr("removed"),
                    HasSubstr("o80 stop arm")));
  ASSERT_EQ(mkfifo(directory_.file_of("arm").c_str(), 0600), 0);
  EXPECT_THAT(list_segments(), Contains(Field(&SegmentEntry::pid, getpid())));
  std::filesystem::remove(directory_.file_of("arm"));
  segment.reset();
  EXPECT_THAT(list_segments(), IsEmpty());
  EXPECT_NO_THROW(OwnedSegment::create(small_spec()));
}

TEST_F(OwnedSegmentTest, ItsNameIsFreeAsSoonAsItsProcessIsKilledAlsoWhereAChildLives) {
  ChildProcess owner([](const auto& ready) {
    const OwnedSegment segment = running_segment();
    if (fork() == 0) {
      std::ofstream(segment_directory() + "/child") << getpid() << std::flush;
      ready();
    }
    pause_for_ever();
  });
  ASSERT_TRUE(owner.wait_until_ready());
  pid_t child = 0;
  std::ifstream(segment_directory() + "/child") >> child;
  ASSERT_GT(child, 0);
  std::filesystem::remove(directory_.file_of("arm"));
  EXPECT_THAT(list_segments(), ElementsAre(Field(&SegmentEntry::pid, owner.pid())));
  owner.kill_now();
  EXPECT_THAT(list_segments(), IsEmpty());
  EXPECT_NO_THROW(OwnedSegment::create(small_spec()));
  kill(child, SIGKILL);
}

}  // namespace
}  // namespace o80
