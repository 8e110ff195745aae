#pragma once

#include <algorithm>
#include <limits>
#include <optional>
#include <span>

#include "balls/surface.hpp"

// Finds the contact of a ball with a surface by a sweep of their relative motion through a step.

namespace o80::mujoco {

/// Straight path of a ball's centre from a share of the step to its end.
struct Path {
  Vector from{}, to{};                    // [m]
  Vector velocity_from{}, velocity_to{};  // [m/s]
  double begin = 0;                       // share of the step

  double part(double share) const noexcept { return (share - begin) / (1 - begin); }
  Vector position(double share) const noexcept { return between(from, to, part(share)); }
  Vector velocity(double share) const noexcept {
    return between(velocity_from, velocity_to, part(share));
  }
};

/// Contact of a ball with a surface.
struct Contact {
  const Surface* surface = nullptr;
  double share = 0;           // of the step
  Vector point{};             // of the surface [m]
  Vector normal{};            // from the surface to the ball
  Vector surface_velocity{};  // at the point [m/s]
};

/// Result of a sweep.
struct Swept {
  std::optional<Contact> contact;
  double smallest = std::numeric_limits<double>::infinity();  // gap on the path [m], if watched
};

inline constexpr double kTouching = 1e-9;    // a smaller gap is a contact [m]
inline constexpr double kFinestStep = 1e-4;  // of a sweep: a graze within it is 60 nm deep [m]
inline constexpr int kMaxSweepSteps = 4096;  // a path of 40 cm within kFinestStep of a surface

/// Ball that passes a surface in a step.
class Sweep {
 public:
  Sweep(const Surface& surface, const Path& path, double radius) noexcept
      : surface_(surface), path_(path), radius_(radius) {}

  /// Finds the first contact at which the ball approaches the surface. Conservative advancement: a
  /// sweep step is never longer than the gap, so that no contact is missed at any speed.
  Swept run() const noexcept;

 private:
  Near look(double share) const noexcept {
    return near(surface_.shape, surface_.motion.inside(path_.position(share), share));
  }
  double gap(const Near& here) const noexcept { return here.distance - radius_; }
  /// Bound of the relative speed of the ball's centre and the surface [m/step].
  double speed_bound() const noexcept {
    const Motion& motion = surface_.motion;
    const double straight =
        length((1 / (1 - path_.begin)) * (path_.to - path_.from) - motion.travel());
    if (motion.angle() == 0) return straight;
    const double lever =
        std::max(length(path_.position(path_.begin) - motion.position(path_.begin)),
                 length(path_.to - motion.position(1)));
    return straight + motion.angle() * lever;
  }
  /// Finds the share at which the gap closes, between a share with and one without a gap.
  double closing(double open, double closed) const noexcept {
    for (int i = 0; i < 50 && closed - open > 1e-15; ++i) {
      const double middle = 0.5 * (open + closed);
      (gap(look(middle)) > kTouching ? open : closed) = middle;
    }
    return closed;
  }
  Contact contact(double share, const Near& here) const noexcept {
    const Vector normal = surface_.motion.outside(here.normal, share);
    const Vector point = path_.position(share) - here.distance * normal;
    return {&surface_, share, point, normal, surface_.motion.velocity(point, share)};
  }
  bool approaching(const Contact& contact) const noexcept {
    return dot(path_.velocity(contact.share) - contact.surface_velocity, contact.normal) < 0;
  }

  const Surface& surface_;
  const Path& path_;
  double radius_;
};

inline Swept Sweep::run() const noexcept {
  const double speed = speed_bound();
  Swept result;
  const auto passed_at = [&](double gap) {
    result.smallest = std::min(result.smallest, std::max(0.0, gap));
  };
  double share = path_.begin;
  double open = -1;  // the last share with an open gap
  for (int step = 0; step < kMaxSweepSteps; ++step) {
    Near here = look(share);
    const double now = gap(here);
    if (now > kTouching) {
      open = share;
    } else {
      // already inside: goes back to the contact
      double touching = share;
      if (open >= 0 && now < -kTouching) {
        touching = closing(open, share);
        here = look(touching);
      }
      open = -1;
      passed_at(gap(here));
      const Contact found = contact(touching, here);
      if (approaching(found)) {
        result.contact = found;
        return result;
      }
    }
    passed_at(now);
    if (share >= 1) return result;
    if (now > speed * (1 - share)) break;  // out of reach
    share = std::min(1.0, share + std::max(now, kFinestStep) / speed);
  }
  if (surface_.watched) passed_at(gap(look(1)));
  return result;
}

/// Finds the first contact of a ball with any of the surfaces. Calls `passed(surface, gap)` with
/// the smallest gap to each watched surface.
template <class Passed>
std::optional<Contact> first_contact(std::span<const Surface> surfaces, const Path& path,
                                     double radius, Passed&& passed) noexcept {
  std::optional<Contact> first;
  for (const Surface& surface : surfaces) {
    const Swept swept = Sweep(surface, path, radius).run();
    if (surface.watched) passed(surface, swept.smallest);
    if (swept.contact && (!first || swept.contact->share < first->share)) first = swept.contact;
  }
  return first;
}

}  // namespace o80::mujoco
