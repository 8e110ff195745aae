#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <vector>

#include "vision/blobs.hpp"

namespace o80::vision {
namespace {

using testing::DoubleNear;
using testing::Ge;

constexpr int kWidth = 160;
constexpr int kHeight = 120;

/// The probability is the red part of the colour.
ColourTable red_table() {
  ColourTable table{};
  for (std::size_t i = 0; i < table.size(); ++i) {
    table[i] = static_cast<std::uint8_t>((i >> 10) * 255 / 31);
  }
  return table;
}

/// An image with red discs whose borders cover parts of pixels.
class Picture {
 public:
  void disc(double x, double y, double radius) {
    for (int row = 0; row < kHeight; ++row) {
      for (int column = 0; column < kWidth; ++column) {
        const double inside = 0.5 + radius - std::hypot(column - x, row - y);
        const double covered = std::min(1.0, std::max(0.0, inside));
        std::uint8_t& red = bytes_[static_cast<std::size_t>(3 * (row * kWidth + column))];
        red = std::max(red, static_cast<std::uint8_t>(255 * covered));
      }
    }
  }
  Image image() const { return {bytes_.data(), kWidth, kHeight}; }

 private:
  std::vector<std::uint8_t> bytes_ = std::vector<std::uint8_t>(3 * kWidth * kHeight, 0);
};

constexpr Region kWhole{0, 0, kWidth, kHeight};

TEST(BlobFinder, FindsTheCentreOfADiscBetweenPixels) {
  BlobFinder finder(red_table());
  for (double shift = 0; shift < 1; shift += 0.1) {
    Picture picture;
    picture.disc(60 + shift, 40 + shift / 2, 4);
    const std::vector<Blob> blobs = finder.find(picture.image(), kWhole, {});
    ASSERT_EQ(blobs.size(), 1U);
    EXPECT_THAT(blobs[0].centre.x, DoubleNear(60 + shift, 0.06));
    EXPECT_THAT(blobs[0].centre.y, DoubleNear(40 + shift / 2, 0.06));
    EXPECT_THAT(blobs[0].area, DoubleNear(M_PI * 16, 8));
  }
}

TEST(BlobFinder, ACoarseSearchFindsEveryDiscWiderThanItsDiagonal) {
  BlobFinder finder(red_table());
  for (int shift = 0; shift < 16; ++shift) {
    Picture picture;
    picture.disc(50 + shift % 4, 60 + shift / 4, 3.0);
    EXPECT_THAT(finder.find(picture.image(), kWhole, {.step = 4, .min_area = 1}).size(), Ge(1U));
  }
}

TEST(BlobFinder, ListsTheLargestFirstAndNoMoreThanItHasRoomFor) {
  BlobFinder finder(red_table());
  Picture picture;
  for (int i = 0; i < 12; ++i) picture.disc(10 + 12 * i, 50, 1.5 + 0.3 * i);
  const std::vector<Blob> blobs = finder.find(picture.image(), kWhole, {});

  ASSERT_EQ(blobs.size(), kMaxBlobs);
  EXPECT_THAT(blobs[0].centre.x, DoubleNear(142, 0.1));
  for (std::size_t i = 1; i < kMaxBlobs; ++i) {
    EXPECT_LT(blobs[i].weight, blobs[i - 1].weight);
  }
}

TEST(BlobFinder, JoinsWhatMeetsInALaterRow) {
  BlobFinder finder(red_table());
  Picture picture;  // a U: two arms, joined below
  for (int y = 20; y < 40; ++y) {
    picture.disc(30, y, 1);
    picture.disc(50, y, 1);
  }
  for (int x = 30; x < 50; ++x) picture.disc(x, 40, 1);
  const std::vector<Blob> blobs = finder.find(picture.image(), kWhole, {});

  ASSERT_EQ(blobs.size(), 1U);
  EXPECT_THAT(blobs[0].centre.x, DoubleNear(40, 0.2));
}

TEST(BlobFinder, SaysWhatTheRegionCuts) {
  BlobFinder finder(red_table());
  Picture picture;
  picture.disc(60, 40, 5);

  EXPECT_FALSE(finder.find(picture.image(), {50, 30, 70, 50}, {})[0].cut);
  EXPECT_TRUE(finder.find(picture.image(), {60, 30, 80, 50}, {})[0].cut);
}

TEST(BlobFinder, LooksAtNothingOutsideOfTheImage) {
  BlobFinder finder(red_table());
  Picture picture;
  picture.disc(2, 2, 4);

  EXPECT_EQ(finder.find(picture.image(), {-50, -50, 20, 20}, {}).size(), 1U);
  EXPECT_EQ(finder.find(picture.image(), {-50, -50, -20, -20}, {}).size(), 0U);
  EXPECT_EQ(finder.find(picture.image(), {500, 500, 600, 600}, {}).size(), 0U);
  EXPECT_EQ(finder.find(picture.image(), {40, 40, 20, 20}, {}).size(), 0U);
}

}  // namespace
}  // namespace o80::vision
