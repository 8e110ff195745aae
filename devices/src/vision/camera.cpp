#include "vision/camera.hpp"

#include <cmath>

namespace o80::vision {

namespace {

/// Point of the plane at distance 1 behind the lens, and its derivatives.
struct Distorted {
  double x = 0, y = 0;
  double xx = 1, xy = 0, yx = 0, yy = 1;
};

Distorted distorted(const std::array<double, 5>& lens, double x, double y) noexcept {
  const auto [k1, k2, p1, p2, k3] = lens;
  const double r2 = x * x + y * y;
  const double radial = 1 + r2 * (k1 + r2 * (k2 + r2 * k3));
  const double growth = 2 * (k1 + r2 * (2 * k2 + r2 * 3 * k3));  // of radial with x^2 / 2
  const double mixed = growth * x * y + 2 * p1 * x + 2 * p2 * y;
  return {.x = x * radial + 2 * p1 * x * y + p2 * (r2 + 2 * x * x),
          .y = y * radial + p1 * (r2 + 2 * y * y) + 2 * p2 * x * y,
          .xx = radial + growth * x * x + 2 * p1 * y + 6 * p2 * x,
          .xy = mixed,
          .yx = mixed,
          .yy = radial + growth * y * y + 6 * p1 * y + 2 * p2 * x};
}

}  // namespace

void Camera::prepare() noexcept {
  // the smallest r2 at which a larger angle no longer moves the pixel outwards
  const auto [k1, k2, p1, p2, k3] = distortion;
  constexpr int kSteps = 900;
  constexpr double kStep = 0.01;  // up to tan(72 degrees)^2
  widest = kSteps * kStep;
  for (int i = 0; i < kSteps; ++i) {
    const double r2 = i * kStep;
    if (1 + r2 * (3 * k1 + r2 * (5 * k2 + r2 * 7 * k3)) > 0) continue;
    widest = r2;
    return;
  }
}

std::optional<Projection> Camera::project(const Vector& point) const noexcept {
  const Vector seen = rotation * point + translation;
  if (!(seen[2] > 1e-6)) return std::nullopt;
  const double x = seen[0] / seen[2];
  const double y = seen[1] / seen[2];
  if (!(x * x + y * y < widest)) return std::nullopt;
  const Distorted lens = distorted(distortion, x, y);

  Projection made;
  made.pixel = {focal[0] * lens.x + centre[0], focal[1] * lens.y + centre[1]};
  made.depth = seen[2];
  // point => camera's frame => plane at distance 1 => lens => pixel
  for (std::size_t j = 0; j < 3; ++j) {
    const double dx = (rotation(0, j) - x * rotation(2, j)) / seen[2];
    const double dy = (rotation(1, j) - y * rotation(2, j)) / seen[2];
    made.slope(0, j) = focal[0] * (lens.xx * dx + lens.xy * dy);
    made.slope(1, j) = focal[1] * (lens.yx * dx + lens.yy * dy);
  }
  return made;
}

std::optional<Vector> Camera::direction(const Pixel& pixel) const noexcept {
  const double x_seen = (pixel.x - centre[0]) / focal[0];
  const double y_seen = (pixel.y - centre[1]) / focal[1];
  double x = x_seen;
  double y = y_seen;
  constexpr int kMaxSteps = 20;
  for (int i = 0; i < kMaxSteps; ++i) {  // Newton's rule
    const Distorted lens = distorted(distortion, x, y);
    const double dx = lens.x - x_seen;
    const double dy = lens.y - y_seen;
    const double determinant = lens.xx * lens.yy - lens.xy * lens.yx;
    if (!(determinant > 1e-9)) return std::nullopt;
    x -= (lens.yy * dx - lens.xy * dy) / determinant;
    y -= (lens.xx * dy - lens.yx * dx) / determinant;
    if (std::abs(dx) + std::abs(dy) < 1e-13) break;
  }
  const Distorted lens = distorted(distortion, x, y);
  const double rest = std::hypot(lens.x - x_seen, lens.y - y_seen);
  if (!(rest < 1e-9) || !(x * x + y * y < widest)) return std::nullopt;
  const Vector ahead{{x, y, 1}};
  return (1 / length(ahead)) * (transposed(rotation) * ahead);
}

}  // namespace o80::vision
