#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <span>

#include "vision/camera.hpp"

namespace o80::vision {

/// Candidate of the ball in one image.
struct Sighting {
  int camera = 0;
  Pixel pixel;
  double area = 0;  // [px^2]; 0: unknown, any size is accepted
};

struct ConsensusRule {
  double tolerance = 3;  // largest distance between a sighting and the projected point [px]
  double noise = 0.3;    // standard deviation of a sighting [px]
  double radius = 0.02;  // of the ball [m]
  int least = 2;         // cameras
  std::optional<Vector> expected{};  // expected place of the ball [m]
};

/// Point in the world on which several cameras agree.
struct Located {
  Vector point;               // [m]
  Matrix<3, 3> covariance;    // [m^2]
  std::uint64_t cameras = 0;  // bit mask of the agreeing cameras
  int count = 0;              // number of agreeing cameras
  double residual = 0;        // root mean square of the distances in the images [px]
};

inline constexpr std::size_t kMaxCameras = 16;
inline constexpr std::size_t kMaxSightings = 128;

/// Finds the point on which most cameras agree, the largest consistent subset of sightings: every
/// pair of cameras proposes a point, and every other camera adds the sighting nearest to it. Equal
/// numbers are decided by the distance to the expected place, or by the residual.
std::optional<Located> locate(std::span<const Camera> cameras, std::span<const Sighting> sightings,
                              const ConsensusRule& rule) noexcept;

}  // namespace o80::vision
