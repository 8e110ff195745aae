#include "vision/blobs.hpp"

#include <algorithm>
#include <functional>

namespace o80::vision {

namespace {

constexpr int kThreshold = 96;  // least probability of a pixel, of 255

std::uint8_t probability(const ColourTable& table, const std::uint8_t* pixel) noexcept {
  const auto index =
      static_cast<std::size_t>((pixel[0] >> 3) << 10 | (pixel[1] >> 3) << 5 | (pixel[2] >> 3));
  return table[index];
}

}  // namespace

int BlobFinder::root_of(int run) noexcept {
  while (runs_[static_cast<std::size_t>(run)].root != run) {
    Run& each = runs_[static_cast<std::size_t>(run)];
    each.root = runs_[static_cast<std::size_t>(each.root)].root;
    run = each.root;
  }
  return run;
}

void BlobFinder::join(int above, int run) noexcept {
  const int a = root_of(above);
  const int b = root_of(run);
  runs_[static_cast<std::size_t>(std::max(a, b))].root = std::min(a, b);
}

void BlobFinder::find_runs(const Image& image, const Region& region, const BlobRule& rule) {
  const int step = rule.step;
  runs_.clear();
  std::size_t above_begin = 0;
  std::size_t above_end = 0;
  for (int y = region.top; y < region.bottom; y += step) {
    const std::size_t row_begin = runs_.size();
    const std::uint8_t* const line = image.bytes + 3L * image.width * y;
    const int row = (y - region.top) / step;
    bool open = false;
    for (int x = region.left; x < region.right; x += step) {
      const std::uint8_t value = probability(table_, line + 3L * x);
      if (value < kThreshold) {
        open = false;
        continue;
      }
      const int column = (x - region.left) / step;
      if (!open) {
        runs_.push_back({row, column, column, static_cast<int>(runs_.size()), 0, 0, 0});
        open = true;
      }
      Run& run = runs_.back();
      run.end = column + 1;
      run.weight += value;
      run.x += static_cast<double>(value) * x;
      run.y += static_cast<double>(value) * y;
    }
    // neighbours in the row above, diagonal ones included
    std::size_t above = above_begin;
    for (std::size_t i = row_begin; i < runs_.size(); ++i) {
      while (above < above_end && runs_[above].end < runs_[i].begin) ++above;
      for (std::size_t k = above; k < above_end && runs_[k].begin <= runs_[i].end; ++k) {
        join(static_cast<int>(k), static_cast<int>(i));
      }
    }
    above_begin = row_begin;
    above_end = runs_.size();
  }
}

std::vector<Blob> BlobFinder::find(const Image& image, Region region, const BlobRule& rule) {
  region = {std::clamp(region.left, 0, image.width), std::clamp(region.top, 0, image.height),
            std::clamp(region.right, 0, image.width), std::clamp(region.bottom, 0, image.height)};
  find_runs(image, region, rule);

  // runs => blobs: a root holds the sums of its blob, and precedes its runs
  struct Sum {
    double weight = 0, x = 0, y = 0;
    int pixels = 0, left = 1 << 30, right = 0, top = 1 << 30, bottom = 0;
  };
  std::vector<Sum> sums(runs_.size());
  for (std::size_t i = 0; i < runs_.size(); ++i) {
    const Run& run = runs_[i];
    Sum& sum = sums[static_cast<std::size_t>(root_of(static_cast<int>(i)))];
    sum.weight += run.weight;
    sum.x += run.x;
    sum.y += run.y;
    sum.pixels += run.end - run.begin;
    sum.left = std::min(sum.left, run.begin);
    sum.right = std::max(sum.right, run.end);
    sum.top = std::min(sum.top, run.row);
    sum.bottom = std::max(sum.bottom, run.row + 1);
  }
  const double per_pixel = static_cast<double>(rule.step) * rule.step;
  std::vector<Blob> found;
  for (const Sum& sum : sums) {
    const double area = sum.pixels * per_pixel;
    if (sum.pixels == 0 || area < rule.min_area) continue;
    const bool cut = sum.left == 0 || sum.top == 0 ||
                     region.left + sum.right * rule.step >= region.right ||
                     region.top + sum.bottom * rule.step >= region.bottom;
    found.push_back(
        {{sum.x / sum.weight, sum.y / sum.weight}, area, sum.weight * per_pixel / 255, cut});
  }
  const auto end = found.begin() + static_cast<std::ptrdiff_t>(std::min(found.size(), kMaxBlobs));
  std::ranges::partial_sort(found, end, std::ranges::greater{}, &Blob::weight);
  found.erase(end, found.end());
  return found;
}

}  // namespace o80::vision
