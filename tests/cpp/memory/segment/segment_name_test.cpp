// A directory of segments that is full, missing, or not ours to write.

#include <gmock/gmock.h>
#include <sched.h>
#include <sys/mount.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>

#include "memory/child_process.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"
#include "o80/memory/segment_list.hpp"

namespace o80 {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using DirectoryTest = SegmentTest;

constexpr int kNotPermitted = 77;

/// What a segment of this length of history says when it is made there; "" if it can be.
std::string refusal(std::uint64_t rows) {
  SegmentSpec spec = small_spec("big");
  spec.rows = rows;
  return message_of<SegmentError>([&] { OwnedSegment::create(spec); });
}

TEST_F(DirectoryTest, ThatIsFullRefusesWhatDoesNotFitNamingTheCureAndStaysUsable) {
  const int code = in_child([&] {
    const char* directory = directory_.path().c_str();
    // of 256 pages, however large a page is
    const auto bytes = 256 * static_cast<std::size_t>(sysconf(_SC_PAGESIZE));
    const std::string size = "size=" + std::to_string(bytes);
    if (unshare(CLONE_NEWNS) != 0 ||
        mount("none", "/", nullptr, MS_REC | MS_PRIVATE, nullptr) != 0 ||
        mount("o80", directory, "tmpfs", 0, size.c_str()) != 0)
      return kNotPermitted;
    // too large at all: 64 bytes a row
    const std::string large = refusal(bytes);
    std::fprintf(stderr, "%s\n", large.c_str());
    if (large.find("no room") == std::string::npos ||
        large.find("o80 clean") == std::string::npos || large.find(directory) == std::string::npos)
      return 1;
    if (directory_.files() != 0) return 2;
    // what fits fits, until the directory is full; then nothing new, and the old ones go on
    const OwnedSegment first = running_segment();
    std::ofstream(directory_.path() + "/filler") << std::string(2 * bytes, 'x');
    if (refusal(1).empty()) return 3;
    if (attach("arm", Access::read_only).life() != Life::running) return 4;
    const volatile std::byte last = first.view().base[first.view().offsets.file_bytes - 1];
    static_cast<void>(last);
    if (directory_.files() != 3) return 5;  // two of the first, and the filler
    // and room made is room
    unlink((directory_.path() + "/filler").c_str());
    if (!refusal(1).empty()) return 6;
    return 0;
  });
  if (code == kNotPermitted) GTEST_SKIP() << "this user may not mount a small file system";
  EXPECT_EQ(code, 0);
}

TEST_F(DirectoryTest, ThatIsNotOursToWriteSaysSo) {
  ASSERT_EQ(chmod(directory_.path().c_str(), 0555), 0);
  const int code = in_child([&] {
    // permissions bind everybody but root
    if (geteuid() == 0 && !become_a_stranger()) return kNotPermitted;
    const std::string said = refusal(1);
    std::fprintf(stderr, "%s\n", said.c_str());
    return said.find(directory_.path()) != std::string::npos &&
                   said.find("Permission denied") != std::string::npos
               ? 0
               : 1;
  });
  chmod(directory_.path().c_str(), 0700);
  if (code == kNotPermitted) GTEST_SKIP() << "no other user to be";
  EXPECT_EQ(code, 0);
}

TEST_F(DirectoryTest, ThatIsMissingIsNamedByEveryVerb) {
  const std::string missing = directory_.path() + "/nowhere";
  setenv("O80_DIRECTORY", missing.c_str(), 1);
  EXPECT_THAT(refusal(1), AllOf(HasSubstr(missing), HasSubstr("unset O80_DIRECTORY")));
  EXPECT_THAT(
      message_of<TimeoutError>([] { AttachedSegment::attach("arm", Access::read_only, soon()); }),
      AllOf(HasSubstr(missing + ", which O80_DIRECTORY names, does not exist"),
            HasSubstr("unset O80_DIRECTORY")));
  EXPECT_TRUE(list_segments().empty());
  EXPECT_TRUE(clean_dead().empty());
  EXPECT_FALSE(clean("arm"));
  setenv("O80_DIRECTORY", directory_.path().c_str(), 1);
}

TEST_F(DirectoryTest, HidesAFileOfAnotherUserButSaysWhatToDo) {
  const OwnedSegment owner = running_segment();
  ASSERT_EQ(chmod(directory_.path().c_str(), 0755), 0);
  const int code = in_child([&] {
    if (geteuid() == 0 && !become_a_stranger()) return kNotPermitted;
    if (access(directory_.file_of("arm").c_str(), R_OK) == 0) return kNotPermitted;
    const std::string write = message_of<SegmentError>(
        [] { AttachedSegment::attach("arm", Access::read_write, soon()); });
    const std::string read =
        message_of<SegmentError>([] { AttachedSegment::attach("arm", Access::read_only, soon()); });
    std::fprintf(stderr, "%s\n%s\n", write.c_str(), read.c_str());
    if (write.find("--permission 640") == std::string::npos) return 2;
    if (read.find("Permission denied") == std::string::npos) return 3;
    // it does not get the name either
    return message_of<SegmentError>([] { OwnedSegment::create(small_spec()); }).empty() ? 4 : 0;
  });
  if (code == kNotPermitted) GTEST_SKIP() << "no other user to be";
  EXPECT_EQ(code, 0);
}

}  // namespace
}  // namespace o80
