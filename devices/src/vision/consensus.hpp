#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "vision/camera.hpp"

namespace o80::vision {

/// What may be the ball in one image.
struct Sighting {
  int camera = 0;
  Pixel pixel;
  double area = 0;  // [px^2]; 0: unknown, any size is accepted
};

struct ConsensusRule {
  double tolerance = 3;    // largest distance between a sighting and the point as seen [px]
  double noise = 0.3;      // standard deviation of a sighting [px]
  double radius = 0.02;    // of the ball [m]
  double size_factor = 4;  // a blob may be that much larger or smaller than the ball is seen
  int least = 2;           // cameras
  std::optional<Vector> expected{};  // where the ball should be [m]
};

/// A point in the world that several cameras agree on.
struct Located {
  Vector point;               // [m]
  Matrix<3, 3> covariance;    // [m^2]
  std::uint64_t cameras = 0;  // bits, of those that agree
  int count = 0;              // of those
  double residual = 0;        // root mean square of the distances in the images [px]
};

inline constexpr std::size_t kMaxCameras = 16;
inline constexpr std::size_t kMaxSightings = 128;

/// The point that the most cameras agree on, by the largest consistent subset of sightings: every
/// pair of cameras proposes a point, every other camera joins with the sighting nearest to it. Of
/// equally many cameras those nearer to the expected place win, or those with the smaller residual.
std::optional<Located> locate(std::span<const Camera> cameras, std::span<const Sighting> sightings,
                              const ConsensusRule& rule) noexcept;

}  // namespace o80::vision
