#pragma once

#include <algorithm>
#include <cmath>
#include <variant>

#include "balls/vector.hpp"

namespace o80::mujoco {

/// Relation of a point to a shape: distance from the surface [m], negative inside, and direction
/// away from the surface.
struct Near {
  double distance = 0;
  Vector normal{};
};

/// Elliptic plate with a rounded rim: all points within half the thickness of a
/// flat ellipse.
struct Plate {
  Vector half{};  // half axes [m]
  int thin = 1;   // the normal axis of the faces

  Near near(const Vector& point) const noexcept;
};

struct Box {
  Vector half{};  // [m]

  Near near(const Vector& point) const noexcept;
};

/// Half space below z = 0.
struct Plane {
  Near near(const Vector& point) const noexcept { return {point.z, {0, 0, 1}}; }
};

/// Shape of a surface, in the frame of its geom.
using Shape = std::variant<Plate, Box, Plane>;

inline Near near(const Shape& shape, const Vector& point) noexcept {
  return std::visit([&](const auto& each) { return each.near(point); }, shape);
}

/// Finds the point of an ellipse (half axes a, b) nearest to an outside point; both in the first
/// quadrant.
struct EllipsePoint {
  double x = 0, y = 0;
};
inline EllipsePoint nearest_on_ellipse(double a, double b, double x, double y) noexcept {
  // root t of (a x / (t + a^2))^2 + (b y / (t + b^2))^2 = 1: convex and falling, so that
  // Newton's method approaches from the left and never passes the root
  double t = std::max({0.0, a * x - a * a, b * y - b * b});
  for (int i = 0; i < 64; ++i) {
    const double u = a * x / (t + a * a);
    const double v = b * y / (t + b * b);
    const double excess = u * u + v * v - 1;
    if (excess < 1e-14) break;
    t += excess / (2 * (u * u / (t + a * a) + v * v / (t + b * b)));
  }
  return {a * a * x / (t + a * a), b * b * y / (t + b * b)};
}

inline Near Plate::near(const Vector& point) const noexcept {
  const int i = (thin + 1) % 3;
  const int j = (thin + 2) % 3;
  const double x = point[i];
  const double y = point[j];
  const double height = point[thin];
  const double a = half[i];
  const double b = half[j];

  // away from the nearest point of the flat ellipse
  double dx = 0;
  double dy = 0;
  if (x * x / (a * a) + y * y / (b * b) > 1) {
    const EllipsePoint rim = nearest_on_ellipse(a, b, std::abs(x), std::abs(y));
    dx = x - std::copysign(rim.x, x);
    dy = y - std::copysign(rim.y, y);
  }
  const double distance = std::sqrt(dx * dx + dy * dy + height * height);
  Vector away;
  double* const axes[] = {&away.x, &away.y, &away.z};
  if (distance > 0) {
    *axes[i] = dx / distance;
    *axes[j] = dy / distance;
    *axes[thin] = height / distance;
  } else {
    *axes[thin] = 1;
  }
  return {distance - half[thin], away};
}

inline Near Box::near(const Vector& point) const noexcept {
  const Vector beyond{std::abs(point.x) - half.x, std::abs(point.y) - half.y,
                      std::abs(point.z) - half.z};
  const auto sign = [](double value) { return value < 0 ? -1.0 : 1.0; };
  if (beyond.x > 0 || beyond.y > 0 || beyond.z > 0) {
    const Vector away{beyond.x > 0 ? std::copysign(beyond.x, point.x) : 0,
                      beyond.y > 0 ? std::copysign(beyond.y, point.y) : 0,
                      beyond.z > 0 ? std::copysign(beyond.z, point.z) : 0};
    const double distance = length(away);
    return {distance, (1.0 / distance) * away};
  }
  // inside: out through the nearest face
  if (beyond.z >= beyond.x && beyond.z >= beyond.y) return {beyond.z, {0, 0, sign(point.z)}};
  if (beyond.y >= beyond.x) return {beyond.y, {0, sign(point.y), 0}};
  return {beyond.x, {sign(point.x), 0, 0}};
}

}  // namespace o80::mujoco
