#include "o80/runtime/provenance.hpp"

#include <fstream>
#include <random>

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

/// Arbitrary texts and options, drawn from a seed.
class DrawnProvenance {
 public:
  explicit DrawnProvenance(std::uint32_t seed) : random_(seed) {}
  std::string text() {
    std::string text(random_() % 20, 0);
    for (char& c : text) c = static_cast<char>(random_());
    return text;
  }
  Provenance::Options options() {
    Provenance::Options options(random_() % 8);
    for (auto& [name, value] : options) {
      name = text();
      value = text();
    }
    return options;
  }
  Provenance provenance() {
    Provenance drawn{.robot = text(),
                     .library = text(),
                     .library_sha256 = text(),
                     .built_with = text(),
                     .options = options(),
                     .run_options = options(),
                     .files = {},
                     .version = text(),
                     .source_hash = text(),
                     .wall_clock_offset = static_cast<std::int64_t>(random_()),
                     .motion_rules = static_cast<std::int64_t>(random_())};
    for (std::size_t i = random_() % 4; i > 0; --i)
      drawn.files.push_back({.option = text(), .path = text(), .sha256 = text()});
    return drawn;
  }
  std::uint64_t number() { return random_(); }

 private:
  std::mt19937_64 random_;
};

TEST(ProvenanceBytesTest, ReadBackWhateverWasWritten) {
  for (std::uint32_t seed = 0; seed < 200; ++seed) {
    const Provenance written = DrawnProvenance(seed).provenance();
    ASSERT_EQ(provenance_from_bytes(to_bytes(written)), written) << seed;
  }
}

TEST(ProvenanceBytesTest, ThatAreCutOrLongerAreRefused) {
  std::vector<std::byte> bytes = to_bytes(DrawnProvenance(3).provenance());
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
