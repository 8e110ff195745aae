#pragma once

#include <array>
#include <cmath>

namespace o80::mujoco {

/// Point, direction or velocity in space.
struct Vector {
  double x = 0, y = 0, z = 0;

  constexpr double operator[](int axis) const noexcept {
    return axis == 0 ? x : (axis == 1 ? y : z);
  }
  bool operator==(const Vector&) const = default;
};

constexpr Vector operator+(const Vector& a, const Vector& b) noexcept {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
constexpr Vector operator-(const Vector& a, const Vector& b) noexcept {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
constexpr Vector operator*(double k, const Vector& a) noexcept {
  return {k * a.x, k * a.y, k * a.z};
}
constexpr double dot(const Vector& a, const Vector& b) noexcept {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
constexpr Vector cross(const Vector& a, const Vector& b) noexcept {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline double length(const Vector& a) noexcept { return std::sqrt(dot(a, a)); }
inline Vector unit(const Vector& a) noexcept { return (1.0 / length(a)) * a; }
constexpr Vector between(const Vector& from, const Vector& to, double share) noexcept {
  return from + share * (to - from);
}

/// Turns `a` about a unit axis [rad].
inline Vector turned(const Vector& a, const Vector& axis, double angle) noexcept {
  const double cosine = std::cos(angle);
  return cosine * a + std::sin(angle) * cross(axis, a) + ((1 - cosine) * dot(axis, a)) * axis;
}

/// Orientation, row by row; the columns are the axes of the body.
struct Rotation {
  std::array<double, 9> m{1, 0, 0, 0, 1, 0, 0, 0, 1};

  constexpr Vector axis(int i) const noexcept {
    const auto k = static_cast<std::size_t>(i);
    return {m[k], m[3 + k], m[6 + k]};
  }
  /// Transforms from the body's axes to the world's.
  constexpr Vector out(const Vector& a) const noexcept {
    return a.x * axis(0) + a.y * axis(1) + a.z * axis(2);
  }
  /// Transforms from the world's axes to the body's.
  constexpr Vector in(const Vector& a) const noexcept {
    return {dot(axis(0), a), dot(axis(1), a), dot(axis(2), a)};
  }
  bool operator==(const Rotation&) const = default;
};

/// Computes the rotation from one orientation to another: unit axis of the world and angle
/// [rad].
struct Turn {
  Vector axis{0, 0, 1};
  double angle = 0;
};

inline Turn turn_between(const Rotation& from, const Rotation& to) noexcept {
  // sum of the cross products of the axes = 2 sin(angle) axis; their dot products sum to
  // 1 + 2 cos(angle)
  Vector sine;
  double trace = 0;
  for (int i = 0; i < 3; ++i) {
    sine = sine + 0.5 * cross(from.axis(i), to.axis(i));
    trace += dot(from.axis(i), to.axis(i));
  }
  const double size = length(sine);
  if (size == 0) return {};
  return {(1.0 / size) * sine, std::atan2(size, 0.5 * (trace - 1))};
}

}  // namespace o80::mujoco
