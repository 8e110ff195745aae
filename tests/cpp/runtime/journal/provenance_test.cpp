#include "o80/runtime/provenance.hpp"

#include <fstream>
#include <limits>

#include "control/motion/number_plan.hpp"
#include "memory/segment/segment_name.hpp"
#include "o80/base/version.hpp"
#include "runtime/backend/backend_options.hpp"
#include "runtime/journal/provenance_bytes.hpp"
#include "runtime/manual_backend.hpp"

namespace o80::test {
namespace {

using ::testing::Contains;
using ::testing::IsEmpty;
using ::testing::Pair;

const std::string kOddText("a\0\n\xFF \xC3\xA4", 7);

/// Something in every field, also what no text should hold.
const Provenance kFull{.robot = "arm",
                       .library = kOddText,
                       .library_sha256 = std::string(64, 'a'),
                       .built_with = "",
                       .options = {{"gain", "2.5"}, {kOddText, ""}, {"", std::string(300, 'x')}},
                       .run_options = {{"frequency", "1000"}},
                       .files = {{"model", "a.xml", "b"}, {"", kOddText, ""}},
                       .version = "1.2.3",
                       .source_hash = kOddText,
                       .wall_clock_offset = -1,
                       .motion_rules = std::numeric_limits<std::int64_t>::max()};

TEST(ProvenanceBytesTest, ReadBackWhateverWasWritten) {
  for (const Provenance& written : {kFull, Provenance{}}) {
    EXPECT_EQ(provenance_from_bytes(to_bytes(written)), written);
  }
}

TEST(ProvenanceBytesTest, ThatAreCutOrLongerAreRefused) {
  std::vector<std::byte> bytes = to_bytes(kFull);
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    const auto cut = std::span(bytes).first(size);
    ASSERT_THROW(provenance_from_bytes(cut), SegmentError) << size;
  }
  bytes.push_back(std::byte{0});
  EXPECT_THROW(provenance_from_bytes(bytes), SegmentError);
}

class ProvenanceTest : public ::testing::Test {
 protected:
  PrivateDirectory directory_;
};

TEST_F(ProvenanceTest, IsReadByFrontends) {
  Provenance given;
  given.robot = "arm";
  given.options = {{"gain", "2.5"}, {"address", "10.0.0.2\n"}};
  StartedBackend manual({.segment = "pair", .bursting = true, .provenance = given});
  const UntypedFrontend observer("pair", {.access = Access::read_only});

  const Provenance found = observer.provenance();
  EXPECT_EQ(found, manual.backend.provenance());
  EXPECT_EQ(found.robot, "arm");
  EXPECT_EQ(found.options, given.options);
  EXPECT_EQ(found.version, version());
  EXPECT_EQ(found.source_hash, source_hash());
  EXPECT_EQ(found.source_hash.size(), 64U);
  EXPECT_EQ(found.motion_rules, kMotionRules);
}

TEST_F(ProvenanceTest, HasTheEffectiveValuesOfOptionsThatWereNotGiven) {
  StartedBackend manual({.segment = "pair", .lanes = 1, .lane_blocks = 100});
  const Provenance found = UntypedFrontend("pair").provenance();
  EXPECT_EQ(found.robot, "pair");
  EXPECT_THAT(found.options, IsEmpty());
  EXPECT_THAT(found.run_options, Contains(Pair("frequency", "1000")));
  EXPECT_THAT(found.run_options, Contains(Pair("history", "100000")));
  EXPECT_THAT(found.run_options, Contains(Pair("lane_blocks", "128")));
  EXPECT_THAT(found.run_options, Contains(Pair("journal", "0.5")));
  EXPECT_THAT(found.run_options, Contains(Pair("permission", "600")));
  EXPECT_THAT(found.run_options, Contains(Pair("bursting", "false")));
}

TEST_F(ProvenanceTest, LeadsFromTheTimeOfARowToTheWallClock) {
  for (const bool bursting : {false, true}) {
    const std::int64_t before = wall_clock_now();
    StartedBackend manual({.segment = "pair", .bursting = bursting});
    const std::int64_t after = wall_clock_now();
    const UntypedFrontend observer("pair", {.access = Access::read_only});
    const std::int64_t time =
        observer.latest().head().time + observer.provenance().wall_clock_offset;
    // between two readings of the clock; the offset is known to less than that
    EXPECT_GE(time, before - 10'000'000) << bursting;
    EXPECT_LE(time, after + 10'000'000) << bursting;
  }
}

TEST_F(ProvenanceTest, ThatIsDamagedIsAnErrorOfItsReaderOnly) {
  StartedBackend manual;
  const UntypedFrontend frontend("pair");
  const SegmentOffsets& offsets = frontend.link()->segment.view().offsets;
  std::fstream file(segment_path("pair"), std::ios::binary | std::ios::in | std::ios::out);
  file.seekp(static_cast<std::streamoff>(offsets.provenance)).put('x').flush();

  EXPECT_THAT(message_of<SegmentError>([&] { static_cast<void>(frontend.provenance()); }),
              HasSubstr("damaged"));
  EXPECT_EQ(UntypedFrontend("pair").latest().head().iteration, 0);
}

TEST_F(ProvenanceTest, RefusesMoreThanASegmentTakes) {
  Provenance given;
  given.options = {{"text", std::string(17U << 20, 'x')}};
  EXPECT_THROW(ManualBackend({.segment = "pair", .provenance = given}), InvalidArgument);
  given.options.assign(5000, {"name", "text"});
  EXPECT_THROW(ManualBackend({.segment = "pair", .provenance = given}), InvalidArgument);
}

}  // namespace
}  // namespace o80::test
