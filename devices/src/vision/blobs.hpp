#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "vision/camera.hpp"

namespace o80::vision {

/// Probability that a pixel of a colour shows the ball, 0 to 255, by the upper five bits of red,
/// green and blue.
using ColourTable = std::array<std::uint8_t, 32 * 32 * 32>;

/// Image of three bytes a pixel, red, green, blue, row by row.
struct Image {
  const std::uint8_t* bytes = nullptr;
  int width = 0, height = 0;
};

/// Rectangle of an image: from (left, top) up to, not including, (right, bottom) [px].
struct Region {
  int left = 0, top = 0, right = 0, bottom = 0;
};

/// Neighbouring pixels that probably show the ball.
struct Blob {
  Pixel centre;       // weighted by probability [px]
  double area = 0;    // [px^2]
  double weight = 0;  // sum of the probabilities, each 0 to 1, times area per searched pixel
  bool cut = false;   // touches the border of the region: the centre is not the ball's
};

inline constexpr std::size_t kMaxBlobs = 8;

/// Criteria of a blob.
struct BlobRule {
  int step = 1;         // search every step-th pixel of every step-th row
  double min_area = 6;  // [px^2]
};

/// Finds the blobs of ball colour in a region.
class BlobFinder {
 public:
  explicit BlobFinder(const ColourTable& table) : table_(table) {}

  /// Returns the blobs with the largest weights, at most kMaxBlobs, the largest first.
  std::vector<Blob> find(const Image& image, Region region, const BlobRule& rule);

 private:
  /// Consecutive pixels of one row above the threshold.
  struct Run {
    int row, begin, end;  // in steps
    int root;             // the root run of the blob
    double weight, x, y;  // sums
  };
  int root_of(int run) noexcept;
  void find_runs(const Image& image, const Region& region, const BlobRule& rule);
  void join(int above, int run) noexcept;

  ColourTable table_;
  std::vector<Run> runs_;  // keeps its memory from call to call
};

}  // namespace o80::vision
