// What a segment reserves, by arithmetic.

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include "control/batch/record.hpp"
#include "memory/segment/segment_name.hpp"
#include "o80/runtime/backend.hpp"

namespace o80 {
namespace {

TEST(SegmentSize, OfEightActuatorsAndAHundredThousandRowsIsThreeTenthsAbovePayloadAtMost) {
  Schema schema;
  const std::uint32_t type = schema.add_type("double", {scalar_field("value", Kind::float64)});
  schema.add_actuators("joint", type, 8);
  BackendOptions options;
  options.segment = "segment-size-" + std::to_string(getpid());
  options.history = 100'000;
  const UntypedBackend backend(schema, options);

  struct stat file{};
  ASSERT_EQ(stat(segment_path(options.segment).c_str(), &file), 0);
  const std::uint64_t rows = options.history * backend.layout().size;
  const std::uint64_t lanes = std::uint64_t{options.lanes} * options.lane_blocks * kBlockBytes;

  EXPECT_LE(static_cast<std::uint64_t>(file.st_size) * 10, (rows + lanes) * 13);
  // all of it is there from the beginning, and no more
  EXPECT_EQ(file.st_blocks * 512, file.st_size);
}

}  // namespace
}  // namespace o80
