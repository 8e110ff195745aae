#include "o80/memory/segment_list.hpp"

#include <gmock/gmock.h>
#include <sys/prctl.h>

#include <fstream>

#include "memory/segment/segment_file.hpp"
#include "memory/segments.hpp"
#include "o80/base/error.hpp"

namespace o80 {
namespace {

using ::testing::ElementsAre;
using SegmentListTest = SegmentTest;

TEST_F(SegmentListTest, ShowsEverySegmentByNameWithItsLife) {
  const OwnedSegment starting = OwnedSegment::create(small_spec("b"));
  const OwnedSegment running = running_segment(small_spec("a"));
  OwnedSegment ending = running_segment(small_spec("c"));  // its process lives
  ending.end(BackendState::failed);
  std::ofstream(directory_.file_of("d")) << "foreign";
  std::ofstream(directory_.path() + "/other") << "no segment at all";

  const std::vector<SegmentEntry> entries = list_segments();

  std::vector<std::string> seen;
  seen.reserve(entries.size());
  for (const SegmentEntry& entry : entries) seen.push_back(entry.name + " " + name_of(entry.life));
  EXPECT_THAT(seen, ElementsAre("a running", "b starting", "c failed", "d unknown"));
  EXPECT_EQ(entries[0].pid, getpid());
  EXPECT_EQ(entries[0].epoch, running.epoch());
  EXPECT_TRUE(entries[0].readable);
  EXPECT_FALSE(entries[3].readable);
  EXPECT_FALSE(entries[0].user.empty());
}

TEST(OwnProgram, IsTheNameOfTheProcessFitForATerminal) {
  char before[16] = "";
  prctl(PR_GET_NAME, before);
  prctl(PR_SET_NAME, "a\tlearner");
  EXPECT_EQ(own_program(), "a?learner") << "without the end of the line";
  EXPECT_EQ(own_process(), "pid " + std::to_string(getpid()) + " (a?learner)");
  prctl(PR_SET_NAME, before);
}

TEST_F(SegmentListTest, IsEmptyWhereThereIsNothing) {
  EXPECT_TRUE(list_segments().empty());
  setenv("O80_DIRECTORY", "/nowhere", 1);
  EXPECT_TRUE(list_segments().empty());
}

TEST_F(SegmentListTest, CleansTheDeadAndRefusesTheLiving) {
  const OwnedSegment alive = running_segment(small_spec("alive"));
  running_segment(small_spec("dead")).end(BackendState::failed);

  EXPECT_THROW(clean("alive"), SegmentTaken);
  EXPECT_TRUE(clean("dead"));
  EXPECT_FALSE(clean("dead"));
  EXPECT_EQ(directory_.files(), 2U);
}

TEST_F(SegmentListTest, CleansAllTheDeadButNothingForeign) {
  const OwnedSegment alive = running_segment(small_spec("alive"));
  running_segment(small_spec("x")).end(BackendState::failed);
  running_segment(small_spec("y")).end(BackendState::failed);
  std::ofstream(directory_.file_of("foreign")) << "not ours";
  std::ofstream(directory_.file_of("x.new-0011223344556677")) << "a draft nobody holds";
  std::ofstream(directory_.file_of("z.commanders-0011223344556677")) << "without its segment";

  EXPECT_THAT(clean_dead(), ElementsAre("x", "y"));
  EXPECT_EQ(directory_.files(), 3U);
  EXPECT_EQ(alive.state(), BackendState::running);
}

}  // namespace
}  // namespace o80
