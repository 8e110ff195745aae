#include "memory/os/descriptors.hpp"

#include <fcntl.h>
#include <gtest/gtest.h>

#include "memory/child_process.hpp"
#include "memory/ring/lane_sender.hpp"
#include "memory/segments.hpp"

namespace o80 {
namespace {

constexpr int kStandard = 3;

/// 0, 1 and 2; which of them are closed is a set of bits.
class DescriptorsTest : public SegmentTest, public testing::WithParamInterface<unsigned> {
 protected:
  static bool is_closed(int descriptor) { return ((GetParam() >> descriptor) & 1U) != 0; }

  /// True if `body` returns true in a child that has closed them.
  template <class Body>
  static bool holds_in_child(Body body) {
    return in_child([&] {
             for (int i = 0; i < kStandard; ++i)
               if (is_closed(i)) ::close(i);
             return body() ? 0 : 1;
           }) == 0;
  }
};

TEST_P(DescriptorsTest, OfSegmentsAndLanesAreAboveTheStandardOnes) {
  EXPECT_TRUE(holds_in_child([] {
    const OwnedSegment owner = running_segment();
    const AttachedSegment segment = attach();
    const LaneSender sender(segment);
    for (int i = 0; i < kStandard; ++i)
      if (is_closed(i) != (fcntl(i, F_GETFD) < 0)) return false;
    return true;
  }));
}

TEST_P(DescriptorsTest, ThatAreMissingLeadAProgramNowhere) {
  EXPECT_TRUE(holds_in_child([] {
    open_standard_descriptors();
    char byte = 'x';
    if (is_closed(0) && read(0, &byte, 1) != 0) return false;
    for (int i = 1; i < kStandard; ++i)
      if (is_closed(i) && write(i, &byte, 1) != 1) return false;
    return fcntl(kStandard - 1, F_GETFD) == 0;  // inherited by programs that this one starts
  }));
}

INSTANTIATE_TEST_SUITE_P(Closed, DescriptorsTest, testing::Range(1U, 8U));

}  // namespace
}  // namespace o80
