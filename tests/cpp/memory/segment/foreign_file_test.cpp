// Whatever bears the name of a segment without being one: nobody waits for it, crashes on it, or
// writes through it.

#include <gmock/gmock.h>
#include <sys/stat.h>
#include <sys/sysmacros.h>

#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

#include "memory/child_process.hpp"
#include "memory/file_bytes.hpp"
#include "memory/ring/history.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"
#include "o80/memory/segment_list.hpp"

namespace o80 {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ForeignFileTest = SegmentTest;

/// What attaching says, whichever way it is done: to read or to write, to the living or the dead.
std::string refusal() {
  std::string said;
  for (const Access access : {Access::read_only, Access::read_write})
    for (const bool dead : {false, true})
      said += message_of<SegmentError>(
                  [&] { AttachedSegment::attach("arm", access, patient(), {.dead = dead}); }) +
              "\n";
  return said;
}

/// Somewhere in the file.
template <class T>
void poke(const std::string& path, std::uint64_t offset, T value) {
  std::fstream file(path, std::ios::binary | std::ios::in | std::ios::out);
  file.seekp(static_cast<std::streamoff>(offset));
  file.write(reinterpret_cast<const char*>(&value), sizeof value);
}

TEST_F(ForeignFileTest, ThatIsAPipeIsRefusedAndNobodyWaitsAtIt) {
  const std::string path = directory_.file_of("arm");
  ASSERT_EQ(mkfifo(path.c_str(), 0600), 0);
  EXPECT_THAT(refusal(), HasSubstr("not a regular file"));
  EXPECT_EQ(list_segments().size(), 1U);
  EXPECT_FALSE(list_segments().at(0).readable);
  // nobody holds it, so the name is free for a backend, as with any other file
  EXPECT_NO_THROW(OwnedSegment::create(small_spec()));
}

TEST_F(ForeignFileTest, ThatIsADeviceIsRefused) {
  const std::string path = directory_.file_of("arm");
  if (mknod(path.c_str(), S_IFCHR | 0600, makedev(1, 3)) != 0)
    GTEST_SKIP() << "this user may not make devices";
  if (!std::ifstream(path)) GTEST_SKIP() << "devices cannot be opened in this file system";
  EXPECT_THAT(refusal(), HasSubstr("not a regular file"));
  EXPECT_NO_THROW(list_segments());
}

TEST_F(ForeignFileTest, ThatIsAFolderIsRefusedBySayingSo) {
  const std::string path = directory_.file_of("arm");
  std::filesystem::create_directory(path);
  EXPECT_THAT(refusal(), HasSubstr(path));
  EXPECT_THAT(message_of<SegmentError>([] { OwnedSegment::create(small_spec()); }),
              AllOf(HasSubstr(path), HasSubstr("exists and"), HasSubstr("directory")));
  EXPECT_TRUE(std::filesystem::is_directory(path));
  EXPECT_EQ(directory_.files(), 1U) << "no draft is left";
}

TEST_F(ForeignFileTest, ThatIsALinkIsNotFollowed) {
  const std::string path = directory_.file_of("arm");
  const std::string target = directory_.path() + "/valuable";
  write_all(target, std::vector<char>(100'000, 'x'));
  std::filesystem::create_symlink(target, path);
  EXPECT_THAT(refusal(), HasSubstr(path));
  EXPECT_THROW(OwnedSegment::create(small_spec()), SegmentError);
  EXPECT_EQ(read_all(target), std::vector<char>(100'000, 'x'));

  // not to a true segment either
  std::filesystem::remove(path);
  const OwnedSegment leg = running_segment(small_spec("leg"));
  std::filesystem::create_symlink(directory_.file_of("leg"), path);
  EXPECT_THAT(refusal(), AllOf(HasSubstr(path), HasSubstr("symbolic links")));
}

TEST_F(ForeignFileTest, CutAnywhereIsRefused) {
  const std::string path = directory_.file_of("arm");
  running_segment().end(BackendState::failed);
  const std::vector<char> whole = read_all(path);
  std::vector<std::size_t> sizes{0, 1, 7, 8, 9, 183, 184, 185, whole.size() - 1};
  for (std::size_t page = 4096; page < whole.size(); page += 4096)
    for (const std::size_t size : {page - 1, page, page + 1, page + 8}) sizes.push_back(size);
  for (const std::size_t size : sizes) {
    write_all(path, {whole.begin(), whole.begin() + static_cast<long>(size)});
    EXPECT_THAT(refusal(), size < 8 ? HasSubstr("not made by o80") : HasSubstr("truncated"))
        << size;
    EXPECT_NO_THROW(list_segments());
  }
  write_all(path, std::vector<char>(whole.size(), 'x'));
  EXPECT_THAT(refusal(), HasSubstr("not made by o80"));
}

TEST_F(ForeignFileTest, ThatGrewIsRefused) {
  const std::string path = directory_.file_of("arm");
  running_segment().end(BackendState::failed);
  std::vector<char> longer = read_all(path);
  for (const std::size_t more : {1U, 4096U}) {
    longer.resize(longer.size() + more);
    write_all(path, longer);
    EXPECT_THAT(refusal(), HasSubstr("longer than its header says"));
  }
}

TEST_F(ForeignFileTest, OfAnotherVersionIsRefusedWithBothVersionsAndTheCure) {
  const std::string path = directory_.file_of("arm");
  running_segment().end(BackendState::failed);
  poke(path, offsetof(SegmentHeader, version), std::uint32_t{77});
  EXPECT_THAT(refusal(), AllOf(HasSubstr("version 77"),
                               HasSubstr("version " + std::to_string(kSegmentVersion)),
                               HasSubstr("Start its backend again"), HasSubstr("o80 clean arm")));
  // the dead do not keep the name, whatever wrote them
  EXPECT_NO_THROW(OwnedSegment::create(small_spec()));
}

TEST_F(ForeignFileTest, OfALivingBackendOfAnotherVersionKeepsItsNameAndIsNotReadAsThisOne) {
  const OwnedSegment living = running_segment();
  const std::string path = directory_.file_of("arm");
  poke(path, offsetof(SegmentHeader, user), std::array<char, 4>{'\x1b', '[', '7', 'm'});
  for (const std::uint32_t version : {kSegmentVersion, 77U}) {
    poke(path, offsetof(SegmentHeader, version), version);
    const std::string said = message_of<SegmentTaken>([] { OwnedSegment::create(small_spec()); });
    EXPECT_THAT(said, AllOf(HasSubstr("'arm' already has a backend"), HasSubstr("o80 stop arm")));
    EXPECT_EQ(said.find('\x1b'), std::string::npos);
    EXPECT_EQ(said.find("?[7m") != std::string::npos, version == kSegmentVersion) << said;
  }
  EXPECT_THROW(clean("arm"), SegmentTaken);
}

TEST_F(ForeignFileTest, WithImpossibleCountersGivesNoRowAndKeepsNobody) {
  OwnedSegment owner = running_segment();
  HistoryWriter writer(owner.view());
  const std::vector<Iteration> row(8, 7);
  for (Iteration k = 0; k < 40; ++k)
    writer.publish(k, reinterpret_cast<const std::byte*>(row.data()));
  const AttachedSegment segment = attach();
  const HistoryReader history(segment.view());
  std::vector<Iteration> rows(8 * 40);
  auto* to = reinterpret_cast<std::byte*>(rows.data());
  ASSERT_EQ(history.latest(to), 39);
  ASSERT_FALSE(history.is_damaged());

  constexpr Iteration kMax = std::numeric_limits<Iteration>::max();
  Counters& counters = owner.view().counters();
  for (const Iteration begun : {kMax, Iteration{1} << 47, Iteration{400}}) {
    counters.begun = begun;
    EXPECT_EQ(history.latest(to), -1);
    EXPECT_TRUE(history.is_damaged());
    EXPECT_FALSE(history.read(39, to));
    EXPECT_EQ(history.read_range(0, 40, to).count, 0U);
  }
}

}  // namespace
}  // namespace o80
