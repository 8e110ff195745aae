#pragma once

#include <array>
#include <optional>

#include "vision/matrix.hpp"

namespace o80::vision {

/// Place in an image; the centre of the first pixel is (0, 0) [px].
struct Pixel {
  double x = 0, y = 0;
};

/// Projection of a point, and its derivatives by the point [px/m].
struct Projection {
  Pixel pixel;
  double depth = 0;  // along the optical axis [m]
  Matrix<2, 3> slope;
};

/// Pinhole camera with radial and tangential distortion, in OpenCV's form:
/// r2 = x^2 + y^2, x' = x (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x y + p2 (r2 + 2 x^2).
struct Camera {
  std::array<double, 2> focal{600, 600};             // [px]
  std::array<double, 2> centre{319.5, 239.5};        // [px]
  std::array<double, 5> distortion{};                // k1, k2, p1, p2, k3
  Matrix<3, 3> rotation = Matrix<3, 3>::identity();  // world => camera: x right, y down, z ahead
  Vector translation{};                              // [m]
  double widest = 1e9;                               // largest r2 with an invertible distortion

  /// Computes `widest`.
  void prepare() noexcept;

  /// Place of the camera in the world [m].
  Vector place() const noexcept { return -1.0 * (transposed(rotation) * translation); }

  /// Projects a point of the world. Nothing if the point is behind the camera, or so far aside that
  /// the distortion would fold it back. The pixel may be outside of the image.
  std::optional<Projection> project(const Vector& point) const noexcept;

  /// Returns the viewing direction of a pixel in the world, of length 1. Nothing if no direction
  /// projects to it.
  std::optional<Vector> direction(const Pixel& pixel) const noexcept;
};

}  // namespace o80::vision
