#pragma once

#include <array>
#include <optional>

#include "vision/matrix.hpp"

namespace o80::vision {

/// A place in an image; the centre of the first pixel is (0, 0) [px].
struct Pixel {
  double x = 0, y = 0;
};

/// Where a camera sees a point, and how that changes with the point [px/m].
struct Projection {
  Pixel pixel;
  double depth = 0;  // along the optical axis [m]
  Matrix<2, 3> slope;
};

/// A pinhole camera with radial and tangential distortion, as OpenCV writes it:
/// r2 = x^2 + y^2, x' = x (1 + k1 r2 + k2 r2^2 + k3 r2^3) + 2 p1 x y + p2 (r2 + 2 x^2).
struct Camera {
  std::array<double, 2> size{640, 480};              // width, height [px]
  std::array<double, 2> focal{600, 600};             // [px]
  std::array<double, 2> centre{319.5, 239.5};        // [px]
  std::array<double, 5> distortion{};                // k1, k2, p1, p2, k3
  Matrix<3, 3> rotation = Matrix<3, 3>::identity();  // world => camera: x right, y down, z ahead
  Vector translation{};                              // [m]
  double widest = 1e9;  // largest r2 for which the distortion can be undone

  /// Fills `widest`.
  void prepare() noexcept;

  /// In the world [m].
  Vector place() const noexcept { return -1.0 * (transposed(rotation) * translation); }

  /// Where a point of the world is seen. Nothing: it is behind the camera, or so far aside that
  /// the distortion would fold it back. The pixel may lie outside of the image.
  std::optional<Projection> project(const Vector& point) const noexcept;

  /// The direction in the world, of length 1, in which a pixel looks. Nothing: no direction is
  /// seen there.
  std::optional<Vector> direction(const Pixel& pixel) const noexcept;

  bool contains(const Pixel& pixel) const noexcept {
    return pixel.x >= -0.5 && pixel.x < size[0] - 0.5 && pixel.y >= -0.5 && pixel.y < size[1] - 0.5;
  }
};

}  // namespace o80::vision
